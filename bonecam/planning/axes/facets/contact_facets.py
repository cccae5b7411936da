"""Facets between the contacts of a path, made once a level (Xu et al. 2013, sections 2 and 4).

Delaunay triangles of the contacts in a plane where they lie as on the surface, with a normal, a curvature and a
Voronoi cell at each contact. Differs from the paper in:

1. Facets across places without contacts (left out, or beyond the edge of the surface) are none: those with an edge
   much longer than most.

A plane in which the contacts of a surface, given by their parameters, lie nearly as they do on the surface.

An open surface is laid out by its mean lengths along s and t. One that is closed round is turned about a point of the
plane: with the length l along it and the mean radius rho (circumference / 2 pi) a place lies at

    r (cos 2 pi s, sin 2 pi s),    ln r = -int dl / rho

which keeps angles and circles on a surface of revolution: circles that hold no other point there hold none here. So
neither the seam nor the pole at the highest t, the free end, needs points of its own; at the lowest t is the post.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.integrate import cumulative_trapezoid

from bonecam.arrays import dots, frozen
from bonecam.mesh.facets.curvature import Curvature
from bonecam.mesh.facets.delaunay import delaunay
from bonecam.mesh.facets.energy.elastic_energy import ElasticEnergy
from bonecam.mesh.facets.energy.voronoi_areas import voronoi_areas
from bonecam.mesh.facets.mls_curvature import mls_curvature
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ContactPath

AROUND, ALONG = 32, 96
"""Places along s and t by which lengths are measured; those along t are denser at the ends, where poles may be."""
LEAST_RADIUS = 1e-3
"""Of a pole, as a share of the largest mean radius."""


def plane_points(surface: TSpline, parameters: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """The places of (s, t) in the plane; in mm where the surface is open round, of no unit where it is closed."""
    s, t = ((float(low), float(high)) for low, high in surface.domain)
    closed = surface.closed_in_s
    around = np.linspace(s[0], s[1], AROUND + 1)
    along = t[0] + np.ptp(t) * (1 - np.cos(np.linspace(0, np.pi, ALONG))) / 2
    grid = np.stack(np.meshgrid(along, around, indexing="ij"), axis=2).reshape(-1, 2)
    points = surface.positions(grid[:, 1], grid[:, 0]).reshape(ALONG, AROUND + 1, 3)
    rings = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
    way = np.r_[0.0, np.cumsum(steps)]
    share = (parameters[:, 0] - s[0]) / np.ptp(s)
    if not closed:
        return np.column_stack([share * rings.mean(), np.interp(parameters[:, 1], along, way)])
    radii = rings / (2 * np.pi)
    radii = np.maximum(radii, LEAST_RADIUS * radii.max())
    log = cumulative_trapezoid(1 / radii, way, initial=0)
    r = np.exp(np.interp(parameters[:, 1], along, -log))
    return np.column_stack([r * np.cos(2 * np.pi * share), r * np.sin(2 * np.pi * share)])


SAME = 1e-6
"""Contacts less than about this apart (mm) are one vertex: the paper's unique vertices."""
LONG = 3.0
"""Facets with an edge so many times as long as MOST edges are none."""
MOST = 95
"""Percentile of the lengths of edges."""
THIN = 1e-6
"""A facet lower than this share of its longest edge in the plane is none: its contacts lie on a line."""


@dataclass(frozen=True, eq=False)
class ContactFacets:
    """Facets `mesh` between the contacts of a `path`; `vertex_of` each contact (n), -1 of one without facets, and a
    contact at each vertex (`contact_of`, v)."""

    path: ContactPath
    mesh: TriangleMesh
    vertex_of: Int[ndarray, " n"]
    contact_of: Int[ndarray, " v"]

    def __post_init__(self) -> None:
        for name in ("vertex_of", "contact_of"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64))

    @property
    def found(self) -> Bool[ndarray, " n"]:
        """Which contacts have facets."""
        return self.vertex_of >= 0

    @cached_property
    def vertex_normals(self) -> Float[ndarray, "v 3"]:
        """Unit normals at the vertices (Eq. 19)."""
        return vertex_normals(self.mesh)

    @cached_property
    def curvature(self) -> Curvature:
        """Curvature at the vertices (Eq. 18); that of the least patch where few others are near."""
        return mls_curvature(self.mesh, few_allowed=True)

    @cached_property
    def energy(self) -> ElasticEnergy:
        """Eq. 22 on the facets."""
        return ElasticEnergy.of(self.mesh)

    @cached_property
    def areas(self) -> Float[ndarray, " n"]:
        """The area (mm^2) of the Voronoi cell of each contact, shared among contacts at one place; that of the median
        contact where there are no facets."""
        each = voronoi_areas(self.mesh)
        sharing = np.bincount(self.vertex_of[self.found], minlength=len(each))
        areas = (each / np.maximum(sharing, 1))[self.vertex_of]
        return np.where(self.found, areas, np.median(areas[self.found]))


def contact_facets(path: ContactPath, surface: TSpline) -> ContactFacets | None:
    """The facets between the contacts of a path on a surface; None where there are none, since all contacts lie on a
    line or there are fewer than three."""
    rounded = np.round(path.contacts / SAME)
    _, first, vertex_of = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    points = plane_points(surface, path.parameters[first])
    try:
        faces = delaunay(points)
    except ValueError:
        return None
    vertices = path.contacts[first]
    faces = faces[_compact(vertices, points, faces)]
    if not len(faces):
        return None
    used, index = np.unique(faces, return_inverse=True)
    number = np.full(len(vertices), -1)
    number[used] = np.arange(len(used))
    mesh = TriangleMesh(vertices[used], index.reshape(-1, 3).astype(np.int32))
    outward = dots(mesh.face_vectors, path.normals[first][faces].mean(axis=1)).sum()
    if outward < 0:
        mesh = TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])
    return ContactFacets(path, mesh, number[vertex_of.ravel()], first[used])


def _compact(
    vertices: Float[ndarray, "v 3"], points: Float[ndarray, "v 2"], faces: Int[ndarray, "m 3"]
) -> Bool[ndarray, " m"]:
    """Which faces have no edge that is much longer than most, and are no line in the plane."""
    edges = np.linalg.norm(np.roll(vertices[faces], -1, axis=1) - vertices[faces], axis=2)
    first, second, third = np.swapaxes(points[faces], 0, 1)
    ways = np.stack([second - first, third - first, third - second])
    doubled = ways[0, :, 0] * ways[1, :, 1] - ways[0, :, 1] * ways[1, :, 0]
    longest = (ways**2).sum(axis=2).max(axis=0)
    near = edges.max(axis=1) <= LONG * np.percentile(edges, MOST)
    return near & (doubled > THIN * longest)
