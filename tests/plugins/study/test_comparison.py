"""Strategies on one small part: every figure is told, what fails is a row, and a kept program is probed."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bonecam_plugins.study import STRATEGIES, comparison
from bonecam_plugins.study import comparison as probed_folder
from bonecam_plugins.study.comparison import LINES
from small_parts import mesh_of, pebble

import bonecam
from bonecam.cli import main
from bonecam.errors import FileError, JobError, LevelError, MachineError
from bonecam.job import Job
from bonecam.levels.job_levels import make_levels
from bonecam.machine import read_machine
from bonecam.machining import Posting, stand_part
from bonecam.nc.requirements import job_dialect
from bonecam.progress import silent
from bonecam.report.outputs import Outputs

pytestmark = pytest.mark.whole

COARSE = Job().with_values(
    surface={"tolerance": 0.2},
    stock={"diameter": 10.0, "length": 13.2},
    holding={"diameter": 4.0, "length": 20.0},
    levels={"roughing_depth": 1.5, "finishing_levels": 1, "finishing_depth": 0.4, "chord_tolerance": 0.02},
    roughing={"scallop": 0.4},
    finishing={"scallop": 0.2},
    path={"chord_tolerance": 0.05, "gouge_tolerance": 0.05},
    mechanics={"refuse": False},
)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder, and bonecam's strategy compared while the published one fails."""
    folder = tmp_path_factory.mktemp("study")

    def failing(surface, stock, job, progress):
        if job.levels.method == "published":
            raise LevelError("level 1: is planted to fail", level=1)
        return make_levels(surface, stock, job, progress)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(comparison, "make_levels", failing)
        names = ["published", "bonecam"]
        found = bonecam.compare(mesh_of(pebble(), 40, 50), COARSE, folder=folder, strategies=names, points=8)
    return folder, found


def test_a_failed_strategy_is_a_row_with_its_reason_and_ends_nothing(made):
    failed, done = made[1].rows
    assert (failed.state, failed.reason, failed.figures) == ("failed", "level 1: is planted to fail", {})
    assert done.name == "bonecam"
    assert {name for name, _ in LINES} <= done.figures.keys()


def test_the_figures_are_those_of_the_program(made):
    (one,) = made[1].measured.values()
    removal, row = one.result.removal, made[1].rows[1].figures
    cut = [level for level in removal.levels if level.tool == 2]
    assert row["depth_finishing_max"] == pytest.approx(max(level.depths.max() for level in cut), rel=1e-3)
    loads = [path for path in removal.mechanics.paths if len(path.moves)]
    peak = max(path.peak.max() for path in loads)
    assert max(row["force_roughing_peak_max"], row["force_finishing_peak_max"]) == pytest.approx(peak, rel=1e-3)
    assert row["program_min"] >= row["axes_min"] >= row["feed_min"] > 0
    assert 0 < row["air_share"] < 1
    assert row["probe_points"] == 8
    assert abs(one.probed.rigid).max() < COARSE.finishing.scallop


def test_the_folder_has_table_claims_curves_and_pages(made):
    names = {file.name for file in made[0].iterdir() if not file.name.startswith(".")}
    assert names == {
        *(f"comparison.{kind}" for kind in ("txt", "md", "csv", "json")),
        *("probe_bonecam.csv", "page_bonecam.html", "index.html", "paths.png", "left.png", "probe.png"),
    }
    told = json.loads((made[0] / "comparison.json").read_text())
    assert [row["state"] for row in told["strategies"]] == ["failed", made[1].rows[1].state]
    page, table = ((made[0] / name).read_text() for name in ("index.html", "comparison.md"))
    files = [word.split('"')[0] for word in page.split('src="')[1:]]
    assert set(files) == {"page_bonecam.html", "paths.png", "left.png", "probe.png"}
    for claim in made[1].claims:
        assert claim.verdict in page
        assert f"| {claim.text} | {claim.of} | {claim.verdict} |" in table


