"""Writes bonecam/kernels/first_run.txt anew: what the demo calls, the costliest first.

NUMBA_CACHE_DIR=$(mktemp -d) python tests/checking/record_first_run.py
"""

import tempfile
from pathlib import Path

import bonecam_meshes

import bonecam
from bonecam.kernels.warming import LIST, called

if __name__ == "__main__":
    LIST.touch()
    with tempfile.TemporaryDirectory() as folder:
        bonecam.convert(bonecam_meshes.path("phalanx"), program=Path(folder) / "phalanx.h", keep=Path(folder) / "look")
    costliest = sorted(called().items(), key=lambda item: (-item[1], item[0]))
    LIST.write_text("".join(f"{name} {kinds}\n" for (name, kinds), _ in costliest), encoding="utf-8")
