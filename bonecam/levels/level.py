"""One surface of the morph, with what was measured on it."""

from dataclasses import dataclass

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tspline import TSpline


@dataclass(frozen=True, eq=False)
class Level:
    """Level `index` (0: the part) and the measured step from the level before; lengths in mm.

    `mesh` is the tessellation the measures were taken on. `surface` is None for the last level, which is
    the stock itself. The cut that machines level k - 1 removes the material between levels k - 1 and k.
    `depth_max` and `depth_mean` go from this level to the one before, `depth_back_max` the other way; `full_mean` is the mean
    depth where at least one full depth of material was left; `histogram` the shares of this level's area by depth, in even
    bins from 0 to `limit`; `outside` how far the level leaves the stock (negative: inside).
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
