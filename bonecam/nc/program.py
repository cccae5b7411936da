"""A posted program: its text, and the counts and times of its blocks."""

import re
import unicodedata
import zlib
from dataclasses import dataclass
from pathlib import Path

from bonecam.errors import FileError
from bonecam.files import second_file
from bonecam.job.levels_section import MOST_LEVELS
from bonecam.nc.dialect import Dialect
from bonecam.text.pattern import Pattern

SECOND, PART = len("_second"), len(f"_{MOST_LEVELS}")
"""Characters by which names of programs of a second clamping, and of parts of a program, are longer."""
HIGHEST_NUMBER = 7999
"""Programs of higher numbers belong to the maker of the machine (Fanuc: 8000 and 9000)."""
LOWEST_DRAWN = 1000
"""Lower numbers are left to programs that are called by hand."""
NUMBERS = HIGHEST_NUMBER + 1 - LOWEST_DRAWN
"""How many numbers a program may draw."""


@dataclass(frozen=True)
class FeedFigures:
    """The feeds of a program's cutting blocks: median and what a tenth of them are below, mm/min, as the axes drive
    them; `limited` is the share of them on which the cutter's feed asks more than an axis can, `beyond` the share
    whose own feed does; `under_half` of them are driven at less than half of the cutter's feed."""

    median: float
    low: float
    limited: float
    beyond: float
    under_half: int


@dataclass(frozen=True)
class ProgramTime:
    """Minutes of a program: `feed`, at its feeds and axis speeds alone; `axes`, as the axes drive it, and `whole`, with
    the ways from run to run, tool changes and spindle starts, None where the machine's file does not know
    accelerations or seconds; `by_hand` so many tool changes are not in it. `tools`: of each tool in the order of the
    program, as far as the axes are known. `assumed`: what the machine's file assumes of the figures that they are made
    of."""

    feed: float
    tools: tuple[float, ...] = ()
    axes: float | None = None
    whole: float | None = None
    by_hand: int = 0
    assumed: tuple[str, ...] = ()

    def __str__(self) -> str:
        text = f"about {self.feed:.1f} min at the feed"
        if self.axes is not None:
            text += f", {self.axes:.1f} as the axes move"
        if self.whole is not None:
            text += f", {self.whole:.1f} with changes"
        return text + (f" but {self.by_hand} by hand" if self.whole is not None and self.by_hand else "")

    @property
    def texts(self) -> list[str]:
        """The minutes, and what of the machine is assumed for them."""
        return [str(self), *([f"assumed: {', '.join(self.assumed)}"] if self.assumed else [])]

    @property
    def report(self) -> dict[str, float | list[str] | None]:
        """What the report tells of it."""
        figures = {"time_min": self.feed, "time_axes_min": self.axes, "time_whole_min": self.whole}
        rounded = {name: None if value is None else round(value, 2) for name, value in figures.items()}
        return {**rounded, "time_texts": self.texts}


@dataclass(frozen=True, repr=False)
class Program:
    """An NC program as text, ending with a newline, with its name, and its number where a control calls it by one.

    `blocks` are its blocks (comments and continued blocks count once), `moves` the blocks that move an axis.
    `rewinds` is how often rotary axes are rewound off the part, `lifts` how often the path is lifted for it
    between two rapids. `rotary_max_deg_per_block` is the largest turn of one axis in a feed move, `tools` the cutter
    numbers in their order, `air_check` what its header tells of the rotary axes.
    """

    text: str
    name: str
    number: int
    machine: str
    controller: str
    extension: str
    blocks: int
    moves: int
    split_moves: int
    rewinds: int
    lifts: int
    tools: tuple[int, ...]
    time: ProgramTime
    feeds: FeedFigures
    rotary_max_deg_per_block: float
    air_check: tuple[str, ...]

    @property
    def time_min(self) -> float:
        """Minutes at its feeds."""
        return self.time.feed

    def __repr__(self) -> str:
        return (
            f"<Program {self.name} for {self.machine} and {self.controller}: {self.blocks} blocks, "
            f"{self.time_min:.1f} min>"
        )


def second_program_file(file: str | Path, dialect: Dialect) -> Path:
    """The file of the second clamping's program beside that of the first, with a name that the control takes."""
    dotted = second_file(file)
    taken = Pattern(dialect.file_name.pattern).match(dotted.stem) is not None
    return dotted if taken else second_file(file, "_")


def check_file_name(file: Path, dialect: Dialect, *, second: bool, split: bool) -> None:
    """FileError where the control of a dialect takes no program of a file's name, nor those of its `second` clamping
    and, where it is `split`, its parts, which are longer; it names one that it takes."""
    longest = dialect.file_name.longest - SECOND * second - PART * split
    pattern = Pattern(dialect.file_name.pattern)
    if len(file.stem) <= longest and pattern.match(file.stem) is not None:
        return
    spelt = file.stem.replace("ß", "ss")
    plain = unicodedata.normalize("NFKD", spelt).encode("ascii", "ignore").decode()
    words = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")
    named = words if pattern.match(words) is not None else f"BONE_{words}"
    proposed = f"{named[:longest].rstrip('_')}{file.suffix}"
    what = f"{dialect.name} loads names of {longest} characters at most that match {dialect.file_name.pattern}"
    raise FileError(f"{file}: {what}: name it {proposed}", file=str(file))


def program_name(file: str | Path, dialect: Dialect) -> str:
    """The name of the program in `file`, or of the program of the part in `file`; BONE where `file` is empty.

    It has capitals, digits and underscores only, which every control takes in a program's name, and no more of them
    than the dialect's.
    """
    return re.sub(r"[^A-Z0-9_]", "_", Path(file).stem.upper())[: dialect.file_name.longest] or "BONE"


def program_number(name: str) -> int:
    """The number of the program of a name, 1 to 7999, for controls that call programs by numbers: that of a name like
    O1234, else one that every name draws for itself from 1000 on, so that two programs of a part have two."""
    given = re.fullmatch(r"O([0-9]{1,4})", name)
    if given and 1 <= int(given[1]) <= HIGHEST_NUMBER:
        return int(given[1])
    return LOWEST_DRAWN + zlib.crc32(name.encode()) % NUMBERS
