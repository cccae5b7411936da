"""The moves of a program level by level, as the comments of its text name the levels."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import ProgramError
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.motions import Motions
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import PARTING

AIR = 1e-4
"""A feed move that removes less is in air, mm^3: a hundredth of a move of 0.2 mm at a depth of 0.1."""
RUBBING = 0.02
"""A cutter that goes less deep rubs rather than cuts, mm: about the radius of its edges."""


@dataclass(frozen=True, eq=False)
class Group:
    """Consecutive moves (m,) of one cutter on one level; `level` is None where no comment names one. `rest` numbers
    the rest paths of the level from 1; 0 is its own path. That of PARTING numbers its steps."""

    level: int | None
    rest: int
    tool: int
    moves: Int[ndarray, " m"]


def groups_of(text: str, motions: Motions, dialect: Dialect) -> Iterator[Group]:
    """The moves in their order, divided where the path or the cutter changes."""
    marks = list(_level_comments(text, dialect))
    names: list[tuple[int | None, int]] = [(None, 0), *((level, rest) for _, level, rest in marks)]
    lines = np.array([line for line, *_ in marks], dtype=np.int64)
    mark = np.searchsorted(lines, motions.lines)
    changes = (np.diff(mark) != 0) | (np.diff(motions.tools) != 0)
    for moves in np.split(np.arange(len(mark)), np.flatnonzero(changes) + 1):
        level, rest = names[mark[moves[0]]]
        yield Group(level, rest, int(motions.tools[moves[0]]), moves)


def _level_comments(text: str, dialect: Dialect) -> Iterator[tuple[int, int, int]]:
    """Line (from 1), level and number of the rest path of each comment that begins a path, as `posting.write` writes
    them."""
    words = r"(?:LEVEL (\d+)(?: REST (\d+))?|PARTING (\d+))"
    comment = re.escape(dialect.comment.replace("{text}", "TEXT")).replace("TEXT", words)
    pattern = re.compile(rf"^(?:\d+ )?{comment}$", re.MULTILINE)
    line = 1
    at = 0
    for match in pattern.finditer(text):
        line += text.count("\n", at, match.start())
        at = match.start()
        yield line, *((PARTING, int(match[3])) if match[3] else (int(match[1]), int(match[2] or 0)))


def motion_lengths(motions: Motions) -> Float[ndarray, " n"]:
    """How far the tip goes in each move, mm, along the straight line between its ends."""
    return np.r_[0.0, np.linalg.norm(np.diff(motions.tips, axis=0), axis=1)]


def feed_minutes(motions: Motions) -> Float[ndarray, " n"]:
    """The time of each feed move, as its feed and the speeds of the machine's rotary axes allow; 0 for rapids
    and moves whose start is unknown."""
    machine = motions.controls[int(motions.tools[0])].machine
    length = motion_lengths(motions)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_feed = np.where(motions.inverse_time, 1 / motions.feed_rates, length / motions.feed_rates)
    turns = np.abs(np.diff(motions.words[:, 3:], axis=0, prepend=motions.words[:1, 3:]))
    by_axes = (turns / np.array([axis.speed for axis in machine.rotary])).max(1)
    return np.where(motions.rapid | ~motions.known_start, 0.0, np.maximum(by_feed, by_axes))


def time_shares(
    moves: Int[ndarray, " m"],
    minutes: Float[ndarray, " n"],
    volumes: Float[ndarray, " n"],
    motions: Motions,
    radius: float,
) -> tuple[float, float]:
    """Shares of the feed time of some moves of a ball of `radius` (mm): in air, of all; and rubbing, of those that are
    no links, where less goes than from a plane by a ball that enters it by RUBBING. `minutes` are
    those of all moves of the text, `volumes` (mm^3) what they remove."""
    cuts = moves[~motions.links[moves]]
    reach = radius - RUBBING
    section = radius**2 * np.arccos(reach / radius) - reach * np.sqrt(radius**2 - reach**2)
    rubs = volumes[cuts] < section * motion_lengths(motions)[cuts]
    return _share(minutes[moves], volumes[moves] < AIR), _share(minutes[cuts], rubs)


def _share(minutes: Float[ndarray, " m"], which: Bool[ndarray, " m"]) -> float:
    total = float(minutes.sum())
    return float(minutes[which].sum()) / total if total > 0 else 0.0


def link_volumes(
    volumes: Float[ndarray, " n"], links: Bool[ndarray, " n"]
) -> tuple[Float[ndarray, " k"], Int[ndarray, " k"]]:
    """What each link removes, mm^3, and its move that removes most; a link is a stretch of consecutive feed moves
    behind a comment LINK of the text."""
    begins = np.flatnonzero(links & ~np.r_[False, links[:-1]])
    ends = np.flatnonzero(links & ~np.r_[links[1:], False]) + 1
    removed = np.array([volumes[a:b].sum() for a, b in zip(begins, ends, strict=True)])
    most = np.array([a + int(np.argmax(volumes[a:b])) for a, b in zip(begins, ends, strict=True)], dtype=np.int64)
    return removed, most


def tools_of(motions: Motions, cutters: Sequence[Cutter]) -> dict[int, Cutter]:
    """The cutters by number; ProgramError where the text describes one otherwise."""
    if not len(motions.tips):
        raise ProgramError("the program moves nothing: there is no removal to simulate", line=0)
    known = {cutter.number: cutter for cutter in cutters}
    for number in np.unique(motions.tools).tolist():
        radius = motions.controls[number].radius
        if number not in known or abs(known[number].envelope_radius - radius) > 1e-4:
            have = f"of radius {known[number].envelope_radius:g} mm" if number in known else "not there"
            raise ProgramError(
                f"the text calls tool {number} with a ball of radius {radius:g} mm, which is {have} in the job: "
                "give the job that the program was made with",
                tool=number,
            )
    return known
