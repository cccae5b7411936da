"""A stock that a caller gives as an object, in the words of a job: where its kind has sizes the job has them; a body of
flat faces goes along, and is kept as a file where the run is kept."""

from dataclasses import replace
from typing import Any

from bonecam.errors import JobError, StockError
from bonecam.job import Job, StockJob
from bonecam.mesh.triangle_mesh import MeshLike, mesh_from
from bonecam.setup.capsule import Capsule
from bonecam.setup.stock import Stock
from bonecam.setup.stock_kind import SIZES
from bonecam.setup.stocks.box import Box
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.setup.stocks.mesh import ConvexStock

KEPT_STOCK = "stock.ply"
"""The body of a stock in memory, as a kept folder has it beside its job.toml."""
GIVING = ("kind", *SIZES)
"""The fields of [stock] that a stock object stands for."""


def with_stock(job: Job, stock: "Stock | MeshLike | None") -> tuple[Job, ConvexStock | None]:
    """The job with the kind and sizes of a `stock` object (mm, Z upright, wherever it lies), and its body where only
    that tells them: the job then has a stock of kind "mesh" without a file. None leaves the job as it is.

    JobError where the job gives a stock too, StockError where the object is no upright body that a job can tell: give
    the mesh of another, or add its kind.
    """
    if stock is None:
        return job, None
    given = [name for name in GIVING if getattr(job.stock, name) != getattr(StockJob, name)]
    if given:
        names = " and ".join(f"stock.{name}" for name in given)
        raise JobError(f"the stock is an object, and the job gives {names}: give one of them", fields=given)
    if isinstance(stock, Capsule | Cylinder | Box):
        if isinstance(stock, Capsule) and (stock.start != stock.end)[:2].any():
            raise StockError(f"the {stock} lies askew: give a stock upright along Z, and turn the part in it")
        sizes: dict[str, Any] = {"kind": stock.kind, **stock.sizes}
        return job.with_values(stock=sizes), None
    body = _body(stock)
    return job.with_values(stock={"kind": body.kind}), body


def _body(stock: "Stock | MeshLike") -> ConvexStock:
    """The body with flat faces of an object: a ConvexStock, or a closed convex mesh."""
    if isinstance(stock, ConvexStock):
        return replace(stock, file="", proven=True)
    if isinstance(stock, Stock):
        what = f"a stock of the class {type(stock).__name__} has no name in a job, and no run could be repeated"
        remedy = 'give a Capsule, Cylinder, Box, ConvexStock or mesh, or add a kind ("Add a stock" in the docs)'
        raise StockError(f"{what}: {remedy}")
    try:
        return ConvexStock(mesh_from(stock))
    except (TypeError, ValueError) as error:
        raise StockError(f"the stock is no stock and no mesh: {error}") from error
