"""The time of a program: what is told of it, and what takes it."""

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from small_parts import capsule_path, path_of
from tool_paths import TWO_PATHS

from bonecam.job import Job
from bonecam.machine import Machine, read_machine
from bonecam.machine.control import Control
from bonecam.machine.machine_file import SecondsTable
from bonecam.nc import read_dialect, write_program
from bonecam.nc.path_words import POLE_PASS, between, post_path, split_moves
from bonecam.nc.program import ProgramTime
from bonecam.planning.motion_time import motion_minutes
from bonecam.tool import MoveKind, ToolPath

TOLERANCE, HOLD = 0.002, np.radians(0.0005)
CONTROLS = {
    "tool-centre": Control(read_machine("mikron-ucp600"), True, 1.0, 75.0),
    "joints": Control(read_machine("linuxcnc-xyzbc"), False, 1.0, 75.0),
}


@pytest.fixture(params=CONTROLS.values(), ids=CONTROLS)
def control(request):
    return request.param


def rough_path():
    """Big steps in position and axis: every move needs splitting."""
    return capsule_path(turns=4.0, count=60)


def past_the_pole(miss_deg: float) -> ToolPath:
    """Axes that lean from -10 to 10 degrees past the singular axis."""
    angle = np.radians(np.linspace(-10, 10, 12))
    axes = np.column_stack([np.sin(angle), np.full(12, np.radians(miss_deg)), np.cos(angle)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return path_of(np.column_stack([np.linspace(0, 6, 12), np.zeros(12), np.full(12, 60.0)]), axes)


def deviations(control, moves) -> tuple[np.ndarray, np.ndarray]:
    """Distance of tip and ball centre from the way meant, at 31 places of every move."""
    words = control.words(moves.tips, moves.angles)
    move = np.arange(len(words) - 1)
    worst = []
    for fraction in np.linspace(0, 1, 31):
        tip, axis = control.between(words[:-1], words[1:], fraction)
        meant, turned = between(moves.tips, moves.axes, control.radius, move, np.full(len(move), fraction))
        centre = np.linalg.norm(tip + control.radius * axis - meant - control.radius * turned, axis=1)
        worst.append(np.maximum(centre, np.linalg.norm(tip - meant, axis=1)))
    return np.max(worst, axis=0), moves.kinds[1:] == 2


def test_between_any_two_rows_the_control_stays_within_the_tolerance(control):
    moves = split_moves(rough_path(), control, TOLERANCE, HOLD)
    worst, rapid = deviations(control, moves)
    assert worst[~rapid].max() <= 1.1 * TOLERANCE
    assert worst[rapid].max() <= 20 * TOLERANCE
    assert len(moves.tips) > len(rough_path().tips)


def test_without_tool_centre_control_no_feed_move_is_longer_than_a_millimetre():
    moves = split_moves(rough_path(), CONTROLS["joints"], TOLERANCE, HOLD)
    steps = np.linalg.norm(np.diff(moves.tips, axis=0), axis=1)
    assert steps[moves.kinds[1:] != 2].max() <= 1 + 1e-9


@pytest.mark.parametrize("miss_deg", [0.0, 0.001, 0.05, 1.0])
def test_a_cut_past_the_singular_axis_is_split_until_it_holds(control, miss_deg):
    moves = split_moves(past_the_pole(miss_deg), control, TOLERANCE, HOLD)
    worst, rapid = deviations(control, moves)
    assert worst[~rapid].max() <= 1.2 * TOLERANCE
    assert len(moves.tips) < 3000


@pytest.mark.parametrize("miss_deg", [0.0, 0.001, 0.05, 1.0])
def test_no_feed_move_turns_an_axis_by_more_than_ten_degrees_but_at_the_pole(control, miss_deg):
    moves = split_moves(past_the_pole(miss_deg), control, TOLERANCE, HOLD)
    feed = moves.kinds[1:] != 2
    turn = np.degrees(np.abs(np.diff(moves.angles, axis=0)).max(axis=1))
    at_pole = np.linalg.norm(np.diff(moves.axes, axis=0), axis=1) < POLE_PASS
    assert turn[feed & ~at_pole].max() <= 10 + 1e-6
    assert turn[feed].max() <= 90 + 1e-6


UCP, XYZBC = read_machine("mikron-ucp600"), read_machine("linuxcnc-xyzbc")
AT_ONCE = SecondsTable(tool_change=0.0, spindle_start=0.0, retract=0.0)


def time_of(paths, machine: Machine = UCP, controller: str = "heidenhain", **nc: object) -> ProgramTime:
    return write_program(paths, machine, read_dialect(controller), Job().with_values(nc=nc)).time


def test_it_tells_minutes_at_the_feed_as_the_axes_move_and_with_changes():
    program = write_program(TWO_PATHS, UCP, read_dialect("heidenhain"), Job())
    feed, axes, whole = program.time.feed, program.time.axes, program.time.whole
    assert feed < axes < whole
    told = f"ABOUT {feed:.1f} MIN AT THE FEED, {axes:.1f} AS THE AXES MOVE, {whole:.1f} WITH CHANGES"
    head = re.sub(r"\n\d+ ;", "", program.text)
    assert f" TIME {told}" in head
    assert " TIME ASSUMED: SPEEDS OF AXES AND SPINDLE, ACCELERATIONS OF AXES, SECONDS OF CHANGES" in head
    assert sum(program.time.tools) == pytest.approx(axes)
    assert len(program.time.tools) == 2


def test_a_machine_without_accelerations_or_seconds_tells_what_it_knows():
    known = time_of(TWO_PATHS)
    no_seconds = replace(UCP, seconds=None, time_assumed=())
    told = f"about {known.feed:.1f} min at the feed"
    assert time_of(TWO_PATHS, no_seconds).texts == [f"{told}, {known.axes:.1f} as the axes move"]
    at_once = replace(UCP, linear=tuple(replace(axis, acceleration=np.inf) for axis in UCP.linear))
    bare = time_of(TWO_PATHS, at_once)
    assert str(bare) == told
    assert (bare.axes, bare.whole) == (None, None)
    assert sum(bare.tools) == pytest.approx(known.feed)


def test_seconds_are_those_of_changes_starts_and_retracts():
    at_once = time_of(TWO_PATHS, replace(UCP, seconds=AT_ONCE)).whole
    for name, count in (("tool_change", 2), ("spindle_start", 2), ("retract", 2)):
        slow = replace(UCP, seconds=AT_ONCE.model_copy(update={name: 30.0}))
        assert time_of(TWO_PATHS, slow).whole == pytest.approx(at_once + count * 30 / 60)
    # LinuxCNC retracts to a height that the program states, and a change by hand takes as long as it takes
    slow = replace(XYZBC, seconds=AT_ONCE.model_copy(update={"retract": 30.0}))
    assert time_of(TWO_PATHS, slow, "linuxcnc").whole == time_of(TWO_PATHS, XYZBC, "linuxcnc").whole
    slow = replace(UCP, seconds=AT_ONCE.model_copy(update={"tool_change": 30.0}))
    by_hand = time_of(TWO_PATHS, slow, tool_change="stop")
    assert by_hand.whole == pytest.approx(at_once)
    assert str(by_hand).endswith(" with changes but 2 by hand")


def rapids_between_runs(text: str) -> Iterator[tuple[ndarray, ndarray]]:
    """The ends of the rapids of a LinuxCNC text between its runs, each with the first one of the next run."""
    at = np.zeros(5)
    cutting = first = False
    for line in text.splitlines():
        if line in ("G93", "G94"):
            cutting = first = line == "G93"
        words = dict(re.findall(r"([XYZBC])(-?[0-9.]+)", re.sub(r"\(.*\)", "", line)))
        if line.startswith(("G0 ", "G1 ")) and words:
            to = np.array([float(words.get(letter, value)) for letter, value in zip("XYZBC", at, strict=True)])
            if not cutting or first:
                yield at, to
            at, first = to, False


def test_between_two_runs_the_machine_drives_the_rapids_that_the_text_states():
    program = write_program(TWO_PATHS, XYZBC, read_dialect("linuxcnc"), Job())
    speed, acceleration = np.array([20.0, 20.0, 20.0, 30.0, 30.0]), 300.0
    seconds = 0.0
    # the first move comes from where the tool stands before
    for before, after in [*rapids_between_runs(program.text)][1:]:
        way = np.abs(after - before)
        full = (way / speed).max(initial=0.0)
        if full > 0:
            ramp = (way / full / acceleration).max()
            seconds += full + ramp if full >= ramp else 2 * np.sqrt(full * ramp)
    assert 5 < seconds < 60
    posted = [post_path(path, XYZBC, read_dialect("linuxcnc"), Job(), path.tips) for path in TWO_PATHS]
    turns = sum(one.driven_minutes[0] for one in posted)
    found = (program.time.whole - program.time.axes + turns) * 60
    assert found == pytest.approx(seconds, abs=0.5)


@pytest.mark.parametrize("controller", ["heidenhain", "siemens-840d", "fanuc-30i"])
def test_rows_are_driven_by_the_tolerances_that_the_program_states(controller):
    dialect = read_dialect(controller)
    for path in TWO_PATHS:
        one = post_path(path, UCP, dialect, Job(), path.tips)
        rapid = (one.moves.kinds == MoveKind.RAPID) & dialect.straight_rapids
        at_feed = np.where(rapid, one.axis_minutes, one.minutes)[1:]
        driven = motion_minutes(UCP, one.joints, at_feed, one.rule)
        assert one.driven_minutes[1:] == pytest.approx(driven)
        assert one.rule.look_ahead == dialect.look_ahead >= 200
        text = write_program([path], UCP, dialect, Job()).text
        assert f"{one.rule.tolerance:.3f}" in text
        assert f"{np.degrees(one.rule.rotary_tolerance):.3f}" in text
        looser = replace(one.rule, tolerance=1.0, rotary_tolerance=0.1)
        assert motion_minutes(UCP, one.joints, at_feed, looser).sum() < driven.sum()
