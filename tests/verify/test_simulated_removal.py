"""Programs whose removal is known, and programs with one fault each, which is found with its block.

A bull nose or flat end whose heel digs into the part is refused by the simulation, as deep as its profile tells.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from small_parts import FINISHING_CUTTER, PATH_CAPSULE, ROUGHING_CUTTER, UPRIGHT_CAPSULE, capsule_path, path_of, pebble

from bonecam.errors import JobError, ProgramError, VerifyError
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.machine.bodies import Frustum
from bonecam.nc import read_dialect, read_program, write_program
from bonecam.setup import Capsule
from bonecam.tool import MoveKind
from bonecam.verify import Accuracy, check_removal, simulate_removal
from bonecam.verify.findings import measure_left
from bonecam.verify.sweeping import NormalProbes
from bonecam.workholding import Clamping, Post
from bonecam.workholding.post import Column

pytestmark = pytest.mark.whole


PAIR = read_machine("mikron-ucp600"), read_dialect("heidenhain")
OTHER = read_machine("linuxcnc-xyzbc"), read_dialect("linuxcnc")
POST = Post(1.0, 32.0)
COARSE = Accuracy(0.1)
LEAN = np.radians(30.0)
CHORDS = 0.008
"""mm: straight moves between 90 centres round an oval of up to 6.5 mm radius, flatter on its sides, bow by up
to this."""


FINE_CUTTER = replace(FINISHING_CUTTER, flute_length=8.0)
"""A ball of 1 mm whose flutes are longer than the cuts here are deep."""


PART = pebble()


def ring_path(surface, level=0, tool=FINE_CUTTER, rings=24, around=90):
    """Makes rings of contacts on a surface, the axis leant up from the normal, between approaches of 12
    mm."""
    rows = []
    for t in np.linspace(0.9, 0.35, rings):
        s = np.linspace(0, 1, around, endpoint=False)
        points = surface.positions(s, np.full(around, t))
        normals = surface.normals(s, np.full(around, t))
        up = np.array([0.0, 0.0, 1.0]) - normals[:, 2:] * normals
        axes = np.cos(LEAN) * normals + np.sin(LEAN) * up / np.linalg.norm(up, axis=1, keepdims=True)
        tips = points + tool.radius * (normals - axes)
        rows += list(zip(tips, axes, [MoveKind.CUT] * around))
    first, last = rows[0], rows[-1]
    rows.insert(0, (first[0] + 12 * first[1], first[1], MoveKind.RAPID))
    rows.append((last[0] + 12 * last[1], last[1], MoveKind.LINK))
    tips, axes, kinds = (np.array(column) for column in zip(*rows))
    return path_of(tips, axes, kinds=kinds.astype(np.int64), tool=tool, level=level)


@pytest.fixture(scope="module")
def text():
    return write_program([ring_path(PART)], *PAIR, Job()).text


def simulate(text, pair=PAIR, finishing=FINE_CUTTER, roughing=ROUGHING_CUTTER, accuracy=COARSE, post=POST, **given):
    cutters = [roughing, finishing]
    return simulate_removal(text, *pair, UPRIGHT_CAPSULE, post, cutters, accuracy=accuracy, **{"part": PART, **given})


@pytest.fixture(scope="module")
def sound(text):
    return simulate(text, limits={0: 3.0})


def words_of(text, line):
    return text.split("\n")[line - 1]


def changed(text, letter, by, share=0.5):
    """The text with one word of one cutting block changed, and the line of that block."""
    lines = text.split("\n")
    cuts = [k for k, line in enumerate(lines) if f" {letter}" in line and re.search(r" L X.* C\S+( F\d+)?$", line)]
    at = cuts[int(share * len(cuts))]
    lines[at] = re.sub(rf" {letter}([+-]\d+\.\d+)", lambda found: f" {letter}{float(found[1]) + by:+.3f}", lines[at])
    return "\n".join(lines), at + 1


def test_a_sound_program_is_accepted(sound):
    check_removal(sound)
    assert sound.rapid_volume == 0
    assert sound.left.deepest_gouge.value < CHORDS
    assert sound.volume_error < 0.2


def test_what_is_removed_and_what_stands_is_the_stock(sound):
    capsule = UPRIGHT_CAPSULE.volume
    # the post's top lies inside the stock: what of it is below
    below = UPRIGHT_CAPSULE.bounds[0, 2]
    assert sound.volume + sound.move_volumes.sum() == pytest.approx(capsule + np.pi * below, rel=2e-3)
    assert sound.levels[0].removed == pytest.approx(sound.move_volumes.sum())


def test_both_dialects_remove_the_same(sound):
    other = simulate(write_program([ring_path(PART)], *OTHER, Job()).text, OTHER)
    assert other.volume == pytest.approx(sound.volume, abs=0.05)
    assert other.levels[0].air_time_share == pytest.approx(sound.levels[0].air_time_share, abs=0.05)


def test_a_turned_cylinder_is_what_stands():
    bottom, top, radius = PATH_CAPSULE
    path = capsule_path(turns=40.0, count=3000)
    blank = Capsule(np.array([0, 0, bottom]), np.array([0, 0, top]), radius + 0.4)
    text = write_program([path], *PAIR, Job()).text
    made = simulate_removal(text, *PAIR, blank, Post(0.5, bottom), [path.cutter], accuracy=COARSE)
    turned = Capsule(blank.start, blank.end, radius)
    # the spiral begins a little below the lower cap's edge: the rest of that cap keeps its 0.4 mm
    lower_cap = 2 / 3 * np.pi * ((radius + 0.4) ** 3 - radius**3)
    post = np.pi * 0.25 * (bottom - radius - 0.4)
    assert made.volume == pytest.approx(turned.volume + lower_cap + post, rel=0.02)
    assert made.levels[0].deepest.value == pytest.approx(0.4, abs=0.04)


def test_what_takes_hundredths_of_a_mm_rubs():
    bottom, top, radius = PATH_CAPSULE
    path = capsule_path(turns=40.0, count=3000)
    text = write_program([path], *PAIR, Job()).text
    shares = []
    for allowance in (0.4, 0.01):
        blank = Capsule(np.array([0, 0, bottom]), np.array([0, 0, top]), radius + allowance)
        made = simulate_removal(text, *PAIR, blank, Post(0.5, bottom), [path.cutter], accuracy=COARSE)
        shares.append(made.levels[0].rubbing_time_share)
    assert shares[0] < 0.1
    assert shares[1] > 0.95


def test_the_report_has_its_keys(sound):
    names = {
        "cell_mm",
        "levels",
        "rapid_contact_mm3",
        "links",
        "clearance_mm",
        "clearance_near",
        "left",
        "given",
        "bridge_diameter_mm",
    }
    assert set(sound.report) == names
    assert set(sound.report["clearance_mm"]) == {"shank", "holder", "spindle", "table"}
    assert set(sound.report["left"]) >= {"area_over_0_02_mm2", "max_mm", "place", "by_reason"}
    level = sound.report["levels"][0]
    assert level["index"] == 0
    depths = {"depth_max_mm", "depth_p99_mm", "over_limit_mm"}
    assert set(level) >= {"removed_mm3", "air_time_share", *depths}
    assert level["over_limit_mm"] == pytest.approx(max(level["depth_max_mm"] - 3.0, 0.0), abs=1e-4)


def test_what_is_left_is_told_by_reason(sound):
    reasons = sound.left.by_reason
    # what the rings leave over the lower end can be reached, a pebble has no hollows
    assert reasons["reachable"] > 1
    assert reasons["gouge"] == 0
    assert sound.report["left"]["area_over_0_02_mm2"] == pytest.approx(reasons["reachable"], abs=1e-3)


@pytest.mark.parametrize(("bowl", "reason"), [(0.9, "gouge"), (1.2, "reachable")])
def test_hollows_narrower_than_the_ball_are_a_reason(text, bowl, reason):
    mesh = Capsule(np.array([0.0, 0.0, 50.0]), np.array([0.0, 0.0, 50.0]), bowl).mesh(0.002)
    inward = (np.array([0.0, 0.0, 50.0]) - mesh.vertices) / bowl
    normal_probes = NormalProbes(mesh, mesh.vertices, inward, np.full(len(inward), 0.1))
    normal_probes.heights[:] = 0.05
    left = measure_left(normal_probes, POST, 1.0, read_program(text, *PAIR))
    assert left.by_reason[reason] == pytest.approx(0.1 * len(inward))


def test_a_rapid_through_stock_is_found():
    tips = np.array([[0, 0, 70.0], [15, 0, 50.0], [15, 0, 41.0], [-15, 0, 41.0], [-15, 0, 60.0]])
    kinds = np.array([MoveKind.RAPID] * 5, dtype=np.int64)
    path = path_of(tips, np.tile([0, 0, 1.0], (5, 1)), kinds=kinds, tool=FINE_CUTTER)
    text = write_program([path], *PAIR, Job()).text
    found = simulate(text, part=None)
    assert "X-15.000" in words_of(text, found.rapid_contact.line)
    with pytest.raises(VerifyError, match=r"a rapid removes .*path\.clearance"):
        check_removal(found)


def test_a_shank_of_9_mm_over_a_ball_of_1_is_found(text):
    found = simulate(text, finishing=replace(FINE_CUTTER, flute_length=2.0, shank_diameter=9.0))
    assert found.shank.touched > 0
    with pytest.raises(VerifyError, match="the shank enters material"):
        check_removal(found)


def test_a_shank_that_begins_at_the_middle_of_the_ball_is_simulated(text):
    """Such flutes have no length above the ball's middle: their steps were divided by zero."""
    radius = FINE_CUTTER.radius
    slim = replace(FINE_CUTTER, flute_length=radius, shank_diameter=1.8 * radius)
    assert np.isfinite(simulate(text, finishing=slim).shank.least.value)


