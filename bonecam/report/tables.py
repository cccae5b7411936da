"""Tables that others read: cutter-location data (APT), contacts, cones, the rows of a batch.

Tool paths as cutter location data in APT words (ISO 4343), which other systems and post processors read.

Written are PARTNO, UNITS, MULTAX, PPRINT (level; LINK and CUT before feeds of that kind), LOADTL, CUTTER, SPINDL,
RAPID, FEDRAT, GOTO and FINI, in the frame of the tool paths. Other systems pass over PPRINT: to them links and cuts
are both feeds. They are read back below.

Cutter location data in APT words (ISO 4343), read.

One statement a line, `WORD` or `WORD/minor words and numbers, separated by commas`; `$$` begins a comment, `$` at the
end of a line continues it. GOTO has the tip of the tool and its axis (unit, from the tip to the spindle); RAPID is for
the next GOTO alone. Feeds behind PPRINT/LINK lead from cut to cut until PPRINT/CUT; a text without them does not tell
links from cuts.

Cones of free tool axes as a table of comma-separated values.

Tool paths as a table of comma-separated values.

The table of a batch (batch.csv): what came of each part, of earlier runs too.
"""

import csv
import io
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import FileError
from bonecam.nc.motions import line_error
from bonecam.runtime.staging import NAME_BYTES
from bonecam.setup.stock import stock_text
from bonecam.tool.path import BESIDE, CALLED, MoveKind, ToolPath


def apt_text(paths: Sequence[ToolPath], name: str = "PART") -> str:
    """Tool paths as APT statements: mm and mm/min, tips with 6 decimals, axes with 9."""
    lines = [f"PARTNO/{name}", "UNITS/MM", "MULTAX/ON"]
    tool = None
    for path in paths:
        lines.append(f"PPRINT/{BESIDE.get(path.level, f'level {path.level}').upper()}")
        if path.cutter.number != tool:
            tool = path.cutter.number
            lines += [f"LOADTL/{tool}", f"CUTTER/{2 * path.cutter.radius:.6f},{path.cutter.radius:.6f}"]
            lines.append(f"SPINDL/RPM,{path.cutter.spindle:.0f},CLW")
        lines += _moves(path)
    return "\n".join([*lines, "FINI", ""])


