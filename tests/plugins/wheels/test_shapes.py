"""A straight blade between two cylinders: sections, and tables of them.

Tables of blade sections and flow paths: equal surfaces from either kind of columns, typed errors for damage.

Blunt edges of blades are rounded outward by half of their width; one side of a blade stays open.

Wheels of one blade: the hub's profile, the channel between two blades, their blank, and what is no wheel.
"""

from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray
from small_wheel import HEIGHT, PROFILE, blade, hub

import bonecam
from bonecam.errors import FileError, SurfaceError
from bonecam.material.rays import lay_solids
from bonecam.mesh.solids import cylinder, solid_difference
from bonecam.surface import blade_solid
from bonecam.surface.skinning import BLUNT, PointRows, has_blunt_edge
from bonecam.verify.sweeping import volumes
from bonecam.wheels import impeller, read_flow_path, read_sections
from bonecam.wheels.tables import about_z, read_blade, read_hub, rounded_edge, widest_edge
from bonecam.wheels.wheel import (
    TurnedBlank,
    channel_of,
    hub_profile,
    meridional,
    places_on,
    point_at,
    revolve_ring,
    wheel_of,
)

ROOT, TIP, LENGTH, HALF = 20.0, 30.0, 24.0, 1.0


@pytest.fixture(scope="session")
def profiles():
    """Closed sections (along the axis, arc, radius), an ellipse LENGTH x 2 HALF at five radii; counter-clockwise seen
    from outside where the axis is +Z."""
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    x, arc = LENGTH / 2 * np.cos(angle), HALF * np.sin(angle)
    return [np.column_stack([x, -arc, np.full(48, r)]) for r in np.linspace(ROOT, TIP, 5)]


Profiles = list[Float[ndarray, "n 3"]]


def table(profile: Float[ndarray, "n 3"], head: str = "") -> str:
    lines = [" ".join(f"{x:.9f}" for x in point) for point in np.vstack([profile, profile[:1]])]
    return "\n".join([head, *lines, ""] if head else [*lines, ""])


def written(folder: Path, profiles: Profiles, head: str) -> list[Path]:
    files = [folder / f"section_{k}.txt" for k in range(len(profiles))]
    for file, profile in zip(files, profiles):
        file.write_text(table(profile, head))
    return files


def cartesian(profile: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
    x, arc, r = profile.T
    return np.column_stack([r * np.cos(arc / r), r * np.sin(arc / r), x])


def test_polar_and_cartesian_tables_give_the_same_outward_rows(profiles, tmp_path):
    polar = read_sections(written(tmp_path, profiles, "X  R*THETA  R"), columns="x r*theta r", axis="x")
    together = tmp_path / "blade.dat"
    together.write_text("\n".join(table(cartesian(p), f"# section {k}") for k, p in enumerate(profiles)))
    xyz = read_sections(together)
    assert polar.closed
    assert xyz.closed
    assert np.abs(np.vstack(polar.rows) - np.vstack(xyz.rows)).max() < 1e-8
    solid = blade_solid(polar.skin(0.01), 0.01)
    assert solid.volume == pytest.approx(np.pi * 12 * 10, rel=0.01)
    reversed_rows = tmp_path / "reversed"
    reversed_rows.mkdir()
    turned = read_sections(written(reversed_rows, [p[::-1] for p in profiles], ""), columns="x r*theta r", axis="x")
    assert blade_solid(turned.skin(0.01), 0.01).volume == pytest.approx(solid.volume, rel=0.01)


@pytest.mark.parametrize("axis", ["x", "y", "z", "-x", "-y", "-z"])
def test_an_axis_becomes_z_by_a_rotation(axis):
    name = "xyz".index(axis[-1])
    turned = about_z(np.eye(3), axis)
    assert np.linalg.det(turned) == pytest.approx(1.0)
    assert turned[name].tolist() == [0.0, 0.0, -1.0 if axis.startswith("-") else 1.0]


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (lambda text: text.replace("R*THETA", "THETA"), "is no point: write x r r"),
        (lambda text: text.replace("20.000000000", "nan", 1), "is not finite"),
        (lambda text: text.replace("20.000000000", "-20.0", 1), "has the radius -20"),
        (lambda text: text.replace("20.000000000", "2O.0", 1), "is no point"),
        (lambda text: text[: len(text) // 2].rsplit(" ", 1)[0], "2 numbers are no point"),
        (lambda text: text.splitlines()[0], "holds no points"),
        (lambda text: "", "holds no points"),
    ],
)
def test_a_damaged_table_is_refused_by_name(profiles, tmp_path, damage, told):
    files = written(tmp_path, profiles, "X  R*THETA  R")
    files[0].write_text(damage(files[0].read_text()))
    with pytest.raises(FileError, match=told) as error:
        read_sections(files, columns="x r*theta r", axis="x")
    assert "section_0.txt" in str(error.value)


def test_one_section_and_wrong_words_are_refused(profiles, tmp_path):
    (file, *_) = written(tmp_path, profiles, "")
    with pytest.raises(FileError, match="one section is no blade"):
        read_sections(file, columns="x r*theta r")
    with pytest.raises(ValueError, match="columns 'r'"):
        read_sections(file, columns="r")
    with pytest.raises(ValueError, match="axis 'w'"):
        about_z(np.eye(3), "w")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x r\n1 2\n2 -1\n", "point 1 has the radius -1"),
        ("x r\n1 2\n1 2\n2 3\n", "points 0 and 1 coincide"),
        ("x r\n1 2\n", "one point is no curve"),
        ("x r\n1 2\n2 3\n\n4 5\n", "holds 2 curves"),
        ("x r\n1 2\n2\nx 3\n", "is no point"),
        ("", "holds no points"),
    ],
)
def test_a_damaged_flow_path_is_refused(text, told, tmp_path):
    file = tmp_path / "hub.txt"
    file.write_text(text)
    with pytest.raises(FileError, match=told):
        read_flow_path(file)