def test_a_lowered_holder_is_found(text):
    short = replace(FINE_CUTTER, flute_length=1.2, shank_diameter=0.6)
    assert simulate(text, finishing=replace(short, overhang=11.5)).holder.touched == 0
    found = simulate(text, finishing=replace(short, overhang=1.5))
    assert found.holder.touched > 0
    with pytest.raises(VerifyError, match="the holder enters material"):
        check_removal(found)


def test_a_lowered_spindle_is_found():
    text = write_program([ring_path(PART, rings=4)], *PAIR, Job()).text
    nose = (Frustum(10.0, 12.0, 12.0),)
    slim = replace(FINE_CUTTER, flute_length=1.2, shank_diameter=0.6, overhang=1.5, nose=nose)
    far = simulate(text, finishing=replace(slim, holder=(Frustum(11.0, 0.6, 0.6),)))
    assert far.spindle.touched == far.shank.touched == 0
    # lowered by 10 mm
    found = simulate(text, finishing=replace(slim, holder=(Frustum(1.0, 0.6, 0.6),)))
    assert found.spindle.touched > 0
    # its short holder stands in material too, and is told first
    alone = replace(found, shank=far.shank, holder=replace(far.holder, touched=0))
    with pytest.raises(VerifyError, match=rf"line {found.spindle.touched}: the spindle enters material"):
        check_removal(alone)


