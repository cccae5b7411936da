"""What a job may ask of a machine: here the time for its passes.

A control's names and lines: what it would refuse is told before planning, with a name that it takes.
"""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tool_paths import THREE_PATHS

import bonecam
from bonecam.errors import FileError, JobError, MachineError, ProgramError
from bonecam.job import Job, NcJob
from bonecam.machine import Machine, machine_names, read_machine
from bonecam.machine.bodies import Frustum, Table
from bonecam.machine.machine import UPRIGHT, machine_files
from bonecam.mesh import TriangleMesh
from bonecam.nc import dialect_names, read_dialect, read_program, write_program
from bonecam.nc.header import record_checks, record_simulation
from bonecam.nc.program import check_file_name, program_name, second_program_file
from bonecam.nc.requirements import check_length, check_reach, check_room, job_dialect, least_lengths
from bonecam.nc.words import comment, comments_of
from bonecam.report.outputs import Outputs
from bonecam.setup import Capsule
from bonecam.verify.control import check_posting

CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)
PART = TriangleMesh(CORNERS, FACES)
"""A corner of a cube: 1000 / 6 mm^3."""


def test_the_least_length_of_the_passes_is_volume_by_depth_and_step():
    balls = (1.0, 0.01), (2.0, 0.02), (2.0, 0.05)
    fine, before, coarse = (2 * np.sqrt(h * (2 * r - h)) for r, h in balls)
    levels = {"depths": "0.1 0.2 0.5"}
    left = 700 - PART.area * (0.1 + 0.2)
    told = {"roughing": PART.area / before + left / (0.5 * coarse), "finishing": PART.area / fine}
    found = least_lengths(PART, 700 + PART.volume, Job().with_values(levels=levels))
    assert found == pytest.approx(told, rel=1e-12)
    assert set(least_lengths(PART, PART.volume - 1, Job()).values()) == {0}


def test_a_stock_that_takes_days_to_cut_is_refused_with_the_hours():
    stock = Capsule(np.zeros(3), np.array([0.0, 0.0, 30.0]), 50.0)
    shares = r"\(1699 m in roughing cuts and 3 m in finishing cuts\)"
    what = rf"\[path\] most_length = 500: .* 7\.55e\+05 mm3 .* takes 1702 m of passes or more {shares}, 12 h: give a"
    with pytest.raises(JobError, match=what):
        check_length(PART, stock, Job())
    check_length(PART, stock, Job().with_values(path={"most_length": 3000.0}))
    deep = {"levels": {"roughing_depth": 2.0}, "roughing": {"radius": 8.0, "scallop": 0.2}}
    told: list[str] = []
    check_length(PART, stock, Job().with_values(**deep), lambda share, what: told.append(what))
    assert told == ["109 m of passes or more, 0.5 h of cutting"]


def test_what_stands_on_the_table_and_reaches_into_the_stock_is_refused_before_anything_is_planned():
    machine = read_machine("mikron-ucp600")
    stock = Capsule(np.array([0.0, 0.0, 45.0]), np.array([0.0, 0.0, 60.0]), 5.0)
    job = Job().with_values(holding={"length": 40.0})
    for lengths, fits in (([40.0], True), ([30.0, 20.0], False)):
        stack = tuple(Frustum(length, 30.0, 30.0) for length in lengths)
        crowded = replace(machine, table=Table(standing=stack))
        if fits:
            check_room(stock, job, crowded)
            continue
        with pytest.raises(MachineError, match=r"reaches to z 50 mm, the stock begins at 40: give a longer post"):
            check_room(stock, job, crowded)


def test_a_table_that_sweeps_more_than_z_travels_is_refused_before_anything_is_planned():
    machine = read_machine("mikron-ucp600")
    stock = Capsule(np.array([0.0, 0.0, 45.0]), np.array([0.0, 0.0, 60.0]), 5.0)
    job = Job().with_values(holding={"length": 40.0})
    check_room(stock, job, replace(machine, table=Table(standing=(Frustum(30.0, 300.0, 300.0),))))
    huge = replace(machine, table=Table(standing=(Frustum(30.0, 90_000.0, 90_000.0),)))
    with pytest.raises(MachineError, match=r"reach 45\d\d\d mm from the pivot.*correct the machine's \[table\]"):
        check_room(stock, job, huge)


