"""The time of a program: at its feeds, as the axes drive it, and with what is between its runs."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.job import Job
from bonecam.nc.posting.path_words import Posted, axis_minutes, joints_and_lengths
from bonecam.nc.posting.travel import Travel, above, lifted
from bonecam.nc.program import ProgramTime
from bonecam.planning.motion_time import ControlRule, motion_minutes

EXACT_STOP = ControlRule(look_ahead=0)
"""Between two runs every block ends at rest."""


def program_time(posted: Sequence[Posted], travel: Travel, job: Job) -> ProgramTime:
    """The minutes of posted paths in their order. The first tool is changed for too; the spindle stops for changes and
    for the stops that the job asks for (`nc.optional_stop`), whose length is left out."""
    machine = posted[0].control.machine
    tools = dict.fromkeys((one.path.cutter.number for one in posted), 0.0)
    for one in posted:
        tools[one.path.cutter.number] += float(one.driven_minutes.sum())
    feed, axes = sum(float(one.minutes.sum()) for one in posted), sum(tools.values())
    minutes = tuple(tools.values())
    assumed = machine.time_assumed
    if not machine.knows_accelerations or machine.seconds is None:
        return ProgramTime(feed, minutes, axes if machine.knows_accelerations else None, assumed=assumed)
    numbers = [one.path.cutter.number for one in posted]
    changes = 1 + sum(a != b for a, b in pairwise(numbers))
    starts = len(posted) if job.nc.optional_stop == "level" else changes
    runs = sum(len(one.runs) for one in posted)
    by_hand = changes if job.nc.tool_change == "stop" else 0
    seconds = (changes - by_hand) * machine.seconds.tool_change + starts * machine.seconds.spindle_start
    if "{retract}" not in posted[0].dialect.templates.retract:
        seconds += runs * machine.seconds.retract
    # the turns of rotary axes to where runs begin are among these ways
    turns = sum(float(one.driven_minutes[[first for first, _ in one.runs]].sum()) for one in posted)
    ways = 0.0
    for one, way in _ways(posted, travel):
        # rapid moves between joints, each from rest to rest
        fastest = axis_minutes(machine, way)[1:]
        if not one.dialect.straight_rapids:
            fastest = np.maximum(fastest, lengths(np.diff(way[:, :3], axis=0)) / job.nc.rapid_feed)
        ways += float(motion_minutes(machine, way, fastest, EXACT_STOP).sum())
    return ProgramTime(feed, minutes, axes, axes - turns + ways + seconds / 60, by_hand, assumed)


def _ways(posted: Sequence[Posted], travel: Travel) -> Iterator[tuple[Posted, Float[ndarray, "k 5"]]]:
    """The joints between two runs: from the end of one up, to where tools start, the turn of the rotary axes, over the
    approach, down to it and to the first row of the next; behind the last run up alone."""
    at = [np.r_[travel.start, _level(posted[0], posted[0].joints[0])]]
    for one in posted:
        for run, (first, end) in enumerate(one.runs):
            words = (above(one, run, travel.retract), one.approaches[run], lifted(one, run, travel.retract))
            high, low, over = joints_and_lengths(one.control, np.array(words))[0]
            if not run and "{over_zero}" in one.dialect.templates.tool:
                at.append(np.r_[travel.start, at[-1][3:]])
            if one.dialect.starts_at_zero:
                at.append(np.r_[travel.start, _level(one, at[-1])])
            turned = np.r_[at[-1][:3], low[3:]]
            yield one, np.array([*at, turned, high, low, one.joints[first]])
            at = [one.joints[end - 1], over]
    yield posted[-1], np.array(at)


def _level(posted: Posted, joints: Float[ndarray, "5"]) -> Float[ndarray, "2"]:
    """The angles (rad) nearest to those of the joints at which all rotary words are zero."""
    turns = [axis.endless and not axis.bounded for axis in posted.control.machine.rotary]
    return np.where(turns, 2 * np.pi * np.round(joints[3:] / (2 * np.pi)), 0.0)