def _moves(path: ToolPath) -> Iterator[str]:
    """RAPID, or a kind and a feed that change, and GOTO, of each move."""
    feed, feeding = None, None
    rows = zip(path.kinds.tolist(), path.feed_rates.tolist(), path.tips.tolist(), path.axes.tolist())
    for kind, wanted, tip, axis in rows:
        if kind == MoveKind.RAPID:
            yield "RAPID"
        elif kind != feeding:
            feeding = kind
            yield f"PPRINT/{MoveKind(kind).name}"
        if kind != MoveKind.RAPID and wanted != feed:
            feed = wanted
            yield f"FEDRAT/MMPM,{feed:.3f}"
        yield "GOTO/{:.6f},{:.6f},{:.6f},{:.9f},{:.9f},{:.9f}".format(*(value + 0.0 for value in (*tip, *axis)))


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
            raise line_error(line, f"{word} behind FINI: end the text there")
        reader.take(line, word, values)
    if not reader.ended:
        line = text.count("\n") + 1
        raise line_error(line, "the text ends without FINI: it is cut off, write it again")
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
                match = STATEMENT.fullmatch(statement) if len(statement) <= LONGEST else None
                if match is None:
                    raise line_error(first, f"{statement[:40]!r} is no APT statement: give WORD or WORD/values")
                yield first, match[1], (match[2] or "").strip()
        if len(begun) > LONGEST:
            raise line_error(first, f"a statement of over {LONGEST} characters: divide it")
    if begun:
        raise line_error(first, "the text ends in the middle of a statement: write it again")


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
            match = re.fullmatch(r"LEVEL (\d{1,6})", values)
            if match or values in CALLED:
                self.level = int(match[1]) if match else CALLED[values]
            elif values in ("LINK", "CUT"):
                self.link = values == "LINK"
        elif word == "UNITS":
            if values not in ("MM", "INCHES"):
                raise line_error(line, f"UNITS/{values[:20]}: give MM or INCHES")
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
                raise line_error(line, f"LOADTL/{values[0]}: give the tool's number")
            self.tool = int(number)
        elif word == "CUTTER":
            sizes = [self.scale * _number(line, word, value) for value in values]
            if not (sizes[0] > 0 and all(0 <= size <= sizes[0] / 2 for size in sizes[1:2])):
                raise line_error(line, f"CUTTER/{','.join(values)[:40]}: give a diameter and a corner that fits it")
            self.cutter = (sizes[0], sizes[1] if len(sizes) > 1 else 0.0)
        elif word == "FEDRAT":
            units = [value.strip() for value in values if not NUMBER.fullmatch(value.strip())]
            numbers = [value for value in values if NUMBER.fullmatch(value.strip())]
            if len(numbers) != 1 or not set(units) <= {"MMPM", "IPM", "PERMIN"}:
                raise line_error(line, f"FEDRAT/{','.join(values)[:40]}: give MMPM and one number")
            unit = 1.0 if "MMPM" in units else INCH if "IPM" in units else self.scale
            self.feed = unit * _number(line, "FEDRAT", numbers[0])
            if not self.feed > 0:
                raise line_error(line, f"a feed of {self.feed:g} mm/min: give a positive one")
        elif word in ("GOTO", "FROM"):
            self._goto(line, word, [_number(line, word, value) for value in values])
        else:
            raise line_error(line, f"the word {word} is not known here: give straight moves (GOTO)")

    def _goto(self, line: int, word: str, values: list[float]) -> None:
        if len(values) not in (3, 6):
            raise line_error(line, f"{word} with {len(values)} numbers: give x, y, z, i, j, k")
        axis = tuple(values[3:]) or (0.0, 0.0, 1.0)
        if abs(math.hypot(*axis) - 1) > UNIT_TOLERANCE:
            raise line_error(line, f"the tool axis {axis} is no unit vector")
        if self.tool is None or not self.cutter[0]:
            raise line_error(line, f"{word} before LOADTL and CUTTER: name the tool first")
        rapid = self.rapid or word == "FROM"
        if not rapid and math.isnan(self.feed):
            raise line_error(line, f"{word} without a feed: give FEDRAT or RAPID before it")
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
        raise line_error(line, f"{word} with {value.strip()[:20]!r}: give a number")
    return float(value.strip())


CONE_COLUMNS = (
    *("level", "rest"),
    *("apex_x", "apex_y", "apex_z"),
    *("axis_x", "axis_y", "axis_z"),
    *("side_x", "side_y", "side_z"),
    *("half_angle_deg", "second_half_angle_deg", "contacts"),
)


def cones_csv(paths: Sequence[ToolPath]) -> str:
    """One line for each cone that contacts keep to, in machining order: the node that stands for them among the ball's
    centres (mm), unit axis, unit direction of the largest opening, both semi-angles, and how many contacts they are."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(CONE_COLUMNS)
    for path in paths:
        if path.cones is None:
            continue
        cones = path.cones
        used, contacts = np.unique(cones.cone_of[cones.cone_of >= 0], return_counts=True)
        for k, count in zip(used, contacts):
            apex = [f"{value:.4f}" for value in cones.apexes[k]]
            frame = [f"{value:.6f}" for value in (*cones.shapes.axes[k], *cones.shapes.sides[k])]
            angles = [f"{value:.3f}" for value in np.degrees(cones.shapes.angles[k])]
            writer.writerow([path.level, path.rest, *apex, *frame, *angles, count])
    return text.getvalue()


PATH_COLUMNS = (
    *("level", "pass", "index"),
    *("contact_x", "contact_y", "contact_z"),
    *("tip_x", "tip_y", "tip_z"),
    *("axis_x", "axis_y", "axis_z"),
    *("kind", "feed"),
)


def toolpath_csv(paths: Sequence[ToolPath]) -> str:
    """One line a point in machining order: mm, unit axes, mm/min. Contacts are empty on links and rapids."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(PATH_COLUMNS)
    for path in paths:
        for i in range(len(path.tips)):
            kind = MoveKind(path.kinds[i])
            contact = [f"{value:.6f}" for value in path.contacts[i]] if kind == MoveKind.CUT else ["", "", ""]
            tip = [f"{value:.6f}" for value in path.tips[i]]
            axis = [f"{value:.9f}" for value in path.axes[i]]
            feed = f"{path.feed_rates[i]:.1f}"
            writer.writerow([path.level, path.pass_index[i], i, *contact, *tip, *axis, kind.name.lower(), feed])
    return text.getvalue()


