"""Runs and threads that put files into one folder take their turns, with no need of the system's locks."""

import subprocess
import sys
import time
from pathlib import Path
from threading import Thread

import pytest
from small_job import SMALL_CAPSULE

from bonecam.mesh import write_mesh
from bonecam.runtime import own_files
from bonecam.runtime.own_files import LOCK, locked

pytestmark = pytest.mark.whole

HOLD = """
import sys, time
from pathlib import Path
from bonecam.runtime.own_files import locked
with locked([Path(sys.argv[1])]):
    print("held", flush=True)
    time.sleep(float(sys.argv[2]))
"""


def test_another_process_and_another_thread_wait(tmp_path):
    with subprocess.Popen([sys.executable, "-c", HOLD, tmp_path, "0.5"], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        began = time.monotonic()
        order = []
        with locked([tmp_path]):
            assert time.monotonic() - began > 0.3
            thread = Thread(target=lambda: _append(tmp_path, order))
            thread.start()
            with locked([tmp_path, tmp_path]):
                time.sleep(0.2)
            order.append("first")
        thread.join()
    assert order == ["first", "second"]
    assert not list(tmp_path.iterdir())


def _append(folder: Path, order: list[str]) -> None:
    with locked([folder]):
        order.append("second")


def test_a_lock_that_was_left_does_not_hold_up_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(own_files, "MAX_WAIT", 0.2)
    (tmp_path / LOCK).write_text("1\nanother-host\n")
    for _ in range(2):
        with locked([tmp_path]):
            pass
        assert not list(tmp_path.iterdir())


ELSEWHERE = """
import os, signal, sys, _signal
sys.modules.update(dict.fromkeys(("fcntl", "resource", "termios", "pwd", "grp")))
missing = {
    signal: "SIGHUP pthread_sigmask SIG_BLOCK SIG_UNBLOCK SIG_SETMASK",
    _signal: "SIGHUP pthread_sigmask",
    os: "sched_getaffinity O_DIRECTORY O_PATH",
}
for module, names in missing.items():
    for name in names.split():
        delattr(module, name)
import bonecam.batch.run
from bonecam.cli import main
sys.exit(main())
"""


def test_levels_are_made_where_there_is_nothing_of_unix(tmp_path):
    """What Windows does not have is taken away: this is no run on Windows."""
    write_mesh(SMALL_CAPSULE.mesh(0.05), tmp_path / "bone.ply")
    sizes = "surface.tolerance=0.2 stock.diameter=7 stock.length=11 holding.diameter=3 holding.length=60"
    depths = "levels.roughing_depth=1 levels.finishing_levels=1 levels.finishing_depth=0.3 mechanics.refuse=false"
    job = [word for setting in f"{sizes} {depths}".split() for word in ("--set", setting)]
    ended = subprocess.run(
        [sys.executable, "-c", ELSEWHERE, "levels", "bone.ply", "-o", "look", *job],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "look" / "level_00.ply").exists()
