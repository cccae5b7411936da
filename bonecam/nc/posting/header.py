"""The header of a program: what it is for, its tools, its zero and its blank, as comments and blocks."""

from collections.abc import Sequence

from jaxtyping import Float
from numpy import ndarray

from bonecam.job import Job
from bonecam.nc.dialect import Dialect
from bonecam.nc.machine import Machine
from bonecam.nc.posting.path_words import Posted
from bonecam.nc.words import plain_text
from bonecam.toolpath.cutter import Cutter


def header_lines(
    machine: Machine,
    dialect: Dialect,
    job: Job,
    name: str,
    posted: Sequence[Posted],
    bounds: Float[ndarray, "2 3"],
    comments: Sequence[str],
) -> list[str]:
    """The first blocks of a program: machine, control, zero and tools as comments, then the job's `comments`;
    the blank, which fills `bounds` (mm) in the control's simulation; the tolerance."""
    length = dialect.numbers["length"]
    corners = dict(
        zip(
            "low_x low_y low_z high_x high_y high_z".split(),
            map(length.text, bounds.ravel()),
            strict=True,
        )
    )
    point = "BALL CENTRE" if posted[0].control.programs_centre else "TOOL TIP"
    where = "IN THE PART" if dialect.tool_centre else "IN MACHINE COORDINATES"
    tools = {one.path.cutter.number: one for one in posted}
    texts = [
        f"machine {machine.title}",
        f"control {dialect.title}",
        f"programmed point: {point} {where}",
        "program zero: on the table, on the axis of the post",
        *comments,
        *(tool_text(one.path.cutter, one.control.tool_length) for one in tools.values()),
    ]
    marked = "\n".join(comment(text, dialect) for text in texts)
    tolerance = length.text(job.path.chord_tolerance / 2)
    return dialect.lines("header", name=name, comments=marked, tolerance=tolerance, **corners)


def comment(text: str, dialect: Dialect) -> str:
    """A comment in the form and the characters of the dialect."""
    return dialect.comment.format(text=plain_text(text, dialect.comment_characters))


def tool_text(cutter: Cutter, tool_length: float) -> str:
    """The comment of the header that describes a cutter, mm; `reading.modal_state` reads it."""
    return f"TOOL {cutter.number} BALL RADIUS {cutter.radius:.4f} LENGTH {tool_length:.4f}"
