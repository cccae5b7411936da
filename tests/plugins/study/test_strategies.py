"""The two strategies that morphing replaces, from the mesh to the simulated program, on the shipped phalanx, coarse."""

from pathlib import Path

import numpy as np
import pytest
from bonecam_meshes import path as shipped
from bonecam_plugins.study import plan_layer_paths

import bonecam
from bonecam.errors import OrientationError
from bonecam.job import Job
from bonecam.machine import MachineLimits
from bonecam.mesh.smooth_surface import nearest_areas
from bonecam.setup import Cylinder
from bonecam.tool import MoveKind

COARSE = Job().with_values(
    mechanics={"refuse": False},
    surface={"tolerance": 0.2},
    levels={"roughing_depth": 1.2, "finishing_depth": 0.3, "chord_tolerance": 0.02},
    roughing={"preset": "ball-4", "scallop": 0.3},
    finishing={"preset": "ball-2", "scallop": 0.1},
    path={"chord_tolerance": 0.02, "gouge_tolerance": 0.04},
)


def converted(strategy: str, folder: Path) -> bonecam.Result:
    job = COARSE.with_values(path={"strategy": strategy})
    return bonecam.convert(shipped("phalanx"), job, program=folder / "bone.h", keep=folder / "keep")


@pytest.fixture(scope="module")
def rotary(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rotary")
    return converted("rotary", folder), folder


@pytest.mark.slow
def test_rotary_milling_keeps_its_tool_radial_and_leaves_the_ends(rotary):
    result, _ = rotary
    part = result.levels.levels[0].mesh.bounds
    for path in result.paths:
        cuts = path.kinds == MoveKind.CUT
        centres = (path.tips + path.cutter.radius * path.axes)[cuts]
        axes = path.axes[cuts]
        np.testing.assert_allclose(axes[:, 2], 0.0, atol=1e-12)
        across = np.cross(axes, centres)[:, 2]
        np.testing.assert_allclose(across, 0.0, atol=1e-9)
        assert part[0, 2] - 0.02 <= centres[:, 2].min()
        assert centres[:, 2].max() <= part[1, 2] + 0.02
    removal = result.removal
    assert removal is not None
    assert removal.rapid_contact is None
    assert removal.left is not None
    high = removal.left.heights > 0.15
    places = removal.left.mesh.vertices[high]
    assert (places[:, 2] > part[1, 2] - 2).any()
    flanks = np.abs(removal.left.mesh.vertices[:, 2] - part[:, 2].mean()) < 0.25 * np.ptp(part[:, 2])
    assert removal.left.heights[flanks].max() < 0.15, "the flanks are finished to the scallop of 0.1 mm"


@pytest.mark.slow
def test_a_program_of_another_strategy_is_simulated_alone_as_in_convert(rotary):
    result, folder = rotary
    job = COARSE.with_values(path={"strategy": "rotary"}, holding={"length": result.report["post"]["length_mm"]})
    alone = bonecam.simulate(folder / "bone.h", folder / "keep", job, cell=0.2)
    assert result.removal is not None
    assert [level.index for level in alone.levels] == [level.index for level in result.removal.levels]
    assert alone.volume == pytest.approx(result.removal.volume, rel=0.02)


@pytest.mark.slow
def test_iso_height_milling_cuts_from_two_sides_within_its_depths(tmp_path):
    result = converted("iso-height", tmp_path)
    sides = [path.axes[path.kinds == MoveKind.CUT] for path in result.paths]
    for axes in sides:
        np.testing.assert_allclose(axes, np.broadcast_to(axes[0], axes.shape), atol=1e-12)
        assert abs(abs(axes[0] @ sides[0][0]) - 1) < 1e-12
    assert sides[-1][0] @ sides[-2][0] == pytest.approx(-1)
    roughing = [path for path in result.paths if path.cutter.name == "roughing"]
    for path in roughing:
        cuts = path.kinds == MoveKind.CUT
        assert np.ptp((path.tips * path.axes)[cuts].sum(1)) < 1e-9, "a slice has one height"
    removal = result.removal
    assert removal is not None
    assert removal.left is not None
    assert removal.rapid_contact is None
    mesh, high = removal.left.mesh, removal.left.heights > 0.15
    assert nearest_areas(mesh, mesh.vertices)[high].sum() < 0.1 * mesh.area
    for level in removal.levels:
        if level.tool == 1:
            assert level.depth_p99 < 1.2 + 0.3, "a slice takes the cusps of the one before too"


def test_a_machine_that_cannot_lay_its_tool_level_is_refused():
    limits = MachineLimits(np.radians(60.0))
    job = COARSE.with_values(path={"strategy": "rotary"})
    with pytest.raises(OrientationError, match="90 deg"):
        plan_layer_paths([], Cylinder(5.0, 1.0, 2.0), job, limits)
