"""A posted program: its text, and the counts and times of its blocks.

Words that give the tool's direction as a vector: what is written of it, and the rotary angles that the control
takes.

The vector leads from the tip to the spindle, along the axes of the machine as they stand with all rotary axes at zero,
as X, Y, Z do. Of the two solutions, and of the whole turns of each axis, the control takes those nearest to where its
axes stand, within their limits; an axis that every angle suits stays.
"""

import re
import unicodedata
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import FileError, MachineError
from bonecam.files import second_file
from bonecam.job.levels_section import MOST_LEVELS
from bonecam.machine.kinematics import LIMIT_GUARD, inverse_rotary, tool_axes
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.schema import VectorTable
from bonecam.text.pattern import Pattern

SECOND, PART, PROBE = len("_second"), len(f"_{MOST_LEVELS}"), len("_probe")
"""Characters by which names of programs of a second clamping, of parts of a program, and of a touch probe's program are
longer."""
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
    accelerations or seconds; `by_hand` so many tool changes are not in it. `blank`: of the axes', to mill stock and
    neck from the bar. `tools`: of each tool in the order of the program, as far as the axes are known. `assumed`: what
    the machine's file assumes of the figures that they are made of."""

    feed: float
    tools: tuple[float, ...] = ()
    axes: float | None = None
    whole: float | None = None
    by_hand: int = 0
    assumed: tuple[str, ...] = ()
    blank: float = 0.0

    def __str__(self) -> str:
        text = f"about {self.feed:.1f} min at the feed"
        if self.axes is not None:
            text += f", {self.axes:.1f} as the axes move"
        if self.blank:
            text += f" ({self.blank:.1f} of it to mill stock and neck)"
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
        figures["time_blank_min"] = self.blank
        rounded = {name: None if value is None else round(value, 2) for name, value in figures.items()}
        return {**rounded, "time_texts": self.texts}


@dataclass(frozen=True, repr=False)
class Program:
    """An NC program as text, ending with a newline, with its name, and its number where a control calls it by one.

    `blocks` are its blocks (comments and continued blocks count once), `moves` the blocks that move an axis.
    `rewinds` is how often rotary axes are rewound off the part, `lifts` how often the path is lifted for it
    between two rapids. `rotary_max_deg_per_block` is the largest turn of one axis in a feed move, `tools` the cutter
    numbers in their order, `air_check` what its header tells of the rotary axes. Its zero is `zero_height` (mm) above
    that of the part's frame.
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
    zero_height: float

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


def check_file_name(file: Path, dialect: Dialect, *, second: bool, split: bool, probe: bool) -> None:
    """FileError where the control of a dialect takes no program of a file's name, nor those of its `second` clamping
    and, where it is `split`, its parts, nor that of its `probe`, which are longer; it names one that it takes."""
    longest = dialect.file_name.longest - max(SECOND * second + PART * split, PROBE * probe)
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


UNIT = 1e-4
"""A vector is a unit vector where its length differs from 1 by less."""
PARTS = (0.25, 0.5, 0.75, 1.0)
"""Where within a move the tool's direction is looked at."""
LEANS = 5e-4
"""By how much the tool may lean otherwise than meant (rad): 1 um on a ball of 2 mm."""
LEAST = np.radians(0.001)
"""A tool on the axis of a table is leant by this (rad), one step of the words of angles: its vector then says how the
table stands, within 2 degrees where it has 6 decimals."""
TURNED = np.radians(1.0)
"""An axis that the control would turn by more (rad) beside what was planned needs its angle in words: at the pole,
where vectors do not say how the table stands."""


