"""Tables of blade sections and flow paths: equal surfaces from either kind of columns, typed errors for damage."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.surface import blade_solid, impeller, read_flow_path, read_sections
from bonecam.surface.blades import about_z

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


def test_polar_and_cartesian_tables_give_the_same_outward_rows(profiles: Profiles, tmp_path: Path) -> None:
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
def test_an_axis_becomes_z_by_a_rotation(axis: str) -> None:
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
def test_a_damaged_table_is_refused_by_name(
    profiles: Profiles, tmp_path: Path, damage: Callable[[str], str], told: str
) -> None:
    files = written(tmp_path, profiles, "X  R*THETA  R")
    files[0].write_text(damage(files[0].read_text()))
    with pytest.raises(FileError, match=told) as error:
        read_sections(files, columns="x r*theta r", axis="x")
    assert "section_0.txt" in str(error.value)


def test_one_section_and_wrong_words_are_refused(profiles: Profiles, tmp_path: Path) -> None:
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
def test_a_damaged_flow_path_is_refused(text: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "hub.txt"
    file.write_text(text)
    with pytest.raises(FileError, match=told):
        read_flow_path(file)


def test_flow_paths_of_either_columns_are_radius_and_height(tmp_path: Path) -> None:
    file = tmp_path / "hub.txt"
    file.write_text("x r\n-1 5\n2 4\n")
    assert read_flow_path(file, axis="-x", scale=10.0).tolist() == [[50, 10], [40, -20]]
    file.write_text("-1 3 4\n2 0 4\n")
    assert read_flow_path(file, columns="x y z").tolist() == [[5, -1], [4, 2]]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rotor 37", "hecc"])
def test_a_wheel_of_nasa_tables_is_of_closed_solids(name: str, shared: Path) -> None:
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
