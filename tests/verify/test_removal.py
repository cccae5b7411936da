"""Meshes of a machine's links: told where they are wrong, and held against tool, table, stock and one another.

A program judged against the mesh as given, not only against the surface that was made of it.

What a bull nose takes out of material.

The distance of a cone from an upright cylinder against the nearest of many points.

What stays on a part, by the reason why.

Heights of normal probes: above the surface what is left, below it how deep the ball went in.
"""

import os
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from small_parts import path_of

from bonecam.errors import BodiesError, MachineError, MeshError, VerifyError
from bonecam.job import Job, MeshJob
from bonecam.kernels.bodies import column_distance, frustum_distance
from bonecam.kernels.rays import Capsules, ProbesByCell, cut_normal_probes, probe_cells
from bonecam.machine import Machine, read_machine
from bonecam.machine.machine import MACHINES
from bonecam.mesh import MeshDistance, Part, Smoothing, TriangleMesh, coarseness_of, prepare_part, write_mesh
from bonecam.mesh.healing import Repair, surface_moves
from bonecam.mesh.part import measure_taken_off
from bonecam.mesh.solids import cylinder
from bonecam.nc import machine_limits, read_dialect, read_program, write_program
from bonecam.planning.collision import block_mesh, body_texts, check_bodies
from bonecam.setup import Capsule
from bonecam.tool import Cutter, ToolPath
from bonecam.verify import Accuracy, Clearance, Left, Spot, check_removal, clearances, simulate_removal
from bonecam.verify.clearances import SHARE, TOUCHING, body_clearance
from bonecam.verify.findings import GivenSurface, beside_limits, given_surface, measure_given
from bonecam.verify.gouge import Gouge
from bonecam.verify.sweeping import NormalProbes
from bonecam.workholding import Clamping, Post
from bonecam.workholding.post import Column

HEIDENHAIN = read_dialect("heidenhain")
CUTTERS = [Cutter.from_job(1, "finishing", Job().tool("finishing"), read_machine("mikron-ucp600").nose)]
BOUNDS = np.array([[-4.0, -4.0, 100.0], [4.0, 4.0, 130.0]])
BLOCKS = {
    "cradle": ("B", [[-150, 150, -60], [150, 200, 60]]),
    "towers": ("bed", [[-60, 240, -300], [60, 300, 100]]),
    "head": ("XYZ", [[-100, 60, 120], [100, 300, 400]]),
}
"""Blocks of the machine's frame, mm, and their links."""


@pytest.fixture
def machine_with(tmp_path):
    """Makes a Mikron with bodies: link and corners of a block by name."""

    def build(bodies, scale=1.0, units="mm"):
        text = (MACHINES / "mikron-ucp600.toml").read_text()
        for name, (link, corners) in bodies.items():
            block = block_mesh(np.array(corners, dtype=float))
            write_mesh(TriangleMesh(block.vertices * scale, block.faces), tmp_path / f"{name}.stl")
            text += f'[[bodies]]\nname = "{name}"\nlink = "{link}"\nstl = "{name}.stl"\nunits = "{units}"\n'
        (tmp_path / "own.toml").write_text(text.replace('beside = "closed"', 'beside = "open"'))
        return read_machine(tmp_path / "own.toml")

    return build


@pytest.fixture
def leaning():
    """Cuts round a part whose axes lean more and more, once round it."""
    polar, azimuth = np.radians(np.linspace(0, 80, 60)), np.radians(np.linspace(0, 330, 60))
    axes = np.column_stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
    return path_of(np.array([0.0, 0.0, 120.0]) + 3 * axes, axes, tool=CUTTERS[0])


def motions_of(path: ToolPath, machine: Machine):
    return read_program(write_program([path], machine, HEIDENHAIN, Job()).text, machine, HEIDENHAIN)


@pytest.mark.parametrize("names", [["cradle"], ["towers"], ["head"], ["cradle", "head"], [*BLOCKS]])
def test_the_least_clearance_is_that_of_all_poses(names, machine_with, leaning):
    machine = machine_with({name: BLOCKS[name] for name in names})
    motions = motions_of(leaning, machine)
    told = body_clearance(motions, machine, CUTTERS, Clamping((Column(140.0, 0.0, -np.inf),), closed=False), BOUNDS)
    assert told is not None
    assert told.least is not None
    way = clearances._way_of(motions, np.arange(len(motions.tips)), motions.controls[1])
    fixed = [
        clearances.Solid("box round the stock", block_mesh(BOUNDS)),
        clearances.Solid("table", cylinder(140.0, -2000.0, 0.0, 0.2)),
    ]
    pairs = clearances._pairs(way, CUTTERS[0], clearances.link_solids(machine), fixed)
    least = min(pair.distance(words) for pair in pairs for words in way.words)
    assert told.least.value <= least + 1e-9 + max(TOUCHING, SHARE * least)
    assert told.least.value >= least - TOUCHING


