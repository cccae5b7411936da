"""The stock a job asks for, given or found round the part, and how the part lies in it.

The stock stands upright on the Z axis. The part is turned (first about X, then Y, then Z, about the middle of
its box) and shifted in it as the job says; without that it lies in the middle of the stock's height.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import ConvexHull, cKDTree

from bonecam.errors import StockError
from bonecam.job import Job, StockJob, field_error
from bonecam.mesh.files.mesh_files import read_mesh
from bonecam.mesh.part import Part
from bonecam.mesh.triangle_mesh import probes
from bonecam.setup.box import Box
from bonecam.setup.centring import centred, is_free
from bonecam.setup.convex import ConvexStock
from bonecam.setup.cylinder import Cylinder
from bonecam.setup.holding import Post, checked_post
from bonecam.setup.rounded import require_roundable
from bonecam.setup.schedule import Schedule, schedule_of
from bonecam.setup.stock import (
    MARGIN,
    Capsule,
    Stock,
    capsule_of_diameter,
    capsule_of_size,
    capsules_round,
    require_inside,
)

SIZES = {
    "capsule": "diameter length",
    "cylinder": "diameter length",
    "box": "width depth length",
    "mesh": "mesh scale",
}
"""What gives the size of each kind of stock."""
HALVINGS, LARGEST_SCALE = 50, 1e4
LYING = ("offset_x", "offset_y", "offset_z", "tilt_x_deg", "tilt_y_deg", "turn_deg")
CHORD, TRIED = 0.001, 16
"""Chord tolerance, in radii, of the capsules that are measured for cuts, and at most so many of them."""


@dataclass(frozen=True, eq=False)
class Setup:
    """The part in its stock on its post, and the depth of each cut; mm, the table is z = 0."""

    part: Part
    stock: Stock
    post: Post
    schedule: Schedule


def place(part: Part, job: Job) -> Setup:
    """The stock round the part, both moved up onto the post.

    JobError, StockError and ToolPathError name sizes, places and offsets that do not go together.
    """
    check_sizes(job.stock)
    schedule = schedule_of(job.levels)
    stock, pose = stock_for(part.mesh.vertices, job.stock, schedule, bottom=job.holding.length)
    if job.mesh.upright and is_free(job.stock):
        pose = centred(part.mesh.moved(pose).vertices, stock, MARGIN) @ pose

    middle = part.mesh.bounds.mean(axis=0)
    off = pose[:2, :3] @ middle + pose[:2, 3] - middle[:2]
    lift = np.array([0.0, 0.0, job.holding.length - stock.bounds[0, 2]])
    pose[:3, 3] += lift
    placed = part.moved(pose)
    standing = stock.moved(lift)
    post = checked_post(placed.mesh, standing, job.holding, (float(off[0]), float(off[1])))
    return Setup(placed, standing, post, schedule)


def check_sizes(stock: StockJob) -> None:
    """JobError where a size is given that this kind of stock does not have: it would be ignored."""
    own = SIZES[stock.kind].split()
    for name in dict.fromkeys(" ".join(SIZES.values()).split()):
        value, default = getattr(stock, name), getattr(StockJob, name)
        if name not in own and value != default:
            kinds = " or ".join(kind for kind, sizes in SIZES.items() if name in sizes.split())
            raise field_error(
                "stock", name, value, f"a {stock.kind} has none: give {' and '.join(own)}, or kind = {kinds}"
            )


def stock_for(
    points: Float[ndarray, "n 3"], job: StockJob, schedule: Schedule, bottom: float | None = None
) -> tuple[Stock, Float[ndarray, "4 4"]]:
    """The stock on the Z axis, and the transform (4, 4) that puts the part's points (n, 3) into it; mm.

    In a box of which neither width nor depth is given the part is turned to the smallest base, and without
    offsets it lies in its middle. Without sizes a capsule (or the bar round it) is the one that takes the
    fewest cuts by the schedule, of those that are at most `job.spare_volume` larger than the smallest.

    Raises StockError with `distance` and `place` where the part leaves a given stock, comes within MARGIN mm
    of its wall or too near to an edge that has to be rounded; with `bottom` (mm) it tells places as they are
    when the stock stands at that height.
    """
    middle, offset = (points.min(0) + points.max(0)) / 2, np.array([job.offset_x, job.offset_y, job.offset_z])
    rotation = _rotation(job.tilt_x_deg, job.tilt_y_deg, job.turn_deg)
    if job.kind == "box" and not (job.width or job.depth or job.turn_deg):
        turn, base = _smallest_base(((points - middle) @ rotation.T)[:, :2], job.allowance)
        rotation = _rotation(0.0, 0.0, turn) @ rotation
        if not offset[:2].any():
            offset[:2] = -middle[:2] - base
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, middle - rotation @ middle + offset
    lying = points @ rotation.T + transform[:3, 3]
    stock = STOCKS[job.kind](
        lying, job, schedule, float((lying[:, 2].min() + lying[:, 2].max()) / 2 - job.offset_z)
    )
    lift = np.array([0.0, 0.0, 0.0 if bottom is None else bottom - stock.bounds[0, 2]])
    require_inside(stock.moved(lift), lying + lift, MARGIN, _otherwise(job))
    require_roundable(stock.moved(lift), lying + lift, MARGIN, _otherwise(job))
    return stock, transform


def _otherwise(job: StockJob) -> str:
    """The rest of the remedy where the job says how the part lies in its stock."""
    given = [f"stock.{name}" for name in LYING if getattr(job, name)]
    larger = (
        ", or a larger stock.scale (0 finds the smallest copy that holds it)"
        if job.kind == "mesh" and job.scale
        else ""
    )
    return larger + (f", or less of {', '.join(given)}" if given else "")


def _rotation(x_deg: float, y_deg: float, z_deg: float) -> Float[ndarray, "3 3"]:
    found = np.eye(3)
    for axis, angle in enumerate(np.radians([x_deg, y_deg, z_deg])):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[u, u], turn[u, v], turn[v, u], turn[v, v] = (
            np.cos(angle),
            -np.sin(angle),
            np.sin(angle),
            np.cos(angle),
        )
        found = turn @ found
    return found


def _smallest_base(points: Float[ndarray, "n 2"], allowance: float) -> tuple[float, Float[ndarray, "2"]]:
    """The turn (degrees) after which the rectangle so far round points has the least area, and its middle
    then.

    A side of it lies along one of the hull's edges (Freeman & Shapira 1975).
    """
    hull = points[ConvexHull(points).vertices]
    edges = np.roll(hull, -1, axis=0) - hull
    turns = np.mod(-np.degrees(np.arctan2(edges[:, 1], edges[:, 0])), 90.0)
    bases = [hull @ _rotation(0.0, 0.0, float(turn))[:2, :2].T for turn in turns]
    least = int(np.argmin([np.prod(np.ptp(base, axis=0) + 2 * allowance) for base in bases]))
    return float(turns[least]), (bases[least].min(0) + bases[least].max(0)) / 2


def easiest_capsule(points: Float[ndarray, "n 3"], job: StockJob, schedule: Schedule) -> Capsule:
    """Of the capsules at most `job.spare_volume` larger than the smallest the one with the fewest cuts, and
    of these that whose farthest place is nearest to the part.

    A level gains a little less than its depth: only what leaves half a roughing depth to spare counts as that
    many cuts.
    """
    capsules, tree = capsules_round(points, job.allowance), cKDTree(points)
    smallest = min(capsules, key=lambda capsule: capsule.volume)
    near = [capsule for capsule in capsules if capsule.volume <= (1 + job.spare_volume) * smallest.volume]

    def cuts(capsule: Capsule) -> tuple[int, float]:
        farthest = float(np.max(tree.query(probes(capsule.mesh(CHORD * capsule.radius)))[0]))
        return schedule.lower_bound(farthest + schedule.beyond / 2), farthest

    return min((smallest, *near[:: 1 + len(near) // TRIED]), key=cuts)


def _capsule(points: ndarray, job: StockJob, schedule: Schedule, middle: float) -> Stock:
    if not (job.diameter or job.length):
        return easiest_capsule(points, job, schedule)
    if job.diameter and not job.length:
        return capsule_of_diameter(job.diameter, points, job.allowance, _otherwise(job))
    return capsule_of_size(job.diameter, job.length, middle)


def _cylinder(points: ndarray, job: StockJob, schedule: Schedule, middle: float) -> Stock:
    """Without sizes the bar round the capsule, because that is what it is rounded to."""
    if not (job.diameter or job.length):
        capsule = easiest_capsule(points, job, schedule)
        return Cylinder(capsule.radius, float(capsule.bounds[0, 2]), float(capsule.bounds[1, 2]))
    radius = job.diameter / 2 or float(np.hypot(points[:, 0], points[:, 1]).max()) + job.allowance
    half = job.length / 2 or _half(points[:, 2] - middle, job)
    return Cylinder(radius, middle - half, middle + half)


def _box(points: ndarray, job: StockJob, schedule: Schedule, middle: float) -> Stock:
    sizes = zip((job.width, job.depth, job.length), (points - [0.0, 0.0, middle]).T)
    half = np.array([size / 2 or _half(extent, job) for size, extent in sizes])
    return Box(np.array([0.0, 0.0, middle]) - half, np.array([0.0, 0.0, middle]) + half)


def _half(extent: ndarray, job: StockJob) -> float:
    return float(np.abs(extent).max()) + job.allowance


def _mesh(points: ndarray, job: StockJob, schedule: Schedule, middle: float) -> Stock:
    """The file's body with the middle of its box on the axis; scale 0: the smallest copy that leaves the
    allowance."""
    if not job.mesh:
        raise StockError(
            "a stock of kind 'mesh' needs a file: give stock.mesh = \"block.stl\" (mm, Z upright)"
        )
    try:
        given = ConvexStock(read_mesh(job.mesh), file=job.mesh)
    except StockError as error:
        raise StockError(f"{job.mesh}: {error}", file=job.mesh, **error.evidence) from error
    stock = given.moved(np.array([0.0, 0.0, middle]) - given.middle)
    if job.scale:
        return stock.scaled(job.scale)

    def holds(scale: float) -> bool:
        return bool(stock.scaled(scale).signed_distance(points).max() <= -job.allowance)

    low, high = 0.0, 1.0
    while not holds(high):
        low, high = high, 2 * high
        if high > LARGEST_SCALE:
            raise StockError(
                f"{job.mesh}: no copy of this body on the Z axis holds the part: move the part with stock.offset_x, offset_y"
            )
    for _ in range(HALVINGS):
        between = (low + high) / 2
        low, high = (low, between) if holds(between) else (between, high)
    return stock.scaled(high)


STOCKS = {"capsule": _capsule, "cylinder": _cylinder, "box": _box, "mesh": _mesh}
