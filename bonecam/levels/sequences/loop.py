"""The loop that makes a sequence of levels, each from the one before, until less than one depth is left to the
stock. The closed morph, the published program and the morph of an open surface all go through it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError, place_name
from bonecam.job.levels_section import MOST_LEVELS
from bonecam.progress import Progress, report
from bonecam.setup.schedule import Schedule

STALL = 0.25
"""A level stalls that brings the stock nearer by less than this share of its depth."""


@runtime_checkable
class Rest(Protocol):
    """What is left between a level and the stock."""

    @property
    def left(self) -> float:
        """The largest distance between the two, mm."""

    @property
    def place(self) -> Float[ndarray, "3"]:
        """Where that is."""


AnyLevel = TypeVar("AnyLevel")
AnyRest = TypeVar("AnyRest", bound=Rest)


@dataclass(frozen=True)
class Stop:
    """When a sequence ends that does not get to the stock: after more than `max_stalled` stalled levels in turn, or
    with level `most`; `remedy` ends the message."""

    remedy: str
    max_stalled: int = MOST_LEVELS
    most: int = MOST_LEVELS


def levels_to_stock(
    made: Sequence[AnyLevel],
    rest: AnyRest,
    schedule: Schedule,
    next_level: Callable[[AnyLevel, int, AnyRest], AnyLevel],
    rest_above: Callable[[AnyLevel, int, AnyRest], AnyRest],
    stop: Stop,
    progress: Progress,
    *,
    lower_bound: int,
    least: int = 0,
) -> list[AnyLevel]:
    """The levels `made` (0, 1, ...) and those above them, up to the last below the stock; `least` in all at least.

    `rest` is what is left above the last one made. `next_level` makes level k from the one before and what is left
    above that; `rest_above` measures what is left above level k. `lower_bound` is K_min, for the progress told.
    LevelError, with the number of the level, where one cannot be made or the sequence stops short of the stock.
    """
    levels = list(made)
    stalled = 0
    while len(levels) < least or rest.left > schedule.limit(len(levels)):
        k = len(levels)
        report(progress, min(1.0, k / lower_bound), f"level {k}")
        try:
            levels.append(next_level(levels[-1], k, rest))
        except LevelError as error:
            if "level" in error.evidence:
                raise
            raise LevelError(f"level {k}: {error}", level=k, **error.evidence) from error

        before = rest
        rest = rest_above(levels[-1], k, before)
        stalled = stalled + 1 if stalls(before, rest, schedule.limit(k)) else 0
        if stalled > stop.max_stalled or k >= stop.most:
            raise LevelError(
                f"level {k} gets no nearer to the stock than {rest.left:.3f} mm at "
                f"{place_name(rest.place)}: {stop.remedy}",
                level=k,
                place=rest.place,
            )
    return levels


def stalls(before: Rest, after: Rest, depth: float) -> bool:
    """Whether a level whose cut may be `depth` mm deep leaves nearly as much to the stock as the one before."""
    return after.left > before.left - STALL * depth
