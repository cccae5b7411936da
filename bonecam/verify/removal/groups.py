"""The moves of a program level by level, as the comments of its text name the levels."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.motions import Motions


@dataclass(frozen=True, eq=False)
class Group:
    """Consecutive moves (m,) of one cutter on one level; `level` is None where no comment names one."""

    level: int | None
    tool: int
    moves: Int[ndarray, " m"]


def groups_of(text: str, motions: Motions, dialect: Dialect) -> Iterator[Group]:
    """The moves in their order, divided where the level or the cutter changes."""
    marks = list(_level_comments(text, dialect))
    numbers = np.array([-1, *(level for _, level in marks)])
    lines = np.array([line for line, _ in marks], dtype=np.int64)
    levels = numbers[np.searchsorted(lines, motions.lines)]
    changes = (np.diff(levels) != 0) | (np.diff(motions.tools) != 0)
    for moves in np.split(np.arange(len(levels)), np.flatnonzero(changes) + 1):
        level = int(levels[moves[0]])
        yield Group(None if level < 0 else level, int(motions.tools[moves[0]]), moves)


def _level_comments(text: str, dialect: Dialect) -> Iterator[tuple[int, int]]:
    """Line (from 1) and number of each comment that begins a level, as `posting.write` writes them."""
    comment = re.escape(dialect.comment.replace("{text}", "TEXT")).replace("TEXT", r"LEVEL (\d+)")
    pattern = re.compile(rf"^(?:\d+ )?{comment}$", re.MULTILINE)
    line = 1
    at = 0
    for found in pattern.finditer(text):
        line += text.count("\n", at, found.start())
        at = found.start()
        yield line, int(found[1])


def feed_minutes(motions: Motions) -> Float[ndarray, " n"]:
    """The time of each feed move, as its feed and the speeds of the machine's rotary axes allow; 0 for rapids
    and moves whose start is unknown."""
    machine = motions.controls[int(motions.tools[0])].machine
    length = np.r_[0.0, np.linalg.norm(np.diff(motions.tips, axis=0), axis=1)]
    with np.errstate(divide="ignore", invalid="ignore"):
        by_feed = np.where(motions.inverse_time, 1 / motions.feed_rates, length / motions.feed_rates)
    turns = np.abs(np.diff(motions.words[:, 3:], axis=0, prepend=motions.words[:1, 3:]))
    by_axes = (turns / np.array([axis.speed for axis in machine.rotary])).max(1)
    return np.where(motions.rapid | ~motions.known_start, 0.0, np.maximum(by_feed, by_axes))