def test_a_wall_beside_the_tool_is_as_far_as_it_is(machine_with):
    """The tool goes upright to x = 40: its nose of 80 mm has its rim at 80 there, the wall stands at 100."""
    tips = np.column_stack([np.linspace(0.0, 40.0, 9), np.zeros(9), np.full(9, 100.0)])
    path = path_of(tips, np.tile([0.0, 0.0, 1.0], (9, 1)), tool=CUTTERS[0])
    machine = machine_with({"wall": ("B", [[100, -50, 0], [120, 50, 300]])})
    motions = motions_of(path, machine)
    told = body_clearance(motions, machine, CUTTERS, Clamping(), BOUNDS)
    assert told is not None
    assert told.least is not None
    assert (told.part, told.other, told.touched) == ("spindle", "wall", 0)
    assert told.least.value == pytest.approx(20.0, abs=TOUCHING)
    assert told.least.place == pytest.approx((40.0, 0.0, 100.0), abs=TOUCHING)


def test_a_program_that_meets_a_body_is_refused_and_no_fault_of_the_part(machine_with):
    tips = np.column_stack([np.linspace(0.0, 40.0, 9), np.zeros(9), np.full(9, 100.0)])
    path = path_of(tips, np.tile([0.0, 0.0, 1.0], (9, 1)), tool=CUTTERS[0])
    machine = machine_with({"wall": ("C", [[70, -50, 0], [120, 50, 300]])})
    stock = Capsule(np.array([0.0, 0.0, 60.0]), np.array([0.0, 0.0, 80.0]), 3.0)
    text = write_program([path], machine, HEIDENHAIN, Job()).text
    removal = simulate_removal(text, machine, HEIDENHAIN, stock, Post(1.0, 57.0), CUTTERS, accuracy=Accuracy(0.4))
    assert removal.report["clearance_mm"]["bodies"] < TOUCHING
    with pytest.raises(BodiesError, match=r"line \d+: the holder comes within 0\.5 mm of the wall at"):
        check_removal(removal)
    check_removal(replace(removal, bodies=Clearance("bodies", None, 0)))


@pytest.mark.parametrize(
    ("bodies", "scale", "units", "told"),
    [
        ({"table": ("C", [[-100, -100, -40], [100, 100, 5]])}, 1.0, "mm", "'table' overlaps the part over"),
        ({"head": ("XYZ", [[-100, -100, -40], [100, 100, 5]])}, 1.0, "mm", "'head' overlaps the tool in front"),
        ({"table": ("C", [[-100, -100, -40], [100, 100, 0]])}, 0.001, "mm", "is 0.286 mm from corner to corner"),
        ({"table": ("C", [[-100, -100, -40], [100, 100, 0]])}, 1.0, "m", "correct units, or the file"),
    ],
)
def test_a_body_out_of_place_is_told_in_a_line(bodies, scale, units, told, machine_with):
    with pytest.raises(MachineError, match=told) as caught:
        check_bodies(machine_with(bodies, scale, units))
    assert "\n" not in str(caught.value)


def test_bodies_in_another_unit_stand_where_they_are(machine_with):
    for scale, units in ((0.1, "cm"), (0.001, "m"), (1 / 25.4, "inch")):
        cradle, head = body_texts(machine_with({name: BLOCKS[name] for name in ("cradle", "head")}, scale, units))
        assert cradle == "cradle: moves with B, X -150 to 150, Y 150 to 200, Z -60 to 60 mm, all axes at zero"
        assert "Z 120 to 400 mm from the spindle nose" in head


def test_a_body_that_is_written_again_is_read_again(machine_with):
    machine = machine_with({"cradle": BLOCKS["cradle"]})
    (before,) = body_texts(machine)
    (body,) = machine.link_bodies
    write_mesh(block_mesh(np.array([[-150, 150, -60], [150, 300, 60]], dtype=float)), body.file)
    os.utime(body.file, ns=(0, body.file.stat().st_mtime_ns + 1))
    (after,) = body_texts(machine)
    assert "Y 150 to 200" in before
    assert "Y 150 to 300" in after


