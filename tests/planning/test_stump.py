"""The parting groove: posted, read back and simulated on a small lump; and jobs that cannot have one.

The layers that cut a stump off: none of them cuts deeper than its depth, in a hollow neither.
"""

from dataclasses import replace

import numpy as np
import pytest
from small_parts import mesh_of, pebble

from bonecam.errors import JobError, VerifyError
from bonecam.finishing import finish
from bonecam.job import HoldingJob, Job
from bonecam.machine import MachineLimits, read_machine
from bonecam.mesh import MeshDistance, Part, TriangleMesh
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.nc import machine_limits, read_dialect, write_program
from bonecam.planning import Scene
from bonecam.planning.layers import HeightField, depths_in
from bonecam.planning.parting import check_parting, foretold_scene, parting_paths
from bonecam.planning.post_length import least_groove, parting_lift, stand_on_post, with_stand_off
from bonecam.planning.stump import STEPS, cut_groove, groove_below, off_part, parting_cutters, stump_chart, stump_layers
from bonecam.report import read_apt
from bonecam.report.tables import apt_text
from bonecam.setup import ConvexStock, Setup, schedule_of, smallest_capsule
from bonecam.tool import Cutter
from bonecam.tool.path import PARTING, MoveKind
from bonecam.verify import Accuracy, check_removal, simulate_removal, verify
from bonecam.verify.removal import check_removal_of_job, cutters_of
from bonecam.workholding import Post, clamping_of

MACHINE, DIALECT = read_machine("mikron-ucp600"), read_dialect("heidenhain")
LIMITS = machine_limits(MACHINE)
JOB = Job().with_values(holding={"diameter": 4.0, "length": 31.0, "parting": True}, levels={"roughing_depth": 0.6})


@pytest.fixture(scope="module")
def lump():
    return mesh_of(pebble(), around=40, along=50)


@pytest.fixture(scope="module")
def scene(lump):
    """The finished lump on its post."""
    return Scene(
        lump,
        lump,
        smallest_capsule(lump.vertices, 0.5),
        Post(2.0, 31.8),
        0.1,
        clamping=clamping_of(JOB.holding, MACHINE.table),
    )


@pytest.fixture(scope="module")
def paths(scene):
    return parting_paths(scene, JOB, LIMITS)


@pytest.fixture(scope="module")
def text(paths):
    return write_program(paths, MACHINE, DIALECT, JOB).text


def simulated(text, lump, scene):
    return simulate_removal(
        text,
        MACHINE,
        DIALECT,
        ConvexStock(convex_hull(lump.vertices), proven=True),
        scene.post,
        cutters_of(JOB, MACHINE),
        clamping=scene.clamping,
        limits={PARTING: 0.6},
        accuracy=Accuracy(0.1),
    )


@pytest.fixture(scope="module")
def removal(text, lump, scene):
    return simulated(text, lump, scene)


def test_the_groove_goes_all_round_in_steps_of_its_own(paths, lump):
    assert [path.title for path in paths] == [f"parting {k}" for k in range(1, len(paths) + 1)]
    assert not any(len(path.uncut) for path in paths)
    groove = cut_groove(paths)
    assert groove.bridge == pytest.approx(1.0)
    assert groove.middle + groove.radius == pytest.approx(lump.bounds[0, 2] - 1.0)
    last = paths[-1].contacts[np.isfinite(paths[-1].contacts[:, 0])]
    around = np.unwrap(np.arctan2(last[:, 1], last[:, 0]))
    at_bridge = np.hypot(last[:, 0], last[:, 1]) < groove.bridge + 1e-9
    assert np.ptp(around[at_bridge]) == pytest.approx(2 * np.pi)


def test_the_text_is_read_back_and_leaves_the_part_alone(text, paths, lump):
    proof = verify(text, paths, MACHINE, DIALECT, MeshDistance(lump))
    assert proof.gouge.depth < 0
    groove = cut_groove(paths)
    assert f"PARTING {len(paths)}" in text
    assert f"GROOVE OF {2 * groove.radius:.2f} MM ROUND THE POST AT Z {groove.middle:.2f}" in text.upper()
    assert "BRIDGE OF DIAMETER 2.00 MM" in text.upper()


