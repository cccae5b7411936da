"""Tool vectors and joints in the place of rotary words: written, read back, refused where they say something else."""

import itertools
import re
from functools import cache

import numpy as np
import pytest
from small_parts import capsule_path, path_of

from bonecam.errors import MachineError, ProgramError, VerifyError
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.machine.kinematics import tool_axes
from bonecam.nc import dialect_names, drivable_paths, read_dialect, read_program, write_program
from bonecam.nc.program import solved_angles, vectors_of, written_vectors
from bonecam.nc.requirements import job_dialect
from bonecam.tool import MoveKind, ToolPath
from bonecam.verify import Tolerances
from bonecam.verify.control import check_control
from bonecam.verify.readback import compare_moves

WITH_VECTORS = [name for name in dialect_names() if "vectors" in read_dialect(name).forms]
WITH_JOINTS = [name for name in dialect_names() if "joints" in read_dialect(name).forms]
FIRST = {
    "heidenhain": r"LN X[+-]\d+\.\d{3} Y\S+ Z\S+ TX[+-][01]\.\d{7} TY[+-]\S+ TZ[+-]\S+ F\d+",
    "siemens-840d": r"G1 X\S+ Y\S+ Z\S+ A3=-?[01]\.\d{6} B3=\S+ C3=\S+ F\d+",
    "fanuc-30i": r"G01 X\S+ Y\S+ Z\S+ I-?[01]\.\d{6} J\S+ K\S+ F\d+\.",
}


@cache
def posted(path: ToolPath, controller: str, axes: str, machine: str = "mikron-ucp600") -> tuple:
    job = Job().with_values(nc={"controller": controller, "axes": axes, "machine": machine})
    chosen, dialect = read_machine(machine), job_dialect(job.nc)
    return write_program([path], chosen, dialect, job).text, chosen, dialect, job


PATH = capsule_path(count=120, turns=3.0)


@pytest.mark.parametrize(
    ("controller", "machine"),
    [*((name, "mikron-ucp600") for name in WITH_VECTORS), ("heidenhain", "hermle-c600u"), ("siemens-840d", "dmu-45")],
)
def test_vectors_are_written_in_every_move_and_read_back(controller, machine):
    text, chosen, dialect, _ = posted(PATH, controller, "vectors", machine)
    assert "UNPROVED" in text or "UNVERIFIED" in text
    form = FIRST.get(controller, FIRST["fanuc-30i"])
    assert len(re.findall(form, text)) > 3
    motions = read_program(text, chosen, dialect)
    check_control(motions, chosen, dialect)
    found = compare_moves(motions, [PATH], dialect, Tolerances())
    assert found.tip_error.max() <= 0.001 + dialect.numbers.length.step


@pytest.mark.parametrize("controller", WITH_VECTORS)
def test_a_program_of_vectors_turns_the_axes_as_one_of_angles(controller):
    by_vector = read_program(*posted(PATH, controller, "vectors")[:3])
    by_angle = read_program(*posted(PATH, controller, "angles")[:3])
    np.testing.assert_allclose(by_vector.axes, by_angle.axes, atol=2e-6)
    np.testing.assert_allclose(by_vector.tips, by_angle.tips, atol=1e-9)
    turns = by_vector.words[:, 3:] - by_angle.words[:, 3:]
    assert np.abs(np.remainder(turns + np.pi, 2 * np.pi) - np.pi).max() < np.radians(0.05)


@pytest.mark.parametrize(
    ("controller", "machine"), [*((name, "mikron-ucp600") for name in WITH_JOINTS), ("siemens-840d", "hermle-c600u")]
)
def test_joints_in_inverse_time_are_written_and_read_back(controller, machine):
    text, chosen, dialect, _ = posted(PATH, controller, "joints", machine)
    assert "G93" in text
    assert not re.search(r"(?m)^(N\d+ )?(TRAORI|.*G43\.4)", text)
    motions = read_program(text, chosen, dialect)
    check_control(motions, chosen, dialect)
    assert motions.inverse_time[~motions.rapid].all()
    found = compare_moves(motions, [PATH], dialect, Tolerances())
    assert found.tip_error.max() <= 0.001 + dialect.numbers.length.step


FAULTS = {
    "heidenhain": [
        (r"TZ([+-]\S+)(?= F)", r"TZ+2.0000000", "unit vector"),
        (r" TY[+-]\S+", "", "unknown block"),
        (r"(LN .*?)TX", r"\1NX", "unknown block"),
        (r"TX[+-]0\.(\d{6})\d ", r"TX+0.\1 ", "unknown block"),
    ],
    "siemens-840d": [
        (r"C3=\S+", "C3=2.000000", "unit vector"),
        (r" B3=\S+", "", "a component of the tool vector is missing"),
        (r" C3=(\S+)", r" C3=\1 B-30.000", "B stands beside a tool vector"),
    ],
    "fanuc-30i": [
        (r"K\S+", "K2.000000", "unit vector"),
        (r" J\S+", "", "a component of the tool vector is missing"),
        (r" K(\S+)", r" K\1 C45.000", "C stands beside a tool vector"),
    ],
}


@pytest.mark.parametrize(
    ("controller", "pattern", "wrong", "told"), [(name, *fault) for name, faults in FAULTS.items() for fault in faults]
)
def test_a_wrong_vector_is_refused_with_its_line(controller, pattern, wrong, told):
    text, machine, dialect, _ = posted(PATH, controller, "vectors")
    lines = text.split("\n")
    row = next(at for at, line in enumerate(lines) if re.search(FIRST[controller], line))
    lines[row] = re.sub(pattern, wrong, lines[row], count=1)
    assert lines[row] not in text
    with pytest.raises(ProgramError, match=rf"^line {row + 1}: .*{told}"):
        read_program("\n".join(lines), machine, dialect)


