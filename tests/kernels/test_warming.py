"""What a default run calls is compiled beforehand, by processes that share it out, once."""

import os
import subprocess
import sys
from itertools import chain
from pathlib import Path

import pytest
from record_first_run import demo

from bonecam.kernels import COMPILED_FOR, FEATURES, TARGET, warming


def run(*command: str, **variables: str) -> str:
    done = subprocess.run(
        [sys.executable, *command], env={**os.environ, **variables}, capture_output=True, text=True, check=True
    )
    return done.stdout


@pytest.mark.whole
def test_the_list_holds_what_the_demo_calls_and_no_more():
    """What is kept is loaded where Python calls it, not where a kernel does; what is not is compiled with all of it."""
    run("-m", "bonecam", "warm")
    told = {tuple(kernel) for kernel in demo()}
    assert told == {(name, kinds) for _, name, kinds in warming.first_run()}, "tests/checking/record_first_run.py"


def test_each_type_of_the_list_is_read_as_it_is_written():
    for _, name, kinds in warming.first_run():
        found = eval(f"[{kinds}]", warming.NAMES)
        assert ", ".join(map(warming._text_of, found)) == kinds, name


@pytest.mark.parametrize("count", [1, 2, 3, 64])
def test_the_shares_are_all_there_is(count):
    """No module is in two of them, and the longest is about as long as it must be."""
    shares = warming.shares_of(count)
    assert sorted(chain(*shares)) == sorted((name, kinds) for _, name, kinds in warming.first_run())
    modules = [{name.partition(".")[0] for name, _ in share} for share in shares]
    assert sum(map(len, modules)) == len(set().union(*modules))
    seconds = {(name, kinds): cost for cost, name, kinds in warming.first_run()}
    of_modules = {m: sum(c for (n, _), c in seconds.items() if n.startswith(f"{m}.")) for m in set().union(*modules)}
    longest = max(sum(seconds[kernel] for kernel in share) for share in shares)
    assert longest < max(*of_modules.values(), 4 / 3 * sum(of_modules.values()) / count) + 0.1


def test_kernels_are_compiled_once_for_all_that_come_later(tmp_path):
    kept = {"NUMBA_CACHE_DIR": str(tmp_path)}
    where = Path(run("-c", "from bonecam.kernels.warming import kept_in; print(kept_in())", **kept).strip())
    assert tmp_path in where.parents
    code = "import bonecam.kernels.warming as w\nw.call_in_worker = lambda *_, **__: print('asked\\n', end='')\n"
    code += "w.cores = lambda: 2\nwith w.warming(lambda *_: True): pass\n"
    assert run("-c", code, **kept) == "asked\nasked\n"
    assert run("-c", code, **kept) == ""


def test_the_target_is_the_same_on_every_machine_that_has_it(tmp_path):
    if COMPILED_FOR != TARGET:
        pytest.skip(f"this machine lacks some of {FEATURES}")
    code = "from bonecam.kernels import COMPILED_FOR; print(COMPILED_FOR)"
    assert run("-c", code).strip() == TARGET
    assert run("-c", code, NUMBA_CPU_NAME="x86-64").strip() == "x86-64"