def test_a_chuck_that_reaches_too_high_is_found(text, sound):
    low = simulate(text, clamping=Clamping((Column(6.0, 20.0),)))
    assert low.table.touched == 0
    assert low.table.least.value <= sound.table.least.value
    found = simulate(text, clamping=Clamping((Column(20.0, 40.0),)))
    with pytest.raises(VerifyError, match=rf"line {found.table.touched}: the \w+ meets table or chuck"):
        check_removal(found)


def test_a_stub_is_material_that_a_tool_must_not_cut(text, sound):
    """The stub stands in the rays, and where it reaches up to the part the cutter meets it."""
    low = simulate(text, clamping=Clamping(stub=Column(6.0, 12.0, 8.0)))
    assert low.table.touched == 0
    assert low.volume - sound.volume == pytest.approx(np.pi * 36 * 4 - np.pi * 8, rel=0.1)
    found = simulate(text, clamping=Clamping(stub=Column(12.0, 36.0, 8.0)))
    with pytest.raises(VerifyError, match="meets table or chuck"):
        check_removal(found)


def test_a_tool_that_touches_what_holds_the_free_end_or_its_bracket_is_found(text, sound):
    """A pin beside the part, and the column of a bracket where the tool comes past; farther off neither is met."""
    far, near = (Clamping(beside=(Column(4.0, 60.0, 0.0, 0.0, y),)) for y in (90.0, 14.0))
    assert simulate(text, clamping=far).tailstock.touched == 0
    found = simulate(text, clamping=near)
    with pytest.raises(VerifyError, match="meets the tailstock"):
        check_removal(found)


