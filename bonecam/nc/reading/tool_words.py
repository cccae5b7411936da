"""How a text names and describes its tools."""

import math
import re

from bonecam.nc.reading.line_error import line_error
from bonecam.nc.reading.motions import Tool
from bonecam.nc.schema.numbering import WHOLE
from bonecam.text.faults import shown
from bonecam.tool.enveloping_ball import enveloping_ball

SIZE = rf"({WHOLE}\.[0-9]+)"
TOOL_COMMENT = re.compile(
    rf"\s*TOOL ({WHOLE}) (?:BALL RADIUS {SIZE}|(?:BULL RADIUS {SIZE} CORNER {SIZE}|FLAT RADIUS {SIZE}) LEAD {SIZE}) "
    rf"LENGTH {SIZE}\s*"
)
"""The comment of the header that describes a cutter, as `posting.header.texts` writes it; mm, the lead of a
bull nose or flat end in degrees."""


def described_tool(text: str, line: int) -> Tool | None:
    """The tool that a comment describes, if it does; ProgramError where its sizes do not fit one another."""
    match = TOOL_COMMENT.fullmatch(text)
    if match is None:
        return None
    number, length = int(match[1]), float(match[7])
    if match[2]:
        return Tool(number, float(match[2]), length, line)
    radius, corner, lead = float(match[3] or match[5]), float(match[4] or 0.0), math.radians(float(match[6]))
    try:
        enveloping_ball(radius, corner, lead)
    except ValueError as error:
        raise line_error(line, f"tool {number}: {error}") from error
    return Tool(number, radius, length, line, corner, lead)


def tool_number(text: str, line: int) -> int:
    """The number of a tool call; ProgramError where it is none."""
    if not re.fullmatch(WHOLE, text):
        raise line_error(line, f"{shown(text)} is no number of a tool")
    return int(text)
