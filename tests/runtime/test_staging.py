"""Outputs take their places together, on any file system, and a side output never costs the program.

A signal that comes while files take their places waits until they are there.

A stop counts wherever it comes: where it is lost, turned into another error, or not heeded at all.

Temporary folders of killed runs go, those of running ones and of other hosts stay.
"""

import multiprocessing
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bonecam.errors import FileError
from bonecam.files import check_folder, whole_folder, write_whole
from bonecam.job import Job
from bonecam.mesh import TriangleMesh, write_mesh
from bonecam.nc.probing import Probing
from bonecam.report import outputs as output_files
from bonecam.report.kept import Result
from bonecam.report.outputs import Outputs
from bonecam.runtime.own_files import OWN_FILES
from bonecam.runtime.staging import (
    HOST,
    STOPPING,
    is_running,
    make_temporary,
    placed,
    remove_abandoned,
    staged,
    temporary_folder,
    undisturbed,
)

SHM = Path("/dev/shm")


@pytest.fixture
def other_file_system(tmp_path):
    """A folder on another file system than `tmp_path`."""
    if not SHM.is_dir() or SHM.stat().st_dev == tmp_path.stat().st_dev:
        pytest.skip("/dev/shm is no other file system here")
    with TemporaryDirectory(dir=SHM) as folder:
        yield Path(folder)


def write_two(folder: Path) -> None:
    check_folder(folder)
    with whole_folder(folder, "two") as work:
        (work / "one").write_text("1")
        write_whole(work / "two", "2")


def test_a_link_to_a_folder_of_another_file_system_is_written(tmp_path, other_file_system):
    (tmp_path / "kept").symlink_to(other_file_system)
    (tmp_path / "none").symlink_to(other_file_system / "made")
    for name in ("kept", "none"):
        write_two(tmp_path / name)
    (tmp_path / "one.h").symlink_to(other_file_system / "one.h")
    write_whole(tmp_path / "one.h", "new")
    found = {item.name for item in other_file_system.iterdir()}
    assert found == {"one", "two", OWN_FILES, "made", "one.h"}
    assert {item.name for item in (other_file_system / "made").iterdir()} == {"one", "two", OWN_FILES}
    assert (tmp_path / "kept").is_symlink()


@contextmanager
def without_privileges() -> Iterator[None]:
    """Root may write anywhere; nobody may not."""
    before = os.geteuid()
    if before == 0:
        os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(before)


def test_a_folder_below_one_that_cannot_be_written_is_written():
    with TemporaryDirectory() as folder:
        kept = Path(folder) / "closed" / "kept"
        kept.mkdir(parents=True)
        kept.chmod(0o777)
        kept.parent.chmod(0o555)
        Path(folder).chmod(0o755)
        with without_privileges():
            write_two(kept)
            with pytest.raises(FileError, match=r"no file can be made in .*closed \(Permission denied\)"):
                check_folder(kept.parent / "other")
        assert (kept / "one").read_text() == "1"
        kept.parent.chmod(0o755)


def made(probing: Probing | None = None) -> Result:
    """What stands for a run's result where only its program's text is looked at."""
    unused: Any = SimpleNamespace(levels=(), mesh=None)
    program: Any = SimpleNamespace(text="BEGIN\n")
    return Result(unused, unused, unused, unused, {"a": 1}, Job(), (), program, probing=probing)


@pytest.fixture
def outputs(tmp_path, monkeypatch):
    """Program, report, surface and kept folder, whose writers are replaced by small ones."""

    def stage(staging, programs, _):
        for file, program in programs.items():
            staging.file(file).write_text(program.text)

    monkeypatch.setattr(output_files, "stage_program_files", stage)
    monkeypatch.setattr(output_files, "post_below", lambda mesh, holding: SimpleNamespace(top=0.0))
    monkeypatch.setattr(output_files, "save_surface", lambda surface, path: write_whole(path, "surface"))
    monkeypatch.setattr(output_files, "fill_kept_folder", lambda work, *_: write_whole(work / "a.png", "x"))
    return Outputs(tmp_path / "p.h", tmp_path / "keep", tmp_path / "r.json", tmp_path / "s.iga")