def vectors_of(machine: Machine, vector: VectorTable, angles: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
    """The components of the tool's directions at rotary angles (rad), as they are written."""
    return vector.number.rounded(machine.in_machine(tool_axes(machine, angles)))


def solved_angles(
    machine: Machine,
    vectors: Float[ndarray, "n 3"],
    before: Float[ndarray, "2"],
    stated: Float[ndarray, "n 2"] | None = None,
) -> tuple[Float[ndarray, "n 2"], Bool[ndarray, "n"]]:
    """The rotary angles (rad, unwound) that a control takes one after the other from those `before`, NaN from the first
    vector on that is no unit vector, or is not reached; and, where angles are `stated` that should be taken, which rows
    are off by more than TURNED: behind these it goes on from what is stated."""
    length = np.linalg.norm(vectors, axis=1)
    axes = machine.in_part(vectors / np.where(length > 0, length, 1.0)[:, None])
    pairs, free = inverse_rotary(machine, axes)
    pairs[np.abs(length - 1) >= UNIT] = np.nan
    bounds = [axis.limits for axis in machine.rotary]
    meant = [] if stated is None else stated.tolist()
    angles = np.full((len(vectors), 2), np.nan)
    off = np.zeros(len(vectors), dtype=bool)
    stand = (float(before[0]), float(before[1]))
    for row, (solutions, stays) in enumerate(zip(pairs.tolist(), free.tolist(), strict=True)):
        nearest = None
        travel = np.inf
        for solution in solutions:
            # its angles in the turns nearest to where the axes stand, and the way to them; infinite beyond the limits
            there = [0.0, 0.0]
            way = 0.0
            for column in (0, 1):
                if stays[column]:
                    there[column] = stand[column]
                    continue
                turn = (solution[column] - stand[column] + np.pi) % (2 * np.pi) - np.pi
                low, high = bounds[column]
                there[column] = stand[column] + turn
                inside = low - LIMIT_GUARD <= there[column] <= high + LIMIT_GUARD
                way += abs(turn) if inside else np.inf
            if way < travel:
                nearest, travel = (there[0], there[1]), way
        if meant:
            one, two = meant[row]
            if nearest is None or max(abs(nearest[0] - one), abs(nearest[1] - two)) > TURNED:
                off[row] = True
                nearest = (one, two)
        if nearest is None:
            break
        angles[row] = stand = nearest
    return angles, off


def angles_from(
    machine: Machine, stand_deg: Sequence[float | None]
) -> Callable[[Float[ndarray, "n 3"]], Float[ndarray, "n 2"]]:
    """What gives the angles (degrees) of `solved_angles` from where the axes stand, None: not known, then NaN."""
    before = np.radians([np.nan if angle is None else angle for angle in stand_deg])
    return lambda vectors: np.degrees(solved_angles(machine, vectors, before)[0])


def written_vectors(
    machine: Machine, vector: VectorTable, words: Float[ndarray, "n 5"]
) -> tuple[Float[ndarray, "n 6"], Bool[ndarray, "n"]]:
    """X, Y, Z and the tool's direction of successive words (mm, deg), as they are written, and which of them must be
    written as rotary words, since the control would turn an axis otherwise. Where it takes none, the tool is leant by
    LEAST at the pole; MachineError where it would lean otherwise than meant on the way all the same."""
    angles = np.radians(words[:, 3:])
    vectors = vectors_of(machine, vector, angles)
    solved, off = solved_angles(machine, vectors, angles[0], angles)
    if vector.takes_angles or not off.any():
        return np.column_stack([words[:, :3], vectors]) + 0.0, off
    vectors = vectors_of(machine, vector, _leant(machine, vectors, angles))
    solved, _ = solved_angles(machine, vectors, angles[0])
    # By how much (rad) the tool leans otherwise within each move between successive angles, at most
    leans = [
        lengths(
            tool_axes(machine, (1 - part) * solved[:-1] + part * solved[1:])
            - tool_axes(machine, (1 - part) * angles[:-1] + part * angles[1:])
        )
        for part in PARTS
    ]
    wrong = ~(np.max(leans, axis=0) <= LEANS)
    if wrong.any():
        row = int(np.argmax(wrong)) + 1
        tilt = ", ".join(
            f"{axis.letter} {value:.3f}" for axis, value in zip(machine.rotary, words[row, 3:], strict=True)
        )
        raise MachineError(
            f"near {tilt} deg a tool vector does not say how the axes of {machine.name} stand, the control may turn "
            'them otherwise: give nc.axes = "angles", or another path.lead_deg',
            row=row,
        )
    return np.column_stack([words[:, :3], vectors]) + 0.0, np.zeros(len(words), dtype=bool)


def _leant(machine: Machine, vectors: Float[ndarray, "n 3"], angles: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """The angles (rad) with the tool leant by LEAST where every angle of an axis gives its direction: then it says
    which one is meant."""
    axes = machine.in_part(vectors)
    _, free = inverse_rotary(machine, axes / lengths(axes)[:, None], LEAST)
    leant = angles.copy()
    for column in (0, 1):
        rows = free[:, 1 - column] & (np.abs(angles[:, column]) < LEAST)
        # on the side from which, or to which, the tool leans beside these rows
        sides = np.where(rows, 0.0, np.sign(angles[:, column]))
        last = np.maximum.accumulate(np.where(sides != 0, np.arange(len(sides)), -1))
        before = np.where(last >= 0, sides[np.maximum(last, 0)], 0.0)
        free_side = -1.0 if machine.rotary[column].limits[0] < -LEAST else 1.0
        leant[:, column] = np.where(rows, np.where(before == 0, free_side, before) * LEAST, angles[:, column])
    return leant


def vector_formats(dialect: Dialect, vector: VectorTable) -> list[str]:
    """The printf formats of X, Y, Z and the components of the tool's direction."""
    length = [f"{letter}{dialect.numbers.length.spec}" for letter in "XYZ"]
    return length + [word.replace("%", "%%").format(number=vector.number.spec) for word in vector.words]


def vector_patterns(vector: VectorTable, number: str) -> list[str]:
    """The patterns of the words of the tool's direction, with their numbers, of the pattern `number`, in groups."""
    return [re.escape(word.replace("{number}", "")) + f"({number})" for word in vector.words]