def test_what_holds_the_free_end_stands_in_the_rays_and_is_never_cut(text, sound):
    """The rings of this program end 2.9 mm from the axis: a pin of 3 mm they go round, one of 6 mm they cut."""
    top = float(UPRIGHT_CAPSULE.bounds[1, 2])
    slim, thick = (replace(POST, pin=Column(radius, top + 8.0, top - 1.0)) for radius in (1.5, 3.0))
    found = simulate(text, post=slim)
    assert found.volume - sound.volume == pytest.approx(np.pi * 1.5**2 * 8, rel=0.15)
    assert found.tailstock.touched == 0
    with pytest.raises(VerifyError, match="meets the tailstock"):
        check_removal(simulate(text, post=thick))


def test_a_tool_below_the_table_is_found():
    text = write_program([ring_path(pebble())], *PAIR, Job()).text
    low = re.sub(r" Z([+-]\d+\.\d+)", lambda found: f" Z{float(found[1]) - 45:+.3f}", text)
    found = simulate(low, part=None)
    assert found.table.least.value < 0
    with pytest.raises(VerifyError, match="meets table or chuck"):
        check_removal(found)


@pytest.mark.parametrize("kind", [MoveKind.LINK, MoveKind.CUT])
def test_a_link_through_standing_material_is_found(kind):
    # 0.3 mm deep along the side of the stock
    x = np.linspace(-1.0, 1.0, 9)
    away = UPRIGHT_CAPSULE.radius + FINE_CUTTER.radius - 0.3
    tips = np.column_stack([x, np.full(len(x), -away), np.full(len(x), 37.0 - FINE_CUTTER.radius)])
    tips = np.vstack([tips[0] + [0, -15, 20], tips[0] + [0, -15, 0], tips, tips[-1] + [0, -15, 0]])
    kinds = np.array([MoveKind.RAPID] * 2 + [kind] * len(x) + [MoveKind.RAPID], dtype=np.int64)
    path = path_of(tips, np.tile([0, 0, 1.0], (len(tips), 1)), kinds=kinds, tool=FINE_CUTTER)
    text = write_program([path], *PAIR, Job()).text
    found = simulate(text, part=None)
    if kind == MoveKind.CUT:
        assert found.link_contact is None
        assert found.levels[0].link_depth is None
        return
    assert found.levels[0].links == pytest.approx(found.levels[0].removed)
    assert found.link_contact.value == pytest.approx(found.levels[0].removed)
    assert found.levels[0].link_depth.value == pytest.approx(0.3, abs=0.08)
    assert "Y-" in words_of(text, found.link_contact.line)
    assert "F900" in words_of(text, found.levels[0].link_depth.line)
    with pytest.raises(VerifyError, match=rf"line {found.link_contact.line}: the moves from one pass to the next"):
        check_removal(found)


