"""The in-process material: what is left of the stock while the levels are machined one after the other, from the stock
inwards.

It is a height field over the parameter domain that all levels share: each place stays where the balls that swept over
it left it, scallops and the fillets of larger balls included. Where a contact was left out it stays where it was
before: an obstacle to shank and holder, and too deep a cut for a ball further in. The closed mesh of what stands goes
through the vertices that balls have lowered, and out to what rays tell beyond it.

At first the mesh is laid on the stock: its vertices on the surface, those next to an edge on the edge. Nearest points
alone would cut the edges off by what the mesh lies below them: material that stays there, because no tool reaches it,
would not be known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int, Int32
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.arrays import numbered
from bonecam.kernels.rays import Capsules, ProbesByCell, cut_normal_probes, probe_cells, useful_moves
from bonecam.levels.measure import Level, LevelGrid, MachinedLevel, RoundedLevel, level_grid, machined_levels
from bonecam.material.dexels import CutDexels, ball_depths, cut_poses, enters_beside, uncut_rays
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.setup.stock import Stock
from bonecam.tool.path import MoveKind, ToolPath

MESH_CHORD = 0.05
"""Chord tolerance (mm) of the grid of the material."""
DEVIATION = 2.5 * MESH_CHORD
"""How far the material may reach out of its mesh, mm."""
ROUNDS = 4
"""Times that the mesh is moved out, at most: what is then beyond it was 0.3 mm at most, before 1.1 mm."""


def hull(standing: Float[ndarray, "n 3"], floor: Float[ndarray, "n 3"], faces: Int32[ndarray, "f 3"]) -> TriangleMesh:
    """The mesh through standing vertices that the material leaves by DEVIATION at most, also where it ends in a cliff
    between a vertex that was cut and one that stands: no vertex is lower than its neighbours by more than that."""
    heights = np.linalg.norm(standing - floor, axis=1)
    least = heights.copy()
    for k in range(3):
        one, other = faces[:, k], faces[:, k - 1]
        np.maximum.at(least, one, heights[other] - DEVIATION)
        np.maximum.at(least, other, heights[one] - DEVIATION)
    up = vertex_normals(TriangleMesh(floor, faces))
    return TriangleMesh(standing + (least - heights)[:, None] * up, faces)


def holding(mesh: TriangleMesh, ends: Float[ndarray, "e 3"]) -> TriangleMesh:
    """The mesh, its vertices moved out until it holds the `ends` of what stands, but for DEVIATION: an edge between
    the wall that a level leaves and a face of the stock that stays runs through no vertex."""
    for _ in range(ROUNDS):
        surface = MeshDistance(mesh)
        beyond = ends[surface.unsigned(ends, 2 * DEVIATION) > DEVIATION]
        beyond = beyond[~surface.inside(beyond)]
        if not len(beyond):
            break
        nearest, faces = surface.closest(beyond)
        out = beyond - nearest
        # of the ends beyond the faces round a vertex the farthest moves it
        order = np.argsort(np.linalg.norm(out, axis=1))
        moved = mesh.vertices.copy()
        at = mesh.faces[faces[order]]
        moved[at] = mesh.vertices[at] + out[order][:, None]
        mesh = TriangleMesh(moved, mesh.faces)
    return mesh


SHARP = np.radians(40.0)
"""Neighbours whose normals are farther apart, and as far from opposite, have an edge between them: on round walls of
1 mm radius they are 36 degrees apart, 0.6 mm."""
PARALLEL = 0.1
"""Three walls whose planes have a smaller share of a singular value have no corner, but an edge."""


def places_on_stock(stock: Stock, points: Float[ndarray, "n 3"], faces: Int32[ndarray, "f 3"]) -> Float[ndarray, "n 3"]:
    """The place of the stock's surface for each vertex of a closed mesh in it: the nearest one, but for the nearer of
    two neighbours on both sides of an edge a place on that edge, and where three walls meet their corner."""
    nearest, normals = stock.closest_points(points), stock.normals(points)
    sides = faces, faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]
    sharp = np.abs(
        [(normals[one] * normals[other]).sum(axis=1) for one, other, _ in (side.T for side in sides)]
    ) < np.cos(SHARP)
    pairs = np.vstack([side[across, :2] for side, across in zip(sides, sharp, strict=True)])

    stock_points = nearest
    for neighbours in (pairs, faces[sharp.all(axis=0)]):
        # where the planes through the neighbours meet, nearest to their middle
        planes, corners = normals[neighbours], nearest[neighbours]
        middle = corners.mean(axis=1)
        out = (planes * (corners - middle[:, None])).sum(axis=2)
        meeting = stock.closest_points(middle + (np.linalg.pinv(planes, rcond=PARALLEL) @ out[:, :, None])[:, :, 0])

        # The places, that of the neighbours in each row which is nearest to its target moved there
        away = np.linalg.norm(stock_points[neighbours] - meeting[:, None], axis=2)
        moved = stock_points.copy()
        moved[neighbours[np.arange(len(away)), np.argmin(away, axis=1)]] = meeting
        stock_points = moved
    return stock_points


DEPTH_CHORD = 0.005
"""Chord tolerance (mm) of the grid of the places that depths of cut are measured from: about 0.25 mm apart."""
REACH = 1.5
"""A level lowers a place by at most this, mm."""
LEAST_HEIGHT = 1e-4
"""A place that is no higher above the level stays as it is, mm."""
STEEP = 0.5
"""Neighbouring places that are farther apart have a steep wall between them, mm."""
DENSE = 0.1
"""Places at which balls cut are so far apart, mm."""
CELL = 0.5
"""Side of the cells that places are found by, mm."""


@dataclass(frozen=True, eq=False)
class Swept:
    """Places at which balls of a `radius` (mm) cut, all on one level."""

    level: int
    radius: float
    places: KDTree


@dataclass(frozen=True, eq=False)
class InProcessStock:
    """The material left of a `stock`: the vertices of `grid` moved to `vertices`; and places of its surface, those of
    the finer grid `depth_grid` moved to `places`. `swept` is where balls cut on the last two levels. `uncut` is the
    stock before the first cut: depths are measured from it. `rays` are what cutters leave whatever the lines of the
    grids.
    `floor` are the vertices on the level that was cut last, None while levels only round the edges of the stock.
    """

    stock: TriangleMesh
    grid: LevelGrid
    vertices: Float[ndarray, "v 3"]
    depth_grid: LevelGrid
    places: Float[ndarray, "p 3"]
    rays: CutDexels
    swept: tuple[Swept, ...] = ()
    uncut: Stock | None = None
    floor: Float[ndarray, "v 3"] | None = None

    @cached_property
    def mesh(self) -> TriangleMesh:
        """The closed mesh that what stands leaves by DEVIATION at most; while levels round the edges of the stock, all
        of it."""
        if self.floor is None:
            return self.stock
        return holding(hull(self.vertices, self.floor, self.grid.faces), self.rays.balls.ends)

    def thickness(self, level: MachinedLevel, contacts: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """Thickness of the material above the level at each contact, mm."""
        floor = self.grid.R @ level.control_points
        thickness = np.linalg.norm(self.vertices - floor, axis=1)
        return thickness[KDTree(floor).query(contacts)[1]]

    def depths(
        self, centres: Float[ndarray, "n 3"], radius: float
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, "n 3"]]:
        """How deep a ball of this radius at each centre enters the material (mm; negative: it is off), and the unit
        direction out of it at the nearest place.

        That is R - |C - M| with M the nearest place of the surface, R + |C - M| where the centre is in the material,
        or less: a ball of radius B that was at P has left no material deeper than |C - P| + R - B in the ball.
        """
        if self.uncut is not None:
            distance, normals = self.uncut.distances_and_normals(centres)
            return radius - distance, normals
        depth, outward = ball_depths(self._surface, centres, radius)
        for swept in self.swept:
            if radius <= swept.radius:
                shift, _ = swept.places.query(centres, distance_upper_bound=swept.radius)
                depth = np.minimum(depth, shift + radius - swept.radius)
        return depth, outward

    def useful(
        self,
        level: MachinedLevel,
        centres: Float[ndarray, "n 3"],
        passes: Int[ndarray, " n"],
        radius: float,
        least: float,
    ) -> Bool[ndarray, " n"]:
        """Whether a ball that moves through these centres lowers the material above a place of the level by `least` mm
        at least on its way to or from each, when the moves before that do have been made."""
        floor = self.depth_grid.R @ level.control_points
        tall = np.minimum(self.depths(floor, 0.0)[0], REACH)
        above = np.flatnonzero(tall > LEAST_HEIGHT)
        if not len(above):
            return np.zeros(len(centres), dtype=bool)
        normals = vertex_normals(TriangleMesh(floor, self.depth_grid.faces))
        order, cell_starts, corner = probe_cells(floor[above], CELL)
        at = above[order]
        probes = ProbesByCell(floor[at], normals[at], cell_starts, corner, CELL)
        goes_on = np.r_[False, passes[1:] == passes[:-1]]
        starts = centres[np.arange(len(centres)) - goes_on]
        useful = useful_moves(probes, starts, centres, radius, least=least, heights=tall[at])
        return useful | np.r_[useful[1:] & goes_on[1:], False]

    def entered_anew(
        self, centres: Float[ndarray, "n 3"], contacts: Float[ndarray, "n 3"], radius: float, depth: float
    ) -> Bool[ndarray, " n"]:
        """Whether a ball of this radius at each centre enters the material by more than `depth` (mm) where one at its
        contact has not been: what leaves a contact may go up in the place that was cut there."""
        return enters_beside(self._places, *self.depths(centres, radius), centres, contacts, radius, depth)

    @cached_property
    def _places(self) -> KDTree:
        """The places, and further ones where the surface rises steeply between two of them."""
        a, b = self.places[np.vstack([self.depth_grid.faces[:, [k, (k + 1) % 3]] for k in range(3)]).T]
        steep = np.linalg.norm(b - a, axis=1) > STEEP
        return KDTree(np.vstack([self.places, _dense(a[steep], b[steep])]))

    @cached_property
    def _surface(self) -> MeshDistance:
        """Distances to the surface through the places."""
        return MeshDistance(TriangleMesh(self.places, self.depth_grid.faces))


def uncut_material(levels: Sequence[Level], stock: Stock) -> InProcessStock:
    """The material before the first cut: the stock. `levels` begin at the part and end at the stock."""
    machined = machined_levels(levels)
    nets = [level.control_points for level in machined]
    grid, fine = (level_grid(machined[0].surface, nets, chord) for chord in (MESH_CHORD, DEPTH_CHORD))
    vertices, places = (places_on_stock(stock, each.R @ nets[-1], each.faces) for each in (grid, fine))
    return InProcessStock(
        levels[-1].mesh, grid, vertices=vertices, depth_grid=fine, places=places, rays=uncut_rays(stock), uncut=stock
    )


def remove_material(material: InProcessStock, level: MachinedLevel, path: ToolPath) -> InProcessStock:
    """The material after `path` has machined `level`: what its balls reach is gone."""
    if not (path.kinds == MoveKind.CUT).any():
        return material
    floor = material.grid.R @ level.control_points
    vertices = _lowered(material.vertices, floor, path)
    places = _lowered(material.places, material.depth_grid.R @ level.control_points, path)
    # Where balls cut on the level of the path and on the one before it: the rest paths of a level cut only parts of it.
    radius = path.cutter.radius
    (starts, _), (ends, _) = cut_poses(path)
    same = [each for each in material.swept if (each.level, each.radius) == (path.level, radius)]
    cut = np.vstack([_dense(starts, ends), *(each.places.data for each in same)])
    kept = [each for each in material.swept if each not in same and each.level <= path.level + 1]
    return replace(
        material,
        vertices=vertices,
        places=places,
        rays=material.rays.after(path),
        swept=(*kept, Swept(path.level, radius, KDTree(cut))),
        uncut=None,
        floor=material.floor if isinstance(level, RoundedLevel) else floor,
    )


def _dense(starts: Float[ndarray, "n 3"], ends: Float[ndarray, "n 3"]) -> Float[ndarray, "m 3"]:
    """Places on straight moves, no more than DENSE apart."""
    counts = np.ceil(np.linalg.norm(ends - starts, axis=1) / DENSE).astype(np.int64)
    move, place = numbered(counts)
    share = (place + 1) / counts[move]
    return np.vstack([starts[counts == 0], starts[move] + share[:, None] * (ends - starts)[move]])


def _lowered(standing: Float[ndarray, "n 3"], floor: Float[ndarray, "n 3"], path: ToolPath) -> ndarray:
    """Each standing place lowered on the line to its place of the level, as far as the balls cut it."""
    heights = np.linalg.norm(standing - floor, axis=1)
    (starts, _), (ends, _) = cut_poses(path)
    above = np.flatnonzero(heights > LEAST_HEIGHT)
    if not len(above) or not len(starts):
        return standing
    normals = (standing - floor)[above] / heights[above, None]
    tall = np.minimum(heights[above], REACH)
    feet = standing[above] - tall[:, None] * normals
    order, cell_starts, corner = probe_cells(feet, CELL)
    above, normals, feet, tall = above[order], normals[order], feet[order], tall[order]
    probes = ProbesByCell(feet, normals, cell_starts, corner, CELL)
    names, owners = np.arange(len(starts)), np.full(len(above), -1)
    capsules = Capsules(starts, ends, np.full(len(starts), path.cutter.radius), names)
    cut_normal_probes(probes, REACH, capsules, tall, owners, from_top=True)
    lowered = standing.copy()
    # never below the level, where a ball may be by the gouge tolerance: the next direction would be inwards
    lowered[above] = feet + np.maximum(tall, 0.0)[:, None] * normals
    return lowered
