"""The second clamping of a small lump that was parted; and shells that do not do."""

import re
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bonecam_meshes import path as shipped
from small_parts import level_of, mesh_of, pebble
from typed_values import differences

import bonecam
from bonecam.errors import BendingError, JobError, MeshError, VerifyError
from bonecam.job import HoldingJob, Job, MechanicsJob
from bonecam.machine import read_machine
from bonecam.mechanics.loads import Standing as Stands
from bonecam.mesh import MeshDistance, Part, TriangleMesh, write_mesh
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.mesh.solids import solid_difference
from bonecam.nc import machine_limits, read_dialect, read_program, write_program
from bonecam.nc.program import program_number
from bonecam.nc.requirements import second_job
from bonecam.planning import Scene
from bonecam.planning.parting import parting_paths
from bonecam.planning.stump import check_second, cut_groove
from bonecam.progress import silent
from bonecam.report.typed import SecondFigures
from bonecam.runtime.timing import StageTimes
from bonecam.second_clamping import second_program, with_second
from bonecam.setup import Capsule, ConvexStock, smallest_capsule
from bonecam.verify import simulate_removal
from bonecam.verify.clearances import shell_clearance
from bonecam.verify.removal import check_removal_of_job, cutters_of, simulate_stump
from bonecam.workholding import clamping_of, post_below
from bonecam.workholding.post import Post
from bonecam.workholding.shell import printed_shell, read_shell

pytestmark = pytest.mark.whole

MACHINE, DIALECT = read_machine("mikron-ucp600"), read_dialect("heidenhain")
LUMP = Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 9.5]), 2.5).mesh(0.05)
JOB = Job().with_values(
    mechanics={"refuse": False},
    holding={"diameter": 3.0, "length": 31.0, "parting": True},
    mesh={"upright": False},
    levels={"roughing_depth": 0.6},
    path={"chord_tolerance": 0.008},
)


def job_with(shell: Path, **holding: object) -> Job:
    return JOB.with_values(holding={"second": str(shell), **holding})


def part_of(mesh: TriangleMesh) -> Part:
    return Part(mesh, "", len(mesh.faces), "mm", (), np.eye(4), mesh)


def fits(job: Job, post: Post) -> None:
    """What is asked of the lump's shell before anything is planned."""
    part = part_of(LUMP)
    shell = read_shell(job, part)
    assert shell is not None
    check_second(shell, part.mesh, post, job)


@pytest.fixture(scope="module")
def parted(tmp_path_factory):
    """The finished lump, with what the simulation of its parting leaves; and a job with a shell."""
    lump = mesh_of(pebble(), around=40, along=50)
    file = tmp_path_factory.mktemp("second") / "shell.stl"
    write_mesh(printed_shell(lump, 0.5, 3.0, 0.1).solid, file)
    job = job_with(file, second_height=2.0, second_chuck_diameter=30.0, second_chuck_height=4.0)
    post = post_below(lump, job.holding)
    clamping = clamping_of(job.holding, MACHINE.table)
    scene = Scene(lump, lump, smallest_capsule(lump.vertices, 0.5), post, 0.1, clamping=clamping)
    paths = parting_paths(scene, job, machine_limits(MACHINE))
    removal = simulate_removal(
        write_program(paths, MACHINE, DIALECT, job).text,
        MACHINE,
        DIALECT,
        ConvexStock(convex_hull(lump.vertices), proven=True),
        post,
        cutters_of(job, MACHINE),
        clamping=clamping,
        part=pebble(),
    )
    levels = SimpleNamespace(levels=[level_of(pebble())])
    report = {"surface": {"deviation_max_mm": 0.0}}
    return SimpleNamespace(job=job, part=part_of(lump), levels=levels, removal=removal, paths=paths, report=report)


@pytest.fixture(scope="module")
def second(parted):
    made = second_program(parted, MACHINE, DIALECT, "bone.h")
    assert made is not None
    return made


