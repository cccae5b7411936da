"""Progress is a parameter: `progress(fraction, message)`, silent by default; False cancels."""

from collections.abc import Callable

from bonecam.errors import Cancelled

Progress = Callable[[float, str], bool | None]


def silent(fraction: float, message: str) -> None:
    """Report nothing."""


def report(progress: Progress, fraction: float, message: str) -> None:
    """Tell `progress`, and raise Cancelled where it answers False."""
    if progress(fraction, message) is False:
        raise Cancelled(f"cancelled at {message}")


def part(progress: Progress, start: float, end: float) -> Progress:
    """A progress for one stage that fills [start, end] of the whole."""
    return lambda fraction, message: progress(start + (end - start) * fraction, message)


def rising(progress: Progress) -> Progress:
    """The same progress, told the largest fraction so far: of work whose rounds cannot be counted
    beforehand."""
    highest = 0.0

    def told(fraction: float, message: str) -> bool | None:
        nonlocal highest
        highest = max(highest, fraction)
        return progress(highest, message)

    return told
