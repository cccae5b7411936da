"""The stock a part is cut from: any closed convex body that answers four questions (signed distance, outward
normals, mesh, size).

A capsule (a cylinder with half-balls at its ends) is every point within `radius` of an axis segment, so that
its signed distance is exact everywhere: `|x - nearest axis point| - radius`. Other stocks are new small files
with the same interface.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import ROUNDING, frozen
from bonecam.errors import StockError, place_name
from bonecam.kernels import capsule
from bonecam.mesh.triangle_mesh import TriangleMesh

MARGIN = 0.05
RADII, RADIUS_SPAN = 241, 1.6
SIZED = ("capsule", "cylinder", "box")
"""The stocks whose sizes a job gives."""
ACROSS = {"diameter": [0, 1], "width": [0], "depth": [1], "length": [2]}
"""The coordinates along which a size reaches."""
UPRIGHT = 1e-9
"""A wall whose normal leans by less stands upright."""
LARGEST = 1e6
"""Lengths and coordinates beyond this, mm, are no stock's."""
TINY = 100
"""The mesh of a stock that is so many times smaller than the part may be in metres."""


@runtime_checkable
class Stock(Protocol):
    """A closed convex body in the part frame, mm."""

    def __str__(self) -> str:
        """Kind and sizes."""
        return stock_text(stock_figures(self))

    @property
    def kind(self) -> str:
        """The word for it in reports."""

    @property
    def diameter(self) -> float:
        """Largest extent across the axis, mm."""

    @property
    def length(self) -> float:
        """Extent along the axis, mm."""

    @property
    def sizes(self) -> dict[str, float]:
        """What it is ordered by, under the names of [stock], mm."""
        return {"diameter": self.diameter, "length": self.length}

    @property
    def file(self) -> str:
        """The file it was read from, if any."""
        return ""

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the body."""

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner, mm."""

    def moved(self, shift: Float[ndarray, "3"]) -> "Stock":
        """The same body elsewhere."""

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance to the surface, mm, negative inside."""

    def outward(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals of the surface at the nearest points."""

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh, its vertices on the surface, its faces within `chord_tolerance` of it."""

    def way_out(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Signed distances and outward normals."""
        return self.signed_distance(points), self.outward(points)

    def nearest(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """The surface point nearest to each point."""
        distance, out = self.way_out(points)
        return np.asarray(points - distance[:, None] * out)


def numbers(what: str, values: Any, count: int) -> Float[ndarray, " n"]:
    """A read-only copy. StockError that tells what they are where they are not so many finite numbers,
    LARGEST at most."""
    try:
        found = np.asarray(values)
    except ValueError:
        found = np.array([])
    if (
        found.dtype.kind not in "fiu"
        or found.shape != (count,)
        or not (np.abs(found.astype(float)) <= LARGEST).all()
    ):
        told = "a finite number" if count == 1 else f"{count} finite numbers"
        raise StockError(f"{what} is {values}: give {told} (mm, {LARGEST:g} at most)")
    return np.asarray(frozen(found))


@dataclass(frozen=True, eq=False)
class Capsule(Stock):
    """All points within `radius` of the segment from `start` to `end`, mm. Raises StockError where there are
    none."""

    start: Float[ndarray, "3"]
    end: Float[ndarray, "3"]
    radius: float
    kind: str = "capsule"

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", numbers("a capsule's start", self.start, 3))
        object.__setattr__(self, "end", numbers("a capsule's end", self.end, 3))
        object.__setattr__(self, "radius", float(numbers("a capsule's radius", [self.radius], 1)[0]))
        if self.radius <= 0:
            raise StockError(f"a capsule of radius {self.radius:g} mm: give a positive one")

    @property
    def diameter(self) -> float:
        """Diameter, mm."""
        return 2 * self.radius

    @property
    def length(self) -> float:
        """Length over both caps, mm."""
        return float(np.linalg.norm(self.end - self.start)) + 2 * self.radius

    @property
    def volume(self) -> float:
        """Volume, mm^3."""
        return float(np.pi * self.radius**2 * (self.length - 2 * self.radius / 3))

    @property
    def middle(self) -> Float[ndarray, "3"]:
        """The middle of the axis."""
        return np.asarray((self.start + self.end) / 2)

    @property
    def bounds(self) -> Float[ndarray, "2 3"]:
        """Lowest and highest corner, mm."""
        return np.array(
            [np.minimum(self.start, self.end) - self.radius, np.maximum(self.start, self.end) + self.radius]
        )

    def moved(self, shift: Float[ndarray, "3"]) -> "Capsule":
        """The same capsule elsewhere."""
        return Capsule(self.start + shift, self.end + shift, self.radius)

    def way_out(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Both from one pass."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        distance, out = np.empty(len(points)), np.empty((len(points), 3))
        capsule.way_out(
            points, self.start, self.end - self.start, float(self.radius), self._frame[0], distance, out
        )
        return distance, out

    def signed_distance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n"]:
        """Distance to the surface, mm, negative inside."""
        return self.way_out(points)[0]

    def outward(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit directions away from the axis segment; on the segment itself any one across it."""
        return self.way_out(points)[1]

    @cached_property
    def _frame(self) -> Float[ndarray, "3 3"]:
        """Two unit vectors across the axis and the axis itself, right-handed."""
        axis = self.end - self.start
        size = np.linalg.norm(axis)
        along = axis / size if size > 0 else np.array([0.0, 0.0, 1.0])
        across = np.cross(np.eye(3)[1 if abs(along[1]) < 0.9 else 0], along)
        across /= np.linalg.norm(across)
        return np.array([across, np.cross(along, across), along])

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh, its vertices on the surface, its faces within `chord_tolerance` of it and
        nearly even."""
        turn = np.arccos(max(1 - chord_tolerance / (2 * self.radius), 0.0))
        around = max(12, int(np.ceil(np.pi / turn)))
        quarter = max(4, int(np.ceil(np.pi / 4 / turn)))
        latitude = np.linspace(0, np.pi / 2, quarter + 1)
        straight = self.length - 2 * self.radius
        rises = np.linspace(0, straight, int(np.ceil(straight / (2 * np.pi * self.radius / around))) + 1)
        height = self.radius * np.concatenate([-np.cos(latitude[1:-1]), 0 * rises, np.cos(latitude[-2:0:-1])])
        reach = self.radius * np.concatenate(
            [np.sin(latitude[1:-1]), 0 * rises + 1, np.sin(latitude[-2:0:-1])]
        )
        lift = np.concatenate([np.zeros(quarter - 1), rises, np.full(quarter - 1, straight)])
        upright = revolved(reach, height + lift, (-self.radius, self.length - self.radius), around)
        return TriangleMesh(upright.vertices @ self._frame + self.start, upright.faces)


def revolved(
    reach: Float[ndarray, " r"], height: Float[ndarray, " r"], ends: tuple[float, float], around: int
) -> TriangleMesh:
    """The closed outward mesh of rings of `around` points about the Z axis, their heights rising, and of the
    axis' points at `ends`."""
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(around)])
    points = reach[:, None, None] * ring + height[:, None, None] * np.array([0.0, 0.0, 1.0])
    poles = np.array([[0, 0, end] for end in ends])
    return TriangleMesh(np.vstack([points.reshape(-1, 3), poles]), _ring_faces(len(reach), around))


def _ring_faces(rings: int, around: int) -> ndarray:
    """The poles come behind the rings."""
    index = np.arange(rings * around).reshape(rings, around)
    a, b = index[:-1].ravel(), np.roll(index, -1, axis=1)[:-1].ravel()
    c, d = np.roll(index, -1, axis=1)[1:].ravel(), index[1:].ravel()
    first, last = rings * around, rings * around + 1
    bottom = np.column_stack([np.full(around, first), np.roll(index[0], -1), index[0]])
    top = np.column_stack([np.full(around, last), index[-1], np.roll(index[-1], -1)])
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d]), bottom, top])
    return faces.astype(np.int32)


