"""One closed, manifold, outward part of genus 0 from a damaged mesh.

How far a repair moved the surface, outward and inward, and what it left out.

A mesh under repair, with what was done to it.

What keeps a mesh from being one closed genus-0 part, each with its place.

Seams: corners of neighbouring faces that are not one vertex, as in STL files, are merged where they are.

Only vertices on open edges are merged, within the smallest tolerance that leaves the fewest open edges, so that
what is closed stays apart however near it is.

Components of a mesh, face by face across edges of two faces: the part, and what lies beside and inside it.

Where components touch at a vertex or an edge only, each is taken by itself: the rest keeps its vertices to the
bit. What touches along faces is told apart by `healing.junctions`.

Junctions: edges at which more than two faces meet, resolved by the cells into which the faces part space.

The part is the largest bounded cell, what it encloses, and cells behind a wall in it; its surface is where faces lie
between it and the rest. Debris that shares faces with it, walls and faces that stick out go; the other faces keep
their vertices to the bit. The cells are exact (Zhou et al. 2016), but mean nothing on a surface that is open elsewhere
or cuts itself.

Cleaning a mesh: duplicates, fins, non-manifold places, orientation, holes, in the order that works.

Large meshes with fewer faces: quadric edge collapse (Garland and Heckbert 1997), by MeshLab, measured.

The later stages need memory and time for every face, and gain nothing from faces that are much smaller than
the deviation of the surface that is fitted (0.08 mm).

Repair: make one closed, manifold, outward, genus-0 part of a mesh, and say what was changed.

Seams are merged, debris and inner shells left out, where they are: the rest keeps its vertices to the bit. Then
three stages, each tried only where the one before left faults: cleaning in the order that worked (duplicates,
null faces, non-manifold edges, reorient, **then** close holes); the outside of a surface that cuts itself (an
exact union, Zhou et al. 2016: it keeps every visible face where it is); and last a new skin shrunk round the
cleaned part (alpha wrap, Portaneri et al. 2022). What comes out is checked and measured against what came in;
a surface that moved by more than `LARGEST_DEVIATION` of the diagonal is refused. Handles are never cut, parts
never chosen or fused: that is for a person to decide.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int, Int32, Int64
from numpy import ndarray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from bonecam.arrays import dots, lengths, unit
from bonecam.errors import MeshError, counted, place_name
from bonecam.mesh.distance import exact_closest, hausdorff
from bonecam.mesh.meshlab import from_meshset, meshlab, to_meshset
from bonecam.mesh.solids import edge_names, edges_of, genus, half_edges, pieces_of, repeats_corner, self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces, probes, side_by_side
from bonecam.progress import Progress, report, silent

ASIDE = 1e-4
"""How far beside a face its two sides are looked at, as a share of the diagonal."""
NOT_MOVED = 1e-9
"""Distances up to this are rounding, mm."""
FIRST_LOOKED_AT = 1000
"""Of so many farthest points the side is looked at first, of twice as many then, until both sides are met."""


@dataclass(frozen=True, eq=False)
class SurfaceMovement:
    """Largest distances, mm, from the old surface to the new one: `outward` of old points that lie in the new solid
    (something was added over them), `inward` of those outside it; `place` is the point of the larger."""

    outward: float
    inward: float
    place: Float[ndarray, "3"]

    @property
    def largest(self) -> float:
        """The larger of both, mm."""
        return max(self.outward, self.inward)


def surface_moves(before: TriangleMesh, after: TriangleMesh, solid: TriangleMesh | None = None) -> SurfaceMovement:
    """How far the corners and middles of the old faces are from the new surface.

    Old faces with material on both sides, as the closed `solid` tells where it is given, lie inside another part of
    the surface: they are no outside and do not count.
    """
    points = probes(before)
    if solid is not None:
        # corners and middles of the faces that have its material on one side at most there
        corners = before.vertices[before.faces]
        middles = corners.mean(1, keepdims=True)
        places = np.concatenate([corners, middles], axis=1)
        aside = unit(before.face_vectors)[:, None] * before.diagonal * ASIDE
        inset = places + ASIDE * (middles - places)
        covered = [winding_numbers(solid, (inset + side * aside).reshape(-1, 3)) > 0.5 for side in (1, -1)]
        points = places.reshape(-1, 3)[~(covered[0] & covered[1])]
    distances = np.linalg.norm(exact_closest(after, points)[0] - points, axis=1)
    order = np.argsort(-distances, kind="stable")
    farthest: dict[bool, float] = {}
    start = 0
    count = FIRST_LOOKED_AT
    while len(farthest) < 2 and start < len(order) and distances[order[start]] > NOT_MOVED:
        some = order[start : start + count]
        inside = np.abs(winding_numbers(after, points[some])) > 0.5
        for side in (True, False):
            if side not in farthest and (inside == side).any():
                farthest[side] = float(distances[some[np.argmax(inside == side)]])
        start += count
        count *= 2
    return SurfaceMovement(
        farthest.get(True, 0.0), farthest.get(False, 0.0), points[order[0]] if len(order) else np.zeros(3)
    )


def winding_numbers(mesh: TriangleMesh, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """How often the mesh goes round each point: about 1 inside, 0 outside, -1 inside a mesh that is inside out.

    The mesh need not be closed (Barill et al. 2018).
    """
    import igl

    vertices = np.array(mesh.vertices)
    return np.asarray(igl.fast_winding_number(vertices, mesh.faces.astype(np.int64), points)).ravel()


def without(mesh: TriangleMesh, left_out: Sequence[TriangleMesh], kept: TriangleMesh) -> TriangleMesh:
    """The mesh as it was before a repair, without the faces that are nearer to what was left out than to what was
    kept."""
    if not left_out:
        return mesh
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    away, apart = (lengths(exact_closest(other, middles)[0] - middles) for other in (kept, side_by_side(left_out)))
    return keep_faces(mesh, away <= apart + NOT_MOVED)


REPORTED = 5e-4
"""Least movement of the surface that a sentence has, mm: what its three decimals show."""


@dataclass(frozen=True)
class Repair:
    """One change of a mesh in a sentence, and how far it moved the surface, mm: `outward` what it added on the
    surface, `inward` what it took off; `hole` is the width of the widest hole that it closed, mm. Pieces that it left
    out, debris and inner shells, are no part of the surface. `guessed` mm2 of surface are not as they were given: those
    that close holes, pieces outside the part that were dropped, and what lies off the surface that was there."""

    change: str
    outward: float = 0.0
    inward: float = 0.0
    left_out: TriangleMesh | None = None
    hole: float = 0.0
    guessed: float = 0.0

    @classmethod
    def between(
        cls, change: str, before: TriangleMesh, after: TriangleMesh, solid: TriangleMesh | None = None
    ) -> "Repair":
        """The change that led from one mesh to another, measured as `surface_moves` does."""
        moves = surface_moves(before, after, solid)
        return cls(change, moves.outward, moves.inward)

    def __str__(self) -> str:
        if max(self.outward, self.inward) < REPORTED:
            return self.change
        return f"{self.change}; moved the surface {self.outward:.3f} mm outward, {self.inward:.3f} mm inward at most"

    @property
    def report(self) -> dict[str, str | float]:
        """The change as the report has it."""
        moved = {"outward_mm": round(self.outward, 6), "inward_mm": round(self.inward, 6)}
        return {"change": self.change, **moved, "guessed_mm2": round(self.guessed, 6)}


@dataclass(frozen=True, eq=False)
class RepairState:
    """A mesh, and the changes that led to it."""

    mesh: TriangleMesh
    done: tuple[Repair, ...] = ()

    def then(self, mesh: TriangleMesh, *changes: str) -> "RepairState":
        """The next state: the changed mesh, and sentences of changes that keep the surface where it is."""
        return RepairState(mesh, self.done + tuple(map(Repair, changes)))

    def keep(
        self, kept: Bool[ndarray, " m"], change: str, *, outside: Bool[ndarray, " m"] | bool = False
    ) -> "RepairState":
        """The next state with the `kept` faces only; the others, all or some of them `outside` the part, are left
        out."""
        area = float(lengths(self.mesh.face_vectors[~kept & outside]).sum() / 2)
        dropped = Repair(change, left_out=keep_faces(self.mesh, ~kept), guessed=area)
        return RepairState(keep_faces(self.mesh, kept), (*self.done, dropped))

    def moved(
        self, mesh: TriangleMesh, change: str, solid: TriangleMesh | None = None, off: float = np.inf
    ) -> "RepairState":
        """The next state after a change that moves the surface: it is measured as `surface_moves` does. What lies
        farther `off` (mm) than a change of this kind does everywhere is guessed."""
        repair = Repair.between(change, self.mesh, mesh, solid)
        middles = mesh.vertices[mesh.faces].mean(axis=1)
        away = lengths(exact_closest(self.mesh, middles)[0] - middles) > off if np.isfinite(off) else False
        guessed = float((lengths(mesh.face_vectors) / 2 * away).sum())
        return RepairState(mesh, (*self.done, replace(repair, guessed=guessed)))

    @property
    def changes(self) -> str:
        """All that was done, in one line."""
        return "; ".join(map(str, self.done))


def apply_filter(state: RepairState, name: str, elements: str = "", sentence: str = "", noun: str = "") -> RepairState:
    """`state` after one MeshLab filter.

    The sentence is added where the number of `elements` (faces or vertices) changed.
    """
    meshset = to_meshset(state.mesh)
    getattr(meshset, name)()
    mesh = from_meshset(meshset)
    changed = abs(len(getattr(mesh, elements)) - len(getattr(state.mesh, elements))) if elements else 0
    return state.then(mesh, *((sentence.format(counted(changed, noun)),) if changed else ()))


@dataclass(frozen=True, eq=False)
class Fault:
    """One thing wrong: its kind (one word), a phrase with the count, and where it is seen first (mm)."""

    kind: str
    what: str
    place: Float[ndarray, "3"]

    def __str__(self) -> str:
        return f"{self.what} near ({', '.join(f'{x:.2f}' for x in self.place)})"


def faults_of(mesh: TriangleMesh) -> tuple[Fault, ...]:
    """All that is wrong: null, open, nonmanifold, mixed, parts, inward, genus, intersecting; nothing for a
    part that can be machined.

    Genus and orientation are looked at only where the mesh is closed and manifold: they mean nothing before.
    """
    faults = []
    null = np.flatnonzero(~mesh.face_vectors.any(axis=1))
    if len(null):
        faults.append(Fault("null", f"{len(null)} faces without area", _place_of_face(mesh, null[0])))
    edges, counts = edges_of(mesh)
    unlike = []
    for kind, phrase, wrong in (
        ("open", "open edges", counts == 1),
        ("nonmanifold", "edges with more than two faces", counts > 2),
    ):
        if wrong.any():
            unlike.append(Fault(kind, f"{wrong.sum()} {phrase}", mesh.vertices[edges[np.argmax(wrong)]].mean(0)))
    halves = half_edges(mesh).reshape(-1, 2)
    _, first, same = np.unique(halves, axis=0, return_index=True, return_counts=True)
    if not unlike and (same > 1).any():
        what = f"{(same > 1).sum()} edges between faces that are oriented against each other"
        unlike.append(Fault("mixed", what, mesh.vertices[halves[first[np.argmax(same)], 0]]))
    faults += unlike or ([] if faults else _shape_faults(mesh))
    cut = self_intersections(mesh)
    if len(cut):
        faults.append(Fault("intersecting", f"{len(cut)} faces that cut others", _place_of_face(mesh, cut[0])))
    return tuple(faults)


def _shape_faults(mesh: TriangleMesh) -> list[Fault]:
    """What is wrong with the shape of a closed, manifold mesh: the first of several."""
    import igl

    pieces = pieces_of(mesh)
    whole = igl.is_vertex_manifold(mesh.faces.astype(np.int64))
    pinched = np.setdiff1d(np.flatnonzero(~whole), np.setdiff1d(np.arange(len(whole)), mesh.faces))
    if len(pinched):
        return [Fault("pinched", f"{len(pinched)} vertices where two surfaces touch", mesh.vertices[pinched[0]])]
    if pieces.max() > 0:
        return [Fault("parts", f"{pieces.max() + 1} separate parts", _place_of_face(mesh, np.argmax(pieces)))]
    if not mesh.volume > 0:
        return [Fault("inward", f"an enclosed volume of {mesh.volume:.3g} mm^3", mesh.vertices[mesh.faces[0, 0]])]
    handles = genus(mesh)
    centre = mesh.vertices[np.unique(mesh.faces)].mean(0)
    what = f"{handles} handle{'s' if handles > 1 else ''} (genus {handles})"
    return [Fault("genus", what, centre)] if handles else []


def _place_of_face(mesh: TriangleMesh, face: np.integer) -> Float[ndarray, "3"]:
    return np.asarray(mesh.vertices[mesh.faces[face]].mean(0))


def holes_of(mesh: TriangleMesh) -> list[Int[ndarray, " k"]]:
    """The vertices on the rim of each hole: open edges that hang together."""
    edges, counts = edges_of(mesh)
    rim = edges[counts == 1]
    if not len(rim):
        return []
    names, compact = np.unique(rim, return_inverse=True)
    ends = compact.reshape(-1, 2)
    graph = sp.coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(names), len(names)))
    count, labels = connected_components(graph, directed=False)
    return [names[labels == k] for k in range(count)]


TOLERANCES = (0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4)
"""Distances within which corners are merged, tried in this order, shares of the diagonal; the last is 3 um on a
phalanx, less than decimation may move."""
SHORTEST_EDGE_SHARE = 0.5
"""Largest tolerance as a share of the shortest edge."""
NO_EDGE = 1e-6
"""Edges up to this share of the diagonal are those of faces without area."""


def weld_seams(state: RepairState) -> RepairState:
    """The mesh with corners along open edges merged, where that leaves fewer of them; faces may then name a vertex
    twice. The sentence tells the largest distance."""
    mesh = state.mesh
    fewest = best = len(_open_edges(mesh))
    welded = mesh
    edges, _ = edges_of(mesh)
    sizes = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    limit = SHORTEST_EDGE_SHARE * sizes[sizes > NO_EDGE * mesh.diagonal].min(initial=np.inf)
    for tolerance in np.array(TOLERANCES) * mesh.diagonal if fewest else ():
        if tolerance > limit:
            break
        # The mesh whose faces name, for each vertex on an open edge, the first that is near it
        rim = np.unique(_open_edges(mesh))
        first = np.arange(len(mesh.vertices))
        first[rim] = rim[nearest_groups(mesh.vertices[rim], tolerance)]
        candidate = TriangleMesh(mesh.vertices, first[mesh.faces].astype(np.int32))
        left = len(_open_edges(candidate))
        if left < best:
            best, welded = left, candidate
        if not left:
            break
    if best == fewest:
        return state
    merged = len(np.unique(mesh.faces)) - len(np.unique(welded.faces))
    moved: Float[ndarray, "m 3 3"] = mesh.vertices[mesh.faces] - mesh.vertices[welded.faces]
    distance = float(np.linalg.norm(moved, axis=2).max())
    message = f"merged {counted(merged, 'duplicate vertex')} along open edges"
    after = keep_faces(welded)
    return state.moved(after, f"{message}, at most {distance:.2g} mm apart") if distance else state.then(after, message)


def _at_rim(mesh: TriangleMesh) -> Bool[ndarray, " m"]:
    """Which faces have an open edge."""
    edges, counts = edges_of(mesh)
    sides, rim = (edge_names(each, len(mesh.vertices)) for each in (half_edges(mesh), edges[counts == 1]))
    return np.asarray(np.isin(sides, rim).any(axis=1))


def _open_edges(mesh: TriangleMesh) -> Int32[ndarray, "e 2"]:
    edges, counts = edges_of(mesh)
    return edges[(counts == 1) & (edges[:, 0] != edges[:, 1])]


def nearest_groups(points: Float[ndarray, "n 3"], tolerance: float) -> Int64[ndarray, " n"]:
    """For each point the first point of its group; points within `tolerance` of each other are of one group."""
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    graph = sp.coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(points), len(points)))
    groups = connected_components(graph, directed=False)[1]
    _, first, index = np.unique(groups, return_index=True, return_inverse=True)
    return np.asarray(first[index], dtype=np.int64)


DEBRIS = 0.05
"""Loose pieces up to this share of the part's area are dropped."""


