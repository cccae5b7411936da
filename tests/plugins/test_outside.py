"""A package from outside, that of the page `extend.md`, is used like what ships; one that is broken stops nothing."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import bonecam_meshes
import numpy as np
import pytest

from bonecam.mesh import read_mesh

PAGE = Path(__file__).parents[2] / "docs" / "pages" / "using" / "extend.md"
FENCE = re.compile(r'^```\w+ title="weigh/(?P<title>[^"]+)"\n(?P<text>.*?)^```$', re.MULTILINE | re.DOTALL)
SCRIPT = """<!DOCTYPE FilterScript>
<FilterScript><filter name="Compute Mass"><Param name="density" type="RichFloat" value="2.0"/></filter></FilterScript>
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder into which pip has installed the package of the page."""
    source, target = tmp_path_factory.mktemp("weigh"), tmp_path_factory.mktemp("site")
    for found in FENCE.finditer(PAGE.read_text(encoding="utf-8")):
        file = source / found["title"]
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(found["text"], encoding="utf-8")
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(target), str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"pip cannot build a package here: {done.stderr[-300:]}")
    return target


def run(site: Path, *words: str, code: int = 0) -> subprocess.CompletedProcess[str]:
    """The command line, or Python, with what is installed in the folder."""
    there = {**os.environ, "PYTHONPATH": str(site)}
    done = subprocess.run([sys.executable, *words], env=there, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    return done


BONE = str(bonecam_meshes.path("phalanx"))


@pytest.mark.whole
def test_the_package_of_the_page_adds_a_command_a_section_a_reader_and_a_name(site, tmp_path):
    assert "weigh" in run(site, "-m", "bonecam", "--help").stdout
    told = run(site, "-m", "bonecam", "weigh", BONE, "--set", "weigh.density=4.4").stdout
    assert float(told.split()[0]) == pytest.approx(4.4e-3 * read_mesh(BONE).volume, rel=1e-3)
    assert "[weigh]\ndensity = 2.7" in run(site, "-m", "bonecam", "job").stdout
    refused = run(site, "-m", "bonecam", "weigh", BONE, "--set", "weigh.density=99", code=2).stderr
    assert refused == "bonecam: [weigh] density = 99.0: keep it within 0.1 .. 25 g/cm3\n"
    code = f"import bonecam; print(bonecam.weigh(bonecam.mesh.read_mesh({BONE!r}), 1.0), bonecam.Job().weigh.density)"
    mass, density = run(site, "-c", code).stdout.split()
    assert (float(mass), density) == (pytest.approx(read_mesh(BONE).volume / 1000), "2.7")
    cube = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]] * 9.0
    np.savetxt(tmp_path / "corner.tri", cube.reshape(4, 9))
    told = run(site, "-m", "bonecam", "weigh", str(tmp_path / "corner.tri")).stdout
    assert told == f"{2.7e-3 * 9**3 / 6:.3f} g\n"
    (tmp_path / "bad.tri").write_text("1 2 nothing\n")
    refused = run(site, "-m", "bonecam", "weigh", str(tmp_path / "bad.tri"), code=2).stderr
    assert "bad.tri" in refused
    assert refused.count("\n") == 1


@pytest.mark.whole
def test_the_package_of_the_page_adds_a_filter_to_scripts(site, tmp_path):
    (tmp_path / "mass.mlx").write_text(SCRIPT)
    assert "g/cm3" in run(site, "-m", "bonecam", "filters", "compute_mass").stdout
    done = run(site, "-m", "bonecam", "script", str(tmp_path / "mass.mlx"), "-i", BONE, "-o", str(tmp_path / "layers"))
    assert done.stdout.count("\n") == 1


@pytest.mark.whole
def test_the_figures_of_the_package_are_in_report_summary_and_batch(site, tmp_path):
    coarse = ["--job", "paper-coarse", "--set", "weigh.density=2.0"]
    words = ["-m", "bonecam", "batch", BONE, "-o", str(tmp_path / "out"), *coarse, "--jobs", "1"]
    run(site, *words)
    report = json.loads((tmp_path / "out" / f"{Path(BONE).stem}.json").read_text())
    assert report["added"] == {"weigh": {"mass_g": pytest.approx(2e-3 * read_mesh(BONE).volume, rel=0.01)}}


BROKEN = """
[bonecam.commands]
broken = no_such_module:COMMAND
[bonecam.sections]
broken = no_such_module:Section
[bonecam.figures]
broken = no_such_module:figures
[bonecam.filters]
broken = no_such_module:FILTERS
"""


def test_a_package_that_does_not_load_is_one_line_and_all_else_works(tmp_path):
    info = tmp_path / "broken-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(BROKEN)
    done = run(tmp_path, "-m", "bonecam", "job", "--all")
    assert "[warnings]" in done.stdout
    lines = done.stderr.splitlines()
    assert len(lines) == 2, "a command and a section"
    assert all(
        "no_such_module" in line and "of broken: cannot be loaded: ModuleNotFoundError" in line for line in lines
    )
    there = {**os.environ, "PYTHONPATH": str(tmp_path), "BONECAM_NO_PLUGINS": "1"}
    alone = subprocess.run([sys.executable, "-m", "bonecam", "job", "--all"], env=there, capture_output=True, text=True)
    assert alone.stderr == ""
    assert "iso-height" in done.stdout
    assert "iso-height" not in alone.stdout