def test_the_second_program_cuts_off_what_stayed_at_the_post(second):
    told = second.report
    assert differences(told, SecondFigures) == []
    assert told["at_post_before_mm2"] > 6.7, "the post of 3 mm alone covers 7.07"
    assert told["at_post_after_mm2"] == 0
    assert not any(path["uncut_reasons"].get("hidden") for path in told["toolpath"]), "nothing stays there"
    assert told["gouge_max_mm"] <= 0.01
    assert told["removal"]["rapid_contact_mm3"] == 0
    assert told["removal"]["clearance_mm"]["shell"] > 1.0
    assert told["file"] == "bone.second.h"
    assert told["time_min"] < 5


def test_force_and_bending_of_the_stump_are_those_of_what_stands_over_the_shell(second, parted):
    told = second.report["mechanics"]
    assert 0 < told["error_kept_um"]["p99"] < 50
    assert 0 < told["neck_stress_p99_mpa"] < told["yield_mpa"] / 2
    assert "BENDING KEEPS" in second.program.text
    assert "error kept" in second.summary
    # half of the lump of 12 mm is in a shell that lies against it all round
    assert second.removal.mechanics.workpiece.clamped == pytest.approx(2.0 + 7.6 + 6.0, abs=0.6)
    rigid = replace(second.removal.mechanics.workpiece, seat=None)
    remaining, vertices = second.removal.remaining, second.clamping.part.vertices
    top = vertices[[np.argmax(vertices[:, 2])]]
    standing = Stands(remaining.sets, remaining.grid, float(top[0, 2]))
    soft, hard = (work.beam(standing) for work in (second.removal.mechanics.workpiece, rigid))
    assert hard.first_frequency(2700.0) > 10_000, "6 mm of a bar of 5 mm"
    assert soft.compliance(top)[0, 0, 0] > 5 * hard.compliance(top)[0, 0, 0]
    assert told["shell"]["modulus_mpa"] == 1600
    assert "THE SHELL OF 1600 N/MM2 BEARS" in second.program.text
    assert "the shell of 1600 N/mm2 bears" in second.summary
    weak = second.removal.mechanics.workpiece.stiffness.model_copy(update={"yield_strength": 1.0})
    work = replace(second.removal.mechanics.workpiece, stiffness=weak, limits=MechanicsJob())
    bent = replace(second.removal.mechanics, workpiece=work)
    with pytest.raises(VerifyError, match="stress at the peaks"):
        check_removal_of_job(replace(second.removal, mechanics=bent), second.job)


def test_balls_touch_the_turned_part_where_the_post_stood(second, parted):
    clamping = second.clamping
    assert clamping.shell.bounds[0, 2] == pytest.approx(2.0)
    stood = clamping.part.move(np.linalg.inv(clamping.pose))
    np.testing.assert_allclose(stood.bounds, parted.part.mesh.bounds, atol=0.02)
    finishing = second.paths[-1]
    cutting = ~np.isnan(finishing.contacts[:, 0])
    off = MeshDistance(clamping.part).signed(finishing.balls[cutting]) - finishing.cutter.radius
    assert off.min() > -0.01
    assert np.percentile(off, 90) < 0.01
    assert finishing.contacts[cutting, 2].min() > clamping.part.bounds[1, 2] - 2.0


def test_the_clearance_from_the_shell_is_that_of_the_tools_at_all_poses(second):
    shell = MeshDistance(second.clamping.shell)
    least = np.inf
    for path in second.paths:
        for section in path.cutter.profile:
            for height in np.arange(section.start, section.end, 0.5) - path.cutter.radius:
                off = shell.signed(path.balls + height * path.axes)
                least = min(least, off.min() - max(section.radius, section.end_radius))
    assert second.report["removal"]["clearance_mm"]["shell"] == pytest.approx(least, abs=0.5)


