"""The levels of a morph: the part, the surfaces between it and its stock, and the stock; each with what was
measured on the cut that ends at it.

Level 0 is the part, level K the stock. Cut k removes the material between levels k - 1 and k; the tool path of
level k - 1 machines it. There are four kinds of levels:

- `PartLevel`: level 0; no cut lies below it.
- `MorphLevel`: a surface over the T-mesh of the part, made by the morph.
- `RoundedLevel`: a level of a stock with edges (`levels/edge_rounding.py`). The morph of such a stock ends at a
  body whose edges are rounded; further levels are larger bodies of the same kind.
- `StockLevel`: the last level, the stock itself.
"""

from abc import ABC
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.measure.certificates.certificate import Certificate
from bonecam.levels.measure.cut_measures import Measures
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline


class Level(ABC):
    """What every kind of level has; lengths in mm.

    `index` is its number k, `mesh` the tessellation that it was measured on, `limit` the largest depth allowed
    to cut k, `measures` what was measured on that cut. `surface` is its T-spline; a stock has none.
    `certificate` holds bounds on cut k that are valid at every point. There is none where the weights of the
    surface are not all one, nor for cuts that only round the stock: their depths are exact by construction.
    """

    index: int
    mesh: TriangleMesh
    limit: float
    measures: Measures
    surface: TSpline | None
    certificate: Certificate | None

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.index}: {self.deepest:.3g} of {self.limit:.3g} mm deep, {self.mesh!r}>"

    @property
    def deepest(self) -> float:
        """The largest depth of the cut, mm, measured from either of its levels to the other."""
        return max(self.measures.depth_max, self.measures.reverse_depth_max)

    @property
    def depth_max(self) -> float:
        """The largest distance of a point of this level from the level before, mm."""
        return self.measures.depth_max

    @property
    def depth_mean(self) -> float:
        """The mean distance of this level from the level before over its area, mm."""
        return self.measures.depth_mean

    @property
    def nesting_min(self) -> float:
        """How far inside this level the level before lies at least, mm; negative where a point lies outside."""
        return self.measures.nesting_min

    @property
    def outside(self) -> float:
        """How far the level leaves the stock, mm; negative where it lies inside."""
        return self.measures.outside

    @property
    def certified(self) -> bool | None:
        """Whether the certificate proves depth, nesting and stock within the tolerances; None without one."""
        return None if self.certificate is None else not self.certificate.shortfalls(self.limit)


@dataclass(frozen=True, eq=False, repr=False)
class PartLevel(Level):
    """Level 0, the surface of the part; `measures` are those of no cut, but for faces that cut each other."""

    surface: TSpline
    mesh: TriangleMesh
    measures: Measures
    index: int = field(default=0, init=False)
    limit: float = field(default=0.0, init=False)
    certificate: None = field(default=None, init=False)

    @property
    def control_points(self) -> Float[ndarray, "c 3"]:
        """Control points over the T-mesh of the part."""
        return self.surface.control_points


@dataclass(frozen=True, eq=False, repr=False)
class MorphLevel(Level):
    """A level of the morph: a surface over the T-mesh of the part."""

    index: int
    surface: TSpline
    mesh: TriangleMesh
    limit: float
    measures: Measures
    certificate: Certificate | None = None

    @property
    def control_points(self) -> Float[ndarray, "c 3"]:
        """Control points over the T-mesh of the part."""
        return self.surface.control_points


@dataclass(frozen=True, eq=False, repr=False)
class RoundedLevel(Level):
    """A level of a stock with edges: a body with rounded edges, of which only what lies inside `stock` is
    machined.

    `surface` has a T-mesh of its own. `control_points` are over the T-mesh of the part; their surface follows
    the level roughly. The first such level is the body that the morph ends at, and only it has a certificate.
    """

    index: int
    surface: TSpline
    mesh: TriangleMesh
    limit: float
    measures: Measures
    stock: Stock
    control_points: Float[ndarray, "c 3"]
    certificate: Certificate | None = None


@dataclass(frozen=True, eq=False, repr=False)
class StockLevel(Level):
    """The last level: the stock, whose surface `mesh` describes."""

    index: int
    mesh: TriangleMesh
    limit: float
    measures: Measures
    certificate: Certificate | None = None
    surface: None = field(default=None, init=False)


MachinedLevel = PartLevel | MorphLevel | RoundedLevel
"""A level that a tool path follows: any but the stock."""


def machined_levels(levels: Iterable[Level]) -> list[MachinedLevel]:
    """The levels that tool paths follow, in the order given."""
    return [level for level in levels if isinstance(level, MachinedLevel)]


def morph_surfaces(levels: Iterable[Level]) -> list[TSpline]:
    """The surfaces over the T-mesh of the part: of level 0 and of the levels of the morph."""
    return [level.surface for level in levels if isinstance(level, PartLevel | MorphLevel)]


def morph_end(levels: Sequence[Level]) -> Level:
    """The level that the morph ends at: the first body with rounded edges, or the stock where it has none."""
    return next((level for level in levels if isinstance(level, RoundedLevel)), levels[-1])


def rounding_cuts(levels: Sequence[Level]) -> range:
    """The numbers of the cuts that round a stock with edges; empty where the morph ends at the stock."""
    return range(morph_end(levels).index + 1, len(levels))