def test_the_simulation_finds_the_groove_within_the_depth_of_a_roughing_cut(removal, paths):
    check_removal(removal)
    steps = removal.levels
    assert [(step.index, step.rest) for step in steps] == [(PARTING, k) for k in range(1, len(paths) + 1)]
    assert max(step.deepest.value for step in steps if step.deepest) < 0.6 + 0.02
    assert all(step.over_limit < 0.02 for step in steps)


def test_the_simulation_measures_the_bridge_and_refuses_one_that_is_too_thin(removal):
    assert removal.bridge == pytest.approx(2.0, abs=0.05)
    assert removal.report["bridge_diameter_mm"] == pytest.approx(removal.bridge, abs=1e-4)
    check_removal(removal, bridge=2.0)
    with pytest.raises(VerifyError, match=r"parting: 1\.99 mm of the post hold the part, 2\.5 mm are wanted"):
        check_removal_of_job(removal, JOB.with_values(holding={"parting_core": 2.5}))
    with pytest.raises(VerifyError, match=r"parting: 0\.00 mm of the post hold the part"):
        check_removal(replace(removal, bridge=0.0), bridge=0.2)
    with pytest.raises(VerifyError, match="parting = true: no section of the program parts the post"):
        check_removal_of_job(replace(removal, bridge=None), JOB)


def test_the_bridge_is_measured_where_it_is_thinnest(paths, lump, scene):
    tips = paths[-1].tips.copy()
    around = np.hypot(tips[:, 0], tips[:, 1])
    tips[:, :2] *= ((around - 0.3) / around)[:, None]
    tips[:, 2] -= 1.5
    deeper = write_program([*paths, replace(paths[-1], tips=tips)], MACHINE, DIALECT, JOB).text
    assert simulated(deeper, lump, scene).bridge == pytest.approx(1.4, abs=0.06)


def test_a_level_that_is_cut_after_the_parting_is_refused(removal):
    level = replace(removal.levels[0], index=0)
    check_removal(replace(removal, levels=(level, *removal.levels)), bridge=2.0)
    with pytest.raises(VerifyError, match=r"line \d+: a cut follows the parting, .*: part at the end"):
        check_removal(replace(removal, levels=(*removal.levels, level)), bridge=2.0)


def test_what_goes_is_the_groove_and_nothing_else(removal, paths):
    radii, heights = cut_groove(paths).outline(2.0, 2001).T
    squares = 2.0**2 - radii**2
    wanted = np.pi * ((squares[1:] + squares[:-1]) / 2 * np.diff(heights)).sum()
    assert sum(step.removed for step in removal.levels) == pytest.approx(wanted, rel=0.03)


def test_cutter_location_data_keep_the_parting(paths):
    assert {path.level for path in read_apt(apt_text(paths)).paths} == {PARTING}


def test_a_surface_finished_alone_is_not_parted():
    with pytest.raises(JobError, match=r"\[holding\] parting = .*: a surface that is finished alone"):
        finish(pebble(), job=Job().with_values(holding={"parting": True}))


def test_without_parting_there_is_no_path(scene):
    plain = JOB.with_values(holding={"parting": False})
    assert parting_paths(scene, plain, LIMITS) == []


def test_a_bridge_is_thinner_than_the_post():
    with pytest.raises(JobError, match=r"parting_core = 4: give less than the post's diameter \(4 mm\)"):
        HoldingJob(diameter=4.0, parting_core=4.0)


def test_a_bridge_is_thick_enough_to_be_measured():
    with pytest.raises(JobError, match=r"parting_core = 1e-09: give 0\.2 mm or more, or 0 for half"):
        HoldingJob(parting_core=1e-9)


