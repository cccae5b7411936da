"""How deep balls enter the mesh of what stands while a layer is cut."""

from dataclasses import dataclass
from functools import cached_property

from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.material.cut_dexels import CutDexels
from bonecam.material.entering import ball_depths, enters_beside
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.layers.height_field import DEVIATION


@dataclass(frozen=True, eq=False)
class HeightMesh:
    """The closed mesh of a height field, known from cell to cell, or of another body out of which what stands reaches
    by the `deviation` at most, mm; its vertices are as near to one another as cells. `rays` are what stands, where that
    is known: the mesh misses ribs that are narrower than cells, and places that were left out."""

    mesh: TriangleMesh
    deviation: float = DEVIATION
    rays: CutDexels | None = None

    def depths(
        self, centres: Float[ndarray, "n 3"], radius: float
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        """How deep a ball of this radius at each centre enters the material at most (mm; negative: it is off), and the
        unit direction out of the mesh at its nearest place."""
        depths, outward = ball_depths(self._surface, centres, radius)
        return depths + self.deviation, outward

    def entered_anew(
        self, centres: Float[ndarray, "n 3"], contacts: Float[ndarray, "n 3"], radius: float, depth: float
    ) -> Bool[ndarray, " n"]:
        """Whether a ball of this radius at each centre enters the mesh by more than `depth` (mm) where one at its
        contact has not been."""
        return enters_beside(
            self._places, *ball_depths(self._surface, centres, radius), centres, contacts, radius, depth
        )

    @cached_property
    def _surface(self) -> MeshDistance:
        return MeshDistance(self.mesh)

    @cached_property
    def _places(self) -> KDTree:
        return KDTree(self.mesh.vertices)
