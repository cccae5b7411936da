"""Feeds that the axes can follow, even along each pass."""

import numpy as np
import pytest
from controls import KINDS, PAIRS
from small_parts import capsule_path, path_of

from bonecam.arrays import unit
from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.machine import Machine
from bonecam.machine.control import Control
from bonecam.machine.kinematics import inverse_linear
from bonecam.nc import Motions, drivable_paths, read_program, write_program
from bonecam.nc.feeds import FEED_PER_MM, LARGEST_RATIO
from bonecam.tool import MoveKind, ToolPath
from bonecam.verify import Tolerances
from bonecam.verify.readback import compare_moves

LARGEST_STEP = 1 / 7
"""The largest step of the scale of feeds (from 140 to 160), as a share of the lower of the two."""


@pytest.fixture(params=KINDS)
def pair(request):
    return PAIRS[request.param]


PATHS = (
    capsule_path(level=5, radius=2.0, offset=1.5, number=1, count=600),
    capsule_path(level=0, radius=1.0, number=2, count=900),
)


def axis_shares(motions: Motions, machine: Machine) -> np.ndarray:
    """What each feed move of a text asks of its slowest axis, as a share of the axis's speed; by moves between known
    places."""
    control: Control = next(iter(motions.controls.values()))
    joints = motions.words
    if control.tool_centre:
        joints = inverse_linear(machine, motions.tips, motions.words[:, 3:], control.tool_length)
    speeds = np.array([axis.speed for axis in (*machine.linear, *machine.rotary)])
    needed = (np.abs(np.diff(joints, axis=0)) / speeds).max(1)
    length = np.linalg.norm(np.diff(motions.tips, axis=0), axis=1)
    feeds = motions.feed_rates[1:]
    with np.errstate(invalid="ignore", divide="ignore"):
        given = np.where(motions.inverse_time[1:], 1 / feeds, length / feeds)
    used = ~motions.rapid[1:] & motions.known_start[1:] & (length > 0.02)
    return np.asarray(needed[used] / given[used])


def test_every_feed_of_the_text_is_one_that_the_axes_can_follow(pair):
    machine, dialect = pair
    raw = read_program(write_program(PATHS, machine, dialect, Job()).text, machine, dialect)
    assert (axis_shares(raw, machine) > 1.01).mean() > 0.3
    lowered = drivable_paths(PATHS, machine, dialect, Job())
    program = write_program(lowered, machine, dialect, Job())
    motions = read_program(program.text, machine, dialect)
    assert axis_shares(motions, machine).max() <= 1.0 + 1e-6
    assert program.feeds.beyond == 0.0
    assert program.feeds.limited > 0.3


def test_the_text_is_proved_against_the_lowered_feeds_only(pair):
    machine, dialect = pair
    lowered = drivable_paths(PATHS, machine, dialect, Job())
    text = write_program(lowered, machine, dialect, Job()).text
    compare_moves(read_program(text, machine, dialect), lowered, dialect, Tolerances())
    with pytest.raises(VerifyError, match=r"feed is .* meant"):
        compare_moves(read_program(text, machine, dialect), PATHS, dialect, Tolerances())


def test_only_feeds_change_and_none_rises(pair):
    for before, after in zip(PATHS, drivable_paths(PATHS, *pair, Job()), strict=True):
        assert np.array_equal(before.tips, after.tips)
        assert (after.feed_rates <= before.feed_rates).all()
        assert (after.feed_rates > 0).all()
        rapid = (before.kinds == MoveKind.RAPID) & pair[1].straight_rapids
        assert np.array_equal(before.feed_rates[rapid], after.feed_rates[rapid])


def test_along_a_pass_the_feed_changes_evenly(pair):
    stepped = pair[1].feed_mode == "per-minute"
    changed = 0
    for path in drivable_paths(PATHS, *pair, Job()):
        step = np.linalg.norm(np.diff(path.tips, axis=0), axis=1)
        cutting = path.kinds == MoveKind.CUT
        both = cutting[1:] & cutting[:-1] & (np.diff(path.pass_index) == 0)
        both[1:] &= both[:-1].copy()
        both[0] = False
        longest = np.maximum(step, np.r_[0.0, step[:-1]])
        rise = np.abs(np.diff(path.feed_rates))
        low = np.minimum(path.feed_rates[1:], path.feed_rates[:-1])
        # even but for the rounding down, by less than a step of the scale
        rounding = LARGEST_STEP * (low + rise) + pair[1].numbers.feed.step if stepped else 1e-3 + 0.0 * low
        assert (rise <= FEED_PER_MM * path.cutter.feed * longest + rounding)[both].all()
        assert (rise <= (LARGEST_RATIO - 1) * (low + rounding) + rounding)[both].all()
        changed += int((rise[both] > 0).sum())
    assert changed > (30 if stepped else 100)


