"""The stock a part is cut from: any closed convex body that answers the questions of `Stock`.

The kinds are the files of `bonecam.setup.stocks`.
"""

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import frozen
from bonecam.errors import StockError, hundredths
from bonecam.mesh.triangle_mesh import TriangleMesh

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
        """Largest extent across the Z axis, mm."""

    @property
    def length(self) -> float:
        """Extent along the axis, mm."""

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
        """The middle of the body, mm."""

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

    def normals(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """Unit outward normals of the surface at the points nearest to `points`."""

    def mesh(self, chord_tolerance: float) -> TriangleMesh:
        """A closed outward mesh, its vertices on the surface, its faces within `chord_tolerance` mm of it."""

    def distances_and_normals(self, points: Float[ndarray, "n 3"]) -> tuple[Float[ndarray, "n"], Float[ndarray, "n 3"]]:
        """Signed distances (mm) and outward normals in one pass."""
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
