"""A program in numbered files, which a caller runs one after the other.

The comments by which the text of a whole program tells where its parts begin, and where the caller goes on.

Which levels of a program share a file.

The files of a program in parts: the caller and what it calls. Their blocks are those of the whole text that was
proved, which `joined` makes of them again.

The whole text of a program of which a caller and the files that it calls were written.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import NamedTuple

from bonecam.errors import ProgramError, file_error
from bonecam.files import input_text, required_text
from bonecam.job import NcJob, field_error
from bonecam.nc.dialect import Dialect
from bonecam.nc.program import LOWEST_DRAWN, NUMBERS, Program
from bonecam.nc.schema import CallsTable, has_number, numbered_pattern
from bonecam.nc.words import comment, number_blocks
from bonecam.runtime.staging import Staging, staged

PARTS_END = "END OF THE PARTS"
"""The comment behind the last part."""
PART = re.compile(r"PART (\d+) OF (\d+) OF ([A-Z0-9_-]+)")
"""How the comment begins that begins a part. A name has no -: it stands for _ where comments have none (Fanuc)."""


class PartMark(NamedTuple):
    """Which part (from 1) of how many `parts` of the program `caller` begins."""

    part: int
    parts: int
    caller: str


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


def marked_parts(sections: Sequence[Section], caller: str, dialect: Dialect, nc: NcJob) -> list[str]:
    """The lines of all sections, with the marks between which each file of the program `caller` has its own."""
    files = grouped(sections, dialect, nc)
    lines = list[str]()
    named = caller if "_" in dialect.comment_characters else caller.replace("_", "-")
    for part, file in enumerate(files, start=1):
        titles = " TO ".join(dict.fromkeys([file[0].title, file[-1].title]))
        lines.append(comment(f"PART {part} OF {len(files)} OF {named} {titles}", dialect))
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


def program_files(program: Program, dialect: Dialect, place: str | Path) -> dict[Path, str]:
    """The texts of a program by file: of the one at `place`, the whole program or the caller of its parts, and of
    the parts beside it. FileError where one would replace a part of another program, or a part what is none."""
    place = Path(place)
    calls = dialect.calls
    others = (_owners(place, dialect) or set()) - {program.name}
    if others:
        raise file_error(place, f"it is a part of {min(others)}", "give another name, or another folder")
    lines = unnumbered(program.text.removesuffix("\n").split("\n"), dialect)
    starts = [at for at, line in enumerate(lines) if mark_in(line, dialect)]
    if not starts or calls is None:
        return {place: program.text}
    end = lines.index(end_mark(dialect))
    caller = lines[: starts[0]]
    texts = {}
    for part, (first, last) in enumerate(zip(starts, [*starts[1:], end], strict=True), start=1):
        fields = part_fields(calls, program, part)
        begin, ends = calls.wrapping(fields)
        caller.append(calls.call.format(**fields))
        file = place.with_name(str(fields["file"]))
        owners = _owners(file, dialect)
        if owners is not None and owners != {program.name}:
            content = f"a part of {min(owners)}" if owners else "no part of a program"
            what = f"it is there, and {content}, but has the name of a part of {program.name}"
            raise file_error(file, what, "move it away, or give another nc.program_number, or another folder")
        texts[file] = number_blocks([*begin, *lines[first:last], *ends], dialect)[0]
    return {place: number_blocks([*caller, *lines[end:]], dialect)[0], **texts}


def write_program_files(program: Program, dialect: Dialect, place: str | Path) -> None:
    """Write the files of a program, all or none; FileError names what cannot be written."""
    with staged() as staging:
        stage_program_files(staging, {Path(place): program}, dialect)


def stage_program_files(staging: Staging, programs: Mapping[Path, Program], dialect: Dialect) -> None:
    """Write the files of all programs of a run, by their places, beside others that are staged; parts of older
    programs of their names go. FileError where two of them have a file of the same name."""
    texts: dict[Path, str] = {}
    for place, program in programs.items():
        own = program_files(program, dialect, place)
        check_apart(texts, own)
        texts |= own
    for file, text in texts.items():
        staging.write(file, text)
    for place, program in programs.items():
        # parts of an older program of this name that the new one, which has fewer, does not call: they might be run
        for part in count(part_count(program.text) + 1):
            if dialect.calls is None:
                break
            file = place.with_name(str(part_fields(dialect.calls, program, part)["file"]))
            if _owners(file, dialect) != {program.name}:
                break
            if file not in texts:
                staging.remove(file)


def check_apart(first: Iterable[Path], second: Iterable[Path]) -> None:
    """FileError where the programs of two clampings have a file of the same name, by their numbers."""
    for file in sorted({*first} & {*second}):
        what = "both clampings have a part of this name"
        raise file_error(file, what, "give another nc.program_number, or another name")


def part_fields(calls: CallsTable, program: Program, part: int) -> dict[str, str | int]:
    """What a part (from 1) of a program is called by."""
    number = program.number + part
    if number >= LOWEST_DRAWN:
        number = LOWEST_DRAWN + (number - LOWEST_DRAWN) % NUMBERS
    name = f"{program.name}_{part}"
    fields: dict[str, str | int] = {"name": name, "lower": name.lower(), "number": number}
    return {**fields, "file": calls.file.format(**fields)}


def _owners(file: Path, dialect: Dialect) -> set[str] | None:
    """The programs that a file says to be a part of, None where there is no file."""
    try:
        before = input_text(file).split("\n", 20)[:20]
    except UnicodeDecodeError:
        return set()
    except OSError:
        return None
    marks = [mark_in(line, dialect) for line in unnumbered(before, dialect)]
    return {mark.caller for mark in marks if mark}


@dataclass(frozen=True)
class Joined:
    """The `text` that a control runs, and the file and the line (from 1) that each of its lines is of."""

    text: str
    places: tuple[tuple[Path, int], ...]

    def place(self, line: int) -> str:
        """File and line of a line (from 1) of the text; where that is 0, the caller."""
        file, at = self.places[min(max(line, 1), len(self.places)) - 1]
        return f"{file}: line {at}" if line else str(file)


def joined(program: Path, dialect: Dialect) -> Joined:
    """The text of a program in a file and in those that it calls, which lie beside it. FileError where one of them
    cannot be read, ProgramError where one is not whole or is none of its parts, or the program is itself a part."""
    text = required_text(program, "an NC program")
    calls = dialect.calls
    given = text.split("\n")
    lines = unnumbered(given, dialect)
    called = [calls.called_by(line) for line in lines] if calls else []
    if calls is None or not any(called):
        mark = next(filter(None, (mark_in(line, dialect) for line in lines)), None)
        if mark is not None and end_mark(dialect) not in lines:
            what = f"{program}: it is part {mark.part} of {mark.parts} of {mark.caller}"
            raise ProgramError(f"{what}: give the program that calls it", line=0)
        return Joined(text, tuple((program, at) for at in range(1, len(given) + 1)))
    _check_numbers(text, lines, program, dialect)
    whole = list[str]()
    origins = list[tuple[Path, int]]()
    part = 0
    for at, (line, fields) in enumerate(zip(lines, called, strict=True), start=1):
        if fields is None:
            whole.append(line)
            origins.append((program, at))
            continue
        file = program.with_name(str(fields["file"]))
        # the lines of the called file between how it begins and how it ends
        own = required_text(file, "a part of an NC program")
        bare = unnumbered(own.split("\n"), dialect)
        begin, end = calls.wrapping(fields)
        inner = bare[len(begin) : len(bare) - len(end) - 1]
        if bare != [*begin, *inner, *end, ""] or not inner:
            wanted = f"begin with {begin[0]!r} and " if begin else ""
            raise ProgramError(f"{file}: a called program must {wanted}end with {end[-1]!r}: write it again", line=0)
        _check_numbers(own, bare, file, dialect)
        part += 1
        mark, parts = mark_in(inner[0], dialect), sum(map(bool, called))
        content = f"part {mark.part} of {mark.parts} of {mark.caller}" if mark else "none of its parts"
        if mark is None or (mark.part, mark.parts) != (part, parts):
            what = f"{file}: it is {content}, called as part {part} of {parts}"
            raise ProgramError(f"{what}: write caller and parts again", line=0)
        whole += inner
        origins += [(file, len(begin) + 1 + offset) for offset in range(len(inner))]
    ended = whole[-1] == ""
    numbered = number_blocks(whole[:-1] if ended else whole, dialect)[0]
    return Joined(numbered if ended else numbered.removesuffix("\n"), tuple(origins))


def _check_numbers(text: str, lines: list[str], file: Path, dialect: Dialect) -> None:
    """ProgramError where the blocks of a file are not numbered in their order, or its last line is not ended."""
    wanted = number_blocks(lines[:-1], dialect)[0]
    if text != wanted:
        pairs = zip(text.split("\n"), wanted.split("\n"), strict=False)
        line = next((at for at, (one, two) in enumerate(pairs, start=1) if one != two), len(lines))
        raise ProgramError(f"{file}: line {line}: its block number is not that of its place", line=line)
