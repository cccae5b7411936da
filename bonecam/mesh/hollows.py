"""Where the centre of a ball that stays outside a mesh can be, nearest to given points.

The closing of a part by a ball of radius r is what no such ball reaches from outside (Serra 1982). A point lies as deep
in it as the nearest centre c with dist(c, part) >= r is farther than r. That centre is found by successive half-spaces:
each foot q of a centre on the part allows only centres x with n . (x - q) >= r, n = (c - q) / |c - q|; the point is
projected onto the intersection of those of all feet so far, the foot of the new centre is added, and all n are taken
anew.

A ball beside a part: where it lies free while it touches the surface, and where it lies nearest to given points.

Undercut hollows, as pores with a narrow mouth: cut out and closed over by new faces.

The walls of such a hollow cannot be moved into its mouth without lying over one another. They go, and the hole that
they leave is triangulated.

Hollows that the smallest ball of a job cannot reach: filled up to where it comes to lie in them.

What is filled is the closing of the part by the ball: the material that stays whatever the program.
Every vertex of a hollow moves towards the nearest ball that stays outside the part, onto that ball: never into the
part, and by no more than the ball leaves there. The faces of hollows are divided first, so that facets follow the ball
within CHORD; all others stay as they are. A surface that followed a pit instead would fold on the levels above it.
An undercut pit, all of whose walls move into its mouth over one another, is capped, or left open where
no cap closes it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from bonecam.arrays import lengths
from bonecam.errors import counted, place_name
from bonecam.kernels.cones import project_on_half_spaces
from bonecam.mesh.distance import MeshDistance, exact_closest
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.healing import Repair
from bonecam.mesh.meshlab import bisect_faces, from_meshset, split_edges, to_meshset
from bonecam.mesh.solids import edges_of, genus, neighbour_middles, pieces_of, self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh

ROUNDS = 40
"""Feet that are looked for at a point, at most; ten are usual."""
MOST_FEET = 12
"""Feet that are kept of a point."""
SAME = 0.02
"""Feet closer to each other than this share of the radius are one: the ball between them is wrong by r SAME^2 / 8."""
ACCURACY = 1e-5
"""A centre that moves by less, mm, has been found; it may enter the part by as much."""
BEYOND = 10.0
"""A projection farther away than so many radii comes from half-spaces that exclude one another."""


def nearest_centres(
    distance: MeshDistance, points: Float[ndarray, "n 3"], starts: Float[ndarray, "n 3"], radius: float
) -> Float[ndarray, "n 3"]:
    """For each point the nearest place (mm) outside a closed mesh that is `radius` or more away from it.

    `starts` are such places, near the points. What comes back is a local minimum, never farther than the start: so
    the depth of a point in the closing is exact, or told too large by what a nearer centre elsewhere would allow.
    """
    mesh = distance.mesh
    normals = mesh.face_vectors / np.maximum(lengths(mesh.face_vectors), np.finfo(float).tiny)[:, None]
    nearest = starts.copy()
    tried = starts.copy()
    feet = np.full((len(points), MOST_FEET, 3), np.inf)
    outward = np.zeros((len(points), MOST_FEET, 3))
    going = np.arange(len(points))
    for _ in range(ROUNDS):
        foot, face = exact_closest(mesh, tried[going])
        away = tried[going] - foot
        nearer = lengths(tried[going] - points[going]) < lengths(nearest[going] - points[going])
        nearer &= lengths(away) >= radius - ACCURACY
        nearer[nearer] = ~distance.inside(tried[going[nearer]])
        nearest[going[nearer]] = tried[going[nearer]]
        # A foot takes the place of one that is the same, an empty place, or that of the foot farthest from the centre
        apart = np.linalg.norm(feet[going] - foot[:, None], axis=2)
        reach = np.linalg.norm(feet[going] - tried[going][:, None], axis=2)
        again = apart.min(axis=1) < SAME * radius
        slot = np.where(again, np.argmin(apart, axis=1), np.argmax(reach, axis=1))
        feet[going, slot] = foot
        outward[going, slot] = normals[face]
        # The place nearest to each point in the half-spaces that the feet of its centre allow (an infinite one none);
        # NaN where they exclude one another. A centre inside the part is led out along its normals
        known = np.isfinite(feet[going, :, :1])
        own = np.where(known, feet[going], 0.0)
        back = tried[going][:, None] - own
        far = np.linalg.norm(back, axis=2, keepdims=True)
        side = np.where((back * outward[going]).sum(axis=2, keepdims=True) < 0, -1.0, 1.0)
        ways = np.where(far > ACCURACY, side * back / np.maximum(far, ACCURACY), outward[going])
        offsets = np.where(known[:, :, 0], (ways * own).sum(axis=2) + radius, -np.inf)
        centres = np.asarray(project_on_half_spaces(points[going], ways, offsets, BEYOND * radius))
        on = lengths(centres - tried[going]) > ACCURACY  # false where there is none
        tried[going[on]] = centres[on]
        going = going[on]
        if not len(going):
            break
    return nearest


CHORD = 0.01
"""Facets of a fill lie within this of the ball, mm: the gouge allowed by default."""
PROBED = 0.5
"""The surface is probed at places no farther apart than this share of the ball's radius."""
AGAIN = 5
"""Times that nearer balls are looked for from those of other points, at most."""


