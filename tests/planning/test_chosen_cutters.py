"""The cutters that are chosen: what a ball leaves is the closing of the part by it, and the best set leaves and takes
the least of all that the list allows."""

from pathlib import Path

import numpy as np
import pytest
from typed_values import differences

from bonecam.errors import JobError
from bonecam.job import Job, read_job, write_job
from bonecam.job.tool_section import AUTO, SIZES
from bonecam.machine import read_machine
from bonecam.mesh import repaired_part
from bonecam.mesh.solids import revolve
from bonecam.nc import machine_limits
from bonecam.planning import with_chosen_cutters
from bonecam.planning.chosen_cutters import CLEAN, SHALLOW, Hollows
from bonecam.report.typed import CutterFigures
from bonecam.report.warnings import cutter_lines
from bonecam.setup import place
from bonecam.workholding import Post

PHALANX = Path(__file__).parents[2] / "meshes/phalanx.ply"
LIMITS = machine_limits(read_machine("mikron-ucp600"))
SIZE = "flute_length = 4.0\nshank_diameter = 6.0\noverhang = 22.0\nholder = '60 12 21, 20 63'\n"


def shop(folder: Path, *radii: float, number: int = 0) -> str:
    """The path of a list of balls of these radii, mm, all of a `number`."""
    tools = [
        f"[[tool]]\nname = 'R{radius:g}'\nnumber = {number}\nradius = {radius}\n{SIZE}"
        f"neck_length = 15.0\nneck_diameter = {1.8 * radius}\n"
        for radius in radii
    ]
    (folder / "shop.toml").write_text("".join(tools))
    return str(folder / "shop.toml")


@pytest.fixture(scope="module")
def phalanx():
    """The phalanx in its stock."""
    job = Job()
    return place(repaired_part(PHALANX, job.mesh), job)


def test_what_a_ball_leaves_in_a_groove_is_the_closing_by_it():
    """A right-angled groove round a waist: the ball that touches both its sides stays R (sqrt 2 - 1) off its bottom.
    Depths are those at the middles of faces, R / 2 long at most."""
    radii, heights = np.array([[5.0, 0.0], [5.0, 2.5], [3.5, 4.0], [5.0, 5.5], [5.0, 8.0]]).T
    part = revolve(radii, heights, (0.0, 8.0), 120)
    hollows = Hollows(part, Post(2.0, 1.0))
    for radius in (0.8, 1.0):
        exact = radius * (np.sqrt(2) - 1)
        assert 0.75 * exact < hollows.deepest(radius) < 1.01 * exact
        wide = radius  # along each side, from the bottom to where the ball touches it
        band = 2 * 2 * np.pi * (3.5 + wide / np.sqrt(8)) * wide
        assert hollows.deeper(radius, 1e-4) == pytest.approx(band, rel=0.12)
    assert not hollows.clean(0.8)
    thirds = hollows.deeper(1.0, SHALLOW) + hollows.deeper(1.0, 0.15) + hollows.deeper(1.0, 0.3)
    assert hollows.steps(1.0, 0.15) == pytest.approx(thirds)


@pytest.mark.whole
def test_of_a_shop_s_list_the_best_set_is_taken_and_told(phalanx, tmp_path):
    job = Job().with_values(nc={"tools": shop(tmp_path, 1.0, 2.0, 3.0)}, finishing={"scallop": 0.02})
    chosen, told = with_chosen_cutters(phalanx, job, LIMITS)
    assert chosen.roughing.radius >= chosen.finishing.radius >= chosen.fine.radius
    assert chosen.smallest_ball == 1.0, "R 2 leaves 0.33 mm in a hollow"
    assert chosen.finishing.preset == f"R{chosen.finishing.radius:g}"
    assert (chosen.finishing.scallop, chosen.holding) == (0.02, job.holding)
    assert chosen.path.fine_cutter == (chosen.finishing.radius > 1.0)
    assert read_back(chosen, tmp_path) == chosen

    assert not list(differences(told, CutterFigures))
    best = told["sets"][0]
    assert best["left_mm"] <= CLEAN
    assert best["roughing"] == chosen.roughing.preset
    assert best["holds"]
    lines = list(cutter_lines(told, ()))
    assert " / ".join(best[name] for name in chosen.cutter_names) in lines[0]
    finer = told["finer"]
    assert finer["radius_mm"] < 1.0
    assert finer["left_mm"] <= best["left_mm"] / 2 + 0.005
    assert finer["left_mm2"] < best["left_mm2"]
    assert f"fine.preset = {finer['preset']} would leave" in lines[-1]

    with_one, _ = with_chosen_cutters(phalanx, job.with_values(roughing={"radius": 2.5}), LIMITS)
    assert (with_one.roughing.radius, with_one.roughing.preset) == (2.5, "")
    assert with_one.finishing.radius <= 2.5


def read_back(job: Job, folder: Path) -> Job:
    """The job of the text of a job."""
    (folder / "job.toml").write_text(write_job(job), encoding="utf-8")
    return read_job(folder / "job.toml")


def test_a_clean_ball_leaves_no_more_than_it_says(phalanx):
    hollows = Hollows(phalanx.part.mesh, Post(4.0, float(phalanx.part.mesh.bounds[0, 2]) + 1.0))
    assert hollows.clean(1.0)
    assert not hollows.clean(1.5)
    assert 0 < hollows.deeper(1.0, SHALLOW) < hollows.deeper(1.5, SHALLOW)


def test_one_cutter_of_a_shop_does_not_stand_in_two_places(phalanx, tmp_path):
    job = Job().with_values(nc={"tools": shop(tmp_path, 1.0, number=7)})
    with pytest.raises(JobError, match=r"nc\.tools = .*: has no ball ends for all sections: add some"):
        with_chosen_cutters(phalanx, job, LIMITS)


def test_a_section_with_a_size_is_its_own_and_one_without_is_chosen(phalanx, tmp_path):
    job = Job()
    assert all(getattr(job, name).preset == AUTO for name in ("roughing", "finishing", "fine"))
    own = job.with_values(roughing={"overhang": 30.0}, finishing={"scallop": 0.02})
    assert (own.roughing.preset, own.finishing.preset) == ("", AUTO)
    section = write_job(own).partition("[finishing]")[2].partition("[fine]")[0]
    assert "\nscallop = 0.02" in section
    assert not any(f"\n{size} = " in section for size in SIZES)
    assert read_back(own, tmp_path) == own
    with pytest.raises(
        JobError, match=r"\[finishing\] radius = 1.5: preset = 'auto' chooses it: leave one of them out"
    ):
        job.with_values(finishing={"preset": "auto", "radius": 1.5})
    stated = own.with_values(finishing={"radius": 1.0})
    assert with_chosen_cutters(phalanx, stated, LIMITS) == (stated, {})