@pytest.fixture(scope="module")
def setup(lump, scene):
    stock = ConvexStock(convex_hull(lump.vertices), proven=True)
    part = Part(lump, "", len(lump.faces), "mm", (), np.eye(4), lump)
    return Setup(part, stock, scene.post, schedule_of(JOB.levels))


def test_a_groove_beside_the_chuck_is_refused(setup):
    held = {"chuck_diameter": 20.0, "chuck_height": 25.0}
    check_parting(setup, JOB, LIMITS)
    with pytest.raises(JobError, match=r"z 28\.00, .*z 30\.00: give holding\.length = 0, .*a neck of 9 mm") as refused:
        check_parting(setup, JOB.with_values(holding=held), LIMITS)
    assert refused.value.evidence["field"] == "parting"

    # the remedy that is named does
    lifted, found = stand_on_post(setup, JOB.with_values(holding=held | {"length": 0.0}), LIMITS)
    assert found.holding.length == 25.0 + 9.0
    check_parting(lifted, found, LIMITS)


def test_a_groove_that_no_cutter_reaches_is_refused(setup):
    upright = MachineLimits(largest=np.radians(5.0), bodies=MACHINE.bodies)
    with pytest.raises(JobError, match=r"no cutter gets all round .*: neither with .*: leave out holding\.parting"):
        check_parting(setup, JOB, upright)


def test_the_stand_off_is_the_least_with_which_a_cutter_gets_all_round(setup):
    """A table that tilts by 30 degrees only: over a stump of 1 mm the tool meets the part."""
    flat = MachineLimits(largest=np.radians(30.0), bodies=MACHINE.bodies)
    assert with_stand_off(setup, JOB, LIMITS)[0].holding.parting_stand_off == 1.0
    job, lift = with_stand_off(setup, JOB, flat)
    assert job.holding.parting_stand_off == 1.5
    assert lift <= 0
    check_parting(setup, job, flat)
    stated = JOB.with_values(holding={"parting_stand_off": 1.0})
    assert with_stand_off(setup, stated, flat)[0].holding.parting_stand_off == 1.0, "what a job states is kept"
    with pytest.raises(
        JobError, match=r"parting_stand_off = 1: no .*: give holding\.parting_stand_off = 0, with which"
    ):
        check_parting(setup, stated, flat)


def test_links_keep_out_of_a_stub_wider_than_the_stock_beside_the_groove(setup):
    """A neck of 3 mm on a bar: the ball leaves the groove within the clearance of the stub's edge."""
    bar = {"chuck_diameter": 30.0, "chuck_height": 10.0, "stub_diameter": 14.0, "stub_length": 17.0, "length": 31.0}
    job = JOB.with_values(holding=bar)
    check_parting(setup, job, LIMITS)
    scene = foretold_scene(setup, job, LIMITS)
    paths = parting_paths(scene, job, LIMITS)
    keeps = scene.clamping.stub
    for path in paths:
        rapid = path.kinds == MoveKind.RAPID
        assert keeps.distance(path.balls[rapid]).min() >= path.cutter.radius + job.path.clearance - 0.01


def test_no_fillet_stands_round_the_post_beside_the_groove(setup):
    """A cutter that is relieved a ball's radius off the post reaches a groove half of the post deep."""
    relieved = {"radius": 1.5, "flute_length": 4.5, "neck_length": 8.0, "neck_diameter": 2.9, "shank_diameter": 6.0}
    job = JOB.with_values(holding={"diameter": 6.0}, roughing=relieved, finishing=relieved)
    assert parting_lift(replace(setup, post=Post(3.0, 31.8)), job, LIMITS) <= 0


def test_the_lower_the_part_stands_the_more_it_has_to_be_lifted_for_the_groove(setup):
    lifts = [parting_lift(setup.lift(by), JOB.with_values(holding={"length": 0.0}), LIMITS) for by in (0.0, -25.0)]
    assert lifts[0] <= 0 < lifts[1]
    assert lifts[1] == pytest.approx(lifts[0] + 25.0)
    assert parting_lift(setup, JOB.with_values(holding={"parting": False}), LIMITS) == -np.inf