def test_feeds_that_every_axis_can_follow_are_left_alone(pair):
    tips = np.column_stack([np.linspace(0, 20, 60), np.zeros(60), np.full(60, 60.0)])
    path = path_of(tips, np.tile([0.0, 0.0, 1.0], (60, 1)))
    (same,) = drivable_paths([path], *pair, Job())
    assert np.array_equal(same.feed_rates, path.feed_rates)


def test_rapids_that_are_written_as_feeds_are_lowered_too():
    machine, dialect = PAIRS["linuxcnc"]
    bent = dialect.model_copy(update={"straight_rapids": False})
    lowered = drivable_paths(PATHS, machine, bent, Job())
    rapid = lowered[0].kinds == MoveKind.RAPID
    assert (lowered[0].feed_rates[rapid] < PATHS[0].feed_rates[rapid]).any()
    program = write_program(lowered, machine, bent, Job())
    assert axis_shares(read_program(program.text, machine, bent), machine).max() <= 1.0 + 1e-6


def over_the_pole(off_deg: float, step: float, still: bool) -> ToolPath:
    """A pass whose tool axis swings from -40 to 40 degrees past the pole, `off_deg` beside it; the tip moves by `step`
    (mm) from row to row, or hardly at all (`still`) where the axis is next to it."""
    rows = np.arange(-20, 21)
    swing = np.radians(2.0 * rows)
    axes = np.column_stack([np.sin(swing), np.full(41, np.sin(np.radians(off_deg))), np.cos(swing)])
    tips = np.column_stack([rows * step, np.zeros(41), np.full(41, 60.0)])
    if still:
        tips[18:22] = tips[18] + np.outer(np.arange(4), [3e-4, 0.0, 0.0])
    return path_of(tips, unit(axes))


@pytest.mark.parametrize("off_deg", [0.0001, 0.01, 0.1, 0.5])
@pytest.mark.parametrize("step", [0.3, 0.002])
@pytest.mark.parametrize("still", [False, True])
def test_beside_the_pole_the_tool_waits_for_its_slowest_axis_and_no_longer(off_deg, step, still):
    machine, dialect = PAIRS["linuxcnc"]
    lowered = drivable_paths([over_the_pole(off_deg, step, still)], machine, dialect, Job())
    program = write_program(lowered, machine, dialect, Job())
    motions = read_program(program.text, machine, dialect)
    compare_moves(motions, lowered, dialect, Tolerances())
    feeds = motions.inverse_time & ~motions.rapid
    minutes = np.where(feeds, 1 / np.where(feeds, motions.feed_rates, 1.0), 0.0)
    joints = np.diff(motions.words, axis=0, prepend=motions.words[:1])
    speeds = np.array([axis.speed for axis in (*machine.linear, *machine.rotary)])
    needed = (np.abs(joints) / speeds).max(1)
    assert (minutes[feeds] >= needed[feeds] * (1 - 1e-6)).all()
    # no more than 5 s beyond what the axes need, and beside the turn itself no block of more than a second
    assert minutes.sum() <= needed[feeds].sum() + 5 / 60
    assert (minutes <= np.maximum(1.01 * needed, 1.01 / 60)).all()
    assert program.feeds.beyond == 0.0
    assert program.time_min < needed.sum() + 0.2


@pytest.mark.parametrize("name", ["heidenhain", "siemens-840d", "fanuc-30i"])
def test_a_program_has_a_few_dozen_feeds_and_states_them_where_they_change(name):
    machine, dialect = PAIRS[name]
    lowered = drivable_paths(PATHS, machine, dialect, Job())
    text = write_program(lowered, machine, dialect, Job()).text
    motions = read_program(text, machine, dialect)
    compare_moves(motions, lowered, dialect, Tolerances())
    feeds = motions.feed_rates[~motions.rapid]
    assert len(feeds) > 1500
    assert len(np.unique(feeds)) <= 60
    in_runs = [line for line in text.splitlines() if "X" in line and "Y" in line and "Z" in line and "(" not in line]
    assert sum(" F" in line for line in in_runs) < 0.7 * len(in_runs)


@pytest.mark.parametrize("name", KINDS)
def test_no_block_has_no_length(name):
    machine, dialect = PAIRS[name]
    # the path comes to a point, again to the same one, and turns back
    there = np.column_stack([np.linspace(0, 5, 30), np.zeros(30), np.full(30, 60.0)])
    tips = np.vstack([there, there[-1] + [1e-7, 0.0, 0.0], there[::-1]])
    path = path_of(tips, np.tile(unit(np.array([[0.3, 0.0, 1.0]])), (61, 1)))
    (shorter,) = drivable_paths([path], machine, dialect, Job())
    assert len(shorter.tips) == 59
    text = write_program([shorter], machine, dialect, Job()).text
    motions = read_program(text, machine, dialect)
    assert (np.abs(np.diff(motions.words, axis=0)).max(axis=1) > 0).all()
    assert len(shorter.contacts) == len(shorter.pass_index) == 59