def limited(name: str = "mikron-ucp600", **limits_deg: tuple[float, float]) -> Machine:
    """A machine that ships, with other limits of some rotary axes."""
    machine = read_machine(name)
    axes = (
        replace(axis, endless=False, limits=tuple(np.radians(limits_deg[axis.letter])))
        if axis.letter in limits_deg
        else axis
        for axis in machine.part_axes
    )
    return replace(machine, part_axes=tuple(axes))


@pytest.mark.parametrize("turns", [(-360, 360), (0, 360), (-185, 185), (-450, 450), (-90, 90)])
def test_turntables_with_limits_reach_all_round(turns):
    check_reach(Job(), limited(C=turns))
    check_reach(Job(), read_machine("linuxcnc-xyzbc"))


@pytest.mark.parametrize(
    ("limits", "job", "told"),
    [
        ({"B": (-10, 10)}, {}, "leans by 9 deg all round at most, the sides of the stock need 15: .*path.max_tilt"),
        pytest.param(
            {"B": (-80, 80)},
            {"path": {"strategy": "rotary"}},
            "the sides of the stock need 90: take another machine",
            marks=pytest.mark.plugged,
        ),
        ({"B": (-0.5, 0.5)}, {}, "leans to some sides only: give wider limits"),
        ({"C": (-80, 80), "B": (-115, 0)}, {}, "C -80 to 80 deg the tool axis leans to some sides only"),
    ],
)
def test_axes_that_do_not_lean_far_enough_all_round_are_refused_with_their_limits(limits, job, told):
    with pytest.raises(MachineError, match=told):
        check_reach(Job().with_values(**job), limited(**limits))


def test_an_endless_axis_across_the_part_is_told_without_limits():
    machine = replace(read_machine("mill-4axis"), part_frame=UPRIGHT)
    with pytest.raises(MachineError, match=r"^mill-4axis: the tool axis leans to some sides only: .* part_z"):
        check_reach(Job().with_values(nc={"machine": "mill-4axis"}), machine)


def test_a_table_that_would_turn_over_for_a_rewind_is_refused_before_anything_is_planned():
    machine = read_machine("mikron-ucp600")
    first, second = machine.part_axes
    round_x = replace(first, letter="A", direction=(1.0, 0.0, 0.0), endless=False, limits=(0.0, 2 * np.pi))
    tilted = replace(second, limits=(-np.radians(179), np.radians(179)))
    with pytest.raises(MachineError, match=r"A must be rewound by 3\d\d deg .* turns the table over") as caught:
        check_reach(Job(), replace(machine, part_axes=(round_x, tilted)))
    assert caught.value.evidence["axis"] == "A"
    middle = replace(round_x, limits=(-np.pi, np.pi))
    check_reach(Job(), replace(machine, part_axes=(middle, tilted)))


LONG = "Proximale Phalanx links - Versuch Nr 12 Größe L (für Dr X) - bitte nicht verwechseln"


@pytest.mark.parametrize("name", dialect_names())
@pytest.mark.parametrize(("second", "split"), [(False, False), (True, True)])
def test_a_name_that_a_control_refuses_is_told_with_one_that_it_takes(name, second, split):
    dialect = read_dialect(name)
    check_file_name(Path(f"bone{dialect.extension}"), dialect, second=second, split=split, probe=second)
    for stem in (LONG, "1", "größe", "a" * 300):
        try:
            check_file_name(Path(f"{stem}{dialect.extension}"), dialect, second=second, split=split, probe=second)
        except FileError as error:
            proposed = Path(str(error).rsplit("name it ", 1)[1])
            assert proposed.suffix == dialect.extension
            check_file_name(proposed, dialect, second=second, split=split, probe=second)
            other = second_program_file(proposed, dialect)
            assert re.fullmatch(dialect.file_name.pattern, other.stem)
            assert len(f"{other.stem}_2000") <= dialect.file_name.longest or not second


def test_siemens_takes_24_letters_digits_and_underscores(tmp_path):
    dialect = read_dialect("siemens-840d")
    told = r"loads names of 24 characters at most that match .*: name it Proximale_Phalanx_links\.mpf"
    with pytest.raises(FileError, match=told):
        Outputs(program=tmp_path / f"{LONG}.mpf").check(None, dialect)
    assert second_program_file("bone.mpf", dialect).name == "bone_second.mpf"
    assert second_program_file("bone.h", read_dialect("heidenhain")).name == "bone.second.h"


