"""Whether the feeds of a text are in the mode that its control needs, and no larger than machine and job allow.

Feeds are those of the tip. Links and rapids that are written as feeds may ask more than the axes can: the control
drives them as fast as it can. By the job a cut is no faster than the shallowest cut of its cutter
(`nc.posting.feeds.fastest_cut` where its feeds are not constant, or the plunge feed where that is more), and its chip
load no larger: a spindle that turns slower than in the job takes as much from the feed. Links may be as fast as links,
plunges and rapids of the job.
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.feeds.drivable_feeds import fastest_cut
from bonecam.nc.reading.motions import Motions
from bonecam.text.numbers import told_apart
from bonecam.tool.cutter import Cutter
from bonecam.verify.control.first_wrong import refuse_first
from bonecam.verify.readback import FEED_TOLERANCE, MIN_LENGTH_STEPS


def check_feed_mode(motions: Motions, dialect: Dialect) -> None:
    """VerifyError at the first feed move whose feed is per minute where the dialect's are in inverse time, or the
    other way round."""
    inverse = dialect.feed_mode == "inverse-time"
    wrong = ~motions.rapid & (motions.inverse_time != inverse)
    message = "per minute, where this control needs it in inverse time" if inverse else "in inverse time"
    refuse_first(motions, wrong, lambda _: f"the feed is {message}: correct the mode in a line before")


def check_feeds(motions: Motions, machine: Machine, dialect: Dialect) -> None:
    """VerifyError at the first feed beyond what the linear axes of the machine make together, mm/min."""
    most = float(np.linalg.norm([axis.speed for axis in machine.linear]))
    speeds, known = tip_speeds(motions, dialect)
    bound = f"the axes of {machine.title} make {most:.0f} at most: give less"
    refuse_first(motions, known & (speeds > most), lambda at: f"a feed of {speeds[at]:.0f} mm/min: {bound}")


def check_feeds_of_job(motions: Motions, dialect: Dialect, job: Job, cutters: dict[int, Cutter]) -> None:
    """VerifyError at the first feed beyond what a job allows for its cutter at the speed of the spindle, mm/min; the
    cutters have the feed of their shallowest cut."""
    speeds, known = tip_speeds(motions, dialect)
    step, spindle_step = dialect.numbers.feed.step, dialect.numbers.spindle.step
    allowed = np.full(len(speeds), np.inf)
    for number, cutter in cutters.items():
        cut = max(fastest_cut(cutter, job), job.nc.plunge_feed)
        link = max(cut, job.nc.link_feed, job.nc.rapid_feed)
        slower = np.minimum((motions.spindle + spindle_step) / cutter.spindle, 1.0)
        rates = np.where(motions.links, link, cut * slower)
        allowed = np.where(motions.tools == number, rates, allowed)
    # in inverse time the lengths are those between rounded words
    rounding = np.where(motions.inverse_time, FEED_TOLERANCE * allowed, step)

    def why(at: int) -> str:
        speed, most = told_apart(float(speeds[at]), float(allowed[at]))
        name = cutters[int(motions.tools[at])].name
        asked = f"a feed of {speed} mm/min at S{motions.spindle[at]:g}"
        return f"{asked}: the job allows {most} for {name}: give less, or give the job that feed"

    refuse_first(motions, known & (speeds > allowed + rounding), why)


def tip_speeds(motions: Motions, dialect: Dialect) -> tuple[Float[ndarray, "n"], Bool[ndarray, "n"]]:
    """The speed (mm/min) that the feed of each move asks of the tip, and whether it is known: of feed moves, in
    inverse time of those that are long beside the last decimal of their words."""
    lengths = np.r_[0.0, np.linalg.norm(np.diff(motions.tips, axis=0), axis=1)]
    speeds = np.where(motions.inverse_time, motions.feed_rates * lengths, motions.feed_rates)
    long_enough = motions.known_start & (lengths > MIN_LENGTH_STEPS * dialect.numbers.length.step)
    return speeds, ~motions.rapid & (~motions.inverse_time | long_enough)