def test_flow_paths_of_either_columns_are_radius_and_height(tmp_path):
    file = tmp_path / "hub.txt"
    file.write_text("x r\n-1 5\n2 4\n")
    assert read_flow_path(file, axis="-x", scale=10.0).tolist() == [[50, 10], [40, -20]]
    file.write_text("-1 3 4\n2 0 4\n")
    assert read_flow_path(file, columns="x y z").tolist() == [[5, -1], [4, 2]]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rotor 37", "hecc"])
def test_a_wheel_of_nasa_tables_is_of_closed_solids(name, shared):
    folder = shared / "meshes" / "blades" / "sections"
    if name == "hecc":
        files = sorted((folder / "hecc").glob("*section*"))
        rows = read_sections(files, columns="x r*theta r", axis="-x", scale=25.4)
        hub, shroud = (
            read_flow_path(next((folder / "hecc").glob(f"*{wall}.txt")), axis="-x", scale=25.4)
            for wall in ("hub", "shroud")
        )
        radius, count = 215.7, 15
    else:
        rows = read_sections(folder / "profile_R37.dat", axis="y", scale=10.0)
        hub, shroud = (
            read_flow_path(folder / f"{wall}_R37.dat", columns="x y z", scale=10.0) for wall in ("hub", "shroud")
        )
        radius, count = 252.0, 36
    made = impeller(rows.skin(0.01), hub, shroud, count, chord_tolerance=0.1)
    assert len(made.blades) == count
    tip = np.hypot(*made.blades[0].vertices[:, :2].T).max()
    assert tip == pytest.approx(radius, abs=2.0)
    for solid in (made.hub, made.shroud, *made.blades):
        corners = solid.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        assert {(a, b) for a, b in corners.tolist()} == {(b, a) for a, b in corners.tolist()}
        assert solid.volume > 0
    assert made.blades[1].volume == pytest.approx(made.blades[0].volume)


CHORD, WIDTH = 20.0, 0.3


def rows(width: float) -> PointRows:
    """Sections from the blunt edge at x = LENGTH along one side, round the other edge and back, counter-clockwise."""
    u = np.linspace(-1.0, 1.0, 81)
    side = (width / 2 + (1 - u**2) * 1.5) * np.sign(u)
    section = np.column_stack([CHORD * u**2, np.where(u == 0, 0.0, -side)])
    return PointRows(tuple(np.column_stack([section, np.full(len(u), z)]) for z in (0.0, 3.0, 6.0)), None, closed=False)


def test_the_cap_is_a_half_circle_over_the_edge():
    given = rows(WIDTH)
    assert widest_edge(given) == pytest.approx(WIDTH)
    made = rounded_edge(given)
    assert made.closed
    for before, after in zip(given.rows, made.rows):
        np.testing.assert_array_equal(after[: len(before)], before)
        cap = after[len(before) :]
        middle = (before[0] + before[-1]) / 2
        np.testing.assert_allclose(np.linalg.norm(cap - middle, axis=1), WIDTH / 2)
        assert (cap[:, 0] > CHORD).all()
        assert cap[:, 0].max() == pytest.approx(CHORD + WIDTH / 2)
        np.testing.assert_allclose(cap[:, 2], before[0, 2])


def test_its_skin_is_closed_round():
    made = rounded_edge(rows(WIDTH)).skin(0.01)
    assert made.closed_in_s
    assert not any(made.poles)
    assert not has_blunt_edge(made)


def test_one_side_and_closed_rows_stay_as_they_are():
    side = rows(3 * BLUNT * 2 * CHORD)
    assert rounded_edge(side) is side
    closed = rounded_edge(rows(WIDTH))
    assert rounded_edge(closed) is closed
    assert widest_edge(closed) == 0.0


REACH = 2.0


@pytest.fixture(scope="module")
def wheel():
    return wheel_of(blade(), hub_profile(hub(), "hub.ply"), 3)


def test_the_profile_of_a_hub_is_that_it_was_turned_by():
    found = hub_profile(hub(), "hub.ply")
    for one, other in ((found, PROFILE), (PROFILE, found)):
        off = np.linalg.norm(point_at(other, places_on(other, one)) - one, axis=1)
        assert off.max() < 0.02
    assert (found[[0, -1], 0] == 0).all()