def test_a_shell_in_the_way_of_the_tool_refuses_the_program(second):
    motions = read_program(second.program.text, MACHINE, DIALECT)
    raised = np.eye(4)
    raised[2, 3] = second.removal.shell.least.value
    shell = second.clamping.shell.move(raised)
    near = shell_clearance(motions, cutters_of(second.job, MACHINE), shell)
    assert near.touched == near.least.line > 0
    with pytest.raises(VerifyError, match=r"line \d+: the tool comes within 0.2 mm of the shell .*farther up"):
        check_removal_of_job(replace(second.removal, shell=near), second.job)


def test_a_shell_without_room_for_what_stays_at_the_tailstock_is_refused(tmp_path):
    """A closed shell round the free end, and one with a hole there as wide as is told."""
    held = {"tailstock": "pin", "tailstock_diameter": 2.0, "tailstock_x": 1e-3}
    bore = Capsule(np.array([0.0, 0, 11.0]), np.array([0.0, 0, 40.0]), 2.1).mesh(0.02)
    whole = printed_shell(LUMP, 0.5, 3.0, 0.1).solid
    file = tmp_path / "shell.stl"
    for shell, room in ((whole, False), (solid_difference(whole, bore), True)):
        write_mesh(shell, file)
        job = job_with(file, **held)
        post = post_below(LUMP, job.holding)
        if room:
            fits(job, post)
        else:
            with pytest.raises(JobError, match=r"what stays at the tailstock, .* leave a hole there of 4 mm"):
                fits(job, post)


def test_the_header_tells_the_second_mounting(second):
    text = re.sub(r"\n\d+ ;", "", second.program.text.upper())
    rim = float(second.clamping.shell.bounds[1, 2])
    assert second.program.zero_height == pytest.approx(rim, abs=0.0005)
    assert "Z 0 ON THE RIM OF THE SHELL" in text
    assert "TURNED OVER ABOUT X" in text
    assert f"DIAMETER 30.00 MM, UP TO Z {4.0 - rim:.2f}" in text
    assert "TEXT READ BACK" in text
    assert "POST BELOW IT" not in text


def test_the_material_of_the_second_program_is_the_stump(second, parted):
    rough = second.report["removal"]["levels"]
    cap = np.pi * (2.5 * 1.5**2 - (2.5**3 - (2.5**2 - 1.5**2) ** 1.5) * 2 / 3)
    stump, bridge = np.pi * 1.5**2 * 1.0, np.pi * 1.1**2 * 1.0
    assert sum(level["removed_mm3"] for level in rough) == pytest.approx(cap + stump + bridge, rel=0.3), (
        "under the round end, a stump of 1 mm and half of the groove's bridge"
    )


@pytest.fixture(scope="module")
def roughed_coarsely(parted):
    """The second clamping's job and program where roughing leaves ridges of 0.3 mm."""
    values = {"roughing": {"scallop": 0.3}, "levels": {"finishing_depth": 0.15}, "nc": {"program_number": 77}}
    job = parted.job.with_values(**values)
    made = second_program(SimpleNamespace(**{**vars(parted), "job": job}), MACHINE, DIALECT, None)
    return replace(job, holding=job.holding.turned_over), made


def test_the_second_program_does_not_have_the_number_of_the_first(roughed_coarsely):
    _, made = roughed_coarsely
    assert made.program.number == program_number(made.program.name) != 77


def test_the_finishing_cutter_takes_what_roughing_left_in_cuts_of_its_depth(roughed_coarsely):
    job, made = roughed_coarsely
    fine = [level for level in made.removal.levels if level.tool == 2]
    assert [level.index for level in fine] == list(range(len(fine)))[::-1]
    assert len(fine) > 2
    for level in fine:
        assert level.deepest.value < job.levels.finishing_depth + 0.04, "half a cell, and a scallop of 0.01"
    assert max(level.deepest.value for level in made.removal.levels) > 0.5