@pytest.mark.parametrize("name", dialect_names())
def test_comments_keep_to_the_longest_line(name):
    dialect = read_dialect(name).model_copy(update={"longest_line": 80})
    text = " ".join(["warning, towards X+ X+ X+ X+ X+ and Y+ and Z+, something bends by 0.123 mm"] * 9)
    lines = comments_of(text, dialect)
    assert max(map(len, [*lines, comment(text, dialect)])) <= 80
    assert "".join("".join(lines).split()).count("BENDS") == 9


@pytest.mark.parametrize("name", dialect_names())
def test_every_line_of_a_program_is_one_that_the_control_loads(name):
    long = "part: " + "Größe L, towards X+ and Y+ " * 40
    for form in ("controller", *read_dialect(name).forms):
        dialect = read_dialect(name).in_form(form)
        machine = read_machine("mikron-ucp600" if dialect.tool_centre else "linuxcnc-xyzbc")
        program = write_program(THREE_PATHS, machine, dialect, Job(), comments=[long])
        program = record_simulation(record_checks(program, dialect, long), dialect, 0.1, long)
        assert max(map(len, program.text.split("\n"))) <= dialect.longest_line <= 512
        read_program(program.text, machine, dialect)


def test_a_line_that_the_control_does_not_load_is_refused_with_its_number():
    machine, dialect = read_machine("linuxcnc-xyzbc"), read_dialect("linuxcnc")
    text = write_program(THREE_PATHS, machine, dialect, Job()).text
    for length, fits in ((252, True), (253, False)):
        longer = text.replace("%\n", f"%\n({'A' * (length - 2)})\n", 1)
        if fits:
            read_program(longer, machine, dialect)
            continue
        with pytest.raises(ProgramError, match=r"line 2: it has 253 characters, linuxcnc loads 252: divide it"):
            read_program(longer, machine, dialect)


@pytest.mark.skipif(shutil.which("rs274") is None, reason="LinuxCNC's interpreter is not here")
def test_linuxcnc_runs_a_line_of_252_characters_and_no_longer_one(tmp_path):
    (tmp_path / "tool.tbl").write_text("T1 P1 Z1 D0.1\n")
    for length, code in ((252, 0), (253, 1)):
        (tmp_path / "line.ngc").write_text(f"%\n({'A' * (length - 2)})\nG21\nM2\n%\n")
        call = ["rs274", "-g", "-t", "tool.tbl", "line.ngc"]
        done = subprocess.run(call, cwd=tmp_path, capture_output=True, timeout=60, check=False)
        assert done.returncode == code


def test_the_program_of_a_part_with_a_long_name_has_one_that_the_control_takes():
    for name in dialect_names():
        dialect = read_dialect(name)
        assert len(program_name(f"{LONG * 3}.stl", dialect)) <= dialect.file_name.longest
    for file, name in (("out/left hand-3.h", "LEFT_HAND_3"), ("", "BONE"), ("kn\u00f6chel.h", "KN_CHEL")):
        assert program_name(file, read_dialect("heidenhain")) == name


def test_a_batch_refuses_a_name_before_any_part(tmp_path):
    parts = [tmp_path / f"{name}.stl" for name in ("bone", LONG)]
    job = Job().with_values(nc={"controller": "siemens-840d"})
    with pytest.raises(FileError, match=r"verwechseln\.stl: .*: name it Proximale_Phalanx_links\.mpf, by the name"):
        bonecam.convert_many(parts, tmp_path / "out", job)
    assert not (tmp_path / "out").exists()


@pytest.mark.plugged
def test_posted_paths_are_refused_a_name_before_they_are_read(tmp_path):
    job = Job().with_values(nc={"controller": "siemens-840d"})
    for name in ("paths.apt", "part.stl"):
        (tmp_path / name).write_text("")
    with pytest.raises(FileError, match=r"name it Proximale_Phalanx_links\.mpf"):
        bonecam.post(tmp_path / "paths.apt", tmp_path / "part.stl", job, program=tmp_path / f"{LONG}.mpf")


@pytest.mark.parametrize("name", machine_names())
def test_the_usual_controller_of_every_machine_fits_it(name):
    job = Job().with_values(nc={"machine": name})
    assert job.nc.controller == ""
    check_posting(job, read_machine(name), job_dialect(job.nc))


def test_the_controller_of_a_machine_file_lies_beside_it_and_a_job_that_names_one_wins(tmp_path):
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
