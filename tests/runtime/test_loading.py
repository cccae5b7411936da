"""Libraries are loaded once, by a thread that lives on; a process that works in threads ends well."""

import subprocess
import sys
from threading import Thread, current_thread, main_thread

import pytest

from bonecam.runtime.loading import loaded_once

pytestmark = pytest.mark.whole

CHAIN = """
from threading import Thread


def work():
    import numpy as np
    import bonecam
    from bonecam.job import Job
    from bonecam.setup.capsule import Capsule

    small = Job().with_values(
        mechanics={"refuse": False},
        surface={"tolerance": 0.2},
        stock={"diameter": 7.0, "length": 11.0},
        holding={"diameter": 3.0, "length": 60.0},
        levels={"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
        roughing={"preset": "ball-4", "scallop": 0.3},
        finishing={"preset": "ball-2", "scallop": 0.1},
        path={"orientation": "lead"},
    )
    mesh = Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 7.5]), 2.5).mesh(0.05)
    print(len(bonecam.convert(mesh, small, program="bone.h", simulation=False).program.text) > 10_000)


for _ in range(2):
    thread = Thread(target=work)
    thread.start()
    thread.join()
"""


def in_a_thread(work: object) -> None:
    thread = Thread(target=work)  # type: ignore[arg-type]
    thread.start()
    thread.join()


def test_the_whole_chain_in_a_thread_ends_well(tmp_path):
    (tmp_path / "chain.py").write_text(CHAIN)
    ended = subprocess.run(
        [sys.executable, "chain.py"], cwd=tmp_path, capture_output=True, text=True, timeout=600, check=False
    )
    assert ended.stdout.split() == ["True", "True"], ended.stderr
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.parametrize("order", [("pymeshlab", "open3d.core"), ("open3d.core", "pymeshlab")])
def test_both_libraries_may_come_first_in_threads(order):
    code = "from threading import Thread\nimport importlib\nfrom bonecam.runtime.loading import loaded_once\n"
    for name in order:
        code += (
            f"load = loaded_once(lambda: importlib.import_module({name!r}))\n"
            "thread = Thread(target=load); thread.start(); thread.join()\n"
        )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_library_is_loaded_once_and_its_thread_stays():
    threads = []

    @loaded_once
    def load():
        threads.append(current_thread())
        return "loaded"

    found: list[str] = []
    for _ in range(2):
        in_a_thread(lambda: found.append(load()))
    assert found == ["loaded", "loaded"]
    assert load() == "loaded"
    (thread,) = threads
    assert thread.is_alive()
    assert thread.daemon


def test_the_main_thread_loads_itself():
    assert loaded_once(current_thread)() is main_thread()


def test_what_a_library_raises_reaches_each_that_asks():
    asked = []

    @loaded_once
    def load():
        asked.append(1)
        raise ImportError("no such library")

    def ask():
        with pytest.raises(ImportError, match="no such library"):
            load()

    in_a_thread(ask)
    ask()
    assert len(asked) == 2