def test_a_body_that_is_open_or_not_there_is_told_in_a_line(machine_with, tmp_path):
    machine = machine_with({"cradle": BLOCKS["cradle"]})
    block = block_mesh(np.array(BLOCKS["cradle"][1], dtype=float))
    write_mesh(TriangleMesh(block.vertices, block.faces[1:]), tmp_path / "open.stl")
    (body,) = machine.link_bodies
    for file, told in (("open.stl", "has 3 open edges: export it as a closed solid"), ("none.stl", "none.stl")):
        changed = replace(machine, link_bodies=(replace(body, file=tmp_path / file),))
        with pytest.raises(MachineError, match=told):
            check_bodies(changed)


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ('link = "B"', 'link = "A"', r"bodies\.1\.link: A: use one of C, B, XYZ, bed"),
        ('name = "head"', 'name = "cradle"', r"bodies\.2\.name: 'cradle' is there twice"),
        ('stl = "head.stl"', 'stl = "head.step"', r"bodies\.2\.stl: 'head\.step': give a file that ends in \.stl"),
        ('units = "mm"', 'units = "feet"', "units"),
    ],
)
def test_wrong_keys_of_bodies_are_told_with_their_place(right, wrong, told, machine_with, tmp_path):
    machine_with({name: BLOCKS[name] for name in ("cradle", "head")})
    text = (tmp_path / "own.toml").read_text()
    assert right in text
    (tmp_path / "own.toml").write_text(text.replace(right, wrong))
    with pytest.raises(MachineError, match=told):
        read_machine(tmp_path / "own.toml")


RADIUS = 2.5


@pytest.fixture(scope="module")
def capsule():
    return Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 7.5]), RADIUS).mesh(0.001)


def as_given(mesh: TriangleMesh, allowed: float) -> GivenSurface:
    return GivenSurface(MeshDistance(mesh), allowed)


def probes_of(mesh: TriangleMesh, heights: float) -> NormalProbes:
    """Normal probes on the capsule's vertices that were cut at one height."""
    inner = mesh.vertices.copy()
    inner[:, :2] = 0.0
    inner[:, 2] = np.clip(mesh.vertices[:, 2], 2.5, 7.5)
    normals = (mesh.vertices - inner) / RADIUS
    normal_probes = NormalProbes(mesh, np.array(mesh.vertices), normals, np.ones(len(inner)))
    normal_probes.heights[:] = heights
    return normal_probes


def dented(mesh: TriangleMesh, depth: float) -> TriangleMesh:
    """The mesh with its side at x = RADIUS pressed in."""
    vertices = np.array(mesh.vertices)
    vertices[:, 0] = np.minimum(vertices[:, 0], RADIUS - depth)
    return TriangleMesh(vertices, mesh.faces)


@pytest.mark.parametrize("height", [-0.2, -0.01, 0.0, 0.15])
def test_what_is_left_lies_as_far_inside_or_outside_as_it_was_cut(capsule, height):
    none = np.zeros(len(capsule.vertices), dtype=bool)
    found = measure_given(probes_of(capsule, height), none, as_given(capsule, 1.0))
    assert found.inside == pytest.approx(-height, abs=0.002)
    assert found.outside == pytest.approx(height, abs=0.002)
    assert found.report["gouge_max_mm"] == pytest.approx(max(-height, 0.0), abs=0.002)


def test_the_post_keeps_material_that_is_not_told_as_left(capsule):
    normal_probes = probes_of(capsule, 0.0)
    low = normal_probes.points[:, 2] < 0.2
    normal_probes.heights[low] = 0.3
    assert measure_given(normal_probes, low, as_given(capsule, 1.0)).outside < 0.002
    assert measure_given(normal_probes, np.zeros_like(low), as_given(capsule, 1.0)).outside == pytest.approx(
        0.3, abs=0.002
    )


def test_a_surface_too_deep_in_the_mesh_as_given_is_refused_with_place_and_remedy(capsule):
    normal_probes = probes_of(capsule, 0.0)
    normal_probes.heights[7] = -0.2
    none = np.zeros(len(capsule.vertices), dtype=bool)
    with pytest.raises(VerifyError, match=r"0\.[12]\d+ mm inside the mesh as given .* raise surface.largest_deviation"):
        measure_given(normal_probes, none, as_given(capsule, 0.1)).check()


def test_a_ball_too_deep_in_the_mesh_as_given_is_refused_with_its_line(capsule):
    given = as_given(capsule, 0.1)
    given.check_gouge(Gouge(0.09, 0.09, 12, (1.0, 2.0, 3.0), 5))
    with pytest.raises(VerifyError, match=r"line 12: the ball goes 0.1100 mm into the mesh as given") as told:
        given.check_gouge(Gouge(0.11, 0.11, 12, (1.0, 2.0, 3.0), 5))
    assert told.value.evidence["line"] == 12