@pytest.mark.parametrize("controller", list(FAULTS))
def test_a_vector_that_leans_otherwise_is_found_by_the_readback(controller):
    text, machine, dialect, _ = posted(PATH, controller, "vectors")
    words = [re.escape(word.replace("{number}", "")) for word in dialect.vector.words[:2]]
    one, two = (rf"{word}(\S+)" for word in words)
    names = [word.replace("{number}", "") for word in dialect.vector.words[:2]]
    swapped = re.sub(rf"{one} {two}", rf"{names[0]}\2 {names[1]}\1", text)
    assert swapped != text
    with pytest.raises((VerifyError, ProgramError)):
        compare_moves(read_program(swapped, machine, dialect), [PATH], dialect, Tolerances())


def test_the_axes_take_the_nearest_solution_and_stay_at_the_pole():
    machine, vector = (read_machine("mikron-ucp600"), job_dialect(Job().with_values(nc={"axes": "vectors"}).nc).vector)
    angles = np.radians([[-20.0, 170.0], [-20.0, 185.0], [-20.0, 200.0], [0.0, 200.0], [-10.0, 200.0]])
    solved, _ = solved_angles(machine, vectors_of(machine, vector, angles), angles[0])
    np.testing.assert_allclose(solved, angles, atol=1e-5)
    unit, _ = solved_angles(machine, np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), angles[0])
    assert np.isnan(unit[1:]).all()
    np.testing.assert_allclose(unit[0], [0.0, angles[0, 1]], atol=1e-12)


POLE = [[-5.0, 0.0], [0.0, 0.0], [0.0, 60.0], [-5.0, 60.0]]
"""Angles of B and C (degrees): C turns at the pole."""


def test_a_change_to_the_other_solution_that_no_vector_states_is_refused():
    machine, vector = read_machine("mikron-ucp600"), read_dialect("fanuc-30i").in_form("vectors").vector
    words = np.zeros((3, 5))
    words[:, 3:] = [[-5.0, 0.0], [5.0, 180.0], [5.0, 190.0]]
    with pytest.raises(MachineError, match=r"near B 5.000, C 180.000 deg a tool vector does not say .*nc.axes"):
        written_vectors(machine, vector, words)
    assert written_vectors(machine, vector, words[1:])[0].shape == (2, 6)


@pytest.mark.parametrize("controller", ["fanuc-30i", "makino", "mitsubishi"])
def test_where_the_control_takes_no_angles_the_tool_leans_a_little_at_the_pole(controller):
    path = pole_path()
    text, machine, dialect, _ = posted(path, controller, "vectors")
    found = compare_moves(motions := read_program(text, machine, dialect), [path], dialect, Tolerances())
    assert found.tip_error.max() <= 0.001
    turns = np.degrees(np.abs(np.diff(motions.words[:, 4])))[motions.known_start[1:]]
    assert turns.max() < 15.0
    # without the lean C would turn at once where the tool leaves the pole
    upright = re.sub(r" I-?0\.0000\d\d J-?0\.0000\d\d K", " I0.000000 J0.000000 K", text)
    assert upright != text
    jumps = read_program(upright, machine, dialect)
    assert np.degrees(np.abs(np.diff(jumps.words[:, 4])))[jumps.known_start[1:]].max() > 30.0


def pole_path() -> ToolPath:
    machine = read_machine("mikron-ucp600")
    angles = np.radians(np.vstack([np.linspace(*pair, 12) for pair in itertools.pairwise(POLE)]))
    axes = tool_axes(machine, angles)
    tips = np.column_stack([np.linspace(0, 9, len(axes)), np.zeros(len(axes)), np.full(len(axes), 60.0)])
    return path_of(tips, axes)


@pytest.mark.parametrize("controller", ["heidenhain", "siemens-840d"])
def test_a_turn_at_the_pole_is_written_in_angles_between_vectors(controller):
    path = pole_path()
    text, machine, dialect, _ = posted(path, controller, "vectors")
    mixed = re.findall(r"(?m)^(?:N?\d+ )(?:L|G1) X\S+ Y\S+ Z\S+ B\S+ C\S+(?: F\d+)?$", text)
    assert 0 < len(mixed) < 30
    assert re.search(FIRST[controller], text)
    compare_moves(read_program(text, machine, dialect), [path], dialect, Tolerances())


def test_a_rapid_that_turns_at_the_pole_lasts_as_long_as_its_axis_needs_in_joints():
    angles = np.radians([[-2.0, 0.0], [-0.8, 0.0], [0.0, 0.0], [0.0, 80.0], [-0.8, 80.0], [-2.0, 80.0]])
    axes = tool_axes(read_machine("mikron-ucp600"), angles)
    tips = np.column_stack([0.05 * np.arange(6), np.zeros(6), np.full(6, 60.0)])
    path = path_of(tips, axes, kinds=np.array([MoveKind.RAPID] * 5 + [MoveKind.CUT], dtype=np.int64))
    job = Job().with_values(nc={"controller": "fanuc-30i", "axes": "joints"})
    machine, dialect = read_machine("mikron-ucp600"), job_dialect(job.nc)
    paths = list(drivable_paths([path], machine, dialect, job))
    text = write_program(paths, machine, dialect, job).text
    compare_moves(read_program(text, machine, dialect), paths, dialect, Tolerances())
    slow = re.sub(r"(?m)(G01 .*B-?0\.000 .*F)(\d+)", lambda found: f"{found[1]}{int(found[2]) // 2}", text)
    assert slow != text
    with pytest.raises(VerifyError, match="feed is"):
        compare_moves(read_program(slow, machine, dialect), paths, dialect, Tolerances())
