"""The whole chain on a mill of four axes: of a part that lies in its rotary axis only the two ends stay."""

import bonecam_meshes
import numpy as np
import pytest

import bonecam
from bonecam.job import Job
from bonecam.mesh import TriangleMesh, read_mesh, write_mesh

SCALLOP = 0.04
JOB = Job().with_values(
    nc={"machine": "mill-4axis", "controller": "fanuc-30i"},
    mechanics={"refuse": False},
    surface={"tolerance": 0.2},
    holding={"diameter": 2.0},
    levels={"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.02},
    roughing={"preset": "ball-4", "scallop": 0.3},
    finishing={"preset": "ball-2", "scallop": SCALLOP},
)
FREE_END = 1.0
"""mm of the part's height below its free end."""
POST_END = 4.0
"""mm above its lowest point: the post, and the fillet of the ball round it."""


@pytest.mark.whole
def test_only_the_ends_of_half_a_phalanx_stay_on_four_axes_with_their_areas(tmp_path):
    mesh = read_mesh(bonecam_meshes.path("phalanx"))
    write_mesh(TriangleMesh(mesh.vertices / 2, mesh.faces), tmp_path / "half.ply")
    result = bonecam.convert(tmp_path / "half.ply", JOB, program=tmp_path / "half.nc", mechanics=False)
    assert result.removal is not None
    left = result.removal.left
    assert left is not None

    heights = left.mesh.vertices[:, 2]
    over = left.heights > SCALLOP + 0.02
    in_between = (heights > heights.min() + POST_END) & (heights < heights.max() - FREE_END)
    assert not (over & in_between).any()
    at_free_end = over & (heights > heights.max() - FREE_END)
    assert at_free_end.any()
    assert left.by_reason["limits"] > 0.5
    assert result.report["uncut_mm2"]["limits"] > 0.5
    assert "beyond the machine's tool axes" in " ".join(result.summary.split())
    axes = np.vstack([path.axes for path in result.paths])
    assert np.abs(axes[:, 2]).max() < 1e-9, "the tool is level in the part's frame"