def test_a_word_changed_by_1_mm_is_found(text):
    wrong, line = changed(text, "X", -1.0)
    found = simulate(wrong)
    assert found.left.deepest_gouge.value > 0.5
    assert abs(found.left.deepest_gouge.line - line) <= 1
    with pytest.raises(VerifyError, match="mm into the part"):
        check_removal(found)


def test_an_angle_changed_by_5_degrees_is_found(text):
    found = [(simulate(wrong), line) for wrong, line in (changed(text, "B", by) for by in (5.0, -5.0))]
    deepest, line = max(found, key=lambda made: made[0].left.deepest_gouge.value)
    assert deepest.left.deepest_gouge.value > 0.02
    assert abs(deepest.left.deepest_gouge.line - line) <= 1


def test_two_levels_swapped_are_found():
    outer, inner = ring_path(pebble(1.2), 1), ring_path(PART)
    limits = {0: 1.6, 1: 2.5}
    right = simulate(write_program([outer, inner], *PAIR, Job()).text, limits=limits)
    wrong = simulate(write_program([inner, outer], *PAIR, Job()).text, limits=limits)
    over = {level.index: level.over_limit for level in wrong.levels}
    assert over[0] > {level.index: level.over_limit for level in right.levels}[0] + 0.3
    assert wrong.levels[1].removed < 0.05 * right.levels[0].removed
    check_removal(right)
    deepest = wrong.levels[0].deepest
    with pytest.raises(VerifyError, match=rf"line {deepest.line}: a cut of level 0 is .* over its limit") as caught:
        check_removal(wrong)
    assert caught.value.evidence["place"] == deepest.place
    check_removal(wrong, limited=False)


def test_a_cut_may_be_deeper_by_the_scallop_of_the_level_before():
    outer = ring_path(pebble(1.2), 1)
    text = write_program([outer, ring_path(PART)], *PAIR, Job()).text
    stated = simulate(text, limits={0: 1.2, 1: 2.5}, scallops={1: 0.02}).levels
    by_tool = simulate(text, limits={0: 1.2, 1: 2.5}).levels
    assert [level.over_limit for level in stated] == [level.over_limit for level in by_tool]
    assert stated[1].over_allowed - by_tool[1].over_allowed == pytest.approx(0.02 - outer.cutter.scallop)
    assert stated[0].over_allowed == by_tool[0].over_allowed


def test_a_rest_path_is_told_apart_and_the_depth_after_it_counts_from_what_it_left():
    rest = replace(ring_path(pebble(0.3)), rest=1)
    both = simulate(write_program([rest, ring_path(PART)], *PAIR, Job()).text, limits={0: 0.5}).levels
    alone = simulate(write_program([ring_path(PART)], *PAIR, Job()).text, limits={0: 0.5}).levels
    assert [(level.index, level.rest) for level in both] == [(0, 1), (0, 0)]
    assert both[1].deepest.value < 0.5 < 1.5 < alone[0].deepest.value


def test_a_tool_call_exchanged_is_found():
    paths = [ring_path(PART, 1, ROUGHING_CUTTER), ring_path(PART, 0, FINE_CUTTER)]
    text = write_program(paths, *PAIR, Job()).text
    wrong = text.replace("TOOL CALL 1", "TOOL CALL 9").replace("TOOL CALL 2", "TOOL CALL 1")
    wrong = wrong.replace("TOOL CALL 9", "TOOL CALL 2")
    assert simulate(text).left.deepest_gouge.value < CHORDS
    found = simulate(wrong)
    assert found.left.deepest_gouge.value > 0.1
    assert found.left.deepest_gouge.line > text[: text.index("TOOL CALL 2")].count("\n")


def test_a_cutter_of_another_job_is_refused(text):
    with pytest.raises(ProgramError, match="give the job"):
        simulate(text, finishing=replace(FINE_CUTTER, radius=1.1))


def test_too_small_a_cell_is_refused(text):
    with pytest.raises(JobError, match="give a cell of at least"):
        simulate(text, accuracy=Accuracy(0.004))
