"""Cutter location data in APT words (ISO 4343), read; `cl_text.py` writes them.

One statement a line, `WORD` or `WORD/minor words and numbers, separated by commas`; `$$` begins a comment, `$` at the
end of a line continues it. GOTO has the tip of the tool and its axis (unit, from the tip to the spindle); RAPID is for
the next GOTO alone. Feeds behind PPRINT/LINK lead from cut to cut until PPRINT/CUT; a text without them does not tell
links from cuts.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import ProgramError
from bonecam.tool.path import PARTING

STATEMENT = re.compile(r"([A-Z][A-Z0-9]*)\s*(?:/(.*))?")
NUMBER = re.compile(r"[+-]?(?:\d{1,12}\.?\d{0,20}|\.\d{1,20})(?:[Ee][+-]?\d{1,2})?")
PASSED_OVER = frozenset({"SPINDL", "COOLNT", "MULTAX", "TLAXIS", "INSERT", "REMARK", "DISPLY", "STOP", "OPSTOP", "END"})
"""Words that say nothing of where the tool goes."""
INCH = 25.4
UNIT_TOLERANCE = 1e-4
"""An axis whose length is off by more is no unit vector."""
LONGEST = 1000
"""Characters of a statement at most."""


@dataclass(frozen=True, eq=False)
class ClPath:
    """The moves of one tool on one level (None where the text names none): the tip and axis that each arrives at, its
    feed (mm/min; NaN for a rapid) and whether it is one. `links` are feeds behind PPRINT/LINK; None where the text does
    not tell links from cuts.

    `diameter` and `corner` (radius) of the cutter, mm; of a ball the corner is half of the diameter.
    """

    level: int | None
    tool: int
    diameter: float
    corner: float
    tips: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    feed_rates: Float[ndarray, " n"]
    rapid: Bool[ndarray, " n"]
    links: Bool[ndarray, " n"] | None


@dataclass(frozen=True, eq=False)
class ClData:
    """A part's name and the paths of its tools in machining order."""

    name: str
    paths: tuple[ClPath, ...]


def read_apt(text: str) -> ClData:
    """The cutter locations of an APT text, in mm.

    ProgramError, with the `line`, where a statement is damaged, a word is not known, a number is missing or too much,
    an axis is no unit vector, no tool or no feed is known, or the text ends before FINI.
    """
    reader = _Reader()
    for line, word, values in _statements(text):
        if reader.ended:
            raise ProgramError(f"line {line}: {word} behind FINI: end the text there", line=line)
        reader.take(line, word, values)
    if not reader.ended:
        line = text.count("\n") + 1
        raise ProgramError(f"line {line}: the text ends without FINI: it is cut off, write it again", line=line)
    return ClData(reader.name, tuple(reader.paths()))


def _statements(text: str) -> Iterator[tuple[int, str, str]]:
    """Line, word, and what follows its slash, of each statement."""
    begun, first = "", 0
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.split("$$")[0].strip()
        first = first if begun else number
        if line.endswith("$"):
            begun += line[:-1].strip()
        else:
            statement = begun + line
            begun = ""
            if statement:
                yield (first, *_divided(statement, first))
        if len(begun) > LONGEST:
            raise ProgramError(f"line {first}: a statement of over {LONGEST} characters: divide it", line=first)
    if begun:
        raise ProgramError(f"line {first}: the text ends in the middle of a statement: write it again", line=first)


def _divided(statement: str, line: int) -> tuple[str, str]:
    match = STATEMENT.fullmatch(statement) if len(statement) <= LONGEST else None
    if match is None:
        raise ProgramError(f"line {line}: {statement[:40]!r} is no APT statement: give WORD or WORD/values", line=line)
    return match[1], (match[2] or "").strip()


