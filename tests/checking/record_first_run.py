"""Writes bonecam/kernels/first_run.txt anew: what the demo calls, and what each takes to compile.

python tests/checking/record_first_run.py
"""

import json
import os
import subprocess
import sys
import tempfile

from bonecam.kernels.warming import LIST

CALLED = """
import json, sys
from pathlib import Path
import bonecam, bonecam_meshes
from bonecam.kernels.warming import called
bonecam.convert(bonecam_meshes.path("phalanx"), program=Path(sys.argv[1]) / "p.h", keep=Path(sys.argv[1]) / "look")
print(json.dumps(sorted(called())))
"""
TIMED = """
import json, sys
from time import process_time
from bonecam.kernels.warming import compile_kernels
for kernel in json.loads(sys.argv[1]):
    start = process_time()
    compile_kernels([kernel], lambda *_: True)
    print(f"{process_time() - start:.1f}", *kernel)
"""


def run(code: str, given: str, **variables: str) -> str:
    command = [sys.executable, "-c", code, given]
    done = subprocess.run(command, env={**os.environ, **variables}, stdout=subprocess.PIPE, text=True, check=True)
    return done.stdout


def demo(**variables: str) -> list[list[str]]:
    """The kernels that the demo calls in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        found: list[list[str]] = json.loads(run(CALLED, folder, **variables))
        return found


if __name__ == "__main__":
    LIST.write_text("")
    with tempfile.TemporaryDirectory() as kept, tempfile.TemporaryDirectory() as empty:
        demo(NUMBA_CACHE_DIR=kept)
        called = demo(NUMBA_CACHE_DIR=kept)  # what is kept is loaded where Python calls it, not where a kernel does
        LIST.write_text(run(TIMED, json.dumps(called), NUMBA_CACHE_DIR=empty), encoding="utf-8")
