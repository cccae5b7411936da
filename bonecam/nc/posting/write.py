"""Writing the NC text: the dialect's templates filled with the words of the posted paths.

A program is one section a cutter (tool call), in it one a level, in it one or more runs: retract, turn the
rotary axes off the part, tool-centre control on where the control has it, approach along the tool axis, the
moves, tool-centre control off, retract.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import ProgramError
from bonecam.job import Job
from bonecam.nc.dialect import Dialect
from bonecam.nc.machine import Machine
from bonecam.nc.posting.block_numbers import number_blocks
from bonecam.nc.posting.header import comment, header_lines
from bonecam.nc.posting.path_words import APPROACH_HEIGHT, Posted, check_travel, joints_of, post_path
from bonecam.nc.program import Program
from bonecam.nc.words import wrapped
from bonecam.progress import Progress, report, silent
from bonecam.toolpath.path import Kind, ToolPath

TOLERANCE_FACTOR = 1.3
"""The control's contour tolerance as a multiple of the chord tolerance of the path: a control smooths best
between 1.1 and 2 of it (Heidenhain, iTNC 530 cycle programming, section 12.5 on cycle 32)."""


def write_program(
    paths: Sequence[ToolPath],
    machine: Machine,
    dialect: Dialect,
    job: Job,
    *,
    name: str = "BONE",
    comments: Sequence[str] = (),
    stock_bounds: Float[ndarray, "2 3"] | None = None,
    progress: Progress = silent,
) -> Program:
    """The program that machines `paths` in their order.

    `name` has letters, digits and underscores. `stock_bounds` (mm) is the blank in the control's simulation;
    without it the box of the tips is taken. MachineError where an axis leaves its limits or travel,
    ProgramError where a number cannot be written.
    """
    if not paths:
        raise ValueError("no tool path: give at least one")
    if not name or not all(letter.isascii() and (letter.isalnum() or letter == "_") for letter in name):
        raise ProgramError(f"program name {name!r}: use letters, digits and _", name=name)
    around = np.vstack([path.tips for path in paths])
    posted: list[Posted] = []
    for index, path in enumerate(paths):
        report(progress, index / len(paths), f"level {path.level}: angles and words")
        before = posted[-1].moves.angles[-1] if posted else None
        posted.append(post_path(path, machine, dialect, job, around, before))
    check_travel(machine, posted)
    bounds = np.array([around.min(0), around.max(0)]) if stock_bounds is None else stock_bounds
    writer = ProgramWriter(machine, dialect, job, name.upper(), posted)
    return writer.program(bounds, comments)


class ProgramWriter:
    """Writes the blocks of one program from its posted paths; `moves` counts those written so far."""

    def __init__(
        self, machine: Machine, dialect: Dialect, job: Job, name: str, posted: Sequence[Posted]
    ) -> None:
        self.machine = machine
        self.dialect = dialect
        self.job = job
        self.name = name
        self.posted = posted
        self.length = dialect.numbers["length"]
        self.angle = dialect.numbers["angle"]
        self.feed = dialect.numbers["feed"]
        self.on, self.off = dialect.tool_centre_blocks(machine)
        self.retract = self.length.text(self._retract_height())
        self.moves = 0

    def program(self, bounds: ndarray, comments: Sequence[str]) -> Program:
        """The whole program; `bounds` (mm) is the blank in the control's simulation."""
        lines = header_lines(self.machine, self.dialect, self.job, self.name, self.posted, bounds, comments)
        tool = None
        for posted in self.posted:
            cutter = posted.path.cutter
            if cutter.number != tool:
                lines += self.dialect.lines("tool_end") if tool is not None else []
                lines += self._moving(
                    "tool",
                    tool=cutter.number,
                    spindle=self.dialect.numbers["spindle"].text(cutter.spindle),
                    retract=self.retract,
                )
                tool = cutter.number
            lines += [comment(f"level {posted.path.level}", self.dialect), *self._level(posted)]
            for run, approach in zip(posted.runs, posted.approaches, strict=True):
                lines += self._run(posted, run, approach)
        lines += self.dialect.lines("tool_end") + self.dialect.lines("footer", name=self.name)
        return self._finish(lines)

    def _finish(self, lines: list[str]) -> Program:
        """The program of these blocks, numbered, with its counts and its time."""
        text, blocks = number_blocks(lines, self.dialect)
        feeds = [posted.moves.kinds != Kind.RAPID for posted in self.posted]
        rotations = [
            np.abs(np.diff(p.words[:, 3:], axis=0, prepend=p.words[:1, 3:])).max(1) for p in self.posted
        ]
        for posted, rotation in zip(self.posted, rotations, strict=True):
            rotation[[run[0] for run in posted.runs]] = 0.0
        return Program(
            text=text,
            name=self.name,
            machine=self.machine.name,
            controller=self.dialect.name,
            extension=self.dialect.extension,
            blocks=blocks,
            moves=self.moves,
            split_moves=sum(len(posted.words) - len(posted.path.tips) for posted in self.posted),
            rewinds=sum(len(posted.runs) - 1 for posted in self.posted),
            tools=tuple(dict.fromkeys(posted.path.cutter.number for posted in self.posted)),
            time_min=float(sum(posted.minutes.sum() for posted in self.posted)),
            rotary_max_deg_per_block=max(
                float(r[f].max(initial=0.0)) for r, f in zip(rotations, feeds, strict=True)
            ),
        )

    def _level(self, posted: Posted) -> list[str]:
        """The blocks that begin a level: its contour tolerance and whether it is roughed."""
        tolerance = self.length.text(TOLERANCE_FACTOR * self.job.path.chord_tolerance)
        return self.dialect.lines(
            "level", tolerance=tolerance, hsc_mode=int(not self.job.is_finishing(posted.path.level))
        )

    def _moving(self, template: str, **fields: object) -> list[str]:
        """The blocks of a template, whose moves are counted."""
        lines = self.dialect.lines(template, **fields)
        self.moves += sum(line.startswith(("L ", "G0 ")) for line in lines)
        return lines

    def _run(self, posted: Posted, run: tuple[int, int], approach: ndarray) -> list[str]:
        """The blocks of one run: turn the rotary axes, approach along the tool axis, machine, retract."""
        words = _words(self.machine.letters, approach, self)
        rotary = " ".join(words[3:])
        linear = " ".join(words[:3])
        plane = " ".join(words[:2])
        lines = (
            self._moving("position", rotary=rotary)
            + self.on
            + self._moving("approach", linear=linear, plane=plane)
        )
        if self.job.nc.coolant:
            lines += self.dialect.lines("coolant_on")
        lines += self._rows(posted, run)
        if self.job.nc.coolant:
            lines += self.dialect.lines("coolant_off")
        return lines + self.off + self._moving("retract", retract=self.retract)

    def _rows(self, posted: Posted, run: tuple[int, int]) -> list[str]:
        """The blocks of the moves of one run, one a row of its words."""
        rows = slice(*run)
        kinds = posted.moves.kinds[rows]
        words = self._written(posted.words[rows])
        form = " ".join(
            f"{letter}{(self.length if i < 3 else self.angle).spec}"
            for i, letter in enumerate(self.machine.letters)
        )
        rapid = "\n".join(self.dialect.move_lines("rapid", words=form))
        feed = "\n".join(self.dialect.move_lines("feed", words=form, feed=self.feed.spec))
        rates = np.clip(self._rates(posted, rows), self.feed.lowest, self.feed.highest)
        rates = self.feed.rounded(rates)
        fast = kinds == Kind.RAPID
        # the first row of a run is reached from the approach height
        fast[0] = True
        self.moves += len(kinds)
        table = np.column_stack([words, rates]).tolist()
        return [
            rapid % tuple(row[:5]) if quick else feed % tuple(row)
            for row, quick in zip(table, fast.tolist(), strict=True)
        ]

    def _rates(self, posted: Posted, rows: slice) -> Float[ndarray, "n"]:
        """The feed of each move as the dialect writes it: mm/min, or 1/min (inverse time)."""
        moves = posted.moves
        if self.dialect.feed_mode == "per-minute":
            return moves.feed_rates[rows]
        length = np.linalg.norm(np.diff(moves.tips[rows], axis=0, prepend=moves.tips[rows][:1]), axis=1)
        with np.errstate(divide="ignore"):
            by_length = moves.feed_rates[rows] / length
            # a rotation on the spot has no length: it takes what the rotary axes need
            by_axes = 1 / posted.minutes[rows]
        return np.where(length > self.length.step, by_length, np.minimum(by_length, by_axes))

    def _written(self, words: Float[ndarray, "n 5"]) -> Float[ndarray, "n 5"]:
        """The words (mm, deg) as numbers of the text: endless axes wrapped where the dialect does, no
        negative zero."""
        written = words.copy()
        for column, axis in enumerate(self.machine.rotary, start=3):
            if axis.endless and self.dialect.endless_words == "wrapped":
                written[:, column] = self.angle.rounded(wrapped(words[:, column]))
        self.length.check(written[:, :3])
        self.angle.check(written[:, 3:])
        # whole steps and no negative zero
        return written + 0.0

    def _retract_height(self) -> float:
        """Machine Z above everything the program does, whatever the rotary axes do meanwhile."""
        heights = []
        reach = []
        pivot = np.array(self.machine.part_axes[-1].pivot) if self.machine.part_axes else np.zeros(3)
        for posted in self.posted:
            heights.append(joints_of(posted, posted.approaches)[:, 2].max())
            # while the table swings under the tool, the part sweeps at most this ball about the pivot
            reach.append(
                np.linalg.norm(joints_of(posted, posted.words)[:, :3] - pivot, axis=1).max()
                if self.machine.part_axes
                else 0.0
            )
        return float(np.ceil(max(max(heights), pivot[2] + max(reach)) + APPROACH_HEIGHT))


def _words(letters: str, values: ndarray, writer: ProgramWriter) -> list[str]:
    """The words of one position (mm, deg), each with its letter."""
    row = writer._written(values[None, :])[0]
    return [
        f"{letter}{(writer.length if i < 3 else writer.angle).spec % value}"
        for i, (letter, value) in enumerate(zip(letters, row, strict=True))
    ]
