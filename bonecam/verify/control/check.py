"""The verdict on a text as its control would run it: limits of axes, feeds, spindle; with its job also coolant, and
feeds, speeds and lengths of tools other than the job's.

Whether the feeds of a text are in the mode that its control needs, and no larger than machine and job allow.

Feeds are those of the tip. Links and rapids that are written as feeds may ask more than the axes can: the control
drives them as fast as it can. By the job a cut is no faster than the shallowest cut of its cutter
(`nc.posting.feeds.fastest_cut` where its feeds are not constant, or the plunge feed where that is more), and its chip
load no larger: a spindle that turns slower than in the job takes as much from the feed. Links may be as fast as links,
plunges and rapids of the job.

Whether the spindle turns and the coolant runs while a text cuts.

All cutters cut clockwise: what turns a spindle the other way is no word of any dialect.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.feeds.drivable_feeds import fastest_cut
from bonecam.nc.posting.tolerances import contour_tolerance
from bonecam.nc.reading.motions import Motions
from bonecam.text.numbers import told_apart
from bonecam.tool.cutter import Cutter
from bonecam.verify.control.axis_limits import check_limits
from bonecam.verify.control.first_wrong import refuse_first
from bonecam.verify.readback import FEED_TOLERANCE, MIN_LENGTH_STEPS
from bonecam.verify.removal.groups import tools_of
from bonecam.verify.removal.of_job import cutters_of


def check_spindle(motions: Motions, machine: Machine, dialect: Dialect) -> None:
    """VerifyError at the first feed move while the spindle stands, or turns faster than the machine or the words of
    the control allow."""
    feed = ~motions.rapid
    stands = "a feed move while the spindle stands: start it before (M3, with S)"
    refuse_first(motions, feed & (motions.spindle == 0), lambda _: stands)

    most = min(machine.spindle_speed, dialect.numbers.spindle.highest)
    bound = f"{machine.title} makes {most:g} 1/min at most: give less"
    refuse_first(motions, feed & (motions.spindle > most), lambda at: f"S{motions.spindle[at]:g}: {bound}")


def check_spindle_of_job(motions: Motions, dialect: Dialect, cutters: dict[int, Cutter]) -> None:
    """VerifyError at the first feed move with a spindle that turns faster than the job says for its cutter."""
    most = np.full(len(motions.tools), np.inf)
    for number, cutter in cutters.items():
        most[motions.tools == number] = cutter.spindle + dialect.numbers.spindle.step

    def why(at: int) -> str:
        cutter = cutters[int(motions.tools[at])]
        return f"S{motions.spindle[at]:g}: the job has {cutter.spindle:g} 1/min for {cutter.name}: give less"

    refuse_first(motions, ~motions.rapid & (motions.spindle > most), why)


def check_coolant(motions: Motions) -> None:
    """VerifyError at the first cut without coolant."""
    dry = ~motions.rapid & ~motions.links & ~motions.coolant
    why = "a cut without coolant, which the job asks for: switch it on before (M8), or nc.coolant = false"
    refuse_first(motions, dry, lambda _: why)


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


SAME_SIZE = 1e-3
"""Sizes of a tool that differ by less (mm) are the same: headers tell ten times as much."""


def check_control(motions: Motions, machine: Machine, dialect: Dialect, job: Job | None = None) -> None:
    """VerifyError with the `line` of the first move of a kind that the control would refuse, or that would cut
    otherwise than meant, with the remedy; ProgramError where the text calls tools that the `job` has not."""
    check_limits(motions, machine)
    check_spindle(motions, machine, dialect)
    check_feed_mode(motions, dialect)
    if job is None:
        check_feeds(motions, machine, dialect)
        return
    cutters = {cutter.number: cutter for cutter in cutters_of(job, machine)}
    _check_tools(motions, cutters)
    tools_of(motions, list(cutters.values()))
    check_spindle_of_job(motions, dialect, cutters)
    quick = {number: replace(one, feed=job.fastest_feed(one.name)) for number, one in cutters.items()}
    check_feeds_of_job(motions, dialect, job, quick)
    check_tolerance(motions, dialect, job)
    if job.nc.coolant:
        check_coolant(motions)


def _check_tools(motions: Motions, cutters: dict[int, Cutter]) -> None:
    """VerifyError where the header describes a tool otherwise than the job."""
    for number, reported in motions.described.items():
        if number not in cutters:
            continue
        meant = cutters[number]
        for name, value, wanted in (
            ("radius", reported.radius, meant.radius),
            ("corner radius", reported.arc, meant.corner),
            ("length", reported.length, meant.length),
        ):
            if abs(value - wanted) > SAME_SIZE:
                what = f"tool {number} has a {name} of {value:g} mm here, of {wanted:g} mm in the job"
                remedy = "give the job that the program was made with"
                raise VerifyError(
                    f"line {reported.line}: {what}: {remedy}", line=reported.line, place=None, error=abs(value - wanted)
                )


def check_tolerance(motions: Motions, dialect: Dialect, job: Job) -> None:
    """VerifyError at the first feed move under a contour tolerance (mm) larger than the job's for roughing, or left to
    the control. Nothing is known where the dialect has no words for it."""
    most = contour_tolerance(dialect, job, finishing=False)
    wide = ~motions.rapid & (motions.tolerances > most + dialect.numbers.length.step)

    def why(at: int) -> str:
        value = motions.tolerances[at]
        message = f"is {value:g} mm" if np.isfinite(value) else "is left to the control"
        return f"the contour tolerance {message}, the job allows {most:g} mm: correct it in a line before"

    refuse_first(motions, wide, why)