def test_faces_that_do_not_close_are_measured_too(capsule):
    opened = TriangleMesh(capsule.vertices, capsule.faces[capsule.vertices[capsule.faces].mean(axis=1)[:, 0] > 0])
    points = np.array([[4.0, 0.0, 5.0], [RADIUS - 0.3, 0.0, 5.0]])
    assert as_given(opened, 1.0).signed(points, 9.0) == pytest.approx([1.5, 0.3], abs=0.002)


def test_a_program_may_go_as_deep_as_the_largest_deviation_the_fit_and_the_gouge_tolerance(capsule):
    job = Job()
    part = prepare_part(capsule, MeshJob())
    allowed = given_surface(part, job, {"surface": {"deviation_max_mm": 0.06}}).allowed
    assert allowed == job.surface.largest_deviation + 0.06 + job.path.gouge_tolerance


def test_a_mesh_off_which_repairs_take_too_much_is_refused_with_file_and_place(capsule):
    taken = measure_taken_off(capsule, dented(capsule, 0.7))
    assert taken.depth == pytest.approx(0.7, abs=1e-3)
    assert taken.place[0] == pytest.approx(RADIUS, abs=1e-3)
    made = replace(prepare_part(capsule, MeshJob()), file="bone.stl", taken_off=taken)
    assert made.require_kept(taken.depth + 0.01) is made
    with pytest.raises(MeshError, match=r"bone.stl: the repairs take 0\.\d+ mm off .* raise surface.largest_deviation"):
        made.require_kept(0.1)


def test_a_mesh_that_was_not_changed_loses_nothing(capsule):
    assert prepare_part(capsule, MeshJob()).taken_off is None


def part_of(given: TriangleMesh, repaired: TriangleMesh, smooth: TriangleMesh) -> Part:
    """A part whose mesh was repaired, then smoothed."""
    moves = surface_moves(repaired, smooth)
    place = moves.place
    found = Smoothing(smooth, repaired, coarseness_of(repaired), moves.outward, moves.inward, moves.largest, 0.1, place)
    done = (Repair("repaired"), found.change)
    return Part(smooth, "bone.stl", 10, "mm", done, np.eye(4), given, smoothing=found)


def test_a_program_may_go_deeper_by_what_a_smoothing_took_off(capsule):
    job = Job()
    part = part_of(capsule, capsule, dented(capsule, 0.7))
    report = {"surface": {"deviation_max_mm": 0.06}}
    allowed = given_surface(part, job, report).allowed
    plain = job.surface.largest_deviation + 0.06 + job.path.gouge_tolerance
    assert allowed - plain == pytest.approx(0.7, abs=1e-3)


def test_what_a_smoothing_takes_off_is_told_apart_from_what_repairs_take():
    coarse = Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 7.5]), RADIUS).mesh(0.3)
    made = prepare_part(coarse, MeshJob(facets="smooth"))
    assert made.smoothing is not None
    assert made.smoothing.inward > 0.01
    assert made.taken_off is not None
    assert made.taken_off.depth < 1e-6
    assert made.require_kept(0.001) is made


POINTS = 400


