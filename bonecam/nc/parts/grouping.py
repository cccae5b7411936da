"""Which levels of a program share a file."""

from collections.abc import Sequence
from typing import NamedTuple

from bonecam.job import NcJob, field_error
from bonecam.nc.dialect import Dialect
from bonecam.nc.parts.marks import PartMark, end_mark, part_mark

WRAPPING = 10
"""Most blocks that a file has beside those of its levels: how it begins and ends, and its mark."""


class Section(NamedTuple):
    """The lines of one path of a program, with its title and tool."""

    title: str
    tool: int
    lines: list[str]

    def blocks(self, dialect: Dialect) -> int:
        """How many blocks they are."""
        mark = dialect.numbering.continuation
        return len(self.lines) - sum(mark is not None and line.endswith(mark) for line in self.lines)


def is_split(nc: NcJob) -> bool:
    """Whether a job wants its program in more than one file."""
    return nc.split != "none" or nc.split_blocks > 0


def marked_parts(sections: Sequence[Section], caller: str, dialect: Dialect, nc: NcJob) -> list[str]:
    """The lines of all sections, with the marks between which each file of the program `caller` has its own."""
    files = grouped(sections, dialect, nc)
    lines = list[str]()
    for part, file in enumerate(files, start=1):
        titles = " TO ".join(dict.fromkeys([file[0].title, file[-1].title]))
        lines.append(part_mark(PartMark(part, len(files), caller), titles, dialect))
        lines += [line for section in file for line in section.lines]
    return [*lines, end_mark(dialect)]


def grouped(sections: Sequence[Section], dialect: Dialect, nc: NcJob) -> list[list[Section]]:
    """The sections of each file: one, those of one tool, or all, and as many as nc.split_blocks allows. JobError where
    one section alone has more blocks."""
    largest = max(sections, key=lambda section: section.blocks(dialect))
    most = largest.blocks(dialect)
    if nc.split_blocks and most + WRAPPING > nc.split_blocks:
        why = f"{largest.title} has {most} blocks: give {most + WRAPPING} or more"
        raise field_error("nc", "split_blocks", nc.split_blocks, why)
    files = list[list[Section]]()
    filled = 0
    for section in sections:
        blocks = section.blocks(dialect)
        begins = not files or nc.split == "level" or (nc.split == "tool" and files[-1][-1].tool != section.tool)
        if begins or (nc.split_blocks and filled + blocks > nc.split_blocks):
            files.append([])
            filled = WRAPPING
        files[-1].append(section)
        filled += blocks
    return files
