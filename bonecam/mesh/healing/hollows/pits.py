"""Hollows that the smallest ball of a job cannot reach: filled up to where it comes to lie in them.

What is filled is the closing of the part by the ball (`closing.py`): the material that stays whatever the program.
Every vertex of a hollow moves towards the nearest ball that stays outside the part, onto that ball: never into the
part, and by no more than the ball leaves there. The faces of hollows are divided first, so that facets follow the ball
within CHORD; all others stay as they are. A surface that followed a pit instead would fold on the levels above it.
An undercut pit, all of whose walls move into its mouth over one another, is capped (`capping.py`), or left open where
no cap closes it.
"""

from dataclasses import dataclass, replace
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
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.healing.hollows.ball import PROBED, Ball
from bonecam.mesh.healing.hollows.capping import cap_folds
from bonecam.mesh.healing.hollows.closing import ACCURACY
from bonecam.mesh.healing.repair_state import Repair
from bonecam.mesh.healing.topology import neighbour_middles
from bonecam.mesh.remeshing import bisect_faces
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh

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

    opened = _put_back(vertices, divided, of_vertex)
    filled = TriangleMesh(vertices, divided.faces)
    hollow_at, wanted = of_vertex, onto_ball
    for hollow in sorted(opened):
        inside = partial(ball.onto, both_ways=True)
        capped = cap_folds(filled, hollow_at == hollow, wanted, ball.longest, inside)
        if capped is not None:
            opened.remove(hollow)
            filled = capped.mesh
            new = len(capped.mesh.vertices) - len(capped.old)
            hollow_at = np.append(hollow_at[capped.old], np.full(new, -1))
            wanted = np.vstack([wanted[capped.old], filled.vertices[len(capped.old) :]])
            vertices[of_vertex == hollow] = onto_ball[of_vertex == hollow]
    if len(opened) == count:
        return Fill(mesh, radius, open=count)
    return _told(mesh, vertices, divided, Fill(filled, radius, count - len(opened), len(opened)))


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
    of_vertex = _joined(faces[within], vertices)
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


def _joined(faces: Int[ndarray, "m 3"], vertices: int) -> Int[ndarray, " v"]:
    """The number of the piece that each of so many vertices belongs to; pieces are joined by faces."""
    edges = np.ones(faces.size), (faces.ravel(), np.roll(faces, 1, axis=1).ravel())
    return connected_components(coo_matrix(edges, shape=(vertices, vertices)), directed=False)[1]


def _put_back(vertices: Float[ndarray, "n 3"], divided: TriangleMesh, of_vertex: Int[ndarray, " n"]) -> set[int]:
    """Put the `vertices` of hollows whose faces cut each other back to where they were; the numbers of these."""
    opened: set[int] = set()
    every = set(of_vertex.tolist()) - {-1}
    while opened < every:
        cut = self_intersections(TriangleMesh(vertices, divided.faces))
        if not len(cut):
            break
        opened |= (set(of_vertex[divided.faces[cut]].ravel().tolist()) & every) - opened or every
        back = np.isin(of_vertex, list(opened))
        vertices[back] = divided.vertices[back]
    return opened


def _told(mesh: TriangleMesh, vertices: Float[ndarray, "n 3"], divided: TriangleMesh, fill: Fill) -> Fill:
    """The figures of a `fill` of a mesh whose faces were `divided`, and their vertices moved."""
    depths = lengths(vertices - divided.vertices)
    x, y, z = vertices[np.argmax(depths)].tolist()
    filled = fill.mesh
    middles = filled.vertices[filled.faces].mean(axis=1)
    moved = lengths(exact_closest(mesh, middles)[0] - middles) > ACCURACY
    return replace(
        fill,
        depth=float(depths.max()),
        place=(x, y, z),
        area=float(lengths(filled.face_vectors[moved]).sum() / 2),
        volume=filled.volume - mesh.volume,
    )
