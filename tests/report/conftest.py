"""A small part that went the whole way, and a browser."""

from pathlib import Path
from typing import Any

import pytest
from small_job import SMALL, SMALL_CAPSULE

import bonecam

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
]


@pytest.fixture(scope="session")
def small_run(tmp_path_factory):
    """A capsule of 5 x 10 mm converted, and the folder with all that was written."""
    folder = tmp_path_factory.mktemp("small")
    mesh = SMALL_CAPSULE.mesh(0.05)
    files: dict[str, Any] = {"program": "bone.h", "keep": "keep", "html": "bone.html", "sheet": "sheet.html"}
    files["apt"] = "bone.apt"
    made = bonecam.convert(mesh, SMALL, **{name: folder / file for name, file in files.items()})
    return made, folder


@pytest.fixture(scope="session")
def second_run(tmp_path_factory):
    """The same capsule parted and held a second time in a shell, and the folder with all that was written."""
    folder = tmp_path_factory.mktemp("second")
    mesh = SMALL_CAPSULE.mesh(0.05)
    shell = {"second": str(folder / "shell.stl"), "second_chuck_diameter": 30.0, "second_chuck_height": 2.0}
    job = SMALL.with_values(holding={"parting": True, **shell})
    bonecam.clamping_shell(mesh, job, output=folder / "shell.stl", wall=2.0)
    files: dict[str, Any] = {"program": "bone.h", "keep": "keep", "html": "bone.html", "sheet": "sheet.html"}
    files |= {"apt": "bone.apt", "report": "bone.json"}
    made = bonecam.convert(mesh, job, **{name: folder / file for name, file in files.items()})
    return made, folder


@pytest.fixture(scope="session")
def browser():
    """A headless chromium."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if not CHROMIUM.exists():
        pytest.skip(f"{CHROMIUM} is not there: apt-get install chromium")
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield opened
        opened.close()
