"""The header of a program: what must be mounted, how the control must be set, and what the program will do, as
comments; the blank; the safe start.

The comments of a program's header on its axes: the room that they take, and how their words are written.
"""

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.header.texts import WIDEST, control_texts, parting_texts, tool_texts
from bonecam.nc.posting.path_words import Posted
from bonecam.nc.posting.tolerances import contour_tolerance, rotary_tolerance_deg
from bonecam.nc.posting.travel import Travel
from bonecam.nc.program import Program, ProgramTime, program_number
from bonecam.nc.words import comment, comments_of


def axis_texts(machine: Machine, travel: Travel, dialect: Dialect) -> list[str]:
    """The room that the program takes, and how endless axes are written."""
    linear = ", ".join(
        f"{axis.letter} {high - low:.1f} of {axis.travel:.1f}"
        for axis, (low, high) in zip(machine.linear, travel.ranges.tolist(), strict=False)
    )
    rotary = ", ".join(
        f"{axis.letter} {low:+.3f} to {high:+.3f}"
        for axis, (low, high) in zip(machine.own_rotary, travel.ranges[3:].tolist(), strict=False)
    )
    return [
        f"travel, mm: {linear}, pivots and tool lengths as assumed",
        f"rotary axes, degrees unwound: {rotary}",
        *(text for axis in machine.rotary if axis.endless for text in _endless_texts(axis.letter, dialect)),
    ]


def _endless_texts(letter: str, dialect: Dialect) -> list[str]:
    """How the words of an endless axis are written, and what the control must do with them."""
    block = f" under {dialect.endless_block}" if dialect.endless_block else ""
    if dialect.endless_words == "wrapped":
        lowest = f"{dialect.endless_from_deg:.0f}..{dialect.endless_from_deg + 360:.0f}"
        form = f" as {dialect.endless_word.format(letter=letter, number='')}" if dialect.has_own_form else ""
        return [
            f"{letter} words: wrapped to {lowest}{form}{block}, the control takes the short way",
            f"{letter} must be a modulo axis, its display reduced to 360 degrees",
        ]
    return [
        f"{letter} words: wound up over many turns{block}, the control drives them as they are",
        f"{letter} must not be a modulo axis, its display not reduced to 360 degrees",
    ]


UNCHECKED = "checks passed: none, this text was not read back"
"""The line of a program before its proof; `record_checks` replaces it."""
UNSIMULATED = "removal not simulated"
"""The line of a program whose removal of material is not simulated; `record_simulation` replaces it."""


def header_lines(
    machine: Machine,
    dialect: Dialect,
    job: Job,
    name: str,
    posted: Sequence[Posted],
    bounds: Float[ndarray, "2 3"],
    comments: Sequence[str],
    travel: Travel,
    time: ProgramTime,
    air_check: Sequence[str],
) -> list[str]:
    """The first blocks of a program: its `comments`, of what must be mounted too, the blank, which fills `bounds`
    (mm) in the control's simulation, the `air_check`, and the safe start with the finest tolerances."""
    length = dialect.numbers.length
    fields = "low_x low_y low_z high_x high_y high_z".split()
    blank = machine.in_machine(np.array(list(product(*bounds.T))))
    box = np.array([blank.min(axis=0), blank.max(axis=0)])
    corners = dict(zip(fields, map(length.text, box.ravel()), strict=True))
    texts = [
        f"machine {machine.title}",
        f"control {dialect.title}",
        *comments,
        *parting_texts([one.path for one in posted]),
        *tool_texts(job, posted, time),
        *control_texts(machine, dialect, posted),
        *axis_texts(machine, travel, dialect),
        *(line for text in time.texts for line in textwrap.wrap(f"time {text}", WIDEST)),
        *(f"air check: {text}" for text in air_check),
        UNCHECKED,
        UNSIMULATED,
    ]
    smallest = min(one.path.cutter.radius for one in posted)
    switch = dialect.tool_centre_switch(machine)
    return dialect.lines(
        "header",
        name=name,
        number=job.nc.program_number or program_number(name),
        comments="\n".join(line for text in texts for line in comments_of(text, dialect)),
        tolerance=length.text(contour_tolerance(dialect, job, finishing=True)),
        rotary_tolerance=rotary_text(dialect, rotary_tolerance_deg(dialect, job, True, smallest)),
        tool_centre_off=switch.off if switch else "",
        **corners,
    )


def level_lines(dialect: Dialect, job: Job, posted: Posted) -> list[str]:
    """The blocks that begin a level: its tolerances and whether it is roughed."""
    finishing = job.is_finishing(posted.path.level)
    turn = rotary_tolerance_deg(dialect, job, finishing, posted.path.cutter.radius)
    return dialect.lines(
        "level",
        tolerance=dialect.numbers.length.text(contour_tolerance(dialect, job, finishing)),
        rotary_tolerance=rotary_text(dialect, turn),
        hsc_mode=int(not finishing),
        machining=dialect.machining.finishing if finishing else dialect.machining.roughing,
    )


def rotary_text(dialect: Dialect, angle: float) -> str:
    """An angle of a tolerance, degrees, with the decimals of the dialect's angles and no sign."""
    return f"{angle:.{dialect.numbers.angle.decimals}f}"


def record_checks(program: Program, dialect: Dialect, checks: str) -> Program:
    """The program with the `checks` that its text passed in the header; no block moves, no line is added. ValueError
    where its text has them already."""
    return _with_line(program, dialect, UNCHECKED, f"checks passed: {checks}")


def record_simulation(program: Program, dialect: Dialect, cell: float, bending: str = "") -> Program:
    """The program with a header that tells that the removal of its text was simulated on rays `cell` mm apart, and what
    `bending` does, if that is known; no block moves, no line is added. ValueError where its text tells it already."""
    simulated = f"removal simulated in cells of {cell:g} mm"
    return _with_line(program, dialect, UNSIMULATED, f"{simulated}, {bending}" if bending else simulated)


def _with_line(program: Program, dialect: Dialect, before: str, after: str) -> Program:
    """The program in whose header one comment is another."""
    line = comment(before, dialect)
    if program.text.count(line) != 1:
        raise ValueError(f"the program has no line {line!r}: give it as it was written")
    return replace(program, text=program.text.replace(line, comment(after, dialect)))
