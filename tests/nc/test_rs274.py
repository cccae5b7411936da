"""LinuxCNC's own interpreter runs what we write.

Other people's readers read what we post: the positions are those that our reader finds.

nc-gcode-interpreter (Sinumerik) does not know DC(): those words are given to it as plain ones, which it drives as
they are. ncplot7py (Fanuc) keeps C within a turn. So C is compared but for whole turns.
"""

import re
import shutil
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from small_parts import capsule_path

from bonecam.job import Job
from bonecam.machine import forward, read_machine
from bonecam.nc import Program, read_dialect, read_program, write_program
from bonecam.nc.parts import program_files

MACHINE, DIALECT = read_machine("linuxcnc-xyzbc"), read_dialect("linuxcnc")
STATE = re.compile(
    r"(STRAIGHT_TRAVERSE|STRAIGHT_FEED)\(([^)]*)\)|CHANGE_TOOL\((\d)\)|USE_TOOL_LENGTH_OFFSET\(\S+ \S+ ([\d.]+),"
)
LENGTHS = {1: 80.0, 2: 75.0}
"""What the tools in the spindle measure, mm from the nose to the tip."""


@dataclass(frozen=True, eq=False)
class Run:
    """A program, what the interpreter printed, and its moves: rapid, X Y Z B C as programmed, where the tip stands on
    the machine (mm) with the length that the interpreter compensates and the tool that it has in the spindle."""

    program: Program
    done: "subprocess.CompletedProcess[str]"
    rapid: list[bool]
    words: np.ndarray
    joints: np.ndarray


def run_text(program: Program, folder: Path) -> Run:
    """Run a program with a tool table of two lengths, which standalone rs274 reads in inches."""
    for file, text in program_files(program, DIALECT, folder / "bone.ngc").items():
        file.write_text(text)
    rows = [f"T{tool} P{tool} Z{length / 25.4:.12f} D0.1" for tool, length in LENGTHS.items()]
    (folder / "tool.tbl").write_text("\n".join(rows) + "\n")
    call = ["rs274", "-g", "-t", "tool.tbl", "bone.ngc"]
    done = subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    tool, compensated = 0, 0.0
    rapid, words, joints = [], [], []
    for found in STATE.finditer(done.stdout):
        if found[3]:
            tool = int(found[3])
        elif found[4]:
            compensated = float(found[4])
        else:
            x, y, z, _, b, c = (float(value) for value in found[2].split(","))
            rapid.append(found[1] == "STRAIGHT_TRAVERSE")
            words.append([x, y, z, b, c])
            joints.append([x, y, z + compensated - LENGTHS[tool], *np.radians([b, c])])
    return Run(program, done, rapid, np.array(words), np.array(joints))


@pytest.fixture(scope="module")
def paths():
    if not shutil.which("rs274"):
        pytest.skip("rs274 (package linuxcnc-uspace) is absent")
    return [
        capsule_path(level=5, radius=2.0, offset=1.5, count=600),
        capsule_path(level=0, radius=1.0, number=2, count=600),
    ]


@pytest.fixture(scope="module", params=["changer", "stop"])
def run(request, paths, tmp_path_factory):
    job = Job().with_values(nc={"tool_change": request.param})
    return run_text(write_program(paths, MACHINE, DIALECT, job), tmp_path_factory.mktemp("rs274"))


def test_the_interpreter_runs_to_the_end(run):
    assert run.done.returncode == 0, run.done.stderr
    assert "PROGRAM_END()" in run.done.stdout


def test_the_interpreter_makes_as_many_moves_as_were_written(run):
    motions = read_program(run.program.text, MACHINE, DIALECT)
    assert len(run.rapid) == run.program.moves == motions.blocks


def test_the_interpreter_stops_at_each_tool_where_the_job_says_so(run):
    assert run.done.stdout.count("PROGRAM_STOP()") == run.program.text.count("\nM0\n")
    assert run.program.text.count("\nM0\n") in (0, 2)


def rows_of(run: Run, motions) -> np.ndarray:
    """The rows of the interpreter's moves that are ours: blocks that only bring an axis to a known place, after a
    tool change, are none."""
    lines = run.program.text.split("\n")
    moving = [number for number, line in enumerate(lines, start=1) if line.startswith(("G0 ", "G1 "))]
    return np.searchsorted(moving, motions.lines)


def test_the_interpreters_positions_agree_to_its_four_decimals(run):
    motions = read_program(run.program.text, MACHINE, DIALECT)
    rows = rows_of(run, motions)
    ours = np.column_stack([motions.words[:, :3], np.degrees(motions.words[:, 3:])])
    assert len(rows) > 0.99 * len(run.rapid)
    assert np.abs(run.words[rows] - ours).max() <= 0.5e-4 + 1e-9
    assert [run.rapid[row] for row in rows] == motions.rapid.tolist()


def test_both_balls_are_on_their_paths_whatever_the_lengths_of_their_tools(run, paths):
    from scipy.spatial import KDTree

    motions = read_program(run.program.text, MACHINE, DIALECT)
    rows = rows_of(run, motions)
    tips, axes = forward(MACHINE, run.joints[rows])
    for path in paths:
        mine = motions.tools == path.cutter.number
        centres = tips[mine] + path.cutter.radius * axes[mine]
        meant = path.tips + path.cutter.radius * path.axes
        assert KDTree(centres).query(meant)[0].max() <= 0.001


