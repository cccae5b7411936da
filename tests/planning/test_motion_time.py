"""The time of moves as the axes drive them, against closed forms, a control that is simulated in time steps, and
LinuxCNC."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray

from bonecam.machine import Machine, read_machine
from bonecam.machine.kinematics import inverse_linear
from bonecam.machine.limits import MachineLimits
from bonecam.planning.motion_time import ControlRule, motion_minutes, rotary_minutes

SECONDS = 60


def mill(acceleration: float = 600.0, jerk: float = math.inf) -> Machine:
    """A machine whose linear axes have these bounds (mm and minutes), its rotary ones much higher ones."""
    machine = read_machine("mikron-ac")
    turning = {"acceleration": 1e12, "jerk": 1e15 if math.isfinite(jerk) else math.inf}
    return replace(
        machine,
        linear=tuple(replace(axis, acceleration=acceleration, jerk=jerk) for axis in machine.linear),
        part_axes=tuple(replace(axis, **turning) for axis in machine.part_axes),
    )


MILL, JERKED = mill(), mill(jerk=12000.0)
"""mm/min^2 and mm/min^3 for round numbers: a / j is 0.05 min, and ramps up to a^2 / j = 30 mm/min have no constant
acceleration."""


def joints(*places: float) -> ndarray:
    table = np.zeros((len(places), 5))
    table[:, 0] = places
    return table


def test_a_corner_is_passed_as_fast_as_its_tolerance_allows():
    # from X to Y at 60 mm/min: each axis changes its speed by c = 1, so v^2 = 8 a e there
    corner = np.zeros((3, 5))
    corner[1:, 0], corner[2, 1] = 50.0, 50.0
    at_feed = np.full(2, 50 / 60)
    for tolerance in (0.001, 0.01, 0.1):
        speed = math.sqrt(8 * 600 * tolerance)
        rounded = 4 * tolerance
        lines = 2 * ((50 - rounded - (2 * 60**2 - speed**2) / 1200) / 60 + (2 * 60 - speed) / 600)
        found = motion_minutes(MILL, corner, at_feed, ControlRule(tolerance)).sum()
        assert found == pytest.approx(lines + 2 * rounded / speed, rel=1e-6)


def test_axes_alone_are_driven_by_the_rotary_axes_from_rest_to_rest():
    # 30 degrees from rest to rest at 800 deg/s^2 and 100 deg/s: the way / speed + speed / acceleration
    angles = np.radians(np.linspace(0, 30, 301))
    axes = np.column_stack([np.cos(angles), np.sin(angles), np.ones(301)]) / math.sqrt(2)
    fast = MachineLimits(2.0, tilt_speed=np.radians(90) * 60, turn_speed=np.radians(100) * 60)
    driven = replace(fast, tilt_acceleration=np.radians(500) * 3600, turn_acceleration=np.radians(800) * 3600)
    joined, at_feed = np.ones(300, dtype=bool), np.full(300, 1e-6)
    assert rotary_minutes(fast, axes, at_feed, joined).sum() * SECONDS == pytest.approx(0.3)
    assert rotary_minutes(driven, axes, at_feed, joined).sum() * SECONDS == pytest.approx(0.3 + 100 / 800, rel=1e-2)
    joined[149] = False
    twice = rotary_minutes(driven, axes, at_feed, joined).sum() * SECONDS
    assert twice == pytest.approx(0.3 + 2 * 100 / 800, rel=1e-2)
    assert rotary_minutes(driven, axes, np.ones(300), joined) == pytest.approx(1.0)


def test_an_axis_that_is_locked_holds_nothing_up():
    """Its acceleration is not known; that its angle comes out a little off makes no difference."""
    limits = MachineLimits(2.0, turn_speed=np.radians(100) * 60, turn_acceleration=np.radians(800) * 3600)
    azimuths = np.array([0.0, 0.0, 0.1, 0.2])

    def minutes(polar: ndarray) -> ndarray:
        axes = np.column_stack([np.sin(polar) * np.cos(azimuths), np.sin(polar) * np.sin(azimuths), np.cos(polar)])
        return rotary_minutes(limits, axes, np.full(3, 1e-4), np.ones(3, dtype=bool))

    found = minutes(np.array([1.0, 1.0 + 1e-9, 1.0, 1.0]))
    assert (found >= 1e-4).all()
    assert found == pytest.approx(minutes(np.ones(4)), rel=1e-3)


def test_a_circle_is_driven_by_its_curvature_however_finely_it_is_sampled():
    # v^2 / R = a where all of both axes is across: R 10 at 60 mm/min would ask for 360 of 600 mm/min^2
    for acceleration, speed in ((600.0, 60.0), (90.0, 30.0)):
        for count in (100, 1000):
            turn = np.linspace(0, 20 * np.pi, 10 * count + 1)
            around = np.column_stack([10 * np.cos(turn), 10 * np.sin(turn), *np.zeros((3, len(turn)))])
            at_feed = np.linalg.norm(np.diff(around, axis=0), axis=1) / 60
            found = motion_minutes(mill(acceleration), around, at_feed).sum()
            assert found == pytest.approx(200 * np.pi / speed, rel=0.02)


def test_a_control_can_stop_at_the_end_of_what_it_looks_ahead_over():
    line, at_feed = joints(*np.linspace(0, 10, 101)), np.full(100, 0.1 / 60)
    times = [motion_minutes(MILL, line, at_feed, ControlRule(look_ahead=moves)).sum() for moves in (0, 1, 4, 20, 100)]
    assert times[0] == pytest.approx(100 * 2 * np.sqrt(0.1 / 600))
    # v^2 = 2 a N l at every point but the ends, and one ramp more
    speed = np.sqrt(2 * 600 * 4 * 0.1)
    assert times[2] == pytest.approx(10 / speed + speed / 600, rel=0.03)  # within a move it may be faster
    assert times == sorted(times, reverse=True)
    assert times[-1] == pytest.approx(10 / 60 + 60 / 600)


def test_without_known_accelerations_nothing_is_added():
    given = np.array([0.3, 0.0, 0.2])
    for rule in (ControlRule(), ControlRule(0.01, parabolic=True)):
        found = motion_minutes(mill(math.inf), joints(0.0, 1.0, 1.0, 5.0), given, rule)
        assert found.tolist() == given.tolist()


def test_a_jerk_adds_the_time_in_which_an_acceleration_builds_up():
    # rest to rest at 60 mm/min: way / v + v / a + a / j
    found = motion_minutes(JERKED, joints(0.0, 100.0), np.array([100 / 60]))
    assert found == pytest.approx([100 / 60 + 60 / 600 + 600 / 12000])


def test_a_short_move_with_jerk_reaches_neither_feed_nor_acceleration():
    # t^3 = 32 way / j
    found = motion_minutes(JERKED, joints(0.0, 0.1), np.array([0.1 / 60]))
    assert found == pytest.approx([(32 * 0.1 / 12000) ** (1 / 3)])


@pytest.mark.parametrize("pieces", [2, 7, 50, 400])
def test_a_line_in_pieces_with_jerk_takes_about_as_long_as_in_one(pieces):
    ways = np.full(pieces, 100 / 60 / pieces)
    found = motion_minutes(JERKED, joints(*np.linspace(0, 100, pieces + 1)), ways)
    assert found.sum() == pytest.approx(100 / 60 + 60 / 600 + 600 / 12000, rel=0.02)


def test_less_jerk_takes_longer_and_much_of_it_as_none():
    places = joints(*np.cumsum(np.tile([1.0, 3.0, -2.0, 5.0], 10)))
    at_feed = np.abs(np.diff(places[:, 0])) / 60
    rule = ControlRule(1e-6, 1e-6)
    times = [motion_minutes(mill(jerk=factor * 12000.0), places, at_feed, rule).sum() for factor in (0.1, 1, 10, 1e9)]
    assert times == sorted(times, reverse=True)
    assert times[-1] == pytest.approx(motion_minutes(MILL, places, at_feed, rule).sum(), rel=1e-3)


K = np.arange(201)
STILL = np.zeros(201)
BACK_AND_FORTH = np.abs(K % 20 - 10)
SIDES = (np.interp(K % 40, [0, 10, 20, 30, 40], [0, 1, 1, 0, 0]), np.interp(K % 40, [0, 10, 20, 30], [0, 0, 1, 1]))
LINUXCNC = {
    # X, Y, Z, A, C by move (mm, degrees), seconds a move, tolerance of G64 (mm), seconds that LinuxCNC took, within
    "smooth": ((0.5 * K, 5 * np.sin(K / 20), STILL, 20 * np.sin(K / 15), 1.5 * K), 0.03, 0.02, 20.130, 0.01),
    "zigzag": ((0.5 * K, 0.1 * (K % 2), STILL, 0.8 * K, 0.4 * K), 0.04, 0.002, 25.051, 0.01),
    "slow": ((1.0 * K, STILL, STILL, 0.3 * K, STILL), 0.25, 0.01, 50.052, 0.01),
    "square": ((8 * SIDES[0], 8 * SIDES[1], 0.05 * (K // 40), STILL, STILL), 0.045, 0.02, 10.131, 0.05),
    "ridges": ((0.2 * K, 0.15 * BACK_AND_FORTH, STILL, STILL, STILL), 0.02, 0.01, 4.616, 0.05),
    "pocket": ((10 * ((K + 1) // 2 % 2), 0.5 * (K // 2), STILL, STILL, STILL), 0.5, 0.01, 103.301, 0.05),
}
"""The first three timed in LinuxCNC 2.9.0~pre1 by an `integ` of its servo thread between M64 and M65, as G93 with
trivkins; the others, in X, Y and Z alone, by its trajectory planner (`emc/tp`) in cycles of 1 ms, which takes 20.111,
25.023 and 50.028 s for the first three. All axes 20 mm/s or 30 deg/s and 300 /s^2."""


@pytest.mark.parametrize("case", LINUXCNC)
def test_parabolic_blends_take_the_time_that_linuxcnc_takes(case):
    columns, seconds, tolerance, measured, within = LINUXCNC[case]
    words = np.column_stack(columns)
    steps = np.abs(np.diff(words, axis=0))
    at_feed = np.maximum(seconds, (steps / [20.0, 20.0, 20.0, 30.0, 30.0]).max(1)) / SECONDS
    places = np.column_stack([words[:, :3], np.radians(words[:, 3:])])
    rule = ControlRule(tolerance, look_ahead=50, parabolic=True)
    found = motion_minutes(read_machine("linuxcnc-xyzac"), places, at_feed * (steps.max(1) > 0), rule)
    assert found.sum() * SECONDS == pytest.approx(measured, rel=within)


PER_PIECE = 12
"""Points at which the simulated control knows from which speed it can brake, in each line and each corner."""


def stepped_seconds(machine: Machine, places: ndarray, at_feed: ndarray, rule: ControlRule, cycle: float) -> float:
    """The seconds that a simulated control takes for moves, in steps of a `cycle` (s): it rounds each corner by a
    parabola in all axes, goes through it no faster than their accelerations allow at an even speed, and in each cycle
    speeds up by what they have left, as long as it can brake before what comes."""
    most, tolerances = machine.accelerations, np.repeat([rule.tolerance, rule.rotary_tolerance], [3, 2])
    rates = np.diff(places, axis=0) / at_feed[:, None]
    changes = np.diff(rates, axis=0)
    with np.errstate(divide="ignore"):
        longest = (4 * tolerances / np.abs(changes)).min(1)
    half = np.r_[0.0, np.minimum(longest, np.minimum(at_feed[1:], at_feed[:-1]) / 2), 0.0]
    pieces = []
    for move, rate in enumerate(rates):
        pieces.append((at_feed[move] - half[move] - half[move + 1], rate, np.zeros(5)))
        if move < len(changes):
            pieces.append((2 * half[move + 1], rate, changes[move] / max(2 * half[move + 1], 1e-300)))
    points, slopes, bends = [0.0], [], []
    for length, rate, bend in pieces:
        for k in range(PER_PIECE if length > 1e-12 else 0):
            slopes.append(rate + bend * length * k / PER_PIECE)
            bends.append(bend)
            points.append(points[-1] + length / PER_PIECE)

    def left(point: int, square: float, way: int) -> float:
        """What the axes leave for speeding up, or, the other way, for braking."""
        slope, bend = slopes[point], bends[point]
        moves = slope != 0
        across = way * np.sign(slope[moves]) * bend[moves] * square
        return max(((most[moves] - across) / np.abs(slope[moves])).min(), 0.0)

    with np.errstate(divide="ignore"):
        brakes = [min(1.0, float((most / np.abs(bend)).min())) for bend in bends] + [0.0]
    for point in reversed(range(len(slopes))):
        step = points[point + 1] - points[point]
        braked = brakes[point + 1] + 2 * step * left(point, brakes[point + 1], -1)
        brakes[point] = min(brakes[point], brakes[point + 1] + 2 * step * left(point, min(braked, brakes[point]), -1))
    place = speed = time = 0.0
    point, cycle = 0, cycle / SECONDS
    while place < points[-1] * (1 - 1e-9):
        while points[point + 1] <= place:
            point += 1
        faster = min(speed + left(point, speed**2, 1) * cycle, 1.0)
        after = place + (speed + faster) / 2 * cycle
        ahead = float(np.interp(after, points[point : point + 200], brakes[point : point + 200]))
        if faster**2 > ahead:
            faster = math.sqrt(ahead)
            after = place + (speed + faster) / 2 * cycle
        if after >= points[-1] or after - place < 1e-12 * points[-1]:
            break
        place, speed, time = after, faster, time + cycle
    return (time + (points[-1] - place) / max(speed / 2, 1e-3)) * SECONDS


def around_a_capsule(machine: Machine, turns: ndarray, heights: ndarray, tilts: ndarray) -> ndarray:
    """Joints, of which A and C turn the tool round a capsule of R 6 at these azimuths, heights and tilts."""
    tips = np.column_stack([6 * np.cos(turns), 6 * np.sin(turns), 60 + heights])
    return inverse_linear(machine, tips, np.column_stack([tilts, turns]), 120.0)


PROGRAMS = ("spiral", "zigzag", "pocket", "beside the pole", "rounded words", "links")


def program(name: str, machine: Machine) -> tuple[ndarray, ndarray]:
    """Joints of a made program, and the feed of its moves, mm/min."""
    k = np.arange(161)
    spiral = around_a_capsule(machine, 0.06 * k, 0.02 * k, 0.9 + 0.2 * np.sin(k / 12))
    feeds = np.full(160, 1800.0)
    if name == "zigzag":
        azimuths = 0.05 * np.abs(k % 20 - 10.0)
        return around_a_capsule(machine, azimuths, 0.3 * (k // 10), 0.9 + 0.0 * k), feeds
    if name == "pocket":
        sides = np.column_stack([SIDES[0], SIDES[1]])[:161]
        return np.column_stack([10 * sides, *np.zeros((3, 161))]), np.full(160, 3000.0)
    if name == "beside the pole":
        turn = np.arctan2(0.4, 0.05 * (k - 80.3))
        return around_a_capsule(machine, turn, 0.02 * k, np.hypot(0.05, 0.004 * (k - 80.3))), feeds
    if name == "rounded words":
        uneven = np.sort(np.random.default_rng(3).uniform(0, 160, 161))
        turned = around_a_capsule(machine, 0.06 * uneven, 0.02 * uneven, 0.9 + 0.2 * np.sin(uneven / 12))
        return np.column_stack([turned[:, :3].round(3), np.radians(np.degrees(turned[:, 3:]).round(3))]), feeds
    if name == "links":
        away = spiral.copy()
        away[40::40, 2] += 15.0
        return away, np.where(np.isin(k[1:] % 40, (0, 1)), 10000.0, 1800.0)
    return spiral, feeds


@pytest.mark.parametrize("name", PROGRAMS)
def test_programs_take_the_time_of_a_control_simulated_in_steps(name):
    machine = read_machine("mikron-ucp600")
    if name == "pocket":  # a slower one
        machine = read_machine("haas-umc750")
    places, feeds = program(name, machine)
    places = places[np.r_[True, np.abs(np.diff(places, axis=0)).max(1) > 0]]
    steps = np.abs(np.diff(places, axis=0))
    speeds = np.array([axis.speed for axis in (*machine.linear, *machine.rotary)])
    at_feed = np.maximum(np.linalg.norm(steps[:, :3], axis=1) / feeds[: len(steps)], (steps / speeds).max(1))
    rule = ControlRule(0.0052, math.radians(0.229))
    found = motion_minutes(machine, places, at_feed, rule).sum() * SECONDS
    stepped = stepped_seconds(machine, places, at_feed, rule, cycle=0.0002)
    assert found == pytest.approx(stepped, rel=0.05)
    assert stepped > 1.02 * at_feed.sum() * SECONDS