class Ball:
    """A ball beside a part, and where it lies free while it touches the surface, which is `probed` on small faces."""

    def __init__(self, mesh: TriangleMesh, radius: float) -> None:
        self.mesh = mesh
        self.radius = radius
        self.probed = split_edges(mesh, PROBED * radius)
        size = np.maximum(lengths(self.probed.face_vectors), np.finfo(float).tiny)[:, None]
        normals = np.vstack([vertex_normals(self.probed), self.probed.face_vectors / size])
        self.probes = np.vstack([self.probed.vertices, self.probed.vertices[self.probed.faces].mean(axis=1)])
        centres = self.probes + radius * normals
        self.distance = MeshDistance(mesh)
        self.entered = radius - self.distance.signed(centres, radius)
        self.free = cKDTree(centres[self.entered <= ACCURACY])

    @property
    def longest(self) -> float:
        """Edges of faces that follow the ball within CHORD, mm, at most."""
        return float(np.sqrt(8 * self.radius * CHORD))

    def lying_near(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        """The centre of the ball outside the part that lies nearest to each point: looked for from free balls, and
        again from one that was found for another point where that lies nearer."""
        starts = np.asarray(self.free.data)[np.asarray(self.free.query(points)[1])]
        centres = nearest_centres(self.distance, points, starts, self.radius)
        for _ in range(AGAIN):
            away, other = cKDTree(centres).query(points)
            nearer = np.asarray(away) < lengths(centres - points) - ACCURACY
            if not nearer.any():
                break
            centres[nearer] = nearest_centres(self.distance, points[nearer], centres[other][nearer], self.radius)
        return centres

    def onto(self, points: Float[ndarray, "n 3"], *, both_ways: bool = False) -> Float[ndarray, "n 3"]:
        """The points moved onto the ball that lies nearest; one that it reaches stays, unless points are to move
        `both_ways`, out of the ball too."""
        centres = self.lying_near(points)
        away = np.maximum(lengths(centres - points), ACCURACY)
        stays = (away <= self.radius + 2 * ACCURACY) & (not both_ways)
        share = np.where(stays, 0.0, 1 - self.radius / away)
        return points + share[:, None] * (centres - points)


ON = 1e-6
"""A face whose middle is nearer than this, mm, to what was left of the surface belongs to it and not to a cap."""
SMOOTHINGS = 20
"""Rounds in which the points inside caps are put where they belong, at most: each after one that moved them to the
middle of their neighbours, as faces of the one before cut each other."""


def cap_folds(
    mesh: TriangleMesh, hollow: Bool[ndarray, " v"], onto_ball: Float[ndarray, "v 3"], ball: Ball
) -> tuple[TriangleMesh, Int[ndarray, " k"]] | None:
    """The mesh with the vertices of a `hollow` moved to `onto_ball`, and with caps in place of the faces there that cut
    each other then: as few of those round them as are needed, all of the hollow at most. What comes
    back is that of `cap`."""
    onto = partial(ball.onto, both_ways=True)
    moved = TriangleMesh(np.where(hollow[:, None], onto_ball, mesh.vertices), mesh.faces)
    walls = hollow[mesh.faces].all(axis=1)
    out = np.zeros(len(walls), dtype=bool)
    out[self_intersections(moved)] = True
    out &= walls
    rings = 1
    capped = cap(moved, out, ball.longest, onto)
    while capped is None and not (out == walls).all():
        before = out
        for _ in range(rings):
            out = walls & np.isin(mesh.faces, mesh.faces[out]).any(axis=1)
        if (out == before).all():
            break
        capped = cap(moved, out, ball.longest, onto)
        rings *= 2
    return capped


def cap(
    mesh: TriangleMesh,
    hollow: Bool[ndarray, " f"],
    longest: float,
    onto: Callable[[Float[ndarray, "n 3"]], Float[ndarray, "n 3"]],
) -> tuple[TriangleMesh, Int[ndarray, " k"]] | None:
    """The closed mesh without the faces of `hollow`, the holes that they leave closed, and the numbers that its
    vertices had before, of which those in caps (the last) have none; None where that is no closed body without handles
    that does not cut itself, as over a groove all the way round.

    Edges in caps are at most `longest` mm; `onto` moves the points (mm) inside them to where they belong.
    """
    old, faces = np.unique(mesh.faces[~hollow], return_inverse=True)
    left = TriangleMesh(mesh.vertices[old], faces.reshape(-1, 3).astype(np.int32))
    if not len(left.faces):
        return None
    meshset = to_meshset(left)
    meshset.meshing_close_holes(maxholesize=len(mesh.faces), selfintersection=True)
    closed = from_meshset(meshset)
    is_ball = (edges_of(closed)[1] == 2).all() and pieces_of(closed).max() == 0 and genus(closed) == 0
    if len(closed.vertices) != len(old) or not is_ball:
        return None
    while True:
        corners = closed.vertices[closed.faces]
        in_caps = lengths(exact_closest(left, corners.mean(axis=1))[0] - corners.mean(axis=1)) > ON
        too_long = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1) > longest
        if not (in_caps & too_long).any():
            break
        closed = bisect_faces(closed, in_caps & too_long)
    inside = np.ones(len(closed.vertices), dtype=bool)
    inside[closed.faces[~in_caps]] = False
    vertices = np.array(closed.vertices)
    for _ in range(SMOOTHINGS if inside.any() else 1):
        vertices[inside] = onto(vertices[inside])
        capped = TriangleMesh(vertices.copy(), closed.faces)
        if not len(self_intersections(capped)):
            return capped, old
        vertices[inside] = neighbour_middles(capped)[inside]
    return None