def test_a_cut_of_the_second_program_that_is_too_deep_is_refused(roughed_coarsely, parted):
    job, made = roughed_coarsely
    paths = [path for path in made.paths if path.cutter.number == 1 or path.level == 0]
    text = write_program(paths, MACHINE, DIALECT, job).text
    groove = cut_groove(parted.paths)
    material = parted.removal.remaining.above(groove.middle).move(made.clamping.pose)
    smoother = job.with_values(roughing={"scallop": 0.05})
    solids = made.clamping.part, made.clamping.shell
    removal = simulate_stump(text, MACHINE, DIALECT, smoother, material, *solids)
    with pytest.raises(VerifyError, match=r"a cut of level 0 is 0\.[1-9]\d* mm deep, 0\.\d+ over its limit"):
        check_removal_of_job(removal, smoother)


@pytest.mark.slow
def test_a_finishing_depth_below_what_the_rays_tell_of_the_material_is_taken_too(parted):
    job = parted.job.with_values(levels={"finishing_depth": 0.045})
    made = second_program(SimpleNamespace(**{**vars(parted), "job": job}), MACHINE, DIALECT, None)
    assert made.report["at_post_after_mm2"] == 0
    assert made.removal.levels[-1].deepest.value < 0.045 + 0.04


@pytest.mark.slow
def test_a_part_gets_both_programs(tmp_path):
    job = Job().with_values(
        surface={"tolerance": 0.2},
        levels={"roughing_depth": 1.2, "finishing_depth": 0.3, "chord_tolerance": 0.02},
        roughing={"scallop": 0.3},
        holding={"parting": True, "second": str(tmp_path / "shell.stl")},
    )
    bonecam.clamping_shell(shipped("phalanx"), job, output=tmp_path / "shell.stl")
    made = bonecam.convert(shipped("phalanx"), job, program=tmp_path / "bone.h", keep=tmp_path / "keep")
    assert made.report["second"]["at_post_after_mm2"] < 0.5
    assert "at the post still keep more than 0.02 mm" in made.summary
    assert made.second is not None
    assert (tmp_path / "bone.second.h").read_text() == made.second.program.text
    assert "Q339=1" in made.program.text
    assert "Q339=2" in made.second.program.text
    kept = {path.name for path in (tmp_path / "keep").iterdir()}
    assert {"second.h", "second.ply", "second.png"} <= kept


def test_a_job_tells_what_the_second_clamping_needs():
    with pytest.raises(JobError, match=r"second = 'a\.stl': give holding\.parting = true"):
        HoldingJob(second="a.stl")
    with pytest.raises(JobError, match="second_chuck_diameter = 0: give both sizes"):
        HoldingJob(second_chuck_height=3.0)
    with pytest.raises(JobError, match="begins with what the simulation of the first leaves"):
        bonecam.convert(LUMP, job_with(Path("a.stl")), simulation=False)


def _moved(mesh: TriangleMesh, *shift: float) -> TriangleMesh:
    pose = np.eye(4)
    pose[:3, 3] = shift
    return mesh.move(pose)


@pytest.mark.parametrize(
    ("fault", "error", "message"),
    [
        ("open", MeshError, r"second = .*is not closed near"),
        ("aside", JobError, r"second = .*it enters the part by \d\.\d+ mm"),
        ("wide", JobError, r"second = .*it lets the part move towards"),
        ("long", JobError, r"second = .*mm of the ball that cuts the stump off: end it farther up"),
    ],
)
def test_a_shell_that_does_not_do_is_refused_before_any_level_is_made(fault, error, message, tmp_path):
    good = printed_shell(LUMP, 0.5, 2.0, 0.1).solid
    shells = {
        "open": lambda: TriangleMesh(good.vertices, good.faces[1:]),
        "aside": lambda: _moved(good, 0.5, 0.0, 0.0),
        "wide": lambda: printed_shell(LUMP, 0.5, 2.0, 0.5).solid,
        "long": lambda: printed_shell(LUMP, 0.9, 2.0, 0.1).solid,
    }
    file = tmp_path / "shell.stl"
    write_mesh(shells[fault](), file)
    with pytest.raises(error, match=message):
        fits(job_with(file), post_below(LUMP, JOB.holding))


