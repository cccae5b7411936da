"""The stock a part is cut from: any closed convex body that answers the questions of `Stock`.

The kinds are the files of `bonecam.setup.stocks`.

Which depth each cut may have: finishing depths next to the part, the roughing depth beyond (Gan et al.
2014, section 4.2).

Cut k removes what lies between level k - 1 and level k. No sequence of cuts can beat
`K_min = min{K : sum_{k <= K} eps_k >= d}`, d being the largest distance from the stock's surface to the part.

How a job gives a stock: what each kind of stock, a file of `bonecam.setup.stocks`, tells of itself.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from numbers import Real
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import ROUNDING, frozen
from bonecam.errors import JobError, LevelError, StockError, did_you_mean, hundredths, place_name
from bonecam.job import LevelsJob, StockJob, field_error
from bonecam.job.levels_section import MOST_LEVELS
from bonecam.job.stock_section import PUBLISHED_KINDS
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.plugins import added, run_added

AXES_ACROSS = {"diameter": [0, 1], "width": [0], "depth": [1], "length": [2]}
"""The coordinates along which each size of a stock extends."""
UPRIGHT = 1e-9
"""A wall is parallel to a coordinate axis where its unit normal has less than this along it."""
LARGEST = 1e6
"""Largest length or coordinate of a stock, mm: a kilometre. What is larger is a mistaken unit."""


@runtime_checkable
class Stock(Protocol):
    """A closed convex body in the part's frame, mm."""

    def __str__(self) -> str:
        """Kind and sizes."""
        return stock_text(stock_figures(self))

    @property
    def kind(self) -> str:
        """The word for it in reports."""

    @property
    def diameter(self) -> float:
        """Largest extent across the Z axis, mm: the longer side of the bounding box, if nothing else is said."""
        return float((self.bounds[1] - self.bounds[0])[:2].max())

    @property
    def length(self) -> float:
        """Extent along the axis, mm."""
        return float(self.bounds[1, 2] - self.bounds[0, 2])

    @property
    def sizes(self) -> dict[str, float]:
        """The sizes it is ordered by, under their names in [stock], mm."""
        return {"diameter": self.diameter, "length": self.length}

    @property
    def file(self) -> str:
        """The file it was read from, or ""."""
        return ""

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the body, mm: that of the bounding box, if nothing else is said."""
        return self.bounds.mean(0)

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner of the bounding box, mm."""

    @property
    def inradius(self) -> float:
        """Radius of the largest ball inside the body, mm."""
        return float(-self.signed_distance(self.middle[None])[0])

    @property
    def has_edges(self) -> bool:
        """Whether the surface has sharp edges, which no morph can follow."""
        return True

    @property
    def has_flats(self) -> bool:
        """Whether the surface has flat faces."""
        return True

    def move(self, shift: Float[ndarray, "3"]) -> "Stock":
        """The body translated by `shift`, mm."""

    def offset(self, distance: float) -> "Stock":
        """The body with its flat and round walls moved outwards by `distance` mm (negative: inwards); edges
        stay edges.

        StockError where nothing is left.
        """

    def round_edges(self, radius: float) -> "Stock":
        """The union of all balls of `radius` mm inside the body: its edges rounded."""

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance of each point to the surface, mm, negative inside."""
        return self.distances_and_normals(points)[0]

    def normals(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals of the surface at the points nearest to `points`."""
        return self.distances_and_normals(points)[1]

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh, its vertices on the surface, its faces within `chord_tolerance` mm of it."""

    def distances_and_normals(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Signed distances (mm) and outward normals in one pass; a body has this, or either alone."""
        return self.signed_distance(points), self.normals(points)

    def closest_points(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """The surface point nearest to each point."""
        distance, normal = self.distances_and_normals(points)
        return points - distance[:, None] * normal

    def larger(self, points: Float[ndarray, "n 3"], lack: float) -> str:
        """The remedy of a refusal: what to order instead where `points` need up to `lack` mm more material."""
        return f"give a stock at least {hundredths(lack)} mm larger there to each side"


def larger_sizes(stock: Stock, points: Float[ndarray, "n 3"], lack: float) -> str:
    """The remedy of a stock whose sizes a job gives: those across the walls nearest to `points`, 2 `lack` mm
    larger."""
    needed = (np.abs(stock.normals(points)) > UPRIGHT).any(axis=0)
    sizes = [
        f"stock.{name} at least {hundredths(size + 2 * lack)}"
        for name, size in stock.sizes.items()
        if needed[AXES_ACROSS[name]].any()
    ]
    return f"give {' and '.join(sizes)}"


def finite_numbers(what: str, values: Any, count: int) -> Float[ndarray, " n"]:
    """A read-only copy of `count` finite numbers, LARGEST at most; StockError names `what` they are where they
    are not."""
    try:
        numbers = np.asarray(values)
    except ValueError:
        numbers = np.array([])
    numeric = numbers.dtype.kind in "fiu" and numbers.shape == (count,)
    if not numeric or not (np.abs(numbers.astype(float)) <= LARGEST).all():
        message = "a finite number" if count == 1 else f"{count} finite numbers"
        raise StockError(f"{what} is {values}: give {message} (mm, {LARGEST:g} at most)")
    return frozen(numbers)


def box_sizes(bounds: Float[ndarray, "2 3"]) -> dict[str, float]:
    """Width, depth and length (along X, Y and Z, mm) of a bounding box."""
    return dict(zip(("width", "depth", "length"), (bounds[1] - bounds[0]).tolist(), strict=True))


def stock_figures(stock: Stock) -> dict[str, Any]:
    """`stock` of the report and of the filters: its kind, its own sizes, and its file where it has one."""
    sizes = {f"{name}_mm": float(size) for name, size in stock.sizes.items()}
    return {"kind": stock.kind, **sizes, **({"file": stock.file} if stock.file else {})}


def stock_text(figures: Mapping[str, Any]) -> str:
    """A stock in a few words, from its figures; sizes in the order of X, Y and Z."""
    sizes = " x ".join(f"{value:.2f}" for name, value in figures.items() if name.endswith("_mm"))
    return f"{figures['kind']} {sizes} mm{' of ' + figures['file'] if 'file' in figures else ''}"


LEAST = 1e-4
"""Least depth of a cut, mm."""
STOCK_CHORD = 0.1
"""Chord tolerance of the stock's mesh that the number of cuts is counted on, mm."""
STOCK_CHORD_SHARE = 0.002
"""That chord tolerance as a share of the stock's diameter, where that is more."""

FARTHEST_DIAGONALS = 3.0
"""A stock further from the part than so many of its diagonals is refused. Levels are meshed as finely as the
part: those of a ball of 3 mm in a cube of 60 mm, ten diagonals away, were not made in 40 s of computing."""


@dataclass(frozen=True)
class Schedule:
    """Depths in mm of the first cuts above the part, and of all others."""

    first: tuple[float, ...]
    beyond: float

    def __post_init__(self) -> None:
        if not (isinstance(self.first, tuple) and all(isinstance(depth, Real) for depth in (*self.first, self.beyond))):
            raise TypeError(
                f"Schedule({self.first!r}, {self.beyond!r}): give depths in mm like Schedule((0.1, 0.1), 0.5)"
            )
        object.__setattr__(
            self, "first", tuple(map(float, self.first))
        )  # sums of numpy's small integers would overflow
        object.__setattr__(self, "beyond", float(self.beyond))
        for k, depth in enumerate((*self.first, self.beyond), start=1):
            if not LEAST <= depth < math.inf:
                raise LevelError(
                    f"cut {k} has the depth {depth} mm: give a finite depth of at least {LEAST} mm", level=k
                )

    def limit(self, k: int) -> float:
        """Largest depth of cut k >= 1, mm."""
        return self.first[k - 1] if k <= len(self.first) else self.beyond

    def reach(self, k: int) -> float:
        """The sum of the depths of cuts 1..k, mm."""
        return sum(self.first[:k]) + max(0, k - len(self.first)) * self.beyond

    def lower_bound(self, distance: float) -> int:
        """K_min: the fewest cuts that can remove `distance` mm. LevelError where they are more than
        MOST_LEVELS."""
        if math.isnan(distance):
            raise LevelError("a distance of nan mm has no number of cuts: give a number")
        for k in range(1, MOST_LEVELS + 1):
            if self.reach(k) >= distance - ROUNDING:
                return k
        raise LevelError(
            f"{distance:.1f} mm of material need more than {MOST_LEVELS} cuts, which take "
            f"{self.reach(MOST_LEVELS):.1f} mm: "
            "give deeper cuts or a smaller stock",
            level=MOST_LEVELS,
            distance=distance,
        )


def schedule_of(job: LevelsJob) -> Schedule:
    """The schedule of a job: its list of depths, its numbers of finishing and roughing depths, or the
    roughing depth throughout."""
    return Schedule(*job.cuts)


def even_out(schedule: Schedule, distance: float, cuts: int, rest: float) -> Schedule:
    """The schedule with shallower roughing cuts, so that the last of `cuts` takes as much as the others.

    `distance` (mm) is the largest from the stock to the part, `rest` what the last cut had to take at most. A
    level gains a share of its depth, the same for all: (distance - first - rest) / ((cuts - 1) * beyond) over
    the roughing cuts but the last.
    """
    before = cuts - 1 - len(schedule.first)
    if before < 1:
        return schedule
    gained = (distance - sum(schedule.first) - rest) / before
    share = gained / schedule.beyond
    return Schedule(schedule.first, min(schedule.beyond, (distance - sum(schedule.first)) / (before * share + 1)))


def check_cuts(part: TriangleMesh, stock: Stock, job: LevelsJob) -> None:
    """JobError where the stock is so far from the part that more than `most_cuts` cuts are needed, StockError
    where it is more than FARTHEST_DIAGONALS away."""
    mesh = stock.mesh(max(STOCK_CHORD, STOCK_CHORD_SHARE * stock.diameter))
    distances = MeshDistance(part).unsigned(mesh.vertices)
    place = mesh.vertices[np.argmax(distances)]
    farthest = float(distances.max())
    cuts = schedule_of(job).lower_bound(farthest)
    if cuts > job.most_cuts:
        what = f"the stock at {place_name(place)} is {farthest:.1f} mm from the part, which takes {cuts} cuts or more"
        deeper = "greater depths" if job.listed else "a greater roughing_depth"
        raise field_error(
            "levels", "most_cuts", job.most_cuts, f"{what}: give a smaller stock or {deeper}, or allow more"
        )
    if farthest > FARTHEST_DIAGONALS * part.diagonal:
        raise StockError(
            f"the stock at {place_name(place)} is {farthest:.1f} mm from the part, more than "
            f"{FARTHEST_DIAGONALS:g} times "
            f"the part's diagonal of {part.diagonal:.1f} mm: give a smaller stock, or a smaller offset of "
            "the part in it",
            distance=farthest,
            place=place,
        )


POSE_FIELDS = ("offset_x", "offset_y", "offset_z", "tilt_x_deg", "tilt_y_deg", "turn_deg")
"""The fields of [stock] that say how the part lies in it."""

SIZES = ("diameter", "length", "width", "depth", "mesh", "scale")
"""The fields of [stock] that are sizes: a kind has some of them."""


@dataclass(frozen=True, eq=False)
class LyingPart:
    """The part as it lies in its stock: points (n, 3), mm, with the stock's axis along Z.

    `middle` is the height of the middle of a stock of given length.
    """

    points: Float[ndarray, "n 3"]
    middle: float


@dataclass(frozen=True)
class StockKind:
    """A kind of stock.

    `sizes` are the fields of [stock] that give its size. `make` gives the stock round a part. `shape` is what must
    be mounted, in words for the program's header. `turn` gives an angle about Z (degrees) and the middle (x, y) of
    the part's base then, where the kind finds them itself. `centres` tells whether a part is shifted across the
    axis to the best place in a stock of given sizes.
    """

    sizes: tuple[str, ...]
    make: Callable[[StockJob, LyingPart, Schedule], Stock]
    shape: str
    turn: Callable[[StockJob, Float[ndarray, "n 3"]], tuple[float, Float[ndarray, "2"]] | None] = lambda job, points: (
        None
    )
    centres: bool = False


def stock_round(job: StockJob, part: "LyingPart", schedule: Schedule) -> Stock:
    """The stock of a job round a part. JobError where a kind that was added makes none."""
    make = kind_of(job).make
    if job.kind in PUBLISHED_KINDS:
        return make(job, part, schedule)
    with run_added("stocks", job.kind):
        stock = make(job, part, schedule)
    if not isinstance(stock, Stock):
        what = f"the stock {job.kind!r} that was added makes {stock!r}"
        raise JobError(f"{what}: let `make` return a stock, such as a ConvexStock", name=job.kind)
    return stock


def kind_of(job: StockJob) -> StockKind:
    """What the kind of stock of a job tells of itself."""
    return _kind(job.kind)


def _kind(name: str) -> StockKind:
    if find_spec(f"bonecam.setup.stocks.{name}"):
        return cast(StockKind, import_module(f"bonecam.setup.stocks.{name}").KIND)
    kind = added("stocks", name)
    if not isinstance(kind, StockKind):
        raise JobError(f"the stock {name!r} that was added is {kind!r}: give a StockKind as KIND", name=name)
    return kind


def check_sizes(job: StockJob) -> None:
    """JobError where a size is given that this kind of stock does not have, which would be ignored, or where the kind
    has one that is no field of [stock]. Kinds that a user added and the job does not name are not loaded."""
    sizes_of = {name: _kind(name).sizes for name in (*PUBLISHED_KINDS, job.kind)}
    own = sizes_of[job.kind]
    for size in own:
        if size not in StockJob.__dataclass_fields__:
            what = f"the stock {job.kind!r} has the size {size!r}, which is no field of [stock]"
            raise JobError(f"{what}{did_you_mean(size, SIZES)}: use {', '.join(SIZES)}", name=job.kind)
    for size in SIZES:
        value = getattr(job, size)
        if size not in own and value != getattr(StockJob, size):
            kinds = " or ".join(kind for kind, sizes in sizes_of.items() if size in sizes)
            why = f"a {job.kind} has none: give {' and '.join(own)}, or kind = {kinds}"
            raise field_error("stock", size, value, why)


def is_posed(job: StockJob) -> bool:
    """Whether a job says how the part lies in its stock."""
    return any(getattr(job, name) for name in POSE_FIELDS)


def pose_remedy(job: StockJob) -> str:
    """The end of a refusal's remedy where the job says how the part lies in its stock; else nothing."""
    given = [f"stock.{name}" for name in POSE_FIELDS if getattr(job, name)]
    return f", or less of {', '.join(given)}" if given else ""


def half_size(size: float, extent: Float[ndarray, " n"], allowance: float) -> float:
    """Half a given size, or where that is 0 the largest of the part's coordinates and the allowance, mm."""
    return size / 2 or float(np.abs(extent).max()) + allowance
