"""How facets sample a smooth surface: how far they lie off it, and whether noise, voxels or true edges shaped them.

A surface that turns by the angle a across an edge, whose two faces are h high on average, is about an arc whose chord
is h: its sagitta, h a / 8, is how far the facets lie off the surface. Each edge counts by the area of its two faces.

Noise moves each vertex by itself: how far one stands out of the middle of its neighbours then tells nothing of how far
those stand out of theirs.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from bonecam.arrays import angles_between, dots, lengths, unit
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.facets.voxel_steps import step_pitch
from bonecam.mesh.healing.topology import half_edges, neighbour_middles, neighbours_of
from bonecam.mesh.triangle_mesh import TriangleMesh

MOST = 0.9
"""Creases and sagittas are those that this share of the area keeps: a few sharp edges make no coarse mesh. It is 0.017
to 0.030 mm for 28 hand bones of 1,500 to 8,400 faces, 0.055 to 0.4 mm for copies of them with 700 to 130."""
FLAT = float(np.radians(0.5))
"""Faces that turn by less across their edge lie in one plane."""
SHARP = float(np.radians(40.0))
"""Planes that creases part which turn by more have true edges."""
PLANAR = 0.5
"""A part is of planes if more of its area lies in faces with a neighbour in their plane: all of a box, a prism or a
cylinder, and of bodies turned from quadrangles; 0.01 to 0.3 of bones."""
FEWEST = 24
"""Fewer faces sample no bone, their edges are meant: the coarsest bones that were tried have 60."""
INCOHERENT = 0.1
"""Bumps of neighbours that are correlated by less are noise: 0.33 to 0.83 on finely meshed bones, 0.15 to 0.45 on those
of 130 to 900 faces, -0.16 to 0.08 with noise of 0.05 mm or more on edges of 0.5 to 0.8 mm."""
LEAST_FACES = 500
"""Of fewer, such a correlation may be chance."""
STEPPED = 0.95
"""A share of the area, of voxel steps that has normals along axes and diagonals of the file: 1 of those, 0.05 of bones
at most."""
MOST_PLANES = 100
"""So many planes along axes and diagonals a part may have that is no sampling by voxels: a box of 0.5 mm voxels has
thousands of steps."""


@dataclass(frozen=True)
class Coarseness:
    """Median `edge` (mm), `crease` (radians) and `sagitta` (mm) that MOST of the area keeps; how far vertices stand out
    of the middle of their neighbours (`bumps`, RMS, mm).

    Whether bumps are `noise`, facets `steps` of voxels of a `pitch` (mm, along X, Y, Z; None where it is not found), or
    `true_edges` bound plane faces, as of a box or a cylinder.
    """

    edge: float
    crease: float
    sagitta: float
    bumps: float
    noise: bool
    steps: bool
    true_edges: bool
    pitch: Float[ndarray, "3"] | None = None

    def __str__(self) -> str:
        rough = f"steps of voxels{self._pitch_text}" if self.steps else "noise"
        also = f", {rough} of {self.bumps:.2g} mm" if self.steps or self.noise else ""
        return f"edges of {self.edge:.2g} mm with creases up to {np.degrees(self.crease):.0f} degrees{also}"

    @property
    def _pitch_text(self) -> str:
        return f" (every {' x '.join(f'{size:.3g}' for size in self.pitch)} mm)" if self.pitch is not None else ""

    @property
    def report(self) -> dict[str, float | bool | list[float] | None]:
        """`facets` of the report."""
        return {
            "edge_mm": round(self.edge, 4),
            "crease_deg": round(float(np.degrees(self.crease)), 2),
            "sagitta_mm": round(self.sagitta, 6),
            "bumps_mm": round(self.bumps, 6),
            "noise": self.noise,
            "steps": self.steps,
            "pitch_mm": None if self.pitch is None else np.round(self.pitch, 4).tolist(),
            "true_edges": self.true_edges,
        }


def coarseness_of(mesh: TriangleMesh) -> Coarseness:
    """The measure of a closed mesh, mm. MeshError where it is not closed and manifold."""
    across = neighbours_of(mesh)
    normals = unit(mesh.face_vectors)
    areas = lengths(mesh.face_vectors) / 2
    corners = mesh.vertices[mesh.faces]
    edges = np.maximum(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2), np.finfo(float).tiny)

    turns = angles_between(np.repeat(normals, 3, axis=0), normals[across.ravel()]).reshape(-1, 3)
    shared = areas[:, None] + areas[across]
    sagittas = shared / edges * turns / 8  # the mean of the two faces' heights over the edge, times a / 8
    bumps, coherence = _bumps(mesh)
    steps = _is_stepped(turns, across, normals, areas)
    crease = _kept_by_most(turns, shared)
    planar = bool(areas[(turns < FLAT).any(axis=1)].sum() > PLANAR * areas.sum())
    return Coarseness(
        edge=float(np.median(edges)),
        crease=crease,
        sagitta=_kept_by_most(sagittas, shared),
        bumps=bumps,
        noise=coherence < INCOHERENT and len(mesh.faces) >= LEAST_FACES and not planar,
        steps=steps,
        true_edges=(planar or len(mesh.faces) < FEWEST) and crease > SHARP and not steps,
        pitch=step_pitch(mesh) if steps else None,
    )


def _kept_by_most(values: Float[ndarray, "m 3"], areas: Float[ndarray, "m 3"]) -> float:
    """The value that MOST of the area does not exceed."""
    order = np.argsort(values, axis=None)
    shares = np.cumsum(areas.ravel()[order]) / areas.sum()
    return float(values.ravel()[order][np.searchsorted(shares, MOST)])


def _bumps(mesh: TriangleMesh) -> tuple[float, float]:
    """The RMS height (mm) of vertices over the middle of their neighbours, less its mean, and the correlation of the
    heights of neighbours; 1 where all heights are equal."""
    start, end = half_edges(mesh).reshape(-1, 2).T
    heights = dots(vertex_normals(mesh), mesh.vertices - neighbour_middles(mesh))
    heights = heights - heights.mean()
    square = float((heights**2).mean())
    together = float((heights[start] * heights[end]).mean())
    return float(np.sqrt(square)), together / square if square > 0 else 1.0


def _is_stepped(
    turns: Float[ndarray, "m 3"],
    across: Int[ndarray, "m 3"],
    normals: Float[ndarray, "m 3"],
    areas: Float[ndarray, " m"],
) -> bool:
    """Whether faces follow a grid of voxels: in many planes, all along axes and diagonals."""
    signs = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    along = (normals @ unit(signs[signs.any(axis=1)]).T).max(axis=1) > np.cos(FLAT)
    face, side = np.nonzero(turns < FLAT)
    graph = coo_array((np.ones(len(face)), (face, across[face, side])), shape=(len(areas),) * 2)
    planes = connected_components(graph, directed=False)[0]
    return bool(planes > MOST_PLANES and areas[along].sum() > STEPPED * areas.sum())