def write(outputs: Outputs) -> None:
    outputs.write(made())


@pytest.mark.parametrize("writer", ["save_surface", "fill_kept_folder"])
@pytest.mark.parametrize("error", [OSError(28, os.strerror(28)), ZeroDivisionError("a bug")])
def test_what_cannot_be_written_costs_nothing_else(writer, error, outputs, tmp_path, monkeypatch):
    def fail(*_):
        raise error

    monkeypatch.setattr(output_files, writer, fail)
    with pytest.raises((FileError, ZeroDivisionError)) as caught:
        write(outputs)
    failed = {"save_surface": "s.iga", "fill_kept_folder": "keep"}[writer]
    assert {item.name for item in tmp_path.iterdir()} == {"p.h", "r.json", "s.iga", "keep"} - {failed}
    assert (tmp_path / "p.h").read_text() == "BEGIN\n"
    if isinstance(caught.value, FileError):
        assert str(caught.value).startswith(f"{tmp_path / failed}: No space left on device: make room")
        assert str(caught.value).endswith(f"({tmp_path / 'p.h'} is written and complete)")
    else:
        assert "is written and complete" in caught.value.__notes__[0]


def test_a_folder_in_the_place_of_a_kept_file_costs_the_kept_folder_only(outputs, tmp_path):
    (tmp_path / "keep" / "a.png").mkdir(parents=True)
    complete = rf"a\.png: is a folder, .*: remove it .* \({re.escape(str(tmp_path))}/p\.h is written and complete\)$"
    with pytest.raises(FileError, match=complete):
        write(outputs)
    assert {item.name for item in tmp_path.iterdir()} == {"p.h", "r.json", "s.iga", "keep"}
    assert [item.name for item in (tmp_path / "keep").iterdir()] == ["a.png"]


def test_without_a_place_for_the_program_nothing_is_written(outputs, tmp_path):
    (tmp_path / "p.h").mkdir()
    with pytest.raises(FileError, match=r"p\.h: is a folder"):
        write(outputs)
    assert [item.name for item in tmp_path.iterdir()] == ["p.h"]


def test_the_probing_program_is_written_with_the_program_or_neither(outputs, tmp_path):
    (tmp_path / "p_probe.h").mkdir()
    run = made(Probing("PROBE\n", "P_PROBE"))
    with pytest.raises(FileError, match=r"p_probe\.h: is a folder"):
        outputs.write(run)
    assert [item.name for item in tmp_path.iterdir()] == ["p_probe.h"]
    (tmp_path / "p_probe.h").rmdir()
    outputs.write(run)
    assert (tmp_path / "p_probe.h").read_text() == "PROBE\n"
    assert (tmp_path / "p.h").read_text() == "BEGIN\n"


def test_a_part_in_the_place_of_the_probing_program_is_told_before_the_work(tmp_path):
    part = tmp_path / "p_probe.h"
    part.write_text("solid")
    Outputs(tmp_path / "p.h").check(part)
    with pytest.raises(FileError, match=r"p_probe\.h"):
        Outputs(tmp_path / "p.h", probe=True).check(part)


def test_a_run_that_is_stopped_writes_nothing(outputs, tmp_path, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(output_files, "fill_kept_folder", stopped)
    with pytest.raises(KeyboardInterrupt):
        write(outputs)
    assert not list(tmp_path.iterdir())


def test_an_error_names_the_file_of_the_user(tmp_path):
    def fail():
        with staged() as staging:
            write_whole(staging.file(tmp_path / "a.h") / "inner", "x")

    with pytest.raises(FileError) as caught:
        fail()
    assert str(caught.value).startswith(f"{tmp_path / 'a.h'}")
    assert ".part" not in str(caught.value)


def write_often(folder: Path, count: int) -> None:
    """Write a set of files again and again, so many in each, all with the count as their text."""
    for _ in range(60):
        with whole_folder(folder, r"level_\d+") as work:
            for index in range(count):
                (work / f"level_{index}").write_text(str(count))


def test_of_two_runs_that_write_into_one_folder_one_is_there_in_the_end(tmp_path):
    fork = multiprocessing.get_context("spawn")
    runs = [fork.Process(target=write_often, args=(tmp_path, count)) for count in (3, 12)]
    for run in runs:
        run.start()
    for run in runs:
        run.join()
    assert [run.exitcode for run in runs] == [0, 0]
    levels = [item for item in tmp_path.iterdir() if item.name != OWN_FILES]
    assert {item.read_text() for item in levels} == {str(len(levels))}


def write_text(path: Path) -> None:
    write_whole(path, "new")


def write_triangle(path: Path) -> None:
    write_mesh(TriangleMesh(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32)), path)


