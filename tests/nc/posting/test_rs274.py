"""LinuxCNC's own interpreter runs what we write."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.nc.dialect import read_dialect
from bonecam.nc.machine import read_machine
from bonecam.nc.posting.write import write_program
from bonecam.nc.reading.read import read_program

MOVE = re.compile(r"(STRAIGHT_TRAVERSE|STRAIGHT_FEED)\(([^)]*)\)")


@pytest.fixture(scope="module")
def run(capsule_path, tmp_path_factory):
    if not shutil.which("rs274"):
        pytest.skip("rs274 (package linuxcnc-uspace) is absent")
    machine, dialect = read_machine("linuxcnc-xyzbc"), read_dialect("linuxcnc")
    paths = [
        capsule_path(level=5, radius=2.0, offset=1.5, count=600),
        capsule_path(level=0, radius=1.0, number=2, count=600),
    ]
    program = write_program(paths, machine, dialect, Job())
    folder = tmp_path_factory.mktemp("rs274")
    (folder / "bone.ngc").write_text(program.text)
    done = subprocess.run(
        ["rs274", "-g", "bone.ngc"], cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )
    return program, read_program(program.text, machine, dialect), done


def test_the_interpreter_runs_to_the_end(run):
    _, _, done = run
    assert done.returncode == 0, done.stderr
    assert "PROGRAM_END()" in done.stdout


def test_the_interpreter_makes_as_many_moves_as_were_written(run):
    program, motions, done = run
    assert len(MOVE.findall(done.stdout)) == program.moves == motions.blocks


def test_the_interpreters_positions_agree_to_its_four_decimals(run):
    program, motions, done = run
    moves = [
        (kind, [float(value) for value in values.split(",")]) for kind, values in MOVE.findall(done.stdout)
    ]
    places = np.array([values for _, values in moves])[:, [0, 1, 2, 4, 5]]
    ours = np.column_stack([motions.words[:, :3], np.degrees(motions.words[:, 3:])])
    # blocks that only bring an axis to a known place, after a tool change, are no rows of ours
    moving = [
        number
        for number, line in enumerate(program.text.split("\n"), start=1)
        if line.startswith(("G0 ", "G1 "))
    ]
    rows = np.searchsorted(moving, motions.lines)
    assert len(rows) > 0.99 * len(places)
    assert np.abs(places[rows] - ours).max() <= 0.5e-4 + 1e-9
    assert [kind == "STRAIGHT_TRAVERSE" for kind, _ in (moves[row] for row in rows)] == motions.rapid.tolist()