def test_the_interpreter_calls_the_parts_and_makes_the_moves_of_the_whole(paths, tmp_path):
    known = tuple(replace(axis, limits=(-1000.0, 1000.0)) for axis in MACHINE.linear)
    machine, end = replace(MACHINE, linear=known), {"table_level": True, "park": "10, -20"}
    asked = {"split": "level", "optional_stop": "level", **end}
    (tmp_path / "one").mkdir()
    (tmp_path / "parts").mkdir()
    whole = write_program(paths, machine, DIALECT, Job().with_values(nc=end))
    parts = write_program(paths, machine, DIALECT, Job().with_values(nc=asked))
    one, called = run_text(whole, tmp_path / "one"), run_text(parts, tmp_path / "parts")
    assert len(list((tmp_path / "parts").glob("bone_*.ngc"))) == len(paths)
    assert called.done.returncode == 0, called.done.stderr
    assert "PROGRAM_END()" in called.done.stdout
    assert called.done.stdout.count("OPTIONAL_PROGRAM_STOP()") == 1
    assert called.rapid == one.rapid
    np.testing.assert_array_equal(called.words, one.words)
    assert called.words[-1][:2].tolist() == [10.0, -20.0]
    assert called.words[-1][3:].tolist() == [0.0, 0.0]
    (tmp_path / "parts" / "bone_2.ngc").unlink()
    lost = subprocess.run(
        ["rs274", "-g", "-t", "tool.tbl", "bone.ngc"], cwd=tmp_path / "parts", capture_output=True, check=False
    )
    assert lost.returncode != 0


MIKRON = read_machine("mikron-ucp600")
ROUNDING = 0.0005
"""Half of the last decimal of the words, mm and degrees: nc-gcode-interpreter holds numbers of seven digits."""


@pytest.fixture(scope="module")
def posted():
    """A program of two tools in a dialect, and the lines and words (mm, degrees) that our reader finds."""

    def post(name):
        dialect = read_dialect(name)
        paths = (
            capsule_path(level=5, radius=2.0, offset=1.5, number=1, count=150),
            capsule_path(level=0, radius=1.0, number=2, count=150),
        )
        text = write_program(paths, MIKRON, dialect, Job()).text
        motions = read_program(text, MIKRON, dialect)
        words = np.column_stack([motions.words[:, :3], np.degrees(motions.words[:, 3:])])
        return text, motions, words

    return post


def differences(theirs, words):
    """By how much words (mm, degrees) differ, of C but for whole turns."""
    off = theirs - words
    off[:, 4] = (off[:, 4] + 180.0) % 360.0 - 180.0
    return off


def test_nc_gcode_interpreter_finds_the_positions_and_feeds_of_siemens(posted):
    interpreter = pytest.importorskip("nc_gcode_interpreter", reason="pip install nc-gcode-interpreter")
    text, motions, words = posted("siemens-840d")
    assert "C=DC(" in text
    plain = re.sub(r"C=DC\(([\d.]+)\)", r"C\1", text)
    table, _ = interpreter.nc_to_dataframe(plain, extra_axes=["B", "C"])
    row_of = {number: row for row, number in enumerate(table["N"].to_list())}
    lines = text.splitlines()
    rows = [row_of[int(lines[line - 1].split(" ")[0][1:])] for line in motions.lines]

    theirs = table.select(["X", "Y", "Z", "B", "C"]).to_numpy()[rows]
    assert np.abs(differences(theirs, words)).max() < ROUNDING
    feeds = table["F"].to_numpy()[rows]
    assert np.array_equal(feeds[~motions.rapid], motions.feed_rates[~motions.rapid])
    assert np.array_equal(table["gg01_motion"].to_numpy()[rows] == "G0", motions.rapid)
    assert set(table["S"].to_numpy()[rows]) == set(motions.spindle)


@pytest.mark.parametrize("name", ["fanuc-30i", "makino", "mitsubishi"])
def test_ncplot7py_finds_the_positions_of_fanuc(posted, name):
    pytest.importorskip("ncplot7py", reason="pip install ncplot7py")
    from ncplot7py.application.nc_execution import NCExecutionEngine
    from ncplot7py.domain.cnc_state import CNCState
    from ncplot7py.domain.machines import get_machine_config
    from ncplot7py.infrastructure.machines.base_stateful_control import UniversalConfigDrivenControl

    text, motions, words = posted(name)
    state = CNCState(machine_config=get_machine_config("FANUC_MILL"))
    control = UniversalConfigDrivenControl(1, ["C1"], [state])
    engine = NCExecutionEngine(control)
    engine.get_Syncro_plot([text], False)
    assert engine.errors == []

    axes_of = {node.nc_code_line_nr: node._motion_context["endAxes"] for node in control.get_exected_nodes(1)}
    theirs = np.array([[axes_of[line][letter] for letter in "XYZBC"] for line in motions.lines.tolist()])
    assert np.abs(differences(theirs, words)).max() < ROUNDING