def test_a_kept_program_is_probed_as_in_the_comparison(made, tmp_path, capsys):
    (one,) = made[1].measured.values()
    Outputs(keep=tmp_path / "keep").write(one.result)
    files = {"csv": "p.csv", "picture": "p.png", "program": "p.h"}
    options = ["-o", "p.csv", "--picture", "p.png", "--program", "p.h"]
    options = [str(tmp_path / word) if "." in word else word for word in options]
    assert main(["probe", str(tmp_path / "keep"), "--points", "8", *options]) == 0
    assert "8 of 8 points" in capsys.readouterr().out
    assert all((tmp_path / name).exists() for name in files.values())
    table = np.loadtxt(tmp_path / "p.csv", delimiter=",", skiprows=1)
    assert np.abs(table[:, 8:10] - np.column_stack([one.probed.deviation, one.probed.rigid])).max() < 2e-3
    (tmp_path / "keep" / "view.gz").write_bytes(b"of another version")
    with pytest.raises(FileError):
        bonecam.probe(tmp_path / "keep", points=8)


def test_what_a_kept_folder_cannot_be_probed_by_is_told_before_it_is_simulated(made, tmp_path, monkeypatch):
    (one,) = made[1].measured.values()
    Outputs(keep=tmp_path / "keep").write(one.result)
    monkeypatch.setattr(probed_folder, "simulate", lambda *_, **__: pytest.fail("simulated"))
    with pytest.raises(JobError, match=r"line 1\.5 is off the part"):
        bonecam.probe(tmp_path / "keep", line=1.5)


@pytest.mark.parametrize("fails", [False, True])
def test_the_part_is_read_and_fitted_once_for_all_strategies(monkeypatch, fails):
    posting = Posting(read_machine(COARSE.nc.machine), job_dialect(COARSE.nc))
    fitted, stood = [], []

    def stand(*given):
        stood.append(stand_part(*given))
        return stood[-1]

    def fit(standing, *_):
        fitted.append(standing.job.path.strategy)
        if fails and fitted == ["morph"]:
            raise LevelError("level 1: is planted to fail", level=1)
        return standing

    monkeypatch.setattr(comparison, "stand_part", stand)
    monkeypatch.setattr(comparison, "morph_standing", fit)
    base, failure = comparison._base(mesh_of(pebble(), 40, 50), COARSE, STRATEGIES, posting, silent)
    (first,) = stood
    assert (fitted, bool(failure)) == ((["morph", "iso-height"], True) if fails else (["morph"], False))
    assert base.setup is first.setup
    assert base.job.holding == first.job.holding


@pytest.mark.parametrize(
    ("given", "told"),
    [({"line": 1.5}, "line 1.5 is off the part: give a parameter s from 0 to 1"), ({"points": 1}, "1 points")],
)
def test_a_line_off_the_part_is_refused_before_the_part_is_read(given, told):
    with pytest.raises(JobError, match=told):
        bonecam.compare("no.stl", **given)


def test_strategies_that_the_machine_cannot_run_are_known_before_anything_is_planned(monkeypatch):
    machine = read_machine("mikron-ucp600")
    table, tilt = machine.part_axes
    leaning = replace(machine, part_axes=(table, replace(tilt, limits=(-np.radians(80), np.radians(80)))))
    failures = comparison._failures(STRATEGIES, COARSE, leaning, job_dialect(COARSE.nc))
    assert set(failures) == {"iso-height", "rotary"}
    monkeypatch.setattr(comparison, "read_machine", lambda _: leaning)
    with pytest.raises(MachineError, match="the sides of the stock need 90: take another machine"):
        bonecam.compare("no.stl", COARSE, strategies=["rotary"])


def test_an_unknown_strategy_is_refused_in_a_line():
    with pytest.raises(JobError, match=r"^strategy 'spiral' is unknown: take some of published, bonecam, iso-height"):
        bonecam.compare("no.stl", strategies=["spiral"])
