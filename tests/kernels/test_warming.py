"""What a default run calls is compiled beforehand, by processes that share it out, once."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bonecam.kernels import COMPILED_FOR, FEATURES, TARGET, warming

CALLED = """
import sys
from pathlib import Path
import bonecam, bonecam_meshes
from bonecam.kernels.warming import called
bonecam.convert(bonecam_meshes.path("phalanx"), program=Path(sys.argv[1]) / "p.h", keep=Path(sys.argv[1]) / "look")
print(*(f"{name} {kinds}" for name, kinds in called()), sep="\\n")
"""


def run(*command: str, **variables: str) -> str:
    done = subprocess.run(
        [sys.executable, *command], env={**os.environ, **variables}, capture_output=True, text=True, check=True
    )
    return done.stdout


@pytest.mark.whole
def test_the_list_holds_what_the_demo_calls_and_no_more(tmp_path):
    told = set(run("-c", CALLED, str(tmp_path)).splitlines())
    assert told == {f"{name} {kinds}" for name, kinds in warming.first_run()}, "tests/checking/record_first_run.py"


def test_each_type_of_the_list_is_read_as_it_is_written():
    for name, kinds in warming.first_run():
        found = eval(f"[{kinds}]", warming.NAMES)
        assert ", ".join(map(warming._text_of, found)) == kinds, name


def test_kernels_are_compiled_once_for_all_that_come_later(tmp_path):
    """The shares of two processes are all there is; with the mark there is nothing to do."""
    shares = [warming.first_run()[share::2] for share in range(2)]
    assert sorted(shares[0] + shares[1]) == sorted(warming.first_run())
    kept = {"NUMBA_CACHE_DIR": str(tmp_path)}
    where = Path(run("-c", "from bonecam.kernels.warming import kept_in; print(kept_in())", **kept).strip())
    assert tmp_path in where.parents
    code = "import bonecam.kernels.warming as w\nw.call_in_worker = lambda *_, **__: print('asked')\n"
    code += "w.cores = lambda: 2\nwith w.warming(lambda *_: True): pass\n"
    assert run("-c", code, **kept) == "asked\nasked\n"
    assert run("-c", code, **kept) == ""


def test_the_target_is_the_same_on_every_machine_that_has_it(tmp_path):
    if COMPILED_FOR != TARGET:
        pytest.skip(f"this machine lacks some of {FEATURES}")
    code = "from bonecam.kernels import COMPILED_FOR; print(COMPILED_FOR)"
    assert run("-c", code).strip() == TARGET
    assert run("-c", code, NUMBA_CPU_NAME="x86-64").strip() == "x86-64"