@pytest.mark.parametrize("write", [write_text, write_triangle])
def test_a_file_keeps_its_mode_and_a_link_leads_to_it(write, tmp_path):
    there, link, dangling = (tmp_path / f"{name}.stl" for name in ("there", "link", "dangling"))
    there.write_text("old")
    there.chmod(0o640)
    link.symlink_to(there.name)
    dangling.symlink_to("new.stl")
    for path in (there, link):
        write(path)
        assert there.read_bytes() != b"old"
        assert there.stat().st_mode & 0o777 == 0o640
        there.write_bytes(b"old")
    write(dangling)
    assert link.is_symlink()
    assert dangling.is_symlink()
    assert sorted(os.listdir(tmp_path)) == ["dangling.stl", "link.stl", "new.stl", "there.stl"]


def test_what_is_written_on_its_way_is_not_placed(tmp_path):
    before = len(placed)
    with whole_folder(tmp_path / "none") as work:
        write_whole(work / "one", "1")
        write_triangle(work / "one.ply")
        assert len(placed) == before
        for item in work.iterdir():
            item.unlink()
    write_two(tmp_path)
    assert [Path(file).name for file in placed[before:]] == ["one", "two", OWN_FILES]


def test_a_signal_takes_effect_after_the_block():
    before = [signal.getsignal(kind) for kind in STOPPING]
    steps = []

    def block():
        with undisturbed():
            with undisturbed():
                signal.raise_signal(signal.SIGINT)
                steps.append("inner")
            steps.append("outer")
        steps.append("never")

    with pytest.raises(KeyboardInterrupt):
        block()
    assert steps == ["inner", "outer"]
    assert [signal.getsignal(kind) for kind in STOPPING] == before


