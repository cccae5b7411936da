"""Stock and neck milled from the bar: posted, read back and simulated on a small capsule; and jobs that cannot."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from small_parts import mesh_of, pebble

import bonecam
from bonecam.errors import JobError, OrientationError
from bonecam.job import Job
from bonecam.kernels.removal import Pieces
from bonecam.machine import read_machine
from bonecam.mesh import Part
from bonecam.nc import machine_limits, read_dialect, write_program
from bonecam.planning.blank import bar_of, blank_depth, blank_paths, check_blank
from bonecam.planning.links import goes_on
from bonecam.planning.post_length import least_neck, shortest_post
from bonecam.report import read_apt
from bonecam.report.tables import apt_text
from bonecam.setup import Capsule, Setup, schedule_of
from bonecam.setup.placement import place
from bonecam.setup.stocks.box import Box
from bonecam.simulation import simulate
from bonecam.tool.path import BLANK, MoveKind
from bonecam.verify import Accuracy, simulate_removal
from bonecam.verify.clearances import nearest_body
from bonecam.verify.removal import cutters_of
from bonecam.workholding import Post, clamping_of
from bonecam.workholding.post import in_collet

MACHINE, DIALECT = read_machine("mikron-ucp600"), read_dialect("heidenhain")
LIMITS = machine_limits(MACHINE)
BAR = {"neck": "milled", "diameter": 4.0, "length": 119.0, "stub_diameter": 13.0, "stub_length": 15.0}
JOB = Job().with_values(holding=BAR)
JOB = replace(JOB, holding=in_collet(JOB.holding, 13.0))
STOCK = Capsule(np.array([0.0, 0.0, 124.5]), np.array([0.0, 0.0, 136.0]), 5.5)
POST = Post(2.0, 121.0)
CLAMPING = clamping_of(JOB.holding, MACHINE.table)


def lump():
    mesh = mesh_of(pebble(), around=40, along=50)
    return Part(mesh, "", len(mesh.faces), "mm", (), np.eye(4), mesh)


@pytest.fixture(scope="module")
def paths():
    return blank_paths(STOCK, POST, CLAMPING, JOB, LIMITS)


@pytest.fixture(scope="module")
def removal(paths):
    text = write_program(paths, MACHINE, DIALECT, JOB).text
    assert "; BLANK 1\n" in text
    cutters = cutters_of(JOB, MACHINE)
    bar = bar_of(STOCK, JOB.holding)
    assert bar is not None
    cut = text, MACHINE, DIALECT, STOCK, POST, cutters
    return simulate_removal(*cut, clamping=CLAMPING, bar=bar, accuracy=Accuracy(cell=0.15))


def test_no_ball_enters_stock_or_neck(paths):
    for path in paths:
        cuts = path.kinds == MoveKind.CUT
        balls = path.balls[cuts]
        # between two points the chord comes nearer by no more than the chord tolerance
        middles = (balls[1:] + balls[:-1])[np.diff(path.pass_index[cuts]) == 0] / 2
        for centres, spare in ((balls, 1e-6), (middles, JOB.path.chord_tolerance)):
            assert STOCK.signed_distance(centres).min() >= path.cutter.radius - spare
            assert POST.distance(centres).min() >= path.cutter.radius - spare
            assert centres[:, 2].min() >= CLAMPING.stub.top + path.cutter.radius - 1e-6
        assert not len(path.uncut)


def test_the_stiffer_cutter_goes_first_and_the_other_into_the_groove(paths):
    radii = [path.cutter.radius for path in paths]
    assert radii == sorted(radii, reverse=True)
    assert len(set(radii)) == 2
    assert [(path.level, path.rest) for path in paths] == [(BLANK, k) for k in range(1, len(paths) + 1)]


def test_the_simulation_finds_all_round_the_stock_gone_within_the_depth(removal, paths):
    bar = np.pi * 6.5**2 * (STOCK.bounds[1, 2] + JOB.holding.bar_end - CLAMPING.stub.top)
    neck = np.pi * POST.radius**2 * (STOCK.bounds[0, 2] - CLAMPING.stub.top)
    gone = sum(level.removed for level in removal.levels)
    # fillets at the foot of the neck and under the caps, and cusps of 0.1 mm, stay
    assert 0.93 * (bar - neck - STOCK.volume) < gone < bar - neck - STOCK.volume
    for level, path in zip(removal.levels, paths, strict=True):
        assert level.deepest.value <= blank_depth(path.cutter) + 0.15 / 2
        assert level.links <= 0.02
    assert removal.table.least.value > 5.0
    assert removal.rapid_contact is None
    assert not any(part.touched for part in (removal.shank, removal.holder, removal.spindle, removal.table))


def test_it_is_told_what_comes_nearest_to_what(removal):
    near = removal.table
    assert near.part in ("ball", "cutter", "neck", "shank", "holder", "spindle")
    assert removal.report["clearance_near"]["table"] == f"{near.part} to {near.other}, line {near.least.line}"
    assert set(removal.report["clearance_near"]) <= set(removal.report["clearance_mm"])
    # a ball above the stub, and one beside the chuck
    for spot, name in (((0.0, 0.0, 117.0), "stub"), ((20.0, 0.0, 101.0), "chuck"), ((100.0, 0.0, 10.0), "table")):
        at, up = np.array([spot]), np.array([[0.0, 0.0, 1.0]])
        still = np.zeros(1, dtype=np.int64), np.zeros(1), np.zeros(1, dtype=bool)
        pieces = Pieces(at, at + 0.01, up, up, *still, np.zeros((1, 1)), np.zeros((1, 1, 2)))
        cutter = cutters_of(JOB, MACHINE)[0]
        assert nearest_body(pieces, cutter, replace(CLAMPING, closed=True)) == name


def test_the_tool_stays_at_the_part_from_layer_to_layer(paths):
    def counts(**nc):
        text = write_program(paths, MACHINE, DIALECT, JOB.with_values(nc=nc)).text
        return re.findall(r"; BLANK (\d+)", text), text.count("A RESTART MAY BEGIN HERE")

    layers = [str(path.rest) for path in paths]
    assert counts() == (layers, 1)
    assert counts(optional_stop="level") == (layers, len(paths) - 1)
    assert counts(split="level") == (layers, len(paths))


def test_a_layer_goes_on_from_where_the_one_before_left_the_bar(paths):
    meetings = [(a, b) for a, b in pairwise(paths) if a.cutter.number == b.cutter.number]
    assert all(goes_on(a, b) for a, b in meetings)
    beside = [a.balls[-1] for a, _ in meetings if a.axes[-1, 2] < 0.9]
    assert beside, "with a tool that leans it does not rise over the bar"
    bar = bar_of(STOCK, JOB.holding)
    for ball in beside:
        assert np.hypot(*ball[:2]) > bar.radius + JOB.roughing.radius + JOB.path.clearance


def test_cutter_location_data_keep_the_blank(paths):
    read = read_apt(apt_text(paths))
    assert {path.level for path in read.paths} == {BLANK}
    assert sum(len(path.tips) for path in read.paths) == sum(len(path.tips) for path in paths)


def test_a_turned_stock_has_no_such_paths():
    turned = JOB.with_values(holding={"neck": "turned"})
    assert blank_paths(STOCK, POST, CLAMPING, turned, LIMITS) == []
    check_blank(_setup(Box(np.array([-5.0, -5.0, 119.0]), np.array([5.0, 5.0, 141.5]))), turned)


def test_the_stock_is_as_thick_as_the_bar():
    part = lump()
    natural = place(part, Job())
    milled = place(part, Job().with_values(holding={"neck": "milled"}))
    assert natural.stock.diameter < milled.stock.diameter == np.ceil(natural.stock.diameter)


def test_a_milled_neck_has_room_for_the_ball():
    assert least_neck(JOB.with_values(holding={"neck": "turned"})) == 3.0
    assert least_neck(JOB) == 3.0
    wide = JOB.with_values(roughing={"radius": 3.0}, finishing={"radius": 2.5})
    assert shortest_post(np.zeros(0), 0.0, CLAMPING, least_neck(wide)) == CLAMPING.stub.top + 5.0


def _setup(stock):
    return Setup(lump(), stock, POST, schedule_of(JOB.levels))


@pytest.mark.parametrize(
    ("stock", "values", "why"),
    [
        (Box(np.array([-5.0, -5.0, 119.0]), np.array([5.0, 5.0, 141.5])), {}, "a box cannot be milled .*'capsule'"),
        (STOCK, {"holding": {"stub_length": 0.0, "stub_diameter": 0.0}}, r"no bar to mill it from.*stub_length"),
        pytest.param(
            STOCK,
            {"path": {"strategy": "rotary"}},
            "'rotary' does not mill the blank.*'morph'",
            marks=pytest.mark.plugged,
        ),
        (STOCK, {"holding": {"tailstock": "pin"}}, "bracket of a tailstock"),
        (STOCK, {"finishing": {"radius": 3.0}}, r"holding\.length = 121 or more"),
    ],
)
def test_what_cannot_be_milled_is_refused_before_planning(stock, values, why):
    with pytest.raises(JobError, match=why):
        check_blank(_setup(stock), JOB.with_values(**values))


def test_a_cutter_that_does_not_get_round_is_told_with_the_remedy():
    blunt = JOB.with_values(roughing={"overhang": 7.0, "flute_length": 6.0})
    with pytest.raises(OrientationError, match=r'holding\.neck = "turned"'):
        blank_paths(STOCK, POST, CLAMPING, blunt, LIMITS)


@pytest.mark.whole
def test_a_part_comes_out_of_a_sawn_bar(tmp_path):
    result = bonecam.convert(
        mesh_of(pebble(), around=40, along=50),
        Job().with_values(holding={"neck": "milled"}, nc={"probe": True}),
        program=tmp_path / "p.h",
        keep=tmp_path / "kept",
    )
    text = (tmp_path / "p.h").read_text()
    assert "DATUM: P_PROBE WRITES IT" in text
    probing = (tmp_path / "p_probe.h").read_text()
    assert re.search(r"BAR: DIAMETER 1\d.00 MM, ITS END AT Z 0.00", probing)
    assert result.probing.text == probing
    assert "probe     p_probe.h" in result.summary
    assert "run p_probe.h once" in result.sheet
    assert "MILLED FIRST FROM A PLAIN BAR" in text
    assert "TURNED" not in text
    levels = result.report["removal"]["levels"]
    assert levels[0]["index"] == BLANK
    again = simulate(tmp_path / "p.h", tmp_path / "kept", mechanics=False)
    assert [one.removed for one in again.levels] == pytest.approx([one["removed_mm3"] for one in levels], rel=0.02)
    assert result.report["removal"]["left"]["gouge_max_mm"] <= 0.01