def components_of(mesh: TriangleMesh) -> Int[ndarray, " m"]:
    """The component each face belongs to, from 0.

    Faces that share an edge of two faces are of one patch. A patch is a component, but patches that end at an edge of
    more faces are one with the others that end there.
    """
    import igl

    patches = np.asarray(igl.extract_manifold_patches(mesh.faces.astype(np.int64))[1]).ravel()
    sides = edge_names(half_edges(mesh), len(mesh.vertices)).ravel()
    _, edge_of, counts = np.unique(sides, return_inverse=True, return_counts=True)
    shared = counts[edge_of] > 2
    own, faces = np.unique(np.column_stack([edge_of, np.repeat(patches, 3)])[shared], axis=0, return_counts=True)
    ends = own[faces == 1]
    met = np.flatnonzero(ends[1:, 0] == ends[:-1, 0])
    count = int(patches.max(initial=-1)) + 1
    graph = sp.coo_array((np.ones(len(met)), (ends[met, 1], ends[met + 1, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1][patches], dtype=np.int64)


def keep_part(state: RepairState) -> RepairState:
    """The largest component, where the others are debris or inner shells; MeshError where they are parts."""
    mesh = state.mesh
    component_of = components_of(mesh)
    areas = np.bincount(component_of, np.linalg.norm(mesh.face_vectors, axis=1) / 2)
    if len(areas) == 1:
        return state
    # The component that the largest lies inside of, else itself: a folded inner shell may have more area
    largest = int(np.argmax(areas))
    order = np.argsort(component_of, kind="stable")
    starts = np.searchsorted(component_of[order], np.arange(len(areas)))
    ends = mesh.vertices[mesh.faces[order]]
    low, high = (extreme.reduceat(extreme.reduce(ends, axis=1), starts) for extreme in (np.minimum, np.maximum))
    round_it = np.flatnonzero(((low < low[largest]) & (high > high[largest])).all(axis=1))
    holding = [k for k in round_it if _shares_inside(mesh, component_of, int(k))[largest] == 1]
    part = int(max(holding, key=lambda k: np.prod(high[k] - low[k]), default=largest))
    corners = mesh.vertices - mesh.vertices.mean(axis=0)
    volumes = np.asarray(np.bincount(component_of, np.linalg.det(corners[mesh.faces]) / 6))
    # Which components have no open edge
    closed = np.ones(len(areas), dtype=bool)
    closed[component_of[_at_rim(mesh)]] = False
    inside = _shares_inside(mesh, component_of, part)
    inner = (inside == 1) | (closed & (inside > 0.5) & (volumes * volumes[part] < 0))
    loose = ~inner
    loose[part] = False
    if areas[loose].max(initial=0.0) > DEBRIS * areas[part]:
        areas = np.where(inner, 0.0, areas)
        parts = int((areas > 0).sum())
        place = _middle(mesh, component_of == np.argsort(-areas, kind="stable")[1])
        what = f"the mesh has {parts} separate parts, the second largest near {place_name(place)} mm"
        remedy = "save the one to machine by itself"
        if (edges_of(mesh)[1] == 1).any():
            remedy += ", or merge close vertices in a mesh editor where the two are one"
        raise MeshError(f"{what}: {remedy}", parts=parts, areas=areas, place=place)
    if loose.any():
        share = areas[loose].max() / areas[part]
        place = _middle(mesh, component_of == np.argmax(np.where(loose, areas, 0.0)))
        which = "the largest " if loose.sum() > 1 else ""
        pieces = f"dropped {counted(int(loose.sum()), 'loose piece')} of at most {share:.2%} of the part's area"
        state = state.keep(~loose[component_of], f"{pieces}, {which}near {place_name(place)}", outside=True)
    if inner.any():
        enclosed = np.where(inner, closed * np.abs(volumes), -1.0)
        shells = _inner_shells(mesh, component_of, enclosed, inside)
        state = state.keep(~inner[component_of[~loose[component_of]]], shells)
    return state


def _shares_inside(mesh: TriangleMesh, component_of: Int[ndarray, " m"], outer: int) -> Float[ndarray, " c"]:
    """The share of the faces of each component whose middles lie inside the component `outer`; 0 for itself."""
    others = component_of != outer
    middles = mesh.vertices[mesh.faces[others]].mean(axis=1)
    inside = np.abs(winding_numbers(keep_faces(mesh, ~others), middles)) > 0.5
    count = int(component_of.max()) + 1
    return np.bincount(component_of[others], inside, count) / np.bincount(component_of, minlength=count)


def _inner_shells(
    mesh: TriangleMesh, component_of: Int[ndarray, " m"], volumes: Float[ndarray, " c"], inside: Float[ndarray, " c"]
) -> str:
    """The sentence on the inner shells, whose `volumes` are not negative: how many were left out, their volume and
    place, and where one comes out of the part."""
    inner = volumes >= 0
    largest = int(np.argmax(volumes))
    near = f"near {place_name(_middle(mesh, component_of == largest))}"
    count = int(inner.sum())
    if not volumes[largest]:
        message = f"dropped {counted(count, 'open sheet')} inside the part, {'the largest ' if count > 1 else ''}{near}"
    elif count == 1:
        message = f"filled an inner shell (cavity) of {volumes[largest]:.3g} mm3 {near}"
    else:
        each = f"{volumes[inner].sum():.3g} mm3 in all, the largest of {volumes[largest]:.3g} mm3"
        message = f"filled {count} inner shells (cavities), {each} {near}"
    through = int((inner & (inside < 1)).sum())
    if through:
        what = "it comes" if count == 1 else f"{through} of them {'comes' if through == 1 else 'come'}"
        message += f"; {what} out through the surface"
    return message


def _middle(mesh: TriangleMesh, faces: Bool[ndarray, " m"]) -> Float[ndarray, "3"]:
    return np.asarray(mesh.vertices[mesh.faces[faces]].mean(axis=(0, 1)))


SMOOTH = float(np.cos(np.radians(25.0)))
"""A surface that goes on below a cell, with a turn of less than this at its rim, has no wall there: neighbouring faces
of the 558 of a coarse talus turn less."""


def resolve_junctions(state: RepairState) -> RepairState:
    """The surface of the part among faces that meet at edges of more than two; the mesh as it is where there are none,
    or the cells of its faces bound no closed surface."""
    import igl.copyleft.cgal as cgal

    mesh = state.mesh
    if not (edges_of(mesh)[1] > 2).any() or len(self_intersections(mesh)):
        return state
    # The cells in front and at the back of each face; 0 is the outside. An open edge leads from the one to the other
    count, sides = cgal.extract_cells(np.array(mesh.vertices), mesh.faces.astype(np.int64))
    ends = sides[_at_rim(mesh)].T
    graph = sp.coo_array((np.ones(ends.shape[1]), tuple(ends)), shape=(count, count))
    cells: Int[ndarray, "m 2"] = connected_components(graph, directed=False)[1][sides].astype(np.int64)
    part = _part_cells(mesh, cells)
    on_front, on_back = part[cells].T
    surface = on_front != on_back
    inward = (on_front & surface).sum() > surface.sum() / 2  # a mesh that is inside out stays so here
    turned = (on_back if inward else on_front) & surface
    faces = np.where(turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    after = keep_faces(TriangleMesh(mesh.vertices, faces), surface)
    # Whether a cell that is not of the part is no debris
    areas = np.linalg.norm(mesh.face_vectors, axis=1) / 2
    front, back = (np.bincount(side, areas, len(part)) for side in cells.T)
    most = (front + back)[1:][~part[1:]].max(initial=0.0)
    others = most > DEBRIS * areas[part[cells].any(axis=1)].sum()
    if not surface.any() or (edges_of(after)[1] == 1).any() or others:
        return state
    if not surface.all():
        outside = ~part[cells].all(axis=1)
        # What the faces are that are not of the surface of the part: those of debris, walls, faces that stick out
        in_debris = ~part[cells] & (cells > 0)
        of_debris = in_debris.any(axis=1) & ~surface
        inside = part[cells].all(axis=1)
        sticking_out = (cells == 0).all(axis=1)
        kinds = {
            f"dropped {counted(len(np.unique(cells[in_debris])), 'piece')} on faces of the part": of_debris,
            f"removed {counted(int(inside.sum()), 'face')} inside the part": inside,
            f"removed {counted(int(sticking_out.sum()), 'face')} that stuck out": sticking_out,
        }
        told = [f"{what} near {place_name(_middle(mesh, some))}" for what, some in kinds.items() if some.any()]
        state = state.keep(surface, ", ".join(told), outside=outside)
    return state.then(after, *([f"turned {counted(int(turned.sum()), 'face')} round"] if turned.any() else []))


def _part_cells(mesh: TriangleMesh, cells: Int[ndarray, "m 2"]) -> Bool[ndarray, " c"]:
    """Which cells are of the part."""
    count = int(cells.max()) + 1
    front, back = cells.T
    corners = mesh.vertices - mesh.vertices.mean(axis=0)
    signed = np.linalg.det(corners[mesh.faces])
    volumes = np.bincount(back, signed, count) - np.bincount(front, signed, count)
    part = np.zeros(count, dtype=bool)
    largest = int(np.argmax(np.where(np.arange(count) > 0, volumes, 0.0)))
    if largest == 0:
        return part
    aside = (cells != largest).all(axis=1)
    graph = sp.coo_array((np.ones(int(aside.sum())), (front[aside], back[aside])), shape=(count, count))
    around = connected_components(graph, directed=False)[1]
    part |= around != around[0]
    part[largest] = True
    grown = True
    while grown:
        behind = [cell for cell in np.flatnonzero(~part)[1:] if _is_behind_wall(mesh, cells, part, int(cell))]
        part[behind] = True
        grown = bool(behind)
    return part


def _is_behind_wall(mesh: TriangleMesh, cells: Int[ndarray, "m 2"], part: Bool[ndarray, " c"], cell: int) -> bool:
    """Whether a cell is a piece of the part behind a wall, not debris upon it: it is no smaller than parts are, or the
    outer surface goes on over it more smoothly than below it, where it would turn sharply."""
    on_front, on_back = part[cells].T
    of_part = on_front != on_back
    of_cell = (cells == cell).any(axis=1)
    shared = of_part & of_cell
    if not shared.any():
        return False
    areas = np.linalg.norm(mesh.face_vectors, axis=1) / 2
    if areas[of_cell].sum() > DEBRIS * areas[of_part].sum():
        return True
    outward = np.where(on_back | (~of_part & (cells[:, 1] == cell)), 1.0, -1.0)[:, None] * unit(mesh.face_vectors)
    # The normal of one face of each kind at each of their edges
    sides = np.sort(half_edges(mesh), axis=2)
    beside, below, over = (
        {(int(a), int(b)): normal for trio, normal in zip(sides[faces], outward[faces], strict=True) for a, b in trio}
        for faces in (of_part & ~shared, shared, of_cell & ~shared)
    )
    rim = sorted(beside.keys() & below.keys() & over.keys())
    if not rim:
        return False
    along, under, above = (np.array([normals[edge] for edge in rim]) for normals in (beside, below, over))
    without = float(dots(along, under).mean())
    return without < SMOOTH and without < float(dots(along, above).mean())


WIDEST_HOLE = 0.5
"""Widest hole that is closed, as a share of the diagonal."""
CUTTING = (
    ("meshing_repair_non_manifold_edges", "faces", "removed {} at edges with more than two faces", "face"),
    ("meshing_repair_non_manifold_vertices", "vertices", "split {} where surfaces touch", "vertex"),
)


INSIDE_OUT = (
    "turned the whole surface outward: it faced inward, as mirror images do; check the scanner's axes "
    "(mesh.mirror turns one back)"
)
"""What is told of a mesh that is inside out."""


def drop_unused(state: RepairState) -> RepairState:
    """The mesh without vertices of no face, which would widen its bounds, faces that name a vertex twice, and faces
    that stand there already: with the same vertices, or with others at the same places, the same way round."""
    mesh = state.mesh
    strays = len(mesh.vertices) - len(np.unique(mesh.faces))
    null = repeats_corner(mesh.faces)
    # Which faces repeat an earlier one
    place_of = np.unique(mesh.vertices + 0.0, axis=0, return_inverse=True)[1].ravel()
    at = place_of[mesh.faces]
    from_lowest = (np.argmin(at, axis=1)[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(at, from_lowest, axis=1)
    duplicate = ~null & (_repeated(np.sort(mesh.faces, axis=1)) | _repeated(turned))
    if not (strays or null.any() or duplicate.any()):
        return state
    counts = {
        "removed {} of no face": (strays, "vertex"),
        "removed {} without area": (int(null.sum()), "face"),
        "removed {}": (int(duplicate.sum()), "duplicate face"),
    }
    reported = (text.format(counted(number, noun)) for text, (number, noun) in counts.items() if number)
    return state.then(keep_faces(mesh, ~(null | duplicate)), *reported)


def _repeated(trios: Int[ndarray, "m 3"]) -> Bool[ndarray, " m"]:
    """Which rows repeat an earlier one."""
    order = np.lexsort(trios.T)
    repeats = np.zeros(len(trios), dtype=bool)
    repeats[order[1:]] = (trios[order[1:]] == trios[order[:-1]]).all(axis=1)
    return repeats


def drop_fins(state: RepairState) -> RepairState:
    """The mesh without faces that stick out from an edge of three faces and end in the open.

    (MeshLab would remove the smallest face of the edge instead.)
    """
    edges, counts = edges_of(state.mesh)
    names, sides = (edge_names(each, len(state.mesh.vertices)) for each in (edges, half_edges(state.mesh)))
    face_counts = counts[np.searchsorted(names, sides)]
    fins = (face_counts == 1).any(1) & (face_counts > 2).any(1)
    count = int(fins.sum())
    if not count:
        return state
    return state.keep(
        ~fins, f"removed {counted(count, 'face')} that {'stick' if count > 1 else 'sticks'} out", outside=True
    )


def close_holes(state: RepairState) -> RepairState:
    """Holes closed; MeshError where one is wider than WIDEST_HOLE of the diagonal.

    One of three edges gets back the only face that it can have: the state tells neither width nor area of such a hole.
    """
    holes = holes_of(state.mesh)
    if not holes:
        return state
    widths = [float(np.linalg.norm(np.ptp(state.mesh.vertices[rim], axis=0))) for rim in holes]
    widest = int(np.argmax(widths))
    if widths[widest] > WIDEST_HOLE * state.mesh.diagonal:
        place = state.mesh.vertices[holes[widest]].mean(0)
        what = f"the mesh is an open sheet: a hole {widths[widest]:.1f} mm wide near {place_name(place)}"
        remedy = "give a closed solid, or its surface (rows of points, STEP, IGES, .tspline) to `bonecam finish`"
        raise MeshError(f"{what}: {remedy}", place=place, width=widths[widest], tried=state.done)
    meshset = to_meshset(state.mesh)
    meshset.meshing_close_holes(maxholesize=len(state.mesh.faces) + 3, selfintersection=False)
    after = from_meshset(meshset)
    closed = len(holes) - len(holes_of(after))
    added = len(after.faces) - len(state.mesh.faces)
    which = f"{closed} of {counted(len(holes), 'hole')}" if closed < len(holes) else counted(closed, "hole")
    widest_text = f"{'the widest ' if len(holes) > 1 else ''}{widths[widest]:.2f} mm across"
    near = f"near {place_name(state.mesh.vertices[holes[widest]].mean(0))}"
    message = f"closed {which} with {counted(added, 'face')}, {widest_text} {near}"
    guessed = max((width for width, rim in zip(widths, holes) if len(rim) > 3), default=0.0)
    alone = np.array([rim for rim in holes if len(rim) == 3], dtype=np.int32).reshape(-1, 3)
    area = after.area - state.mesh.area - TriangleMesh(state.mesh.vertices, alone).area
    return RepairState(after, (*state.done, Repair(message, hole=guessed, guessed=max(area, 0.0))))


MOST_FACES = 50_000
"""A mesh of more faces is decimated to so many, 0.0025 mm apart on a phalanx of
28 mm with 571,904 faces."""
DECIMATION_DEVIATION = 0.008
"""Largest distance between the mesh before and after, either way, mm: a tenth of the fit's default tolerance."""
TRIES = 2
"""Numbers of faces that are tried: each time twice as many."""


def decimate(
    mesh: TriangleMesh, most: int = MOST_FACES, *, progress: Progress = silent
) -> tuple[TriangleMesh, tuple[Repair, ...]]:
    """The mesh (mm) with at most `most` faces, its seams merged before, and what was changed; a mesh that has no more
    comes back as it is.

    Twice as many where fewer move the surface by more than LARGEST_DEVIATION, MeshError where that moves it
    too.
    """
    if len(mesh.faces) <= most:
        return mesh, ()
    state = drop_unused(weld_seams(RepairState(mesh)))
    deviation = np.inf
    for k in range(TRIES):
        target = most * 2**k
        report(progress, k / TRIES, f"decimating {len(mesh.faces)} faces to {target}")
        # The mesh with edges collapsed until `target` faces are left
        meshset = to_meshset(state.mesh)
        meshset.meshing_decimation_quadric_edge_collapse(
            targetfacenum=target, preservenormal=True, preserveboundary=True, preservetopology=True
        )
        fewer = from_meshset(meshset)
        if not 0 < len(fewer.faces) <= target:
            continue
        deviation = max(hausdorff(mesh, fewer))
        if deviation <= DECIMATION_DEVIATION:
            message = f"decimated {len(mesh.faces)} faces to {len(fewer.faces)}, {deviation:.4f} mm apart at most"
            return fewer, state.moved(fewer, message).done
    moved = f"moves the surface by {deviation:.3f} mm" if np.isfinite(deviation) else "is not possible"
    raise MeshError(
        f"the mesh has {len(mesh.faces)} faces, and decimating it to {most * 2 ** (TRIES - 1)} {moved}: smooth "
        f"it, or decimate it to {most} in a mesh editor",
        faces=len(mesh.faces),
        deviation=deviation,
    )


LARGEST_DEVIATION = 0.02
"""Largest distance between the mesh before and after, as a share of the diagonal."""
FLAT = 1e-3
"""Least thickness of a solid, as a share of the diagonal."""
_REMEDIES = {
    "genus": "fill the opening in a mesh editor",
    "parts": "save the one to machine by itself",
    "open": "close it in a mesh editor",
}


def repair(mesh: TriangleMesh, *, progress: Progress = silent) -> tuple[TriangleMesh, tuple[Repair, ...]]:
    """One closed, manifold, outward part of genus 0 without self-intersections, and what was changed.

    MeshError names what is wrong, where (mm), what was tried, and the remedy; its evidence has `place` and
    `tried`.
    """
    report(progress, 0.0, "looking for faults")
    _refuse_flat(mesh)
    kept = keep_part(drop_fins(drop_unused(weld_seams(RepairState(mesh)))))
    faults = faults_of(kept.mesh)
    if not faults:
        return kept.mesh, kept.done
    _refuse_handles(faults, kept)

    areal = apply_filter(kept, "meshing_remove_null_faces", "faces", "removed {} without area", "face")
    tidied = resolve_junctions(drop_fins(areal))
    # Non-manifold places cut apart, then faces oriented alike, then holes closed, then all turned outwards
    cleaned = tidied
    for cutting in CUTTING:
        cleaned = apply_filter(cleaned, *cutting)
    cut = keep_part(cleaned)
    # All faces of a piece oriented alike
    after = apply_filter(cut, "meshing_re_orient_faces_coherently").mesh
    turned = int((dots(after.face_vectors, cut.mesh.face_vectors) < 0).sum())
    turned = min(turned, len(after.faces) - turned)
    cleaned = close_holes(cut.then(after, *((f"turned {counted(turned, 'face')} round",) if turned else ())))
    if cleaned.mesh.volume < 0:
        cleaned = cleaned.then(TriangleMesh(cleaned.mesh.vertices, cleaned.mesh.faces[:, ::-1]), INSIDE_OUT)
    trouble = _not_repaired(faults, kept)
    for k, stage in enumerate((None, unite, wrap)):
        report(progress, (k + 1) / 4, f"repairing: {faults[0]}")
        state = stage(cleaned) if stage else cleaned  # which may be good enough
        remaining = faults_of(state.mesh)
        if remaining:
            _refuse_handles(remaining, state)
            trouble = _not_repaired(remaining, state)
            continue
        moves = surface_moves(tidied.mesh, state.mesh, cleaned.mesh)
        if moves.largest <= LARGEST_DEVIATION * kept.mesh.diagonal:
            return state.mesh, state.done
        what = (
            f"the repair ({state.changes}) moves the surface by {moves.largest:.2f} mm near {place_name(moves.place)}"
        )
        trouble = MeshError(f"{what}: mend the mesh there in a mesh editor", place=moves.place, tried=state.done)
    raise trouble


def _refuse_handles(faults: tuple[Fault, ...], state: RepairState) -> None:
    """MeshError where a mesh has no faults but handles (and self-intersections): no stage removes handles."""
    if any(fault.kind == "genus" for fault in faults) and {fault.kind for fault in faults} <= {"genus", "intersecting"}:
        raise _not_repaired(tuple(fault for fault in faults if fault.kind == "genus"), state)


def _not_repaired(faults: tuple[Fault, ...], state: RepairState) -> MeshError:
    tried = f" after repair ({state.changes})" if state.done else ""
    remedy = next(
        (_REMEDIES[fault.kind] for fault in faults if fault.kind in _REMEDIES), "mend it there in a mesh editor"
    )
    message = f"the mesh has {', '.join(map(str, faults))}{tried}: {remedy}"
    return MeshError(message, faults=faults, place=faults[0].place, tried=state.done)


def _refuse_flat(mesh: TriangleMesh) -> None:
    if not len(mesh.faces):
        raise MeshError("the mesh has no faces: give a surface mesh")
    used = mesh.vertices[np.unique(mesh.faces)]
    size = float(np.linalg.norm(np.ptp(used, axis=0)))
    thickness = np.ptp(
        (used - used.mean(0)) @ np.linalg.svd(used - used.mean(0), full_matrices=False)[2].T, axis=0
    ).min()
    if thickness < FLAT * size:
        faces = "one triangle" if len(mesh.faces) == 1 else f"{len(mesh.faces)} triangles"
        what = (
            f"the mesh ({faces}) is flat: {round(float(thickness), 9):.3g} mm thick, {size:.3g} mm from "
            "corner to corner"
        )
        raise MeshError(f"{what}: give a solid part", thickness=float(thickness))


WRAP_ALPHA = 0.01
"""Radius of the ball that shrinks round the part, as a share of the diagonal."""
WRAP_OFFSET = 0.001
"""Distance from the part at which it stops, as a share of the diagonal."""
OFF = 3.0
"""So many times that distance from the old surface the new skin is a guess."""


def unite(state: RepairState) -> RepairState:
    """The outside of a surface that cuts itself: the exact boundary of what it encloses at least once (Zhou et al.
    2016); the mesh as it is where it encloses no volume.
    """
    import igl.copyleft.cgal as cgal

    try:
        vertices, faces, _ = cgal.mesh_boolean(
            np.array(state.mesh.vertices), state.mesh.faces.astype(np.int64), type_str="union"
        )
    except RuntimeError:
        return state
    after = TriangleMesh(vertices, np.asarray(faces, dtype=np.int32))
    if not len(after.faces):
        return state
    depth = np.linalg.norm(exact_closest(after, state.mesh.vertices)[0] - state.mesh.vertices, axis=1)
    cut = len(self_intersections(state.mesh))
    what = f"the outside of {counted(cut, 'face')} that cut each other" if cut else "the outside only"
    message = f"kept {what} (what lay up to {depth.max():.2f} mm inside is gone)"
    return keep_part(state.moved(after, message, state.mesh))


def wrap(state: RepairState) -> RepairState:
    """A new skin shrunk round the part (alpha wrap, Portaneri et al. 2022)."""
    size = state.mesh.diagonal
    pure = meshlab().PureValue
    meshset = to_meshset(state.mesh)
    shares = {"alpha": WRAP_ALPHA, "offset": WRAP_OFFSET}
    if "alpha" in meshset.filter_parameter_values("generate_alpha_wrap"):
        given = {name: pure(share * size) for name, share in shares.items()}
    else:  # MeshLab up to 2023.12
        given = {f"{name}_fraction": share for name, share in shares.items()}
    meshset.generate_alpha_wrap(**given)
    message = f"shrank a new skin round the part (ball {WRAP_ALPHA * size:.2f} mm, offset {WRAP_OFFSET * size:.3f} mm)"
    return state.moved(from_meshset(meshset), message, state.mesh, off=OFF * WRAP_OFFSET * size)