def test_a_shell_bears_feeds_until_error_or_stress_reach_their_limit(second):
    """With the largest error at that which is kept it bears just these feeds; with less the feeds fall by more, as what
    the edges press stays."""
    mechanics = second.removal.mechanics
    borne = []
    for largest in (mechanics.error.p99, 0.9 * mechanics.error.p99, 0.001):
        limits = replace(mechanics.workpiece.limits, largest_error=largest)
        borne.append(replace(mechanics, workpiece=replace(mechanics.workpiece, limits=limits)).feeds_borne)
    assert borne[0] == pytest.approx(1.0)
    assert 0 < borne[1] < 0.9
    assert 0 <= borne[2] < borne[1]


@pytest.fixture(scope="module")
def stands():
    """The lump on its post, before anything is planned."""
    job = JOB.with_values(holding={"second": "lump.shell.stl"})
    lump = _moved(LUMP, 0.0, 0.0, job.holding.length)
    post = post_below(lump, job.holding)
    return SimpleNamespace(job=job, setup=SimpleNamespace(part=part_of(lump), post=post))


@dataclass(frozen=True)
class Stood:
    """What `with_second` reads of a part that stands."""

    setup: SimpleNamespace
    job: Job


def told_early(stands, tmp_path, **values: dict[str, object]) -> Job:
    """The job with the shell that is made for the lump and foretold to do."""
    job = stands.job.with_values(holding={"second": str(tmp_path / "lump.shell.stl")}, **values)
    standing = Stood(stands.setup, job)
    made = with_second(lambda _: standing, job, MACHINE, StageTimes(), silent, whole=True, mechanics=True)
    return made.job


def test_the_shell_that_is_made_for_a_part_is_the_highest_that_leaves_the_ball_room(stands, tmp_path):
    job = told_early(stands, tmp_path, mechanics={"refuse": True})
    part, post = stands.setup.part, stands.setup.post
    shell = read_shell(job, part)
    check_second(shell, part.mesh, post, job)
    raised = np.eye(4)
    raised[2, 3] = -0.3
    with pytest.raises(JobError, match="of the ball that cuts the stump off"):
        check_second(shell.move(raised), part.mesh, post, job)
    assert {path.name for path in tmp_path.iterdir()} == {
        "lump.shell.stl",
        "lump.shell.print.stl",
        "lump.shell.print.3mf",
    }


def test_what_refuses_the_second_program_is_found_before_planning_with_a_remedy_that_was_tried(stands, tmp_path):
    with pytest.raises(BendingError) as refused:
        told_early(stands, tmp_path, mechanics={"refuse": True, "largest_error": 0.001})
    text = str(refused.value)
    assert "refused before planning" in text
    assert "neither with roughing.feed" in text
    assert not list(tmp_path.iterdir()), "a shell that does not do is not written"


@pytest.mark.parametrize(("controller", "given", "taken"), [("heidenhain", 1, 2), ("siemens-840d", 3, 4)])
def test_the_second_clamping_has_the_next_work_offset(controller, given, taken):
    job = job_with(Path("a.stl")).with_values(nc={"controller": controller, "work_offset": given})
    assert second_job(job).nc.work_offset == taken
    with pytest.raises(JobError, match=r"work_offset = 4: .* siemens-840d has not: give 1 to 3"):
        bonecam.convert(LUMP, job.with_values(nc={"controller": "siemens-840d", "work_offset": 4}))


@pytest.mark.parametrize("controller", ["siemens-840d", "fanuc-30i"])
def test_other_controls_get_a_second_program_too(parted, second, controller, monkeypatch):
    monkeypatch.setattr(bonecam.second_clamping, "second_paths", lambda *_, **__: list(second.paths))
    made = second_program(parted, MACHINE, read_dialect(controller), None)
    assert made is not None
    assert made.program.controller == controller
    assert made.report["at_post_after_mm2"] == 0
    assert made.report["gouge_max_mm"] <= 0.01
    assert made.report["removal"]["rapid_contact_mm3"] == 0
    assert "SECOND CLAMPING" in made.program.text
    assert len(made.paths) == len(second.paths)
