"""A stock that a caller gives as an object, in the words of a job: where its kind has sizes the job has them; a body of
flat faces goes along, and is kept as a file where the run is kept.

A blank of revolution, turned before, and what a machinist is told of it.

The setup: the stock a job asks for, how the part lies in it, the post below it, the depths of the cuts.

The stock stands upright on the Z axis. The part is turned (first about X, then Y, then Z, about the middle of
its box) and shifted in it as the job says; without that it lies in the middle of the stock's height.

Where a part lies best in a stock of given size: so that the largest distance from the stock to the part,
and with it K_min, is least.

Shifts across the axis are searched (Nelder & Mead 1965, fixed start and steps: the same answer every time).
Turns and shifts along the axis would lower K_min further, but measured they leave more to be cut at the ends,
where control points are few.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from bonecam.errors import BonecamError, JobError, StockError, ToolPathError
from bonecam.job import Job, StockJob
from bonecam.job.holding_section import MILLED
from bonecam.mesh.part import Part
from bonecam.mesh.pose import rotation, settled_pose
from bonecam.mesh.triangle_mesh import MeshLike, mesh_from
from bonecam.setup.capsule import Capsule
from bonecam.setup.rounding import MARGIN, require_inside, require_roundable
from bonecam.setup.stock import (
    SIZES,
    LyingPart,
    Schedule,
    Stock,
    check_sizes,
    is_posed,
    kind_of,
    pose_remedy,
    schedule_of,
    stock_round,
)
from bonecam.setup.stocks.box import Box
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.setup.stocks.mesh import ConvexStock
from bonecam.workholding.post import MISSES, Post, checked_post, next_bar

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


CHORD = 0.1
"""Chord tolerance, mm, of the stock's mesh on which the largest distance is measured."""
TRIALS = 120
"""Most shifts that are tried."""
FIRST_STEP = 0.2
"""Size of the first simplex, mm."""
PENALTY = 10.0
"""Weight of a mm that the material over the part is too thin, against a mm of distance."""
SPARE = 0.1
"""Material asked for beyond the margin, mm."""


def centring_shift(points: Float[ndarray, "n 3"], stock: Stock, margin: float) -> Float[ndarray, "4 4"]:
    """The translation (4, 4) of the part's points across the Z axis after which the farthest point of the stock
    is nearest to them.

    At least `margin` mm of material stay over the part (as much as there is where that is less).
    """
    surface = stock.mesh(CHORD).vertices
    tree = cKDTree(points)
    room = min(margin + SPARE, -float(stock.signed_distance(points).max()))

    def cost(x: ndarray) -> float:
        shift = np.append(x, 0.0)
        lack = max(0.0, room + float(stock.signed_distance(points + shift).max()))
        return float(np.max(tree.query(surface - shift)[0])) + PENALTY * lack

    start = FIRST_STEP * np.vstack([np.zeros(2), np.eye(2)])
    solution = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"maxfev": TRIALS, "initial_simplex": start})
    transform = np.eye(4)
    if solution.fun < cost(np.zeros(2)):
        transform[:2, 3] = solution.x
    return transform


TALL = 300.0
"""Length of the post (mm) while it is not known: no tool comes down to the table from there."""


@dataclass(frozen=True, eq=False)
class Setup:
    """The part in its stock on its post, and the depth of each cut; mm, the table is z = 0."""

    part: Part
    stock: Stock
    post: Post
    schedule: Schedule

    def lift(self, by: float) -> "Setup":
        """The setup that stands higher by so many mm, on a longer post."""
        pose = np.eye(4)
        pose[2, 3] = by
        post = self.post.lift(by)
        return Setup(self.part.move(pose), self.stock.move(pose[:3, 3]), post, self.schedule)


def place(part: Part, job: Job, body: ConvexStock | None = None) -> Setup:
    """The stock round the part, both moved up onto the post; one whose length is to be found is TALL. A `body` is the
    stock of a job without its file.

    JobError, StockError and ToolPathError name sizes, places and offsets that do not go together.
    """
    try:
        return _place(part, job, body)
    except ToolPathError as error:
        remedy = _offsets_in_vain(part, job, body)
        if remedy is None:
            raise
        misses = MISSES.format(error.evidence["diameter"])
        raise ToolPathError(f"{misses}: {remedy}", offset=(0.0, 0.0)) from error


