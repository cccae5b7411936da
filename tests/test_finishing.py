"""One surface machined alone: open and closed ones are covered, posted, and gouge neither part nor obstacle."""

import base64
from dataclasses import replace

import numpy as np
import pytest
from small_parts import pebble

import bonecam
from bonecam.errors import BendingError, FileError, JobError, MachineError, MeshError, SurfaceError, UnitsError
from bonecam.machine import read_machine
from bonecam.mesh import MeshDistance, write_mesh
from bonecam.mesh.solids import revolve
from bonecam.mesh.triangle_mesh import keep_faces
from bonecam.nc.requirements import job_dialect
from bonecam.report import read_apt
from bonecam.report.page.contents import unpack
from bonecam.surface import TSpline, blade_solid, save_surface, skin
from bonecam.tool import MoveKind
from bonecam.verify.proof import prove_surface_removal

pytestmark = pytest.mark.whole

JOB = bonecam.Job().with_values(
    holding={"length": 60.0, "diameter": 10.0},
    finishing={"radius": 2.0, "flute_length": 6.0, "shank_diameter": 3.6, "overhang": 45.0, "scallop": 0.2},
    path={"orientation": "lead", "max_tilt_deg": 85.0},
)
SIZE = 10.0


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 8 - x**2 / 60 - y**2 / 90


def panel() -> TSpline:
    """An open surface over a square of 2 SIZE, its normals upward."""
    x = np.linspace(-SIZE, SIZE, 21)
    rows = [np.column_stack([x, np.full(21, y), height(x, np.full(21, y))]) for y in np.linspace(-SIZE, SIZE, 9)]
    return skin(rows, 1e-4, closed=False)


def block(count: int = 49) -> bonecam.TriangleMesh:
    """The solid below the panel, to z = 0."""
    x, y = (v.ravel() for v in np.meshgrid(*2 * [np.linspace(-SIZE, SIZE, count)], indexing="ij"))
    top = np.column_stack([x, y, height(x, y)])
    index = np.arange(count**2).reshape(count, count)
    a, b, c, d = (v.ravel() for v in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    upper = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    rim = np.r_[index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]]
    after = np.roll(rim, -1)
    walls = np.vstack(
        [np.column_stack([rim + count**2, after + count**2, after]), np.column_stack([rim + count**2, after, rim])]
    )
    faces = np.vstack([upper, upper[:, ::-1] + count**2, walls])
    return bonecam.TriangleMesh(np.vstack([top, top * [1, 1, 0]]), faces.astype(np.int32))


def moved_block(x: float) -> bonecam.TriangleMesh:
    """The block, moved along x."""
    return bonecam.TriangleMesh(block().vertices + np.array([x, 0.0, 0.0]), block().faces)


def blunt_blade() -> TSpline:
    """The skin of a straight blade 12 mm tall, whose sections end at an edge 0.4 mm wide."""
    u = np.linspace(-1.0, 1.0, 41)
    side = (0.2 + (1 - u**2) * 1.5) * np.sign(u)
    section = np.column_stack([16 * u**2 - 8, -side])
    return skin([np.column_stack([section, np.full(41, z)]) for z in (0.0, 6.0, 12.0)], 0.01, closed=False)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    files = {"program": folder / "panel.h", "keep": folder / "keep", "report": folder / "panel.json"}
    files |= {"html": folder / "panel.html", "apt": folder / "panel.cls"}
    return bonecam.finish(panel(), block(), job=JOB, **files), folder


def test_an_open_surface_is_cut_whole_from_edge_to_edge(finished):
    made, _ = finished
    assert made.report["surface"]["kind"] == "open"
    assert not len(made.path.uncut)
    contacts = made.path.contacts[made.path.kinds == MoveKind.CUT]
    found = made.workpiece.surface.project(contacts)
    assert found.distances.max() < 1e-6
    for direction in (0, 1):
        assert found.parameters[:, direction].min() == pytest.approx(0, abs=1e-6)
        assert found.parameters[:, direction].max() == pytest.approx(1, abs=1e-6)


