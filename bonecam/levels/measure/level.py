"""One surface of the morph, with what was measured on it."""

from collections.abc import Sequence
from dataclasses import dataclass

from jaxtyping import Float
from numpy import ndarray

from bonecam.levels.measure.certificate import Certificate
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline


@dataclass(frozen=True, eq=False)
class Level:
    """Level `index` (0: the part) and the measured step from the level before; lengths in mm.

    `mesh` is the tessellation the measures were taken on. `surface` is None for the last level, which is
    the stock itself. The cut that machines level k - 1 removes the material between levels k - 1 and k.
    `depth_max` and `depth_mean` go from this level to the one before, `depth_back_max` the other way;
    `full_mean` is the mean depth where at least one full depth of material was left (on `full_area` mm^2 of
    the level before); `histogram` the shares of this level's area by depth, in even bins from 0 to `limit`;
    `outside` how far the level leaves the stock (negative: inside). A level that rounds the stock
    (`levels/edge_rounding.py`) has a T-mesh of its own: only what of its surface lies inside the body
    `within` is machined, and `shared` are control points over the other levels' T-mesh that follow it
    roughly. `certificate` is what holds everywhere on the cut, also between the points measured.
    """

    index: int
    surface: TSpline | None
    mesh: TriangleMesh
    limit: float
    depth_max: float
    depth_mean: float
    nesting_min: float
    self_intersections: int
    depth_back_max: float = 0.0
    full_mean: float = 0.0
    outside: float = 0.0
    histogram: tuple[float, ...] = ()
    within: Stock | None = None
    shared: Float[ndarray, "c 3"] | None = None
    full_area: float = 0.0
    certificate: Certificate | None = None

    @property
    def deepest(self) -> float:
        """The depth of the cut either way, mm."""
        return max(self.depth_max, self.depth_back_max)

    @property
    def certified(self) -> bool | None:
        """Whether depth, nesting and stock are proven everywhere on the cut; None where nothing is known, or
        nothing has to be proven."""
        return None if self.certificate is None else not self.certificate.shortfalls(self.limit)

    @property
    def net(self) -> Float[ndarray, "c 3"]:
        """Control points over the T-mesh that all levels share."""
        assert self.surface is not None
        return self.surface.control_points if self.shared is None else self.shared


def rounding_cuts(levels: Sequence[Level]) -> range:
    """The cuts that round a stock with edges down to the body that the morph ends at; empty where it ends at
    the stock."""
    body = next((level.index for level in levels if level.within is not None), len(levels) - 1)
    return range(body + 1, len(levels))
