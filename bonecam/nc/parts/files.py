"""The files of a program in parts: the caller and what it calls. Their blocks are those of the whole text that was
proved, which `joined` makes of them again."""

from collections.abc import Iterable, Mapping
from itertools import count
from pathlib import Path

from bonecam.errors import FileError
from bonecam.files import input_text
from bonecam.nc.dialect import Dialect
from bonecam.nc.parts.marks import end_mark, mark_in, part_count, unnumbered
from bonecam.nc.posting.block_numbers import number_blocks
from bonecam.nc.program import LOWEST_DRAWN, NUMBERS, Program
from bonecam.nc.schema.calls_table import CallsTable
from bonecam.runtime.staging import Staging, staged


def program_files(program: Program, dialect: Dialect, place: str | Path) -> dict[Path, str]:
    """The texts of a program by file: of the one at `place`, the whole program or the caller of its parts, and of
    the parts beside it. FileError where one would replace a part of another program, or a part what is none."""
    place = Path(place)
    calls = dialect.calls
    others = (_owners(place, dialect) or set()) - {program.name}
    if others:
        what = f"{place}: it is a part of {min(others)}"
        raise FileError(f"{what}: give another name, or another folder", file=str(place))
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
        _check_own(file, program.name, dialect)
        texts[file] = number_blocks([*begin, *lines[first:last], *ends], dialect)[0]
    return {place: number_blocks([*caller, *lines[end:]], dialect)[0], **texts}


def stale_parts(program: Program, dialect: Dialect, place: str | Path) -> list[Path]:
    """The files beside that at `place` that are parts of an older program of this name, and that the new one, which has
    fewer, does not call: a person might run them."""
    found = list[Path]()
    for part in count(part_count(program.text) + 1):
        if dialect.calls is None:
            break
        file = Path(place).with_name(str(part_fields(dialect.calls, program, part)["file"]))
        if _owners(file, dialect) != {program.name}:
            break
        found.append(file)
    return found


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
        for file in stale_parts(program, dialect, place):
            if file not in texts:
                staging.remove(file)


def check_apart(first: Iterable[Path], second: Iterable[Path]) -> None:
    """FileError where the programs of two clampings have a file of the same name, by their numbers."""
    for file in sorted({*first} & {*second}):
        what = f"{file}: both clampings have a part of this name"
        raise FileError(f"{what}: give another nc.program_number, or another name", file=str(file))


def part_fields(calls: CallsTable, program: Program, part: int) -> dict[str, str | int]:
    """What a part (from 1) of a program is called by."""
    number = program.number + part
    if number >= LOWEST_DRAWN:
        number = LOWEST_DRAWN + (number - LOWEST_DRAWN) % NUMBERS
    name = f"{program.name}_{part}"
    fields: dict[str, str | int] = {"name": name, "lower": name.lower(), "number": number}
    return {**fields, "file": calls.file.format(**fields)}


def _check_own(file: Path, caller: str, dialect: Dialect) -> None:
    """FileError where a file is there that is no part of this program."""
    owners = _owners(file, dialect)
    if owners is not None and owners != {caller}:
        content = f"a part of {min(owners)}" if owners else "no part of a program"
        what = f"{file}: it is there, and {content}, but has the name of a part of {caller}"
        remedy = "move it away, or give another nc.program_number, or another folder"
        raise FileError(f"{what}: {remedy}", file=str(file))


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