def sampled_distance(foot, axis, section, column):
    """The least distance of points on the cylinder from the cone: a little too large."""
    radius, top, bottom = column
    angle = np.linspace(0, 2 * np.pi, POINTS, endpoint=False)
    wall = [(radius, z) for z in np.linspace(bottom, top, POINTS // 4)]
    lids = [(r, z) for r in np.linspace(0, radius, POINTS // 10) for z in (bottom, top)]
    points = np.vstack(
        [np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(POINTS, z)]) for r, z in wall + lids]
    )
    along = (points - foot) @ axis
    out = np.linalg.norm(points - foot - along[:, None] * axis, axis=1)
    taper = (section[3] - section[2]) / (section[1] - section[0])
    return min(frustum_distance(a, o, section[0], section[1], section[2], taper) for a, o in zip(along, out))


@pytest.mark.parametrize("seed", range(12))
def test_a_cone_is_as_far_from_a_cylinder_as_the_nearest_point(seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3) * ([0.05, 0.05, 1.0] if seed % 3 == 0 else 1.0)
    axis /= np.linalg.norm(axis)
    foot = rng.normal(size=3) * 30 + [0.0, 0.0, 60.0]
    section = np.array([10.0, 60.0, *rng.uniform(2, 40, 2)])
    column = np.array([rng.uniform(2, 30), rng.uniform(5, 50), 0.0])
    truth = sampled_distance(foot, axis, section, column)
    told = column_distance(foot, axis, section, column, np.inf)
    assert told == pytest.approx(max(truth, 0.0), abs=0.05)
    assert column_distance(foot, axis, section, column, 1.0) == pytest.approx(min(told, 1.0))


def test_bodies_that_meet_have_no_distance():
    foot, axis = np.array([0.0, 3.0, 10.0]), np.array([0.0, 0.0, 1.0])
    assert column_distance(foot, axis, np.array([0.0, 5.0, 2.0, 2.0]), np.array([2.0, 12.0, 0.0]), 9.0) == 0


NOWHERE = Spot(0.0, 0, (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("name", "tilt_deg", "caps"),
    [("mill-4axis", 75.0, 2), ("mill-4axis", 60.0, 2), ("mikron-ucp600", 75.0, 0), ("mikron-ucp600", 30.0, 1)],
)
def test_places_that_no_tool_axis_faces_are_a_reason(name, tilt_deg, caps):
    """On a ball of 1 mm they are caps: about both ends under a level tool, about the lower one where it leans by 114
    degrees at most."""
    count = 20_000
    heights = 1 - (2 * np.arange(count) + 1) / count
    azimuths = np.pi * (1 + 5**0.5) * np.arange(count)
    level = np.sqrt(1 - heights**2)[:, None] * np.column_stack([np.cos(azimuths), np.sin(azimuths)])
    normals = np.column_stack([level, heights])
    areas = np.full(count, 4 * np.pi / count)
    mesh = Capsule(np.zeros(3), np.zeros(3), 1.0).mesh(0.1)
    probes = NormalProbes(mesh, normals, normals, areas)
    reasons = {"post": 7.0, "tailstock": 0.0, "gouge": 1.0, "reachable": float(areas.sum())}
    left = Left(mesh, probes.heights, NOWHERE, NOWHERE, reasons, reachable=np.arange(count))
    told = beside_limits(left, probes, machine_limits(read_machine(name)), np.radians(tilt_deg))
    half = 90.0 - tilt_deg if name == "mill-4axis" else 180.0 - 114.0 - tilt_deg
    expected = caps * 2 * np.pi * (1 - np.cos(np.radians(half)))
    assert told.by_reason["limits"] == pytest.approx(expected, rel=0.02)
    assert told.by_reason["limits"] + told.by_reason["reachable"] == pytest.approx(reasons["reachable"])
    assert told.area == pytest.approx(left.area)
    assert len(told.reachable) < len(left.reachable) or not caps


BALL = 2.0
REACH = 0.3
X = np.array([1.0, 0.0, 0.0])


def height_after(centre: ndarray, from_top: bool = False, tall: float = REACH) -> float:
    """The height of a normal probe at the origin along X after a ball at the centre."""
    point, normal = np.zeros((1, 3)), X[None]
    _, starts, corner = probe_cells(point, 0.5)
    probes = ProbesByCell(point, normal, starts, corner, 0.5)
    balls = Capsules(centre[None], centre[None], np.full(1, BALL), names=np.zeros(1, dtype=int))
    heights = np.full(1, tall)
    cut_normal_probes(probes, REACH, balls, heights, np.full(1, -1), from_top=from_top)
    return float(heights[0])


@pytest.mark.parametrize("gouge", [-0.1, 0.003, 0.5, BALL])
def test_a_ball_from_outside_is_in_the_part_by_the_depth_of_its_lowest_point(gouge):
    assert height_after((BALL - gouge) * X) == pytest.approx(-gouge)


@pytest.mark.parametrize("out", [0.003, 0.5])
def test_a_ball_that_grazes_a_thin_edge_is_in_the_part_by_what_holds_the_point(out):
    """The chord was told before: 4 mm of a ball behind an edge, 0.2 mm of one that passes a tip at 0.003 mm."""
    assert height_after((out - BALL) * X) == pytest.approx(-out)
    assert height_after((BALL - out) * np.array([0.0, 1.0, 0.0])) == pytest.approx(-out)
    assert height_after(-1.01 * BALL * X) == REACH


def test_from_the_top_only_what_holds_the_upper_end_is_cut():
    below = np.array([BALL - 0.5, 0.0, 0.0])
    assert height_after(below, tall=4.0) == pytest.approx(-0.5)
    assert height_after(below, from_top=True, tall=4.0) == 4.0
    assert height_after(below, from_top=True, tall=3.0) == pytest.approx(-0.5)