@dataclass(eq=False)
class _Reader:
    """What the statements so far say."""

    name: str = ""
    ended: bool = False
    scale: float = 1.0
    level: int | None = None
    tool: int | None = None
    cutter: tuple[float, float] = (0.0, 0.0)
    feed: float = math.nan
    rapid: bool = False
    link: bool | None = None
    rows: list[tuple[tuple, tuple[float, ...]]] = field(default_factory=list)

    def take(self, line: int, word: str, values: str) -> None:
        """Take one statement."""
        if word in PASSED_OVER:
            return
        if word == "PARTNO":
            self.name = values
        elif word == "PPRINT":
            # Take what is said of the moves that follow; any other text is passed over
            match = re.fullmatch(r"LEVEL (\d{1,6})|PARTING", values)
            if match:
                self.level = int(match[1] or PARTING)
            elif values in ("LINK", "CUT"):
                self.link = values == "LINK"
        elif word == "UNITS":
            if values not in ("MM", "INCHES"):
                raise ProgramError(f"line {line}: UNITS/{values[:20]}: give MM or INCHES", line=line)
            self.scale = INCH if values == "INCHES" else 1.0
        elif word == "RAPID":
            self.rapid = True
        elif word == "FINI":
            self.ended = True
        else:
            self._numbers(line, word, values.split(","))

    def _numbers(self, line: int, word: str, values: list[str]) -> None:
        """Take a statement of numbers."""
        if word == "LOADTL":
            number = _number(line, word, values[0])
            if number != int(number) or number < 0:
                raise ProgramError(f"line {line}: LOADTL/{values[0]}: give the tool's number", line=line)
            self.tool = int(number)
        elif word == "CUTTER":
            sizes = [self.scale * _number(line, word, value) for value in values]
            if not (sizes[0] > 0 and all(0 <= size <= sizes[0] / 2 for size in sizes[1:2])):
                raise ProgramError(
                    f"line {line}: CUTTER/{','.join(values)[:40]}: give a diameter and a corner that fits it", line=line
                )
            self.cutter = (sizes[0], sizes[1] if len(sizes) > 1 else 0.0)
        elif word == "FEDRAT":
            self._feed(line, values)
        elif word in ("GOTO", "FROM"):
            self._goto(line, word, [_number(line, word, value) for value in values])
        else:
            raise ProgramError(f"line {line}: the word {word} is not known here: give straight moves (GOTO)", line=line)

    def _feed(self, line: int, values: list[str]) -> None:
        units = [value.strip() for value in values if not NUMBER.fullmatch(value.strip())]
        numbers = [value for value in values if NUMBER.fullmatch(value.strip())]
        if len(numbers) != 1 or not set(units) <= {"MMPM", "IPM", "PERMIN"}:
            raise ProgramError(f"line {line}: FEDRAT/{','.join(values)[:40]}: give MMPM and one number", line=line)
        unit = 1.0 if "MMPM" in units else INCH if "IPM" in units else self.scale
        self.feed = unit * _number(line, "FEDRAT", numbers[0])
        if not self.feed > 0:
            raise ProgramError(f"line {line}: a feed of {self.feed:g} mm/min: give a positive one", line=line)

    def _goto(self, line: int, word: str, values: list[float]) -> None:
        if len(values) not in (3, 6):
            raise ProgramError(f"line {line}: {word} with {len(values)} numbers: give x, y, z, i, j, k", line=line)
        axis = tuple(values[3:]) or (0.0, 0.0, 1.0)
        if abs(math.hypot(*axis) - 1) > UNIT_TOLERANCE:
            raise ProgramError(f"line {line}: the tool axis {axis} is no unit vector", line=line)
        if self.tool is None or not self.cutter[0]:
            raise ProgramError(f"line {line}: {word} before LOADTL and CUTTER: name the tool first", line=line)
        rapid = self.rapid or word == "FROM"
        if not rapid and math.isnan(self.feed):
            raise ProgramError(f"line {line}: {word} without a feed: give FEDRAT or RAPID before it", line=line)
        feed = math.nan if rapid else self.feed
        tip = (self.scale * value for value in values[:3])
        self.rows.append(
            ((self.level, self.tool, *self.cutter), (*tip, *axis, feed, float(rapid), float(bool(self.link))))
        )
        self.rapid = False

    def paths(self) -> Iterator[ClPath]:
        """The moves, divided where level or tool changes."""
        starts = [k for k in range(len(self.rows)) if k == 0 or self.rows[k][0] != self.rows[k - 1][0]]
        for first, last in zip(starts, [*starts[1:], len(self.rows)]):
            table = np.array([numbers for _, numbers in self.rows[first:last]])
            axes = table[:, 3:6] / lengths(table[:, 3:6])[:, None]
            level, tool, diameter, corner = self.rows[first][0]
            yield ClPath(
                level,
                tool,
                diameter,
                corner,
                tips=table[:, :3],
                axes=axes,
                feed_rates=table[:, 6],
                rapid=table[:, 7] > 0,
                links=None if self.link is None else table[:, 8] > 0,
            )


def _number(line: int, word: str, value: str) -> float:
    """A finite number of a statement."""
    if not NUMBER.fullmatch(value.strip()):
        raise ProgramError(f"line {line}: {word} with {value.strip()[:20]!r}: give a number", line=line)
    return float(value.strip())
