"""Temporary folders of killed runs go, those of running ones and of other hosts stay."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from threading import Thread

import pytest

from bonecam.runtime.staging import HOST, is_running, make_temporary, remove_abandoned, temporary_folder

KILLED = """
import os, signal, sys
from pathlib import Path
from bonecam.runtime.staging import make_temporary
(make_temporary(Path(sys.argv[1])) / "half").write_text("half")
os.kill(os.getpid(), getattr(signal, sys.argv[2]))
"""


def test_the_folder_of_a_killed_process_goes_with_the_next_that_is_made(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", KILLED, tmp_path, "SIGKILL"], check=False)
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(f".bonecam-{HOST}-")
    with temporary_folder(tmp_path) as work:
        assert [item.name for item in tmp_path.iterdir()] == [work.name]
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system tells of no zombies")
def test_the_folder_of_a_process_that_nobody_has_asked_how_it_ended_goes_too(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", KILLED, tmp_path, "SIGKILL"]) as run:
        os.waitid(os.P_PID, run.pid, os.WEXITED | os.WNOWAIT)  # which leaves it to be asked
        assert len(list(tmp_path.iterdir())) == 1
        assert not is_running(run.pid)
        remove_abandoned(tmp_path)
        assert not list(tmp_path.iterdir())


def test_a_process_that_ends_by_itself_leaves_nothing(tmp_path: Path) -> None:
    run = subprocess.run([sys.executable, "-c", KILLED, tmp_path, "SIGINT"], stderr=subprocess.DEVNULL)
    assert run.returncode != 0
    assert not list(tmp_path.iterdir())


def test_what_runs_is_of_another_host_or_another_name_stays(tmp_path: Path) -> None:
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


def test_a_folder_that_cannot_be_made_is_an_os_error() -> None:
    with pytest.raises(OSError, match="proc"):
        make_temporary(Path("/proc"))


def test_a_folder_that_another_thread_is_making_is_not_taken_for_abandoned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = Thread(target=remove_abandoned, args=(tmp_path,))
    mkdtemp = tempfile.mkdtemp

    def made_beside_another_thread(**place: str | Path) -> str:
        made = mkdtemp(**place)
        other.start()
        other.join(0.5)  # it waits until the folder is known, so this ends by the time
        return made

    monkeypatch.setattr(tempfile, "mkdtemp", made_beside_another_thread)
    made = make_temporary(tmp_path)
    other.join()
    assert made.is_dir()
