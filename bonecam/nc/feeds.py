"""The feeds that a program's words take: a few dozen values.

They are preferred numbers of the series R20 (ISO 3), twenty a decade, to which feeds of machine tools are stepped (ISO
229), and those that a path asks for: the cutter's, that of links and of plunges. A feed is rounded down: what an axis
allows is never exceeded. FLOOR of a cut's feed is on the scale too, so that no feed falls below it by the rounding.

Feeds that the axes of the machine can follow, even along each pass.

Where a move asks more of an axis than its speed, the control slows down there by itself, from block to block, and the
chip load jumps. So the feed of each row of a path is lowered first: it is at most what every axis can do on all moves
that lead to the row,

    F <= length / max over axes of |joint change| / speed.

Along the cuts of a pass it is lowered further, forwards and backwards, so that from one row to the next it changes by
no more than half of the cutter's feed per mm of path, and by no more than a factor of two. The chip load F / (spindle
speed x teeth) changes as evenly. That lowers no feed below FLOOR of what is asked: the ball would rub, where the axes
allow more. On the shipped phalanx this takes 2.5 % more time than the model of a control that changes its feed at once
from block to block. Then each feed is rounded down to one of a few dozen values, which takes 1 %. The
first row of a pass, entered at the plunge feed, is left out of it.

In inverse time each block has its own time. Beside the pole, where the axes turn round while the tip hardly moves, the
feed of a row is lowered to SLOW of the cutter's at most, and blocks on which the axes allow less last as long as their
turn: a feed for such a block, taken over by its neighbours, would let the tool dwell for minutes.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.job import Job
from bonecam.job.materials.preset import MOST_FEED
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.path_words import SLOW, Posted, moved_rows, post_path, with_rows
from bonecam.nc.program import FeedFigures
from bonecam.nc.schema import NumberFormat
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath

R20 = np.array([100, 112, 125, 140, 160, 180, 200, 224, 250, 280, 315, 355, 400, 450, 500, 560, 630, 710, 800, 900])
"""The rounded preferred numbers of a decade."""
DECADES = 6
"""From 1 to 999,999 mm/min."""
FLOOR = 0.5
"""Evenness lowers no feed below this share of what is asked, beyond what the axes of its own row ask for."""


def feed_scale(path: ToolPath, number: NumberFormat) -> Float[ndarray, " k"]:
    """The feeds (mm/min) that the words of a path may have, rising, in whole steps of the `number` F."""
    asked = np.unique(path.feed_rates)
    floors = FLOOR * np.unique(path.feed_rates[path.kinds == MoveKind.CUT])
    # a feed that is asked for stands as it is asked: its word is rounded as it is written
    return np.unique(np.r_[stepped_feeds(number, floors), asked])


def stepped_feeds(number: NumberFormat, *more: Float[ndarray, " m"]) -> Float[ndarray, " k"]:
    """The preferred feeds (mm/min) and some `more`, rising, rounded down to whole steps of the `number` F."""
    feeds = np.concatenate([R20 * 10.0 ** (decade - 2) for decade in range(DECADES)] + list(more))
    whole = np.floor(feeds / number.step + 1e-9) * number.step
    return np.unique(whole[whole > 0])


def on_scale(feeds: Float[ndarray, "n"], scale: Float[ndarray, " k"]) -> Float[ndarray, "n"]:
    """The largest feeds of a scale that are no larger than the `feeds`; the lowest of it below them all."""
    return np.asarray(scale[np.maximum(np.searchsorted(scale, feeds * (1 + 1e-12), "right") - 1, 0)])


FEED_PER_MM = 0.5
"""Largest change of the feed along a pass, as a share of the cutter's feed per mm of path."""
TIMED_STEP = 0.001
"""Feeds that are written in inverse time are whole multiples of this, mm/min."""
LEAST_SHARE = 0.002
"""A block is told to be below half of the cutter's feed where it is by this share of the feed: words are rounded."""
LARGEST_RATIO = 2.0
"""Largest ratio of the feeds of successive rows of a pass, and of a feed by the force to the cutter's."""


def drivable_paths(paths: Sequence[ToolPath], machine: Machine, dialect: Dialect, job: Job) -> tuple[ToolPath, ...]:
    """The paths with feeds that the machine's axes can follow when they are posted in this order, without rows whose
    words are those of the row before; rapids are left as they are where the control drives them as rapids.
    MachineError where a path cannot be posted."""
    around = np.vstack([path.tips for path in paths])
    before = None
    lowered = []
    for path in paths:
        posted = post_path(path, machine, dialect=dialect, job=job, around=around, before=before)
        before = posted.moves.angles[-1]
        kept = moved_rows(posted)
        feeds = _drivable_feeds(posted, kept)
        lowered.append(replace(with_rows(path, kept), feed_rates=feeds))
    return tuple(lowered)