TABLE = "batch.csv"
"""The name of the table."""


@dataclass(frozen=True)
class Outcome:
    """What came of one part: state `done`, `kept` (from an earlier run, as its seconds are) or `failed` with its
    message.

    `name` is that of its results, `job` the job file that is its own. Largest distance of the surface from the mesh
    (`deviation_mm`), `stock`, machining time, and area of the part that keeps more than 0.02 mm away from the post
    (`left_mm2`); `warnings` are their codes, of a part that was refused the refusal's. What is not known, as of a part
    that failed, is 0 or empty.
    """

    name: str
    mesh: str
    job: str
    state: str
    program: str = ""
    second: str = ""
    levels: int = 0
    time_min: float = 0.0
    deviation_mm: float = 0.0
    stock: str = ""
    left_mm2: float = 0.0
    warnings: str = ""
    seconds: float = 0.0
    message: str = ""


COLUMNS = [item.name for item in fields(Outcome)]
"""The columns of batch.csv."""


def outcome_of(
    name: str, mesh: str, job: str, report: Mapping[str, Any], seconds: float, state: str = "done"
) -> Outcome:
    """The outcome of a part with its report."""
    left = report["removal"].get("left") or {}
    return Outcome(
        name=name,
        mesh=mesh,
        job=job,
        state=state,
        program=report["nc"]["file"],
        second=report.get("second", {}).get("file", ""),
        levels=len(report["levels"]) - 1,
        time_min=report["nc"]["time_min"],
        deviation_mm=report["surface"]["deviation_max_mm"],
        stock=stock_text(report["stock"]),
        left_mm2=left.get("area_over_0_02_mm2", 0.0),
        warnings=" ".join(warning["code"] for warning in report.get("warnings", ())),
        seconds=round(seconds, 2),
    )


def failed(name: str, mesh: str, job: str, seconds: float, message: str, code: str = "") -> Outcome:
    """The outcome of a part that has none; `code` is that of its refusal."""
    return Outcome(name, mesh, job, "failed", warnings=code, seconds=round(seconds, 2), message=message)


def read_rows(table: Path) -> dict[str, dict[str, Any]]:
    """The rows of an earlier run's table by name; none where there is no table. FileError where it is another file."""
    if not table.exists():
        return {}
    try:
        with open(table, encoding="utf-8", errors=NAME_BYTES, newline="") as file:
            reader = csv.DictReader(file, strict=True)
            rows = list(reader)
            ours = reader.fieldnames == COLUMNS and all(None not in {*row, *row.values()} for row in rows)
    except (OSError, ValueError, csv.Error) as error:
        raise FileError(f"{table}: cannot be read ({error}): move it away", file=str(table)) from error
    if not ours:
        raise FileError(f"{table}: is no table of a batch: move it away, or use another folder", file=str(table))
    return {row["name"]: dict(row) for row in rows}


def table_text(rows: Iterable[dict[str, Any]]) -> str:
    """The text of the table with these rows."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