LEAST = 0.15
"""A hollow no deeper than this is left as it is, mm: levels over it do not fold. With hollows filled from 0.08 on, the
phalanx's program takes 12 % longer and leaves as much."""
SHALLOW = 0.02
"""Hollows reach as far as they are deeper than this, mm: what the simulation calls left over."""
UNFOLDINGS = 20
"""Rounds in which folded faces are smoothed, at most."""
MOST_FOLDED = 0.3
"""Share of the vertices moved that folded faces may have to be smoothed: more of them are an undercut pit."""


@dataclass(frozen=True, eq=False)
class Fill:
    """A part whose hollows are filled.

    `depth` (mm) is the farthest that its surface moved, outward, at `place`; `area` (mm^2) of the surface moved,
    `volume` (mm^3) is what was added, in `hollows`; `open` of them are left as they are, since the fill would cut the
    part.
    """

    mesh: TriangleMesh
    radius: float
    hollows: int = 0
    open: int = 0
    depth: float = 0.0
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    area: float = 0.0
    volume: float = 0.0

    @property
    def repairs(self) -> tuple[Repair, ...]:
        """What was done; nothing where there is no hollow."""
        ball = f"that a ball of {self.radius:g} mm cannot reach"
        repairs = []
        if self.hollows:
            size = f"{self.area:.1f} mm2, {self.volume:.2f} mm3, deepest at {place_name(np.array(self.place))}"
            repairs.append(Repair(f"filled {counted(self.hollows, 'hollow')} {ball}, {size}", outward=self.depth))
        if self.open:
            repairs.append(Repair(f"left {counted(self.open, 'hollow')} {ball} open: a fill would cut the part"))
        return tuple(repairs)

    @property
    def report(self) -> dict[str, Any]:
        """`filled` of the report; the place in the frame of the mesh."""
        return {
            "ball_radius_mm": self.radius,
            "hollows": self.hollows,
            "left_open": self.open,
            "depth_max_mm": round(self.depth, 6),
            "place": [round(value, 3) for value in self.place],
            "area_mm2": round(self.area, 2),
            "volume_mm3": round(self.volume, 3),
        }