def _drivable_feeds(posted: Posted, kept: Bool[ndarray, "n"]) -> Float[ndarray, "m"]:
    """The feed of each row of a path that is `kept`, mm/min, on the scale of the path, or in inverse time in whole
    TIMED_STEPs."""
    path = posted.path
    number = posted.dialect.numbers.feed
    asked = path.feed_rates
    limit = np.full(len(path.tips), np.inf)
    moving = posted.lengths > posted.dialect.numbers.length.step
    moving[[first for first, _ in posted.runs]] = False
    with np.errstate(divide="ignore"):
        reached = posted.lengths[moving] / posted.axis_minutes[moving]
    np.minimum.at(limit, posted.moves.rows[moving], reached)
    if posted.dialect.feed_mode != "per-minute":
        # what is slower is timed by its turn, block by block
        limit = np.maximum(limit, SLOW * path.cutter.feed)
    path = with_rows(path, kept)
    asked = asked[kept]
    limit = limit[kept]
    feeds = np.minimum(asked, limit)
    steps = np.linalg.norm(np.diff(path.tips, axis=0, prepend=path.tips[:1]), axis=1)

    # lowered, not below their floors, so that they change evenly along each pass
    rise = (FEED_PER_MM * path.cutter.feed * np.maximum(steps, np.r_[0.0, steps[:-1]])).tolist()
    follows = _follows(path).tolist()
    even, least = feeds.tolist(), np.minimum(feeds, FLOOR * asked).tolist()
    for row in range(1, len(even)):
        if follows[row]:
            near = min(even[row - 1] + rise[row], LARGEST_RATIO * even[row - 1])
            even[row] = min(even[row], max(near, least[row]))
    for row in range(len(even) - 1, 0, -1):
        if follows[row]:
            near = min(even[row] + rise[row], LARGEST_RATIO * even[row])
            even[row - 1] = min(even[row - 1], max(near, least[row - 1]))
    feeds = np.array(even)

    # rounded down: a feed that is rounded up is beyond the axis again
    if posted.dialect.feed_mode == "per-minute":
        feeds = np.minimum(on_scale(feeds, feed_scale(path, number)), np.maximum(feeds, number.step))
    else:
        feeds = np.minimum(np.maximum(np.floor(feeds / TIMED_STEP + 1e-9), 1.0) * TIMED_STEP, asked)
    rapid = (path.kinds == MoveKind.RAPID) & posted.dialect.straight_rapids
    return np.where(rapid, path.feed_rates, feeds)


def fastest_cut(cutter: Cutter, job: Job) -> float:
    """The largest feed (mm/min) that a cut of a cutter may have by the job: the cutter's; where feeds go by the force,
    as long as a tooth takes no larger chip than the material's cutting data ever give it, and leaves no feed marks over
    the scallop, at most LARGEST_RATIO of it too."""
    if job.path.feed == "constant":
        return cutter.feed
    chip = min(2 * MOST_FEED * cutter.radius, math.sqrt(8 * cutter.radius * cutter.scallop))
    return max(min(chip * cutter.flutes * cutter.spindle, LARGEST_RATIO * cutter.feed), cutter.feed)


def _follows(path: ToolPath) -> Bool[ndarray, "n"]:
    """Rows that go on with the cuts of the row before, on one pass, that row being more than its entry."""
    cutting = path.kinds == MoveKind.CUT
    goes_on = cutting & np.r_[False, cutting[:-1] & (np.diff(path.pass_index) == 0)]
    return goes_on & np.r_[False, goes_on[:-1]]


def feed_figures(posted: Sequence[Posted]) -> FeedFigures:
    """The figures of the cutting blocks of posted paths."""
    asked = []
    own = []
    driven = []
    under = 0
    for one in posted:
        cuts = (one.moves.kinds == MoveKind.CUT) & (one.lengths > one.dialect.numbers.length.step)
        cuts[[first for first, _ in one.runs]] = False
        length, axes = one.lengths[cuts], one.axis_minutes[cuts]
        asked.append(axes * one.path.cutter.feed / length)
        # a block that is timed by its turn asks for what its axes can
        own.append(np.where(one.by_turn[cuts], 1.0, axes * one.moves.feed_rates[cuts] / length))
        driven.append(length / one.minutes[cuts])
        under += int((driven[-1] < (FLOOR - LEAST_SHARE) * one.path.cutter.feed).sum())
    feeds = np.concatenate(driven)
    if not len(feeds):
        return FeedFigures(0.0, 0.0, 0.0, 0.0, 0)
    median, low = np.percentile(feeds, [50, 10]).tolist()
    limited, beyond = (float((np.concatenate(ratio) > 1 + 1e-9).mean()) for ratio in (asked, own))
    return FeedFigures(median, low, limited, beyond, under)