def test_the_text_gouges_nothing_and_its_files_are_there(finished):
    made, folder = finished
    assert made.report["nc"]["gouge_max_mm"] <= JOB.path.gouge_tolerance
    assert "GOUGE" in (folder / "panel.h").read_text()
    names = {"surface.iga", "solid.ply", "toolpath.csv", "toolpath.apt", "toolpath.png", "view.gz"}
    assert names <= {file.name for file in (folder / "keep").iterdir()}
    assert "surface   open" in made.summary
    assert (folder / "panel.json").stat().st_size > 200
    read = read_apt((folder / "panel.cls").read_text())
    assert np.abs(read.paths[0].tips - made.path.tips).max() < 1e-6
    payload = (folder / "panel.html").read_text(encoding="utf-8").split('type="text/plain">')[1].split("<")[0]
    shown = unpack(base64.b64decode(payload), "panel.html")
    assert shown.arrays["text"].tobytes().decode() == made.program.text
    assert [layer["level"] for layer in shown.facts["program"]["layers"]] == [made.path.level]


def test_force_and_bending_are_told_of_what_the_text_removes_and_a_wire_is_refused(finished):
    made, folder = finished
    told = made.report["mechanics"]
    assert 0 < told["error_kept_um"]["p95"] < 20
    assert "BENDING KEEPS" in (folder / "panel.h").read_text()
    assert "error kept" in made.summary
    assert {"error.ply", "error.png", "left.ply"} <= {file.name for file in (folder / "keep").iterdir()}
    # what stands before is the layer of the finishing cut: the scallops of 0.2 mm stay
    depth = made.report["removal"]["levels"][0]["depth_max_mm"]
    assert 0.8 * JOB.levels.finishing_depth < depth < 1.1 * JOB.levels.finishing_depth
    wire = replace(made.job, holding=replace(made.job.holding, diameter=3.0))
    machine, dialect = read_machine(wire.nc.machine), job_dialect(wire.nc)
    bodies = wire, made.workpiece.surface, made.workpiece.solid
    with pytest.raises(BendingError, match="stress at the peaks is"):
        prove_surface_removal(made.program.text, machine, dialect, *bodies)


def test_a_mesh_patch_is_cut_as_the_surface_through_it(tmp_path):
    write_mesh(keep_faces(block(), slice(0, 2 * 48**2)), tmp_path / "top.stl")
    made = bonecam.finish(tmp_path / "top.stl", block(), job=JOB)
    assert made.report["surface"]["kind"] == "open"
    assert made.report["nc"]["gouge_max_mm"] <= JOB.path.gouge_tolerance
    contacts = made.path.contacts[made.path.kinds == MoveKind.CUT]
    assert np.abs(MeshDistance(made.workpiece.solid).signed(contacts)).max() < 0.06
    assert np.ptp(contacts[:, :2], axis=0) == pytest.approx([2 * SIZE, 2 * SIZE], abs=0.05)


def test_an_obstacle_over_the_surface_is_kept_clear_of_by_ball_and_shank():
    wall = revolve(np.full(2, 2.0), np.array([2.0, 40.0]), (2.0, 40.0), 32)
    made = bonecam.finish(panel(), block(), [wall], JOB)
    cuts = made.path.kinds == MoveKind.CUT
    assert len(made.path.uncut)
    assert set(made.path.reasons) <= {"gouge", "collision"}
    distance = MeshDistance(made.workpiece.solid)
    for up, radius in ((0.0, 2.0), (10.0, 1.8), (30.0, 1.8)):
        points = made.path.tips[cuts] + (2.0 + up) * made.path.axes[cuts]
        assert distance.signed(points).min() > radius - JOB.path.gouge_tolerance


def test_links_keep_out_of_a_blade_that_ends_at_a_blunt_edge():
    blade = blunt_blade()
    hub = revolve(np.full(2, 12.0), np.array([-4.0, 0.5]), (-4.0, 0.5), 48)
    job = JOB.with_values(path={"orientation": "cones"}, warnings={"refuse": False})
    made = bonecam.finish(blade, hub, job=job, mechanics=False)
    alone = MeshDistance(blade_solid(made.workpiece.surface, 0.01))
    along = np.linspace(0, 1, 20)[:, None, None]
    balls = made.path.balls[:-1] + along * np.diff(made.path.balls, axis=0)
    assert alone.signed(balls.reshape(-1, 3)).min() > 2.0 - 0.02
    assert made.removal is not None
    assert made.removal.rapid_volume == 0.0


