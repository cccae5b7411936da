"""Commands that are stopped or killed at random moments: one line and the signal's exit code, no file by halves,
nothing left after the next run, no process left."""

import csv
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from uuid import uuid4

import pytest
from small_parts import mesh_of, pebble

from bonecam.mesh import write_mesh
from bonecam.surface import save_surface

pytestmark = pytest.mark.whole

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
COARSE = [
    "mechanics.refuse=false",
    *"surface.tolerance=0.2 levels.roughing_depth=1.4 roughing.scallop=0.3 finishing.scallop=0.1".split(),
    *"roughing.preset=ball-4 finishing.preset=ball-2".split(),
]
SCRIPT = """<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Subdivision Surfaces: Loop"><Param type="RichInt" value="3" name="Iterations"/></filter>
 <filter name="apply_coord_taubin_smoothing"><Param type="RichInt" value="200" name="stepSmoothNum"/></filter>
</FilterScript>
"""
MARK = "BONECAM_TEST_RUN"
"""The variable of the environment by which the processes of a run are found."""


@pytest.fixture(scope="module")
def lump(tmp_path_factory):
    """A small part, for which the chain takes some seconds."""
    file = tmp_path_factory.mktemp("part") / "lump.stl"
    write_mesh(mesh_of(pebble(), 32, 40), file)
    save_surface(pebble(), file.with_suffix(".tspline"))
    return file


def arguments(command: str, part: Path, folder: Path) -> list[str]:
    """A call of the command that writes all it can into the folder."""
    job = [word for setting in COARSE for word in ("--set", setting)]
    if command == "script":
        script = part.with_name("script.mlx")
        script.write_text(SCRIPT, encoding="utf-8")
        return ["script", str(script), "-i", str(part), "-o", str(folder / "layers")]
    if command == "levels":
        return ["levels", str(part), "-o", str(folder / "look"), *job]
    if command == "batch":
        copy = part.with_name("other.stl")
        copy.write_bytes(part.read_bytes())
        return ["batch", str(part), str(copy), "-o", str(folder / "out"), "--jobs", "2", "--resume", *job]
    keep = ["--keep", str(folder / "look"), "--report", str(folder / "p.json")]
    if command == "finish":
        fine = ["--set", "finishing.scallop=0.1", "--set", "holding.length=40"]
        return ["finish", str(part.with_suffix(".tspline")), "-o", str(folder / "p.h"), *keep, *fine]
    return ["convert", str(part), "-o", str(folder / "p.h"), *keep, *job]


def start(words: list[str], mark: str) -> "subprocess.Popen[str]":
    """The command in a session of its own, as a shell starts it in the foreground."""
    return subprocess.Popen(
        [sys.executable, "-m", "bonecam", *words],
        env={**os.environ, MARK: mark, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=heed_signals,
    )


def heed_signals() -> None:
    """Under nohup, or in the background of a shell, signals are ignored."""
    for kind in STOPS:
        signal.signal(kind, signal.SIG_DFL)


def processes(mark: str) -> list[int]:
    """The processes of the run that are alive."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if f"{MARK}={mark}".encode() in (place / "environ").read_bytes():
                found.append(int(place.name))
        except OSError:
            continue
    return found


def kill(command: str, part: Path, folder: Path, kind: signal.Signals, after: float, group: bool) -> str:
    """Run the command and send it (or its whole group, as a terminal does) the signal `after` so many seconds.
    Proves what is left; tells what became of it."""
    folder.mkdir()
    mark = uuid4().hex
    run = start(arguments(command, part, folder), mark)
    time.sleep(after)
    over = run.poll() is not None
    if not over:
        (os.killpg if group else os.kill)(run.pid, kind)
    sent = time.monotonic()
    _, told = run.communicate(timeout=60)
    told_at = time.monotonic() - sent
    while processes(mark):
        assert time.monotonic() < sent + 5.0, f"{processes(mark)} still run 5 s after {kind.name}"
        time.sleep(0.02)
    assert told_at < 5.0
    prove_whole(folder)
    if kind is signal.SIGKILL or over:
        assert not told
        assert run.returncode in ((0,) if over else (-9,))
        return "over" if over else "killed"
    if run.returncode != 0:
        assert run.returncode in (128 + kind, -kind), told
        assert told.count("\n") == (run.returncode > 0), told
        assert not told or told.startswith("bonecam: stopped; ")
        assert not left(folder)
    return "done" if run.returncode == 0 else "stopped"


def left(folder: Path) -> list[Path]:
    """The temporary files in a folder and those in it."""
    return [item for item in folder.rglob("*") if item.name.endswith(".part") or item.name.startswith(".bone.")]


def prove_whole(folder: Path) -> None:
    """No file in its place is there by halves."""
    for file in [item for item in folder.rglob("*") if item.is_file() and ".part" not in str(item)]:
        content = file.read_bytes()
        assert content, file
        if file.suffix == ".h":
            assert content.rstrip().endswith(b" MM"), file
        if file.suffix == ".json":
            assert content.endswith(b"}\n"), file
        if file.suffix == ".csv" and file.name == "batch.csv":
            assert all(row["state"] == "done" for row in csv.DictReader(content.decode().splitlines()))


def run_whole(command: str, part: Path, folder: Path) -> float:
    """Run the command to its end in a folder where it was killed before; the seconds that it takes."""
    folder.mkdir(exist_ok=True)
    began = time.monotonic()
    run = start(arguments(command, part, folder), uuid4().hex)
    _, told = run.communicate(timeout=600)
    assert run.returncode == 0, told
    assert not left(folder)
    return time.monotonic() - began


def content_of(folder: Path) -> dict[str, bytes]:
    """The bytes of what a command made but for times: programs, surfaces and meshes."""
    kinds = (".h", ".ply", ".tspline", ".png")
    return {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.suffix in kinds}


COMMANDS = ("convert", "batch", "levels", "script", "finish")


@pytest.mark.parametrize("number", range(8))
def test_a_command_that_is_stopped_early_leaves_nothing(number, lump, tmp_path):
    chance = random.Random(number)
    kind = (*STOPS, signal.SIGKILL)[number % 4]
    kill(COMMANDS[number // 2], lump, tmp_path / "run", kind, chance.uniform(0.02, 2.0), number % 2 == 0)


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_hundred_kills_leave_nothing_by_halves(command, lump, tmp_path):
    chance = random.Random(command)
    run_whole(command, lump, tmp_path / "first")  # which may compile: the second tells how long a run takes
    seconds = run_whole(command, lump, tmp_path / "whole")
    wanted = content_of(tmp_path / "whole")
    assert wanted
    for number in range(25):
        folder = tmp_path / f"run{number}"
        kind = (*STOPS, signal.SIGKILL)[number % 4]
        what = kill(command, lump, folder, kind, chance.uniform(0.02, seconds), chance.random() < 0.5)
        print(command, number, kind.name, what, len(left(folder)), flush=True)
        if number % 6 == 3:
            run_whole(command, lump, folder)
            assert content_of(folder) == wanted