def test_a_hub_with_a_bore_or_a_keyway_is_refused():
    bored = solid_difference(hub(), cylinder(2.0, -5.0, 15.0, 0.1))
    with pytest.raises(SurfaceError, match="without bore"):
        hub_profile(bored, "hub.ply")
    pose = np.eye(4)
    pose[:3, 3] = [-14.0, 0.0, 0.0]
    keyed = solid_difference(hub(), cylinder(2.0, -5.0, 1.0, 0.1).move(pose))
    with pytest.raises(SurfaceError, match=r"no body of revolution|plain section"):
        hub_profile(keyed, "hub.ply")


def test_the_channel_runs_from_hub_to_tips_over_one_pitch(wheel):
    channel = channel_of(wheel, REACH)
    (left, right), (low, high) = channel.floor.domain
    t = np.linspace(low, high, 50)
    floor, roof = (meridional(each.positions(np.full(50, left), t)) for each in (channel.floor, channel.roof))
    np.testing.assert_allclose(np.linalg.norm(roof - floor, axis=1), HEIGHT, atol=0.1)
    ends = [channel.floor.positions(np.full(50, s), t) for s in (left, right)]
    azimuths = [np.arctan2(each[:, 1], each[:, 0]) for each in ends]
    np.testing.assert_allclose(azimuths[1] - azimuths[0], wheel.pitch, atol=1e-3)
    along = PROFILE[3] - PROFILE[2]
    normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    np.testing.assert_allclose((floor - PROFILE[2]) @ normal, 0.0, atol=0.02)


def test_grown_blades_hold_the_true_one_by_the_allowance(wheel):
    grown = bonecam.mesh.MeshDistance(wheel.grown_blades(0.2, 0.05)[0])
    s, t = (x.ravel() for x in np.meshgrid(np.linspace(0, 1, 40), np.linspace(0.2, 0.8, 9)))
    away = -grown.signed(wheel.blade.positions(s, t))
    assert away.min() > 0.19
    assert away.max() < 0.32


def test_the_gap_is_that_between_neighbours(wheel):
    gap, place = wheel.gap()
    radius = float(np.hypot(*place[:2]))
    assert gap == pytest.approx(2 * radius * np.sin(wheel.pitch / 2), rel=0.01)


def test_blades_that_overlap_are_told_with_their_place():
    with pytest.raises(SurfaceError, match=r"12 blades overlap their neighbours, at \(") as error:
        wheel_of(blade(3.0), PROFILE, 12)
    assert error.value.evidence["error"] > 0


def test_a_hub_is_read_from_its_flow_path(tmp_path):
    file = tmp_path / "hub.txt"
    file.write_text("x r\n" + "".join(f"{z:g} {r:g}\n" for r, z in PROFILE[2:4]))
    found = read_hub(file, blade(), "mm")
    on_cone = found[(found[:, 0] > 6.01) & (found[:, 1] > 0.01)]
    off = (on_cone - PROFILE[2]) @ np.array([10.0, 8.0]) / np.hypot(10.0, 8.0)
    np.testing.assert_allclose(off, 0.0, atol=0.01)
    assert found[0, 0] == 0.0


def test_an_open_side_of_a_blade_is_no_wheel(tmp_path):
    file = tmp_path / "side.txt"
    rows = ["\n".join(f"{10 + h:g} {y:g} {z:g}" for z in range(6) for y in [0.1 * z]) for h in range(3)]
    file.write_text("\n\n".join(rows) + "\n")
    side, _ = read_blade(file, "mm", 0.01)
    with pytest.raises(SurfaceError, match="not closed round"):
        wheel_of(side, PROFILE, 3)


WAISTED = np.array([[0, 0], [10, 0], [10, 3], [8, 3], [7, 6], [4, 9], [4, 12], [0, 12]], float)
RECESSED = np.array([[0, 0], [10, 0], [10, 3], [8, 3], [7, 6], [8, 11], [4, 9], [0, 9]], float)


@pytest.mark.parametrize("profile", [WAISTED, RECESSED], ids=["waisted", "recessed"])
def test_rays_hold_the_body_and_no_recess(profile):
    (r, z), (R, Z) = profile[:-1].T, profile[1:].T
    volume = np.pi / 3 * ((Z - z) * (r * r + r * R + R * R)).sum()
    sets, _ = lay_solids([TurnedBlank(profile).mesh], 0.25, 200.0)
    np.testing.assert_allclose(volumes(sets), volume, rtol=4e-3)


def test_what_is_to_be_turned_is_told():
    assert TurnedBlank(WAISTED).text == ("blank: turned to the blades' tips, diameter 20.00 mm, from Z 0.00 to Z 12.00")


def test_a_revolved_polygon_is_a_closed_outward_ring():
    ring = revolve_ring(np.array([[4.0, 0.0], [6.0, 0.0], [6.0, 3.0], [4.0, 3.0]]), 256)
    assert ring.volume == pytest.approx(np.pi * (36 - 16) * 3, rel=1e-3)
