"""Programs are named for their controller, and never as a file of another kind; APT files hold the tool path."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bonecam
from bonecam.errors import FileError
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.parts import check_apart, joined
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect
from bonecam.report import read_apt
from bonecam.report.outputs import Outputs, check_ending
from bonecam.verify.readback import Tolerances, compare_moves


@pytest.mark.parametrize(
    ("controller", "name", "proposed"),
    [
        ("heidenhain", "a.ngc", "a.h"),
        ("heidenhain", "a.gcode", "a.h"),
        ("linuxcnc", "a.H", "a.ngc"),
        ("siemens-840d", "a.h", "a.mpf"),
        ("fanuc-30i", "a.mpf", "a.nc"),
    ],
)
def test_a_program_named_for_another_controller_is_refused_with_the_name_that_fits(
    controller: str, name: str, proposed: str
) -> None:
    with pytest.raises(FileError, match=f"name it {proposed}"):
        check_ending(Path(name), read_dialect(controller))


def test_parts_of_both_clampings_do_not_share_a_file() -> None:
    first, second = ({Path(name): "" for name in names.split()} for names in ("a.nc O0078.nc", "b.nc O0078.nc"))
    with pytest.raises(FileError, match=r"O0078\.nc: both clampings have a part of this name: give another"):
        check_apart(first, second)
    check_apart(first, {Path("b.nc"): ""})


@pytest.mark.parametrize("name", ["a.h", "a.H", "a.nc", "a.i"])
def test_a_control_s_own_endings_are_free(name: str) -> None:
    check_ending(Path(name), read_dialect("heidenhain"))


def test_a_program_is_never_named_as_a_part() -> None:
    with pytest.raises(FileError, match=r"name it bone\.h"):
        check_ending(Path("bone.stl"), read_dialect("heidenhain"))


@pytest.mark.parametrize(("name", "proposed"), [("p", "p.h"), ("out/p.", "p.h"), (".h", "h.h"), ("-", "-.h")])
def test_a_program_without_an_ending_is_refused_with_the_one_that_the_control_lists(name: str, proposed: str) -> None:
    with pytest.raises(FileError, match=rf"has no ending, heidenhain programs end in \.h: name it {proposed}$"):
        check_ending(Path(name), read_dialect("heidenhain"))


def test_the_apt_file_has_every_move_of_the_tool_paths(small_run: tuple[bonecam.Result, Path]) -> None:
    made, folder = small_run
    read = read_apt((folder / "bone.apt").read_text(encoding="utf-8"))
    assert read.name == made.program.name
    for name in ("tips", "axes"):
        found = np.vstack([getattr(path, name) for path in read.paths])
        assert np.abs(found - np.vstack([getattr(path, name) for path in made.paths])).max() < 1e-6


@pytest.mark.parametrize("name", ["a.h", "a", "a.stl"])
def test_an_apt_file_with_another_ending_is_refused(name: str) -> None:
    with pytest.raises(FileError, match=rf"name it {name}\.apt"):
        Outputs(apt=name).check()


def test_a_split_program_is_written_as_caller_and_parts_that_join_to_what_was_proved(
    small_run: tuple[bonecam.Result, Path], tmp_path: Path
) -> None:
    made, _ = small_run
    job = made.job.with_values(nc={"split": "level"})
    machine, dialect = read_machine(job.nc.machine), job_dialect(job.nc)
    program = write_program(made.paths, machine, dialect, job, name="BONE")
    place = tmp_path / f"bone{program.extension}"
    Outputs(program=place).write(replace(made, program=program, job=job, second=None))
    assert len(list(tmp_path.iterdir())) == len(made.paths) + 1
    whole = joined(place, dialect).text
    assert whole == program.text
    compare_moves(read_program(whole, machine, dialect), made.paths, dialect, Tolerances())
