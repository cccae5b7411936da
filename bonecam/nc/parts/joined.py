"""The whole text of a program of which a caller and the files that it calls were written."""

from dataclasses import dataclass
from pathlib import Path

from bonecam.errors import ProgramError
from bonecam.files import required_text
from bonecam.nc.dialect import Dialect
from bonecam.nc.parts.marks import end_mark, mark_in, unnumbered
from bonecam.nc.posting.block_numbers import number_blocks
from bonecam.nc.schema.calls_table import CallsTable


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
        first, inner = _inner(file, fields, calls, dialect)
        part += 1
        mark, parts = mark_in(inner[0], dialect), sum(map(bool, called))
        content = f"part {mark.part} of {mark.parts} of {mark.caller}" if mark else "none of its parts"
        if mark is None or (mark.part, mark.parts) != (part, parts):
            what = f"{file}: it is {content}, called as part {part} of {parts}"
            raise ProgramError(f"{what}: write caller and parts again", line=0)
        whole += inner
        origins += [(file, first + offset) for offset in range(len(inner))]
    ended = whole[-1] == ""
    numbered = number_blocks(whole[:-1] if ended else whole, dialect)[0]
    return Joined(numbered if ended else numbered.removesuffix("\n"), tuple(origins))


def _inner(file: Path, fields: dict[str, str | int], calls: CallsTable, dialect: Dialect) -> tuple[int, list[str]]:
    """The first line (from 1) of a called file between how it begins and how it ends, and these lines."""
    text = required_text(file, "a part of an NC program")
    lines = unnumbered(text.split("\n"), dialect)
    begin, end = calls.wrapping(fields)
    inner = lines[len(begin) : len(lines) - len(end) - 1]
    if lines != [*begin, *inner, *end, ""] or not inner:
        wanted = f"begin with {begin[0]!r} and " if begin else ""
        raise ProgramError(f"{file}: a called program must {wanted}end with {end[-1]!r}: write it again", line=0)
    _check_numbers(text, lines, file, dialect)
    return len(begin) + 1, inner


def _check_numbers(text: str, lines: list[str], file: Path, dialect: Dialect) -> None:
    """ProgramError where the blocks of a file are not numbered in their order, or its last line is not ended."""
    wanted = number_blocks(lines[:-1], dialect)[0]
    if text != wanted:
        pairs = zip(text.split("\n"), wanted.split("\n"), strict=False)
        line = next((at for at, (one, two) in enumerate(pairs, start=1) if one != two), len(lines))
        raise ProgramError(f"{file}: line {line}: its block number is not that of its place", line=line)