def _offsets_in_vain(part: Part, job: Job, body: ConvexStock | None) -> str | None:
    """The remedy for a post that misses the part, where it would meet it without the job's offsets."""
    given = {name: getattr(job.stock, name) for name in ("offset_x", "offset_y")}
    given = {name: offset for name, offset in given.items() if offset}
    if not given:
        return None
    try:
        _place(part, job.with_values(stock=dict.fromkeys(given, 0.0)), body)
    except BonecamError:
        return None
    return "leave out " + " and ".join(f"stock.{name} = {offset:g}" for name, offset in given.items())


def _place(part: Part, job: Job, body: ConvexStock | None) -> Setup:
    """Stock, part and post as `place` returns them."""
    check_sizes(job.stock)
    schedule = schedule_of(job.levels)
    height = job.holding.length or TALL

    def stock_of(stock: StockJob) -> tuple[Stock, Float[ndarray, "4 4"]]:
        spare = job.surface.tolerance_for()
        return stock_for(part.mesh.vertices, stock, schedule, bottom=height, spare=spare, body=body)

    stock, pose = stock_of(job.stock)
    if job.holding.neck == MILLED and isinstance(stock, Capsule) and not job.stock.diameter:
        # the bar itself, between the caps; one that is too thin is refused with its own name later
        bar = max(job.holding.stub_diameter or next_bar(stock.diameter), stock.diameter)
        stock, pose = stock_of(replace(job.stock, diameter=bar))
    if job.mesh.upright and may_centre(job.stock):
        pose = centring_shift(part.mesh.move(pose).vertices, stock, MARGIN) @ pose

    middle = part.mesh.bounds.mean(axis=0)
    off_axis = pose[:2, :3] @ middle + pose[:2, 3] - middle[:2]
    lift = np.array([0.0, 0.0, height - stock.bounds[0, 2]])
    pose[:3, 3] += lift
    pose = settled_pose(pose)
    placed = part.move(pose)
    standing = stock.move(lift)
    width = float(np.ptp(standing.bounds[:, :2], axis=0).min())
    post = checked_post(placed.mesh, width, job.holding, (float(off_axis[0]), float(off_axis[1])))
    return Setup(placed, standing, post, schedule)


def may_centre(job: StockJob) -> bool:
    """Whether all sizes of a stock whose kind centres the part are given, and how the part lies in it is not."""
    kind = kind_of(job)
    return kind.centres and all(getattr(job, size) > 0 for size in kind.sizes) and not is_posed(job)


def stock_for(
    points: Float[ndarray, "n 3"],
    job: StockJob,
    schedule: Schedule,
    bottom: float | None = None,
    spare: float = 0.0,
    body: ConvexStock | None = None,
) -> tuple[Stock, Float[ndarray, "4 4"]]:
    """The stock on the Z axis, and the transform (4, 4) that puts the part's points (n, 3) into it; mm.

    A box of which neither width nor depth is given stands on the part's smallest base: the part is turned and,
    without offsets, laid in its middle. A capsule or cylinder without sizes takes the fewest cuts by the
    schedule, of those that are at most `job.spare_volume` larger than the smallest. A `body` given is the stock.

    Raises StockError with `distance` and `place` where the part leaves a given stock, comes within MARGIN mm
    of its wall or too near to an edge that has to be rounded; with `bottom` (mm) it tells places as they are
    when the stock stands at that height, and asks for `spare` mm more than the points need (`require_inside`).
    """
    # The transform (4, 4) of the part's points that the job, or else the kind of stock, asks for; mm.
    middle = (points.min(0) + points.max(0)) / 2
    offset = np.array([job.offset_x, job.offset_y, job.offset_z])
    turn = rotation(job.tilt_x_deg, job.tilt_y_deg, job.turn_deg)
    placement = kind_of(job).turn(job, (points - middle) @ turn.T)
    if placement is not None:
        angle, base = placement
        turn = rotation(0.0, 0.0, angle) @ turn
        if not offset[:2].any():
            offset[:2] = -middle[:2] - base
    transform = np.eye(4)
    transform[:3, :3] = turn
    transform[:3, 3] = middle - turn @ middle + offset
    lying = points @ transform[:3, :3].T + transform[:3, 3]
    middle = float((lying[:, 2].min() + lying[:, 2].max()) / 2 - job.offset_z)
    stock: Stock
    if body is not None:
        stock = body.on_axis(middle)
    else:
        stock = stock_round(job, LyingPart(lying, middle), schedule)

    lift = np.array([0.0, 0.0, 0.0 if bottom is None else bottom - stock.bounds[0, 2]])
    require_inside(stock.move(lift), lying + lift, MARGIN, pose_remedy(job), spare)
    require_roundable(stock.move(lift), lying + lift, MARGIN, pose_remedy(job))
    return stock, transform