def sides(bounds: Float[ndarray, "2 3"]) -> dict[str, float]:
    """The sizes of what is as wide, deep and long as its bounds, mm."""
    return dict(zip(("width", "depth", "length"), (bounds[1] - bounds[0]).tolist(), strict=True))


def stock_figures(stock: Stock) -> dict[str, Any]:
    """`stock` of the report and of the filters: its kind, its own sizes, and its file where it has one."""
    sizes = {f"{name}_mm": float(size) for name, size in stock.sizes.items()}
    return {"kind": stock.kind, **sizes, **({"file": stock.file} if stock.file else {})}


def stock_text(figures: Mapping[str, Any]) -> str:
    """The stock in a few words, from its figures: its sizes are told in the order of X, Y and Z."""
    sizes = " x ".join(f"{value:.2f}" for name, value in figures.items() if name.endswith("_mm"))
    return f"{figures['kind']} {sizes} mm{' of ' + figures['file'] if 'file' in figures else ''}"


def place_in(stock: Stock, place: Float[ndarray, "3"]) -> str:
    """A place (mm) as messages name it, with the stock's heights in the same frame."""
    return f"{place_name(place)} (the stock reaches from z = {stock.bounds[0, 2]:.2f} to {stock.bounds[1, 2]:.2f})"


def require_inside(stock: Stock, points: Float[ndarray, "n 3"], margin: float, otherwise: str = "") -> None:
    """Raise StockError where a point has less than `margin` mm of the stock's material outside it;
    `otherwise` ends its remedy."""
    depth = stock.signed_distance(points)
    worst = int(np.argmax(depth))
    if depth[worst] > -margin + ROUNDING:
        place = points[worst]
        trouble = (
            f"leaves it by {depth[worst]:.3f} mm"
            if depth[worst] > 0
            else f"comes within {abs(depth[worst]):.3f} mm of its wall"
        )
        tiny = stock.kind == "mesh" and TINY * np.linalg.norm(np.ptp(stock.bounds, axis=0)) < np.linalg.norm(
            np.ptp(points, axis=0)
        )
        raise StockError(
            f"the stock ({stock}) does not hold the part, which {trouble} "
            f"at {place_in(stock, place)}: {_larger(stock, points[depth > -margin], float(depth[worst]) + margin)}{otherwise}"
            f"{', or stock.scale = 1000 where its file is in metres' if tiny else ''}",
            distance=float(depth[worst]),
            place=place,
        )


