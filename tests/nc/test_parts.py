"""A program in numbered files: what the control runs of them is what was proved as one text."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from controls import KINDS
from tool_paths import THREE_PATHS

from bonecam.errors import FileError, JobError, ProgramError, VerifyError
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.nc import Dialect, Program, read_program, write_program
from bonecam.nc.parts import joined, part_count, program_files, stage_program_files, write_program_files
from bonecam.nc.requirements import job_dialect
from bonecam.runtime.staging import staged
from bonecam.verify.control import program_text

MACHINE = read_machine("mikron-ucp600")
Made = tuple[Program, Dialect, Job]


@cache
def made_of(controller: str, name: str = "BONE", **nc: object) -> Made:
    job = Job().with_values(nc={"controller": controller, **nc})
    dialect = job_dialect(job.nc)
    return write_program(THREE_PATHS, MACHINE, dialect, job, name=name), dialect, job


def written(made: Made, folder: Path) -> Path:
    program, dialect, _ = made
    place = folder / f"bone{program.extension}"
    write_program_files(program, dialect, place)
    return place


@pytest.mark.parametrize(
    ("controller", "split", "files"),
    [
        *((name, {"split": "level"}, 3) for name in KINDS),
        ("heidenhain", {"split": "tool"}, 2),
        ("fanuc-30i", {"split_blocks": 1000}, 2),
    ],
)
def test_the_files_run_the_moves_of_the_program_in_one(controller, split, files, tmp_path):
    made = made_of(controller, **split)
    program, dialect, _ = made
    caller = written(made, tmp_path)
    assert len(list(tmp_path.iterdir())) - 1 >= files
    assert joined(caller, dialect).text == program.text
    whole, _, _ = made_of(controller)
    one, other = (read_program(text, MACHINE, dialect) for text in (whole.text, joined(caller, dialect).text))
    np.testing.assert_array_equal(one.words, other.words)
    np.testing.assert_array_equal(one.feed_rates, other.feed_rates)
    np.testing.assert_array_equal(one.spindle, other.spindle)
    np.testing.assert_array_equal(one.tools, other.tools)


@pytest.mark.parametrize(
    ("controller", "call", "file", "first", "last"),
    [
        ("heidenhain", "CALL PGM BONE_1.h", "BONE_1.h", "0 BEGIN PGM BONE_1 MM", "END PGM BONE_1 MM"),
        ("siemens-840d", 'EXTCALL("BONE_1.mpf")', "BONE_1.mpf", "; PART 1 OF 2 OF BONE LEVEL 5 TO LEVEL 4", "M17"),
        ("fanuc-30i", "M98 P0078", "O0078.nc", "%", "%"),
        ("makino", "M98 P0078", "O0078.nc", "%", "%"),
        ("mitsubishi", "M98 P0078", "O0078.nc", "%", "%"),
        ("linuxcnc", "o<bone_1> call", "bone_1.ngc", "o<bone_1> sub", "M2"),
    ],
)
def test_a_caller_calls_parts_that_return_to_it(controller, call, file, first, last, tmp_path):
    caller = written(made_of(controller, split="tool", program_number=77), tmp_path)
    calls = [line for line in caller.read_text().split("\n") if line.endswith(call)]
    assert len(calls) == 1
    part = (tmp_path / file).read_text().removesuffix("\n").split("\n")
    assert first in part[0]
    assert part[-1].endswith(last)
    assert not [line for line in part[:-1] if line.endswith((" M30", " M2"))]


def test_every_part_begins_with_all_that_a_restart_needs(tmp_path):
    caller = written(made_of("heidenhain", split="level"), tmp_path)
    for part in (1, 2, 3):
        text = caller.with_name(f"BONE_{part}.h").read_text()
        start = text[: text.index("CUT")]
        for word in ("CYCL DEF 247", "PLANE RESET", "CYCL DEF 32.1", "TOOL CALL", "M140 MB MAX", "M126", "M3"):
            assert word in start


def test_no_file_has_more_blocks_than_the_job_allows(tmp_path):
    written(made_of("fanuc-30i", split_blocks=1000), tmp_path)
    parts = [path.read_text().count("\n") for path in tmp_path.glob("O*.nc")]
    assert len(parts) == 2
    assert max(parts) <= 1000


def test_a_split_too_small_for_one_level_is_one_line():
    with pytest.raises(
        JobError, match=r"^\[nc\] split_blocks = 40: level \d has \d+ blocks: give \d+ or more$"
    ) as caught:
        made_of("heidenhain", split_blocks=40)
    needed = int(str(caught.value).split("give ")[1].split(" ")[0])
    made_of("heidenhain", split_blocks=needed)
    with pytest.raises(JobError, match="split_blocks"):
        made_of("heidenhain", split_blocks=needed - 1)


def without(text: str, line: str) -> str:
    return "\n".join(each for each in text.split("\n") if line not in each)


FAULTS: dict[str, Callable[[Path], object]] = {
    "a part is missing": lambda folder: (folder / "BONE_2.h").unlink(),
    "two parts are exchanged": lambda folder: (folder / "BONE_1.h").write_text(
        (folder / "BONE_2.h").read_text().replace("BONE_2", "BONE_1")
    ),
    "a part is cut off": lambda folder: (folder / "BONE_2.h").write_text(
        (folder / "BONE_2.h").read_text()[:3000].rsplit("\n", 1)[0] + "\n"
    ),
    "a block is lost": lambda folder: (folder / "BONE_2.h").write_text(
        without((folder / "BONE_2.h").read_text(), "M126")
    ),
    "a call is lost": lambda folder: (folder / "bone.h").write_text(
        without((folder / "bone.h").read_text(), "CALL PGM BONE_3")
    ),
    "the name inside is another": lambda folder: (folder / "BONE_2.h").write_text(
        (folder / "BONE_2.h").read_text().replace("END PGM BONE_2", "END PGM BONE_9")
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_files_that_are_not_those_of_the_program_are_refused(fault, tmp_path):
    made = made_of("heidenhain", split="level")
    caller = written(made, tmp_path)
    FAULTS[fault](tmp_path)
    with pytest.raises((ProgramError, FileError), match=r"(BONE_\d|bone)\.h: "):
        joined(caller, made[1])


def test_a_fault_in_a_part_is_told_with_its_file_and_line(tmp_path):
    program, dialect, job = made_of("heidenhain", split="level")
    caller = written((program, dialect, job), tmp_path)
    part = tmp_path / "BONE_2.h"
    lines = part.read_text().split("\n")
    row = next(at for at, line in enumerate(lines) if " F900" in line)
    lines[row] = lines[row].replace("F900", "F9e2")
    part.write_text("\n".join(lines))
    with pytest.raises((VerifyError, ProgramError), match=rf"BONE_2\.h: line {row + 1} \(of the whole program line "):
        program_text(caller, MACHINE, dialect, job)


def test_a_part_without_its_caller_is_told_as_one(tmp_path):
    made = made_of("siemens-840d", split="level")
    written(made, tmp_path)
    with pytest.raises(ProgramError, match=r"BONE_2\.mpf: it is part 2 of 3 of BONE: give the program that"):
        joined(tmp_path / "BONE_2.mpf", made[1])
    (tmp_path / "whole.mpf").write_text(made[0].text)
    assert joined(tmp_path / "whole.mpf", made[1]).text == made[0].text


def test_the_files_are_written_all_or_none(tmp_path):
    made = made_of("heidenhain", split="level")
    (tmp_path / "BONE_3.h").mkdir()
    with pytest.raises(FileError, match=r"BONE_3\.h"):
        written(made, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["BONE_3.h"]


def test_a_part_does_not_replace_that_of_another_program(tmp_path):
    program, dialect, _ = made_of("fanuc-30i", split="tool", program_number=77)
    written((program, dialect, Job()), tmp_path)
    other, _, _ = made_of("fanuc-30i", "OTHER", split="tool", program_number=78)
    with pytest.raises(FileError, match=r"O0079\.nc: it is there, and a part of BONE"):
        program_files(other, dialect, tmp_path / "other.nc")


def test_a_part_does_not_replace_a_file_that_is_none(tmp_path):
    made = made_of("fanuc-30i", split="tool", program_number=77)
    (tmp_path / "O0079.nc").write_text("%\nO0079\nM30\n%\n")
    with pytest.raises(FileError, match=r"O0079\.nc: it is there, and no part of a program"):
        written(made, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["O0079.nc"]


def test_a_program_does_not_replace_a_part_that_another_calls(tmp_path):
    made = made_of("linuxcnc", split="tool")
    written(made, tmp_path)
    other, dialect, _ = made_of("linuxcnc", "BONE_1")
    with pytest.raises(FileError, match=r"bone_1\.ngc: it is a part of BONE: give another name"):
        program_files(other, dialect, tmp_path / "bone_1.ngc")


@pytest.mark.parametrize("controller", ["heidenhain", "fanuc-30i", "linuxcnc"])
def test_parts_of_a_longer_program_go_with_it(controller, tmp_path):
    other = tmp_path / "notes.txt"
    other.write_text("mine")
    first = made_of(controller, split="level", program_number=77)
    caller = written(first, tmp_path)
    assert len(list(tmp_path.iterdir())) == 2 + part_count(first[0].text) == 5
    for fewer in ({"split": "tool"}, {}):
        made = made_of(controller, program_number=77, **fewer)
        written(made, tmp_path)
        assert set(tmp_path.iterdir()) == {other, *program_files(made[0], made[1], caller)}
    assert part_count(made[0].text) == 0


@pytest.mark.parametrize("controller", ["heidenhain", "fanuc-30i"])
def test_parts_of_longer_programs_of_both_clampings_go(controller, tmp_path):
    def write(**nc):
        dialect = made_of(controller, **nc)[1]
        named = {
            tmp_path / f"{name}{dialect.extension}": made_of(controller, name, **nc)[0]
            for name in ("BONE", "BONE_SECOND")
        }
        with staged() as staging:
            stage_program_files(staging, named, dialect)
        return {file for place, program in named.items() for file in program_files(program, dialect, place)}

    for split, files in (("level", 8), ("tool", 6), ("none", 2)):
        own = write(split=split)
        assert {*tmp_path.iterdir()} == own
        assert len(own) == files


def test_parts_stay_where_the_new_program_is_refused(tmp_path):
    caller = written(made_of("heidenhain", split="level"), tmp_path)
    before = {file: file.read_text() for file in tmp_path.iterdir()}
    (tmp_path / "BONE_2.h").write_text("mine")
    with pytest.raises(FileError, match="no part of a program"):
        written(made_of("heidenhain", split="tool"), tmp_path)
    assert caller.read_text() == before[caller]
    assert len(list(tmp_path.iterdir())) == len(before)
