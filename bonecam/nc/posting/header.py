"""The header of a program: what must be mounted, how the control must be set, and what the program will do, as
comments; the blank; the safe start."""

from collections.abc import Sequence

from jaxtyping import Float
from numpy import ndarray

from bonecam.job import Job
from bonecam.nc.dialect import Dialect
from bonecam.nc.machine import Machine
from bonecam.nc.posting.header_texts import axis_texts, control_texts, parting_texts, tool_texts
from bonecam.nc.posting.path_words import Posted
from bonecam.nc.posting.tolerances import contour_tolerance, rotary_tolerance_deg
from bonecam.nc.posting.travel import Travel
from bonecam.nc.words import plain_text

UNCHECKED = "checks passed: none, this text was not read back"
"""The line of a program before its proof; `record_checks` replaces it."""


def header_lines(
    machine: Machine,
    dialect: Dialect,
    job: Job,
    name: str,
    posted: Sequence[Posted],
    bounds: Float[ndarray, "2 3"],
    comments: Sequence[str],
    travel: Travel,
) -> list[str]:
    """The first blocks of a program: its `comments`, of what must be mounted too, the blank, which fills `bounds`
    (mm) in the control's simulation, and the safe start with the finest tolerances."""
    length = dialect.numbers["length"]
    places = "low_x low_y low_z high_x high_y high_z".split()
    corners = dict(zip(places, map(length.text, bounds.ravel()), strict=True))
    texts = [
        f"machine {machine.title}",
        f"control {dialect.title}",
        *comments,
        *parting_texts([one.path for one in posted]),
        *tool_texts(job, posted),
        *control_texts(machine, dialect, posted),
        *axis_texts(machine, travel, posted),
        UNCHECKED,
    ]
    smallest = min(one.path.cutter.radius for one in posted)
    switch = dialect.tool_centre_switch(machine)
    return dialect.lines(
        "header",
        name=name,
        comments="\n".join(comment(text, dialect) for text in texts),
        tolerance=length.text(contour_tolerance(dialect, job, finishing=True)),
        rotary_tolerance=rotary_text(dialect, rotary_tolerance_deg(dialect, job, True, smallest)),
        tool_centre_off=switch.off if switch else "",
        **corners,
    )


def rotary_text(dialect: Dialect, angle: float) -> str:
    """An angle of a tolerance, degrees, with the decimals of the dialect's angles and no sign."""
    return f"{angle:.{dialect.numbers['angle'].decimals}f}"


def comment(text: str, dialect: Dialect) -> str:
    """A comment in the form and the characters of the dialect."""
    return dialect.comment.format(text=plain_text(text, dialect.comment_characters))


def record_checks(text: str, dialect: Dialect, checks: str) -> str:
    """The text of a program whose header names the `checks` that it passed; no block moves, no line is added."""
    before = comment(UNCHECKED, dialect)
    if text.count(before) != 1:
        raise ValueError("the program has no line for its checks: give the text as it was written")
    return text.replace(before, comment(f"checks passed: {checks}", dialect))