def fill_pits(mesh: TriangleMesh, radius: float) -> Fill:
    """The closed mesh (mm) with every hollow filled that a ball of `radius` mm does not reach by more than LEAST.

    Vertices outside hollows stay to the last bit, and come first; a mesh without hollows comes back itself.
    """
    ball = Ball(mesh, radius)
    hollow_of = _hollows(ball)
    count = int(hollow_of.max(initial=-1)) + 1
    if not count:
        return Fill(mesh, radius)
    divided = _divided(ball, hollow_of >= 0)
    of_face = hollow_of[exact_closest(ball.probed, divided.vertices[divided.faces].mean(axis=1))[1]]
    of_vertex = np.full(len(divided.vertices), -1)
    of_vertex[divided.faces[of_face >= 0]] = of_face[of_face >= 0, None]
    asked = np.flatnonzero(of_vertex >= 0)
    vertices = np.array(divided.vertices)
    vertices[asked] = ball.onto(vertices[asked])
    onto_ball = vertices.copy()
    moved = lengths(vertices - divided.vertices) > 0
    _unfold(ball, vertices, divided.faces, moved)

    # Put the `vertices` of hollows whose faces cut each other back to where they were; the numbers of these
    opened: set[int] = set()
    every = set(of_vertex.tolist()) - {-1}
    while opened < every:
        cut = self_intersections(TriangleMesh(vertices, divided.faces))
        if not len(cut):
            break
        opened |= (set(of_vertex[divided.faces[cut]].ravel().tolist()) & every) - opened or every
        back = np.isin(of_vertex, list(opened))
        vertices[back] = divided.vertices[back]
    filled = TriangleMesh(vertices, divided.faces)
    hollow_at, wanted = of_vertex, onto_ball
    for hollow in sorted(opened):
        capped = cap_folds(filled, hollow_at == hollow, wanted, ball)
        if capped is not None:
            opened.remove(hollow)
            filled, old = capped
            hollow_at = np.append(hollow_at[old], np.full(len(filled.vertices) - len(old), -1))
            wanted = np.vstack([wanted[old], filled.vertices[len(old) :]])
            vertices[of_vertex == hollow] = onto_ball[of_vertex == hollow]
    if len(opened) == count:
        return Fill(mesh, radius, open=count)
    depths = lengths(vertices - divided.vertices)
    x, y, z = vertices[np.argmax(depths)].tolist()
    middles = filled.vertices[filled.faces].mean(axis=1)
    changed = lengths(exact_closest(mesh, middles)[0] - middles) > ACCURACY
    return Fill(
        filled,
        radius,
        hollows=count - len(opened),
        open=len(opened),
        depth=float(depths.max()),
        place=(x, y, z),
        area=float(lengths(filled.face_vectors[changed]).sum() / 2),
        volume=filled.volume - mesh.volume,
    )


def _hollows(ball: Ball) -> Int[ndarray, " f"]:
    """The number of the hollow, deeper than LEAST, that each probed face lies in; -1 in none."""
    faces = ball.probed.faces
    vertices = len(ball.probed.vertices)
    none = np.full(len(faces), -1)
    depths = np.zeros(len(ball.probes))
    blocked = ball.entered > SHALLOW
    if not blocked.any() or not ball.free.n:
        return none
    depths[blocked] = lengths(ball.lying_near(ball.probes[blocked]) - ball.probes[blocked]) - ball.radius
    of_face = np.maximum(depths[faces].max(axis=1), depths[vertices:])
    within = of_face > SHALLOW
    walls = faces[within]
    edges = np.ones(walls.size), (walls.ravel(), np.roll(walls, 1, axis=1).ravel())
    of_vertex = connected_components(coo_matrix(edges, shape=(vertices, vertices)), directed=False)[1]
    seeds = np.unique(of_vertex[faces[of_face > LEAST, 0]])
    numbers = np.full(vertices, -1)
    numbers[seeds] = np.arange(len(seeds))
    return np.where(within, numbers[of_vertex[faces[:, 0]]], none)


def _divided(ball: Ball, hollow: Bool[ndarray, " f"]) -> TriangleMesh:
    """The part with its faces divided in hollows, which are given by probed faces."""
    middles = cKDTree(ball.probed.vertices[ball.probed.faces[hollow]].mean(axis=1))
    divided = ball.mesh
    while True:
        corners = divided.vertices[divided.faces]
        edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        near = middles.query(corners.mean(axis=1))[0] < edge + PROBED * ball.radius
        if not (near & (edge > ball.longest)).any():
            return divided
        divided = bisect_faces(divided, near & (edge > ball.longest))


def _unfold(
    ball: Ball, vertices: Float[ndarray, "n 3"], faces: Int[ndarray, "m 3"], moved: Bool[ndarray, " n"]
) -> None:
    """Change the `vertices` of faces that cut each other, where they have `moved`: walls of a narrow pit that lean over
    come to lie on one another. They go to the middle of their neighbours and back onto the balls."""
    for _ in range(UNFOLDINGS):
        cut = self_intersections(TriangleMesh(vertices, faces))
        folded = np.unique(faces[cut])
        if not moved[folded].any() or moved[folded].sum() > MOST_FOLDED * moved.sum():
            return
        folded = np.unique(faces[np.isin(faces, folded).any(axis=1)])
        folded = folded[moved[folded]]
        middles = neighbour_middles(TriangleMesh(vertices, faces))
        vertices[folded] = ball.onto(middles[folded], both_ways=True)
