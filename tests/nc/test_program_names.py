"""A control's names and lines: what it would refuse is told before planning, with a name that it takes."""

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

import bonecam
from bonecam.errors import FileError, MachineError, ProgramError
from bonecam.job import Job, NcJob
from bonecam.machine.machine import machine_files, machine_names, read_machine
from bonecam.nc.dialect import dialect_names, read_dialect
from bonecam.nc.header import record_checks, record_simulation
from bonecam.nc.posting import write_program
from bonecam.nc.program import check_file_name, program_name, second_program_file
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect
from bonecam.nc.words import comment, comments_of
from bonecam.report.outputs import Outputs
from bonecam.tool.path import ToolPath
from bonecam.verify.control import check_posting

LONG = "Proximale Phalanx links - Versuch Nr 12 Größe L (für Dr X) - bitte nicht verwechseln"


@pytest.mark.parametrize("name", dialect_names())
@pytest.mark.parametrize(("second", "split"), [(False, False), (True, True)])
def test_a_name_that_a_control_refuses_is_told_with_one_that_it_takes(name: str, second: bool, split: bool) -> None:
    dialect = read_dialect(name)
    check_file_name(Path(f"bone{dialect.extension}"), dialect, second=second, split=split)
    for stem in (LONG, "1", "größe", "a" * 300):
        try:
            check_file_name(Path(f"{stem}{dialect.extension}"), dialect, second=second, split=split)
        except FileError as error:
            proposed = Path(str(error).rsplit("name it ", 1)[1])
            assert proposed.suffix == dialect.extension
            check_file_name(proposed, dialect, second=second, split=split)
            other = second_program_file(proposed, dialect)
            assert re.fullmatch(dialect.file_name.pattern, other.stem)
            assert len(f"{other.stem}_2000") <= dialect.file_name.longest or not second


def test_siemens_takes_24_letters_digits_and_underscores(tmp_path: Path) -> None:
    dialect = read_dialect("siemens-840d")
    told = r"loads names of 24 characters at most that match .*: name it Proximale_Phalanx_links\.mpf"
    with pytest.raises(FileError, match=told):
        Outputs(program=tmp_path / f"{LONG}.mpf").check(None, dialect)
    assert second_program_file("bone.mpf", dialect).name == "bone_second.mpf"
    assert second_program_file("bone.h", read_dialect("heidenhain")).name == "bone.second.h"


@pytest.mark.parametrize("name", dialect_names())
def test_comments_keep_to_the_longest_line(name: str) -> None:
    dialect = read_dialect(name).model_copy(update={"longest_line": 80})
    text = " ".join(["warning, towards X+ X+ X+ X+ X+ and Y+ and Z+, something bends by 0.123 mm"] * 9)
    lines = comments_of(text, dialect)
    assert max(map(len, [*lines, comment(text, dialect)])) <= 80
    assert "".join("".join(lines).split()).count("BENDS") == 9


@pytest.mark.parametrize("name", dialect_names())
def test_every_line_of_a_program_is_one_that_the_control_loads(name: str, three_paths: Sequence[ToolPath]) -> None:
    long = "part: " + "Größe L, towards X+ and Y+ " * 40
    for form in ("controller", *read_dialect(name).forms):
        dialect = read_dialect(name).in_form(form)
        machine = read_machine("mikron-ucp600" if dialect.tool_centre else "linuxcnc-xyzbc")
        program = write_program(three_paths, machine, dialect, Job(), comments=[long])
        program = record_simulation(record_checks(program, dialect, long), dialect, 0.1, long)
        assert max(map(len, program.text.split("\n"))) <= dialect.longest_line <= 512
        read_program(program.text, machine, dialect)


def test_a_line_that_the_control_does_not_load_is_refused_with_its_number(three_paths: Sequence[ToolPath]) -> None:
    machine, dialect = read_machine("linuxcnc-xyzbc"), read_dialect("linuxcnc")
    text = write_program(three_paths, machine, dialect, Job()).text
    for length, fits in ((252, True), (253, False)):
        longer = text.replace("%\n", f"%\n({'A' * (length - 2)})\n", 1)
        if fits:
            read_program(longer, machine, dialect)
            continue
        with pytest.raises(ProgramError, match=r"line 2: it has 253 characters, linuxcnc loads 252: divide it"):
            read_program(longer, machine, dialect)


@pytest.mark.skipif(shutil.which("rs274") is None, reason="LinuxCNC's interpreter is not here")
def test_linuxcnc_runs_a_line_of_252_characters_and_no_longer_one(tmp_path: Path) -> None:
    (tmp_path / "tool.tbl").write_text("T1 P1 Z1 D0.1\n")
    for length, code in ((252, 0), (253, 1)):
        (tmp_path / "line.ngc").write_text(f"%\n({'A' * (length - 2)})\nG21\nM2\n%\n")
        call = ["rs274", "-g", "-t", "tool.tbl", "line.ngc"]
        done = subprocess.run(call, cwd=tmp_path, capture_output=True, timeout=60, check=False)
        assert done.returncode == code


def test_the_program_of_a_part_with_a_long_name_has_one_that_the_control_takes() -> None:
    for name in dialect_names():
        dialect = read_dialect(name)
        assert len(program_name(f"{LONG * 3}.stl", dialect)) <= dialect.file_name.longest
    assert program_name("out/left hand-3.h", dialect) == "LEFT_HAND_3"


def test_a_batch_refuses_a_name_before_any_part(tmp_path: Path) -> None:
    parts = [tmp_path / f"{name}.stl" for name in ("bone", LONG)]
    job = Job().with_values(nc={"controller": "siemens-840d"})
    with pytest.raises(FileError, match=r"verwechseln\.stl: .*: name it Proximale_Phalanx_links\.mpf, by the name"):
        bonecam.convert_many(parts, tmp_path / "out", job)
    assert not (tmp_path / "out").exists()


def test_posted_paths_are_refused_a_name_before_they_are_read(tmp_path: Path) -> None:
    job = Job().with_values(nc={"controller": "siemens-840d"})
    for name in ("paths.apt", "part.stl"):
        (tmp_path / name).write_text("")
    with pytest.raises(FileError, match=r"name it Proximale_Phalanx_links\.mpf"):
        bonecam.post(tmp_path / "paths.apt", tmp_path / "part.stl", job, program=tmp_path / f"{LONG}.mpf")


@pytest.mark.parametrize("name", machine_names())
def test_the_usual_controller_of_every_machine_fits_it(name: str) -> None:
    job = Job().with_values(nc={"machine": name})
    assert job.nc.controller == ""
    check_posting(job, read_machine(name), job_dialect(job.nc))


def test_the_controller_of_a_machine_file_lies_beside_it_and_a_job_that_names_one_wins(tmp_path: Path) -> None:
    text = (machine_files()["linuxcnc-xyzbc"]).read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text('like = "linuxcnc"\ntitle = "Our own"\n')
    mine = tmp_path / "mill.toml"
    for stated, title in (("own.toml", "Our own"), ("", "Heidenhain Klartext")):
        mine.write_text(re.sub(r"(?m)^controller = .*\n", f'controller = "{stated}"\n' if stated else "", text))
        assert job_dialect(NcJob(machine=str(mine))).title == title
    assert job_dialect(NcJob(machine=str(mine), controller="makino")).name == "makino"
    mine.write_text(text.replace('controller = "linuxcnc"', 'controller = "linuxcmc"'))
    with pytest.raises(MachineError, match=r"mill\.toml: controller 'linuxcmc' is unknown"):
        job_dialect(NcJob(machine=str(mine)))
