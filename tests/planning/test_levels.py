"""What the paths of all levels of a job leave, by the simulation of the posted text."""

from pathlib import Path

import numpy as np
import pytest

import bonecam
from bonecam.mesh.solids import revolve
from bonecam.tool.path import PARTING

JOB = bonecam.Job().with_values(
    mechanics={"refuse": False},
    mesh={"pits": "keep"},
    surface={"tolerance": 0.05},
    holding={"diameter": 3.0, "length": 60.0},
    levels={"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
    roughing={"preset": "ball-4", "scallop": 0.3},
    finishing={"preset": "ball-2", "scallop": 0.02},
    fine={"scallop": 0.02},
    path={"orientation": "lead", "fine_cutter": True},
)


def waisted() -> bonecam.TriangleMesh:
    """A body of revolution, 6 x 10 mm, with a groove of radius 0.5 mm at its bottom."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 81)[1:-1]
    heights = 5 + 5 * np.sin(angle)
    radii = 3 * np.cos(angle) ** 0.8 - 0.6 * np.exp(-(((heights - 6) / 0.75) ** 2))
    return revolve(radii, heights, (0.0, 10.0), 48)


@pytest.mark.whole
def test_a_fine_cutter_cuts_the_hollow_that_the_finishing_ball_does_not_enter(tmp_path: Path) -> None:
    """Without it 13.6 mm2 stay in the groove, 0.12 mm high. The finished part is parted from its post."""
    job = JOB.with_values(holding={"parting": True})
    made = bonecam.convert(waisted(), job, program=tmp_path / "waisted.h")
    on_levels = [path for path in made.paths if path.level >= 0]
    assert [path.cutter.number for path in on_levels][-2:] == [2, 3]
    assert len({path.title for path in made.paths}) == len(made.paths)
    assert "TOOL CALL 3 " in made.program.text
    left = made.report["removal"]["left"]
    assert left["by_reason"]["gouge"] < 0.1
    assert left["max_mm"] < 0.03
    assert max(level["over_limit_mm"] or 0.0 for level in made.report["removal"]["levels"]) < 0.05
    fine = on_levels[-1]
    assert 0 < (~np.isnan(fine.contacts[:, 0])).sum() < 1500, "only the hollow and the fillet at the post"
    assert set(on_levels[-2].reasons) <= {"collision", "limits", "short", "covered"}

    parting = made.report["parting"]
    assert made.paths[-1].level == PARTING
    assert parting["steps"] == len(made.paths) - len(on_levels)
    assert parting["bridge_diameter_mm"] == pytest.approx(1.5)
    assert parting["stump_height_mm"] == pytest.approx(1.0, abs=0.05)
    assert "a bridge of 1.50 mm holds the part" in made.summary
    assert f"parting Z {parting['z_mm']:.2f}" in made.sheet
    assert len(made.report["toolpath"]) == len(on_levels)


@pytest.mark.slow
def test_the_part_comes_out_the_same_without_cuts_in_air(tmp_path: Path) -> None:
    """In a stock that is near to its ends and far from its sides: outer levels have air at the ends."""
    job = JOB.with_values(
        stock={"diameter": 9.0, "length": 11.0}, levels={"roughing_depth": 0.5}, path={"fine_cutter": False}
    )
    made = [
        bonecam.convert(waisted(), job.with_values(path={"least_depth": depth}), program=tmp_path / "w.h")
        for depth in (0.03, 0.0)
    ]
    length, air = (
        [sum(row[name] for row in one.report["toolpath"]) for one in made] for name in ("length_mm", "trimmed_mm")
    )
    assert air[1] == 0
    assert air[0] > 0.05 * length[1]
    assert length[0] < length[1] - 0.5 * air[0]
    heights = [one.removal.left.heights for one in made if one.removal and one.removal.left]
    assert np.abs(heights[0] - heights[1]).max() < JOB.finishing.scallop
    areas = [one.report["removal"]["left"]["area_over_0_02_mm2"] for one in made]
    assert areas[0] == pytest.approx(areas[1], abs=0.5)
