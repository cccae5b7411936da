"""The verdict on a text as its control would run it: limits of axes, feeds, spindle; with its job also coolant, and
feeds, speeds and lengths of tools other than the job's."""

from dataclasses import replace

import numpy as np

from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.tolerances import contour_tolerance
from bonecam.nc.reading.motions import Motions
from bonecam.tool.cutter import Cutter
from bonecam.verify.control.axis_limits import check_limits
from bonecam.verify.control.feeds import check_feed_mode, check_feeds, check_feeds_of_job
from bonecam.verify.control.first_wrong import refuse_first
from bonecam.verify.control.spindle import check_coolant, check_spindle, check_spindle_of_job
from bonecam.verify.removal.groups import tools_of
from bonecam.verify.removal.of_job import cutters_of

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
                    f"line {reported.line}: {what}: {remedy}",
                    line=reported.line,
                    place=None,
                    error=abs(value - wanted),
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
