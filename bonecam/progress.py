"""The progress of long work, reported to a function `progress(fraction, message)`, the fraction from 0 to 1;
where it returns False the work is cancelled."""

import logging
from collections.abc import Callable

from bonecam.errors import Cancelled

log = logging.getLogger("bonecam")
Progress = Callable[[float, str], bool | None]


def silent(fraction: float, message: str) -> None:
    """Ignore the report: the progress of work that nobody watches."""


def report(progress: Progress, fraction: float, message: str) -> None:
    """Call `progress`, and log the message for who debugs; raises Cancelled where `progress` returns False."""
    log.debug("%s", message)
    if progress(fraction, message) is False:
        raise Cancelled(f"cancelled at {message}")


def part(progress: Progress, start: float, end: float) -> Progress:
    """A progress for one stage, whose fractions from 0 to 1 fill [start, end] of the whole."""
    return lambda fraction, message: progress(start + (end - start) * fraction, message)


def rising(progress: Progress) -> Progress:
    """A progress that reports the largest fraction so far, for work whose rounds cannot be counted
    beforehand."""
    highest = 0.0

    def report_highest(fraction: float, message: str) -> bool | None:
        nonlocal highest
        highest = max(highest, fraction)
        return progress(highest, message)

    return report_highest
