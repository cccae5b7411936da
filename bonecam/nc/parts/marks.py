"""The comments by which the text of a whole program tells where its parts begin, and where the caller goes on."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from bonecam.nc.dialect import Dialect
from bonecam.nc.schema.numbering import has_number, numbered_pattern
from bonecam.nc.words import comment

PARTS_END = "END OF THE PARTS"
"""The comment behind the last part."""
PART = re.compile(r"PART (\d+) OF (\d+) OF ([A-Z0-9_-]+)")
"""How the comment begins that begins a part. A name has no -: it stands for _ where comments have none (Fanuc)."""


class PartMark(NamedTuple):
    """Which part (from 1) of how many `parts` of the program `caller` begins."""

    part: int
    parts: int
    caller: str


def part_mark(mark: PartMark, told: str, dialect: Dialect) -> str:
    """The comment that begins a part, with what is `told` of it."""
    caller = mark.caller if "_" in dialect.comment_characters else mark.caller.replace("_", "-")
    return comment(f"PART {mark.part} OF {mark.parts} OF {caller} {told}", dialect)


def part_count(text: str) -> int:
    """How many files a whole program calls, 0 where it is in one."""
    found = PART.search(text)
    return int(found[2]) if found else 0


def end_mark(dialect: Dialect) -> str:
    """The comment behind the last part."""
    return comment(PARTS_END, dialect)


def mark_in(line: str, dialect: Dialect) -> PartMark | None:
    """The part that a line without its number begins, None where it begins none."""
    before, _, _ = dialect.comment.partition("{text}")
    match = PART.match(line[len(before) :]) if line.startswith(before) else None
    return PartMark(int(match[1]), int(match[2]), match[3].replace("-", "_")) if match else None


def unnumbered(lines: Sequence[str], dialect: Dialect) -> list[str]:
    """Lines without their block numbers."""
    numbering = dialect.numbering
    if numbering.format is None:
        return list(lines)
    pattern = re.compile(numbered_pattern(numbering, "(.*)"))
    matches = [pattern.fullmatch(line) for line in lines]
    return [
        each[2] if each and has_number(each[2], numbering) else line for line, each in zip(lines, matches, strict=True)
    ]
