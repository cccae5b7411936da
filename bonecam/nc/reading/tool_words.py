"""How a text names and describes its tools."""

import re

from bonecam.nc.reading.line_error import line_error
from bonecam.nc.reading.motions import Tool
from bonecam.nc.schema.numbering import WHOLE
from bonecam.text.faults import shown

TOOL_COMMENT = re.compile(rf"\s*TOOL ({WHOLE}) BALL RADIUS ({WHOLE}\.[0-9]+) LENGTH ({WHOLE}\.[0-9]+)\s*")
"""The comment of the header that describes a cutter, as `posting.header.texts` writes it; mm."""


def described_tool(text: str, line: int) -> Tool | None:
    """The tool that a comment describes, if it does."""
    match = TOOL_COMMENT.fullmatch(text)
    return Tool(int(match[1]), float(match[2]), float(match[3]), line) if match else None


def tool_number(text: str, line: int) -> int:
    """The number of a tool call; ProgramError where it is none."""
    if not re.fullmatch(WHOLE, text):
        raise line_error(line, f"{shown(text)} is no number of a tool")
    return int(text)
