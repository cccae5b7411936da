"""The layers that cut a stump off: none of them cuts deeper than its depth, in a hollow neither."""

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.layers import HeightField, depths_in
from bonecam.planning.stump import STEPS, off_part, stump_chart, stump_layers
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import Post

UP = np.array([0.0, 0.0, 1.0])
LENGTH, WIDTH, DEEP = 3.0, 6.0, 2.0
JOB = Job().with_values(roughing={"radius": 2.0}, finishing={"radius": 0.75, "scallop": 0.02})


def groove() -> TriangleMesh:
    """A block along X with its top at Z 10 and a groove of 90 degrees, DEEP, along its middle."""
    outline = np.array([[-WIDTH, 0], [WIDTH, 0], [WIDTH, 10], [DEEP, 10], [0, 10 - DEEP], [-DEEP, 10], [-WIDTH, 10]])
    n = len(outline)
    ends = [np.column_stack([np.full(n, x), outline]) for x in (-LENGTH, LENGTH)]
    ring = np.arange(n)
    following = np.roll(ring, -1)
    fan = np.array([[4, 5, 6], [4, 6, 0], [4, 0, 1], [4, 1, 2], [4, 2, 3]])
    sides = [np.column_stack([ring, following, following + n]), np.column_stack([ring, following + n, ring + n])]
    faces = np.vstack([*sides, fan[:, ::-1], fan + n]).astype(np.int32)
    mesh = TriangleMesh(np.vstack(ends), faces)
    return mesh if mesh.volume > 0 else TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


@pytest.mark.whole
def test_finishing_layers_in_a_groove_cut_no_deeper_than_their_depth() -> None:
    around = MeshDistance(groove())
    x, y = (side.ravel() for side in np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1.5, 1.5, 13)))
    places = np.column_stack([x, y, 10 - DEEP + np.abs(y)])
    chart = stump_chart(UP, places, JOB.roughing.radius)
    a, b = np.meshgrid(chart.a, chart.b, indexing="ij")
    base = chart.bases(a.ravel(), b.ravel()).reshape(*a.shape, 3)
    stump = np.hypot(base[..., 0], base[..., 1]) < 1.8
    material = off_part(
        HeightField(chart, np.where(stump, 10.5, 0.0), np.zeros(a.shape)), around, JOB.levels.finishing_depth
    )
    cutters = tuple(
        Cutter.from_job(number, name, JOB.tool(name)) for number, name in ((1, "roughing"), (2, "finishing"))
    )
    layers = stump_layers(material, around, Post(1.8, 0.0), places, cutters, JOB)
    depth = JOB.levels.finishing_depth
    sunk = [
        depths_in(layer.material, layer.path.centres, layer.path.cutter.radius).max()
        for layer in layers
        if layer.path.cutter.number == 2
    ]
    assert len(sunk) > 4, "a ball of 2 leaves 0.8 mm in the groove"
    assert max(sunk) < depth * (1 + 1 / STEPS) + 0.003, "the first too, on the cusps of roughing"
    assert np.median(sunk[:-1]) > 0.8 * depth