def crossed() -> TSpline:
    """A pebble whose upper half is turned through its axis."""
    points = pebble().control_points.copy()
    points[points[:, 2] > points[:, 2].mean(), :2] *= -1.0
    return pebble().with_control_points(points)


def scaled(surface: TSpline, *by: float) -> TSpline:
    return surface.with_control_points(surface.control_points * by)


@pytest.mark.parametrize(
    ("given", "error", "why"),
    [
        (
            lambda: (panel(), moved_block(4 * SIZE)),
            SurfaceError,
            r"lies \d+\.\d to \d+\.\d mm off .*give the solid that it bounds",
        ),
        (lambda: (panel(),), SurfaceError, "give the part"),
        (
            lambda: ("block.stl", block()),
            SurfaceError,
            r"block\.stl: a patch of one piece has one edge, this mesh is closed",
        ),
        (lambda: ("block.mlx", block()), FileError, r"ending '\.mlx': give a surface that passes can follow"),
        (lambda: (panel(), "missing.stl"), FileError, r"missing\.stl"),
        (lambda: (panel(), block(), ["open.stl"]), MeshError, r"open\.stl is not closed near"),
        (
            lambda: (panel(), bonecam.TriangleMesh(block().vertices, block().faces[:, ::-1])),
            MeshError,
            r"solid 0 of part and obstacles encloses .*turn its faces outward",
        ),
        (
            lambda: (scaled(panel(), -1, 1, 1), block()),
            SurfaceError,
            r"the surface: 100% of it lies in the solids .*: reverse every row",
        ),
        (lambda: (scaled(pebble(), 0, 0, 1),), SurfaceError, "the surface: encloses no volume"),
        (lambda: (scaled(pebble(), 1, -1, 1),), SurfaceError, r"the surface: .* point inward: reverse every row"),
        (lambda: (crossed(),), MeshError, "the surface: its surface cuts itself"),
    ],
)
def test_what_cannot_be_machined_alone_is_refused_before_it_is_planned(given, error, why, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh(block(), "block.stl")
    write_mesh(keep_faces(block(), slice(1, None)), "open.stl")
    with pytest.raises(error, match=why):
        bonecam.finish(*given(), job=JOB)


def test_surfaces_far_larger_than_a_part_are_refused_before_they_are_tessellated(tmp_path):
    huge = pebble().with_control_points(1e4 * pebble().control_points)
    save_surface(huge, tmp_path / "huge.tspline")
    for given, name in ((huge, "the surface"), (tmp_path / "huge.tspline", r"huge\.tspline")):
        with pytest.raises(UnitsError, match=rf"{name}: .*e\+05 mm from corner to corner: .*: scale it first"):
            bonecam.finish(given, job=JOB)


@pytest.mark.parametrize(
    ("values", "why"),
    [
        (
            {"holding": {"neck": "milled"}},
            r"\[holding\] neck = 'milled': .* stands in no bar: leave it out, or use `conv",
        ),
        ({"nc": {"probe": True}}, r"\[nc\] probe = True: .* stands in no bar: leave it out, or use `convert`"),
    ],
)
def test_what_there_is_of_a_bar_alone_is_refused_before_the_surface_is_read(values, why, tmp_path):
    with pytest.raises(JobError, match=why):
        bonecam.finish(tmp_path / "none.xyz", job=JOB.with_values(**values))
    with pytest.raises(JobError, match=why):
        bonecam.blades(tmp_path / "none.xyz", tmp_path / "none.stl", 2, job=JOB.with_values(**values))


def test_refusals_of_path_and_program_name_the_surface(tmp_path):
    file = tmp_path / "far.xyz"
    steps = (-9, -3, 3, 9)
    file.write_text("\n\n".join("\n".join(f"{9000 + x} {y} 8" for x in steps) for y in steps), encoding="utf-8")
    with pytest.raises(MachineError, match=r"far.xyz: .*X runs over"):
        bonecam.finish(file, moved_block(9000.0), job=JOB)
