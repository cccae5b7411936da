"""The folder of wheels stands apart: nothing else imports or names it, and without it the core runs."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from small_wheel import blade, job

import bonecam
from bonecam.surface import save_surface

ROOT = Path(__file__).parents[3]
IMPORTS = """
import sys
from importlib import import_module
from pkgutil import walk_packages
import bonecam
for found in walk_packages(bonecam.__path__, "bonecam."):
    if found.name != "bonecam.__main__":
        import_module(found.name)
print(bonecam.__file__, len([name for name in sys.modules if name.startswith("bonecam.")]))
"""


@pytest.fixture(scope="module")
def core(tmp_path_factory):
    """A folder with bonecam and its meshes, without wheels."""
    folder = tmp_path_factory.mktemp("core")
    shutil.copytree(ROOT / "bonecam", folder / "bonecam", ignore=shutil.ignore_patterns("wheels"))
    shutil.copytree(ROOT / "meshes", folder / "bonecam_meshes")
    return folder


def run(core: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Python in the folder, with nothing of plugins."""
    there = {**os.environ, "PYTHONPATH": str(core), "BONECAM_NO_PLUGINS": "1"}
    return subprocess.run([sys.executable, *words], env=there, cwd=core, capture_output=True, text=True)


def test_the_core_imports_without_it(core):
    done = run(core, "-c", IMPORTS)
    assert done.returncode == 0, done.stderr
    file, count = done.stdout.split()
    assert Path(file).is_relative_to(core)
    assert int(count) > 150


def test_a_wheel_is_then_refused_in_one_line(core):
    for words in (["blades", "a.txt", "--hub", "b.stl", "--count", "3", "-o", "a.h"], ["demo", "--impeller"]):
        done = run(core, "-m", "bonecam", *words)
        assert done.returncode == 2
        assert words[-1 if words[0] == "demo" else 0] in done.stderr.splitlines()[-1]


@pytest.mark.whole
def test_the_core_plans_without_it_what_it_plans_with_it(core, tmp_path):
    save_surface(blade(), core / "blade.tspline")
    (core / "job.toml").write_text(bonecam.write_job(job()), encoding="utf-8")
    words = ["finish", "blade.tspline", "-o", "blade.h", "--job", "job.toml", "--no-simulation", "-q"]
    done = run(core, "-m", "bonecam", *words)
    assert done.returncode == 0, done.stderr
    made = bonecam.finish(core / "blade.tspline", job=job(), program=tmp_path / "blade.h", simulation=False)
    assert (core / "blade.h").read_text() == made.program.text
    assert np.isfinite(made.path.tips).all()
