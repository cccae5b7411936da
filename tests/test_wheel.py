"""The wheel carries everything: it works in a venv outside the checkout."""

import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = {"bonecam": "bonecam", "plugins": "bonecam_plugins", "meshes": "bonecam_meshes"}
"""Folders of the checkout, and the packages that they are installed as."""
LEFT_OUT = {".pyc", ".nbc", ".nbi"}
"""Endings of what is compiled."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel of the checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    copy = folder / "checkout"  # a build leaves a folder, from which the next would take what is gone
    for name in FOLDERS:
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns(*(f"*{end}" for end in LEFT_OUT)))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, copy)
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(folder), str(copy)]
    done = subprocess.run(command, capture_output=True, text=True)
    if "No matching distribution" in done.stderr:
        pytest.skip("pip finds no setuptools to build a wheel with")
    assert done.returncode == 0, done.stderr
    (made,) = folder.glob("*.whl")
    return made


@pytest.fixture(scope="module")
def outside(wheel, tmp_path_factory):
    """The python of a venv outside the checkout with the wheel, and the libraries of this one but no checkout."""
    folder = tmp_path_factory.mktemp("outside")
    venv.create(folder / "venv", with_pip=False)
    (site,) = (folder / "venv").glob("lib/python*/site-packages")
    zipfile.ZipFile(wheel).extractall(site)
    (site / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return folder / "venv" / "bin" / "python"


def called(python: Path, *words: str) -> str:
    """What `bonecam` prints in the venv."""
    folder = python.parents[2]
    return subprocess.run(
        [python, "-m", "bonecam", *words], cwd=folder, capture_output=True, text=True, check=True
    ).stdout


def test_every_file_of_the_packages_is_in_it(wheel):
    packed = set(zipfile.ZipFile(wheel).namelist())
    for folder, package in FOLDERS.items():
        files = [path for path in (ROOT / folder).rglob("*") if path.is_file() and path.suffix not in LEFT_OUT]
        assert len(files) > 3
        missing = [path for path in files if f"{package}/{path.relative_to(ROOT / folder).as_posix()}" not in packed]
        assert missing == []


@pytest.mark.plugged
def test_its_data_is_found_outside_the_checkout(outside):
    code = "import bonecam, bonecam_meshes; print(bonecam.__file__, bonecam_meshes.path('phalanx'))"
    places = subprocess.run([outside, "-c", code], capture_output=True, text=True, check=True, cwd="/").stdout
    assert str(ROOT) not in places
    for kind, name in (
        ("machines", "mikron-ucp600"),
        ("dialects", "siemens-840d"),
        ("materials", "peek"),
        ("tools", "ball-2"),
    ):
        assert name in called(outside, kind)
    assert "generate_stock" in called(outside, "filters")


@pytest.mark.slow
def test_it_makes_the_demo(outside):
    told = called(outside, "demo", "-o", "phalanx.h", "--html", "phalanx.html", "--sheet", "sheet.html")
    assert "proof" in told
    assert (outside.parents[2] / "phalanx.h").read_text(encoding="utf-8").startswith("0 BEGIN PGM PHALANX MM")
