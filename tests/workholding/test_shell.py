"""The printed shell of a second clamping: two closed halves that come off the part, with datum, screws and arrow."""

from functools import cache

import numpy as np
import pytest
from bonecam_meshes import path as shipped

from bonecam.errors import JobError
from bonecam.job import HoldingJob
from bonecam.job.holding_section import FLATS
from bonecam.mesh import MeshDistance, TriangleMesh, read_mesh, write_mesh
from bonecam.mesh.solids import edges_of, pieces_of, self_intersections
from bonecam.mesh.triangle_mesh import probes
from bonecam.setup import Capsule
from bonecam.workholding.shell import PIN_DEPTH, PrintedShell, check_shell, printed_shell

GAP = 0.1
PARTS = {
    "phalanx": lambda: read_mesh(shipped("phalanx")),
    "capsule": lambda: Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 9.5]), 2.5).mesh(0.05),
    "leaning": lambda: Capsule(np.array([0.0, 0, 3.0]), np.array([6.0, 4.0, 20.0]), 3.0).mesh(0.05),
}


@cache
def made(name: str) -> tuple[TriangleMesh, PrintedShell]:
    part = PARTS[name]()
    return part, printed_shell(part, 0.6, 3.0, GAP)


@pytest.fixture(params=PARTS)
def part_and_shell(request):
    return made(request.param)


def shifted(mesh: TriangleMesh, by: np.ndarray) -> TriangleMesh:
    pose = np.eye(4)
    pose[:3, 3] = by
    return mesh.move(pose)


def test_each_half_is_one_closed_solid(part_and_shell):
    _, shell = part_and_shell
    for half in shell.halves:
        assert (edges_of(half)[1] == 2).all()
        assert pieces_of(half).max() == 0
        assert half.volume > 0
        assert not len(self_intersections(half))


def test_the_halves_keep_the_gap_from_the_part_and_two_from_one_another(part_and_shell):
    part, shell = part_and_shell
    off = MeshDistance(shell.solid).unsigned(part.vertices, 1.0)
    assert off.min() == pytest.approx(GAP, abs=0.02)
    first, second = shell.halves
    assert (first.vertices @ shell.split).min() == pytest.approx(GAP, abs=2e-4)
    assert (second.vertices @ shell.split).max() == pytest.approx(-GAP, abs=2e-4)


def test_the_halves_come_off_the_part_straight_away_from_one_another(part_and_shell):
    part, shell = part_and_shell
    points = probes(part)
    for half, side in zip(shell.halves, (1.0, -1.0), strict=True):
        for way in (0.3, 1.0, 3.0, 8.0):
            off = MeshDistance(shifted(half, side * way * shell.split)).signed(points)
            assert off.min() > -0.02, "facets of the part between its corners"


def test_of_the_planes_through_the_axis_the_one_is_taken_under_which_least_is_caught():
    """The capsule leans by 6 mm in X and 4 in Y: the plane goes along with it, so that the halves catch nothing."""
    _, shell = made("leaning")
    lean = np.array([6.0, 4.0, 0.0]) / np.hypot(6.0, 4.0)
    assert abs(shell.split @ lean) < np.sin(np.radians(5.0))
    assert shell.relieved < 0.5


def test_flat_pin_and_arrow_are_the_datum(part_and_shell):
    _, shell = part_and_shell
    x, y = FLATS[shell.flat]
    toward = np.array([x, -y, 0.0])
    assert toward @ shell.split < -0.7, "in the second half, off the plane between them"
    solid = MeshDistance(shell.solid)
    low, high = shell.solid.bounds[:, 2]
    reach = (shell.solid.vertices @ toward).max()
    wide = (shell.solid.vertices @ -toward).max()
    assert reach == pytest.approx(wide - 1.5, abs=0.05)
    on_axis = np.array([[0.0, 0.0, high - 1.0], [0.0, 0.0, high - PIN_DEPTH + 2.5]])
    assert solid.unsigned(on_axis).min() >= shell.pin / 2
    middle = (reach - 3.0) * toward
    assert solid.signed(middle[None] + [0.0, 0.0, low + 0.3])[0] > 0, "the arrow, 0.6 mm deep in the rim"
    assert solid.signed(middle[None] + [0.0, 0.0, low + 1.0])[0] < 0


def test_two_screws_draw_the_halves_together(part_and_shell):
    part, shell = part_and_shell
    along = np.cross(shell.split, [0.0, 0.0, 1.0])
    height = shell.solid.bounds[:, 2].mean()
    held = part.vertices[part.vertices[:, 2] > shell.solid.bounds[0, 2]] @ along
    first, second = (MeshDistance(half) for half in shell.halves)
    for end in (held.max() + GAP, held.min() - GAP):
        axis = (end + np.sign(end) * 3.2) * along + [0.0, 0.0, height]
        through, core, head = (axis + away * shell.split for away in (2.0, -5.0, 6.0))
        assert first.signed(through[None])[0] == pytest.approx(1.7, abs=0.1)
        assert second.signed(core[None])[0] == pytest.approx(1.25, abs=0.1)
        assert first.signed(head[None])[0] > 2.0
        assert MeshDistance(part).signed(through[None])[0] > 1.7 + 1.4, "a wall between screw and part"


@pytest.mark.parametrize("ending", ["stl", "3mf"])
def test_the_printed_file_holds_what_the_collision_check_knows(part_and_shell, ending, tmp_path):
    _, shell = part_and_shell
    file = tmp_path / f"shell.{ending}"
    write_mesh(shell.to_print, file)
    printed = read_mesh(file)
    assert (edges_of(printed)[1] == 2).all()
    assert pieces_of(printed).max() == 1
    assert printed.volume == pytest.approx(shell.solid.volume, rel=1e-5)
    assert printed.bounds[0, 2] == pytest.approx(0.0, abs=1e-4)
    assert np.ptp(printed.bounds[:, 2]) == pytest.approx(np.ptp(shell.solid.bounds[:, 2]), abs=1e-3)


def test_a_shell_is_asked_for_the_datum_that_its_job_states():
    part, shell = made("capsule")
    check_shell(shell.solid, part, HoldingJob(second_flat=shell.flat, second_pin=4.0))
    other = next(name for name in FLATS if name != shell.flat)
    with pytest.raises(JobError, match=r"second_flat = .*no flat of 4 mm there: say where"):
        check_shell(shell.solid, part, HoldingJob(second_flat=other))
    chuck = HoldingJob(second_chuck_diameter=10.0, second_chuck_height=5.0)
    with pytest.raises(JobError, match=r"second_chuck_diameter = 10: .*shell, which is 2\d\.\d+ mm across"):
        check_shell(shell.solid, part, chuck)
    with pytest.raises(JobError, match=r"second_pin = 6: the shell has room for 4\.\d+ mm"):
        check_shell(shell.solid, part, HoldingJob(second_pin=6.0))


def test_a_shell_has_a_size():
    with pytest.raises(ValueError, match="covered = 1, wall = 3, gap = 0: give a share between 0 and 1"):
        printed_shell(PARTS["capsule"](), 1.0, 3.0, 0.0)