def test_a_part_stands_so_high_that_the_groove_is_over_what_the_cutter_is_kept_off(setup):
    """On a stub up to just under the groove the part is lifted by what is missing, and then no more."""
    lowest = float(setup.part.mesh.bounds[0, 2])
    cutters = parting_cutters(JOB, MACHINE.bodies)
    groove = max(groove_below(lowest, setup.post, JOB.holding, cutter).bottom for cutter in cutters)
    bar = {"chuck_diameter": 30.0, "chuck_height": 10.0, "stub_diameter": 6.0, "stub_length": groove - 10.2}
    job = JOB.with_values(holding={**bar, "length": 0.0})
    kept = least_groove(clamping_of(job.holding, MACHINE.table))
    lift = parting_lift(setup, job, LIMITS)
    assert kept > groove
    assert lift >= kept - groove - 1e-9
    assert parting_lift(setup.lift(lift), job, LIMITS) <= 1e-9


UP = np.array([0.0, 0.0, 1.0])
LENGTH, WIDTH, DEEP = 3.0, 6.0, 2.0
STUMP_JOB = Job().with_values(roughing={"radius": 2.0}, finishing={"radius": 0.75, "scallop": 0.02})


def groove() -> TriangleMesh:
    """A block along X with its top at Z 10 and a groove of 90 degrees, DEEP, along its middle."""
    outline = np.array([[-WIDTH, 0], [WIDTH, 0], [WIDTH, 10], [DEEP, 10], [0, 10 - DEEP], [-DEEP, 10], [-WIDTH, 10]])
    n = len(outline)
    ends = [np.column_stack([np.full(n, x), outline]) for x in (-LENGTH, LENGTH)]
    ring = np.arange(n)
    following = np.roll(ring, -1)
    fan = np.array([[4, 5, 6], [4, 6, 0], [4, 0, 1], [4, 1, 2], [4, 2, 3]])
    sides = [np.column_stack([ring, following, following + n]), np.column_stack([ring, following + n, ring + n])]
    faces = np.vstack([*sides, fan[:, ::-1], fan + n]).astype(np.int32)
    mesh = TriangleMesh(np.vstack(ends), faces)
    return mesh if mesh.volume > 0 else TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


@pytest.mark.whole
def test_finishing_layers_in_a_groove_cut_no_deeper_than_their_depth():
    around = MeshDistance(groove())
    x, y = (side.ravel() for side in np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1.5, 1.5, 13)))
    places = np.column_stack([x, y, 10 - DEEP + np.abs(y)])
    chart = stump_chart(UP, places, STUMP_JOB.roughing.radius)
    a, b = np.meshgrid(chart.a, chart.b, indexing="ij")
    base = chart.bases(a.ravel(), b.ravel()).reshape(*a.shape, 3)
    stump = np.hypot(base[..., 0], base[..., 1]) < 1.8
    material = off_part(
        HeightField(chart, np.where(stump, 10.5, 0.0), np.zeros(a.shape)), around, STUMP_JOB.levels.finishing_depth
    )
    cutters = tuple(
        Cutter.from_job(number, name, STUMP_JOB.tool(name)) for number, name in ((1, "roughing"), (2, "finishing"))
    )
    layers = stump_layers(material, around, Post(1.8, 0.0), places, cutters, STUMP_JOB)
    depth = STUMP_JOB.levels.finishing_depth
    sunk = [
        depths_in(layer.material, layer.path.centres, layer.path.cutter.radius).max()
        for layer in layers
        if layer.path.cutter.number == 2
    ]
    assert len(sunk) > 4, "a ball of 2 leaves 0.8 mm in the groove"
    assert max(sunk) < depth * (1 + 1 / STEPS) + 0.003, "the first too, on the cusps of roughing"
    assert np.median(sunk[:-1]) > 0.8 * depth
