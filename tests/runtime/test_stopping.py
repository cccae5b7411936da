"""A stop counts wherever it comes: where it is lost, turned into another error, or not heeded at all."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

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
def test_a_stop_is_one_line_and_leaves_nothing(work: str, tmp_path) -> None:
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


def test_no_import_is_cut_short_by_a_stop(tmp_path: Path) -> None:
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
def test_a_stop_before_the_first_import_of_the_command_is_one_line(kind: signal.Signals) -> None:
    call = [sys.executable, "-c", EARLY.replace("{number}", str(int(kind)))]
    run = subprocess.run(call, capture_output=True, text=True, check=False)
    assert run.stderr == "bonecam: stopped; nothing was written\n"
    assert run.stdout == ""
    assert run.returncode == 128 + kind
