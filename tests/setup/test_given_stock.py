"""A stock in memory is told by a job, or is refused; a kept run of it is repeated from its folder."""

from dataclasses import replace

import numpy as np
import pytest

import bonecam
from bonecam.errors import JobError, StockError
from bonecam.job import Job, read_job
from bonecam.mesh import TriangleMesh, write_mesh
from bonecam.setup import Box, Capsule, ConvexStock, Cylinder, RoundedStock
from bonecam.setup.placement import with_stock

pytestmark = pytest.mark.whole

PRISM = Cylinder(6.0, 3.0, 30.0).mesh(5.0)
SIZES = {
    "capsule": (Capsule(np.array([1.0, 2, 9]), np.array([1.0, 2, 29]), 5.0), {"diameter": 10.0, "length": 30.0}),
    "cylinder": (Cylinder(5.0, 3.0, 33.0, (4.0, 0.0)), {"diameter": 10.0, "length": 30.0}),
    "box": (Box(np.zeros(3), np.array([8.0, 9, 30])), {"width": 8.0, "depth": 9.0, "length": 30.0}),
}


@pytest.mark.parametrize("kind", SIZES)
def test_a_stock_with_sizes_becomes_those_of_the_job(kind):
    stock, sizes = SIZES[kind]
    job, body = with_stock(Job(), stock)
    assert body is None
    assert job == Job().with_values(stock={"kind": kind, **sizes})


@pytest.mark.parametrize("given", [PRISM, ConvexStock(PRISM, file="gone.stl"), (PRISM.vertices, PRISM.faces)])
def test_a_body_of_flat_faces_goes_along_without_a_file(given):
    job, body = with_stock(Job(), given)  # type: ignore[arg-type]
    assert body is not None
    assert (job.stock.kind, job.stock.mesh, body.file) == ("mesh", "", "")
    assert np.array_equal(body.surface.vertices, PRISM.vertices)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (Capsule(np.array([0.0, 0, 9]), np.array([1.0, 0, 29]), 5.0), "lies askew"),
        (RoundedStock(Box(np.zeros(3), np.ones(3)), 0.1), "of the class RoundedStock has no name in a job"),
        ((PRISM.vertices, PRISM.faces + 9), "is no stock and no mesh: faces name vertices outside"),
        (TriangleMesh(PRISM.vertices, PRISM.faces[1:]), "not closed"),
    ],
)
def test_what_no_job_can_tell_is_refused(given, why):
    with pytest.raises(StockError, match=why):
        with_stock(Job(), given)  # type: ignore[arg-type]


def test_a_stock_given_twice_is_refused():
    job = Job().with_values(stock={"diameter": 12.0})
    with pytest.raises(JobError, match=r"the job gives stock.diameter: give one"):
        with_stock(job, PRISM)


def ellipsoid() -> TriangleMesh:
    """A body of 8 x 8 x 16 mm."""
    ball = Capsule(np.zeros(3), np.array([0.0, 0, 1e-6]), 4.0).mesh(0.01)
    return replace(ball, vertices=ball.vertices * [1.0, 1.0, 2.0])


@pytest.mark.parametrize("stock", [SIZES["cylinder"][0], PRISM], ids=["sizes", "body"])
def test_a_kept_run_is_repeated_from_its_folder(stock, tmp_path):
    job = Job().with_values(
        surface={"tolerance": 0.2},
        holding={"diameter": 4.0, "length": 20.0},
        mechanics={"refuse": False},
        levels={"roughing_depth": 1.5, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
    )
    write_mesh(ellipsoid(), tmp_path / "part.ply")
    first = bonecam.morph_levels(tmp_path / "part.ply", job, stock=stock, keep=tmp_path / "kept")
    (tmp_path / "kept").rename(tmp_path / "moved")
    again = bonecam.morph_levels(tmp_path / "part.ply", read_job(tmp_path / "moved" / "job.toml"))
    assert (tmp_path / "moved" / "stock.ply").exists() == (stock is PRISM)
    assert again.stock.kind == first.stock.kind
    assert np.array_equal(again.stock.bounds, first.stock.bounds)
    for one, other in zip(first.levels.levels, again.levels.levels, strict=True):
        assert np.array_equal(one.mesh.vertices, other.mesh.vertices)