def _larger(stock: Stock, points: Float[ndarray, "n 3"], lack: float) -> str:
    """The remedy where these points want up to `lack` mm more of the stock: the sizes across their nearest
    walls, rounded up."""
    if stock.kind not in SIZED:
        return f"give a stock at least {_up(lack)} mm larger there to each side"
    needed = (np.abs(stock.outward(points)) > UPRIGHT).any(axis=0)
    sizes = [
        f"stock.{name} at least {_up(size + 2 * lack)}"
        for name, size in stock.sizes.items()
        if needed[ACROSS[name]].any()
    ]
    return f"give {' and '.join(sizes)}"


def _up(size: float) -> str:
    """Hundredths of a mm, rounded up."""
    return f"{math.ceil(round(100 * size, 6)) / 100:.2f}"


def capsules_round(points: Float[ndarray, "n 3"], allowance: float) -> list[Capsule]:
    """Capsules on the Z axis that hold the points with `allowance` mm of material around them, from the
    thinnest to 1.6 times as thick.

    For a radius the caps move in until a point is `allowance` below their surface; the scan is fixed, so the
    answer is too.
    """
    if allowance <= 0:
        raise StockError(
            f"an allowance of {allowance} mm leaves no material round the part: give a positive one",
            distance=allowance,
        )
    reach = np.linalg.norm(points[:, :2], axis=1)
    found: list[Capsule] = []
    for inner in reach.max() * np.linspace(1 + 1e-9, RADIUS_SPAN, RADII):
        rise = np.sqrt(inner**2 - reach**2)
        low, high = float((points[:, 2] + rise).min()), float((points[:, 2] - rise).max())
        if low > high:
            low = high = (low + high) / 2
        found.append(Capsule(np.array([0, 0, low]), np.array([0, 0, high]), float(inner) + allowance))
    return found


def smallest_capsule(points: Float[ndarray, "n 3"], allowance: float) -> Capsule:
    """That of `capsules_round` of the least volume."""
    return min(capsules_round(points, allowance), key=lambda capsule: capsule.volume)


def capsule_of_diameter(
    diameter: float, points: Float[ndarray, "n 3"], allowance: float, otherwise: str = ""
) -> Capsule:
    """The shortest capsule of this diameter on the Z axis that holds the points with `allowance` mm of
    material around them.

    Raises StockError where none does; `otherwise` ends its remedy.
    """
    reach, inner = np.linalg.norm(points[:, :2], axis=1), diameter / 2 - allowance
    worst = int(np.argmax(reach))
    if reach[worst] >= inner:
        raise StockError(
            f"a capsule of diameter {diameter:g} mm does not hold the part {reach[worst]:.2f} mm from the axis "
            f"and {points[worst, 2] - points[:, 2].min():.2f} mm above its lower end, and {allowance:g} mm round it: "
            f"give at least {2 * (reach[worst] + allowance):.2f}{otherwise}",
            distance=float(reach[worst] - inner),
            place=points[worst],
        )
    rise = np.sqrt(inner**2 - reach**2)
    low, high = float((points[:, 2] + rise).min()), float((points[:, 2] - rise).max())
    low, high = (low, high) if low <= high else ((low + high) / 2,) * 2
    return Capsule(np.array([0, 0, low]), np.array([0, 0, high]), diameter / 2)


def given_capsule(
    diameter: float,
    length: float,
    points: Float[ndarray, "n 3"],
    margin: float = MARGIN,
    middle: float | None = None,
) -> Capsule:
    """A capsule of this size on the Z axis, centred on the part's height or at z = `middle`.

    Raises StockError with `distance` and `place` where the part leaves it or has less than `margin` mm of
    material outside it.
    """
    if middle is None:
        middle = float(points[:, 2].min() + points[:, 2].max()) / 2
    capsule = capsule_of_size(diameter, length, middle)
    require_inside(capsule, points, margin)
    return capsule


def capsule_of_size(diameter: float, length: float, middle: float) -> Capsule:
    """A capsule of this size on the Z axis about z = `middle`. StockError names the setting where there is
    none."""
    if diameter <= 0:
        raise StockError(
            f"stock.diameter = {diameter:g}: a capsule {length:g} mm long needs one: give the diameter, or no stock.length",
            distance=0.0,
        )
    if length < diameter:
        what = f"stock.length = {length:g}: a capsule of diameter {diameter:g} mm is no shorter than that over both caps"
        raise StockError(
            f"{what}: give at least {diameter:g}, or a smaller stock.diameter", distance=diameter - length
        )
    half = (length - diameter) / 2
    return Capsule(np.array([0, 0, middle - half]), np.array([0, 0, middle + half]), diameter / 2)
