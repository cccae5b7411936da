"""The solvers beside the default are reached from a job and lead to a verified program."""

import pytest
from bonecam_meshes import path as shipped

import bonecam
from bonecam.job import Job
from bonecam.levels.solvers.solver import SOLVERS
from bonecam.mesh.files.mesh_files import read_mesh

pytestmark = pytest.mark.whole

COARSE = Job().with_values(
    mechanics={"refuse": False},
    mesh={"rows": 8, "row_points": 24},
    surface={"tolerance": 0.5, "largest_deviation": 1.0, "max_control_points": 60},
    holding={"diameter": 4.0, "length": 110.0},
    path={"orientation": "lead"},
    levels={"finishing_levels": 1, "finishing_depth": 0.5, "roughing_depth": 1.5, "chord_tolerance": 0.05},
    roughing={"preset": "ball-4", "scallop": 0.4},
    finishing={"radius": 2.0, "flute_length": 8.0, "shank_diameter": 4.0, "scallop": 0.4},
)


@pytest.mark.parametrize("solver", sorted(set(SOLVERS) - {"admm"}))
def test_a_reference_solver_leads_to_a_verified_program(solver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the phalanx at half its size, without certificates: those of levels as coarse as these take longer than all
    the rest."""
    if solver == "clarabel":
        pytest.importorskip("clarabel", reason="the extra `reference` is not installed")
    monkeypatch.setattr("bonecam.levels.measure.certifiable", lambda surface: False)
    job = COARSE.with_values(levels={"solver": solver})
    whole = read_mesh(shipped("phalanx"))
    result = bonecam.convert((0.5 * whole.vertices, whole.faces), job, simulation=False)
    assert result.program.text
    report = result.report
    assert report["nc"]["gouge_max_mm"] <= 0.01
    assert len(report["levels"]) - 1 <= report["levels_lower_bound"] + 1
    assert all(row["depth_max_mm"] <= row["limit_mm"] + 0.002 for row in report["levels"][1:])