def test_a_signal_that_is_ignored_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with undisturbed():
            signal.raise_signal(signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


RUN = """
import os, signal, sys, time
from bonecam.cli import stopping
from bonecam.runtime.staging import make_temporary
from pathlib import Path
make_temporary(Path(sys.argv.pop()))
def stop():
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(0.01)
class Lost:
    def __del__(self):
        stop()
def lost():
    Lost()
    time.sleep(60)
def turned():
    try:
        stop()
    except KeyboardInterrupt as error:
        raise ImportError("numpy is broken") from error
def not_heeded():
    stopping.GRACE = 0.3
    while True:
        try:
            stop()
            time.sleep(60)
        except KeyboardInterrupt:
            pass
sys.exit(stopping.run_stoppable(lambda arguments: {work}()))
"""


@pytest.mark.parametrize("work", ["stop", "lost", "turned", "not_heeded"])
def test_a_stop_is_one_line_and_leaves_nothing(work, tmp_path):
    began = time.monotonic()
    run = subprocess.run(
        [sys.executable, "-c", RUN.replace("{work}", work), tmp_path], capture_output=True, text=True, check=False
    )
    assert run.stderr == "bonecam: stopped; nothing was written\n"
    assert run.returncode == 143
    assert time.monotonic() < began + 5.0
    assert not list(tmp_path.iterdir())


IMPORTED = """
import os, signal, sys, time
os.kill(os.getpid(), signal.SIGTERM)
try:
    time.sleep(0.1)
except KeyboardInterrupt:
    print("cut short", file=sys.stderr)
"""
IMPORTING = """
import sys, time
from bonecam.cli.stopping import run_stoppable
def work(arguments):
    import compiled
    time.sleep(60)
sys.exit(run_stoppable(work))
"""


def test_no_import_is_cut_short_by_a_stop(tmp_path):
    """A module of pyo3 prints a panic where the import of another in it is interrupted."""
    (tmp_path / "compiled.py").write_text(IMPORTED, encoding="utf-8")
    call = [sys.executable, "-c", IMPORTING]
    run = subprocess.run(call, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert run.stderr == "bonecam: stopped; nothing was written\n"
    assert run.returncode == 143


EARLY = """
import os, signal, sys
class Stop:
    def find_spec(self, name, path=None, target=None):
        if name == "bonecam.cli.stopping":
            os.kill(os.getpid(), {number})
sys.meta_path.insert(0, Stop())
from bonecam.cli import main
sys.argv[1:] = ["filters"]
sys.exit(main())
"""


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_stop_before_the_first_import_of_the_command_is_one_line(kind):
    call = [sys.executable, "-c", EARLY.replace("{number}", str(int(kind)))]
    run = subprocess.run(call, capture_output=True, text=True, check=False)
    assert run.stderr == "bonecam: stopped; nothing was written\n"
    assert run.stdout == ""
    assert run.returncode == 128 + kind


KILLED = """
import os, signal, sys
from pathlib import Path
from bonecam.runtime.staging import make_temporary
(make_temporary(Path(sys.argv[1])) / "half").write_text("half")
os.kill(os.getpid(), getattr(signal, sys.argv[2]))
"""


def test_the_folder_of_a_killed_process_goes_with_the_next_that_is_made(tmp_path):
    subprocess.run([sys.executable, "-c", KILLED, tmp_path, "SIGKILL"], check=False)
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(f".bonecam-{HOST}-")
    with temporary_folder(tmp_path) as work:
        assert [item.name for item in tmp_path.iterdir()] == [work.name]
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system tells of no zombies")
def test_the_folder_of_a_process_that_nobody_has_asked_how_it_ended_goes_too(tmp_path):
    with subprocess.Popen([sys.executable, "-c", KILLED, tmp_path, "SIGKILL"]) as run:
        os.waitid(os.P_PID, run.pid, os.WEXITED | os.WNOWAIT)  # which leaves it to be asked
        assert len(list(tmp_path.iterdir())) == 1
        assert not is_running(run.pid)
        remove_abandoned(tmp_path)
        assert not list(tmp_path.iterdir())


def test_a_process_that_ends_by_itself_leaves_nothing(tmp_path):
    run = subprocess.run([sys.executable, "-c", KILLED, tmp_path, "SIGINT"], stderr=subprocess.DEVNULL)
    assert run.returncode != 0
    assert not list(tmp_path.iterdir())


def test_what_runs_is_of_another_host_or_another_name_stays(tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    assert is_running(1)
    assert not is_running(gone.pid)
    mine = {
        f".bonecam-{HOST}-1-abcdefgh.part",
        f".bonecam-another-{gone.pid}-abcdefgh.part",
        f".bonecam-{HOST}-{gone.pid}-abcdefgh.part.txt",
        "bone.h.part",
        f"{HOST}-{gone.pid}.part",
    }
    for name in mine:
        (tmp_path / name).mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / f".bonecam-{HOST}-{gone.pid}-linklink.part").symlink_to("elsewhere")
    with temporary_folder(tmp_path) as work:
        remove_abandoned(tmp_path)
        found = {item.name for item in tmp_path.iterdir()}
    assert found == {*mine, "elsewhere", f".bonecam-{HOST}-{gone.pid}-linklink.part", work.name}


def test_a_folder_that_cannot_be_made_is_an_os_error():
    with pytest.raises(OSError, match="proc"):
        make_temporary(Path("/proc"))


def test_a_folder_that_another_thread_is_making_is_not_taken_for_abandoned(tmp_path, monkeypatch):
    other = Thread(target=remove_abandoned, args=(tmp_path,))
    mkdtemp = tempfile.mkdtemp

    def made_beside_another_thread(**place):
        made = mkdtemp(**place)
        other.start()
        other.join(0.5)  # it waits until the folder is known, so this ends by the time
        return made

    monkeypatch.setattr(tempfile, "mkdtemp", made_beside_another_thread)
    made = make_temporary(tmp_path)
    other.join()
    assert made.is_dir()
