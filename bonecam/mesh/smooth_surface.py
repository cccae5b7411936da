"""The area of a mesh about points on it.

On which side of facets points lie (Xu et al. 2013, Eq. 21 and Fig. 4).

The convex hull, closed in every case: CGAL's through libigl, whose predicates are exact. (Qhull's merged
facets may leave cracks.)

The steps that voxels leave on a mesh: their pitch, measured from its vertices, and a surface without them that stays
within half a voxel.

Steps are smoothed by steps that shrink and swell (Taubin 1995) on edges of one weight; after each pair every vertex
is held within half a pitch of where it was, as in constrained elastic surface nets (Gibson 1998). A point of a face
moves by a mean of what its corners move by, so that the largest move of a vertex bounds the distance between both
surfaces, either way.

How facets sample a smooth surface: how far they lie off it, and whether noise, voxels or true edges shaped them.

A surface that turns by the angle a across an edge, whose two faces are h high on average, is about an arc whose chord
is h: its sagitta, h a / 8, is how far the facets lie off the surface. Each edge counts by the area of its two faces.

Noise moves each vertex by itself: how far one stands out of the middle of its neighbours then tells nothing of how far
those stand out of theirs.

The surface of one label of a map: marching cubes between the voxels inside and outside, in mm and the map's space,
smoothed within half a voxel.

A smooth surface near the vertices of facets that are coarser, or rougher, than what is asked of them.

Noise and the steps of voxels are smoothed first, by steps that shrink and swell (Taubin 1995; `voxel_steps`). Then,
where facets are coarse: Loop's subdivision surface (Loop 1987), C2 but at irregular vertices, as fine facets. By itself
it shrinks: coarse bones lose 2 to 16 % of their volume. So each control point is moved once by what the surface misses
its vertex by, a relaxed first step of progressive interpolation (Cheng et al. 2009, "Loop subdivision surface based
progressive interpolation", JCST 24). Further steps come nearer to the vertices, and swing and cut themselves between
them. Where a surface leaves a vertex, the tip of a process say, farther than is allowed, only the control points of
such vertices make them. Where it cuts itself, as beside slivers of facets, the facets there are kept.
"""

from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from bonecam.arrays import angles_between, dots, lengths, unit
from bonecam.errors import MeshError, file_error, hundredths, place_name
from bonecam.job import MeshJob
from bonecam.mesh.distance import MeshDistance, barycentric, exact_closest
from bonecam.mesh.facets import vertex_normals
from bonecam.mesh.files.label_map import LabelMap, read_label_map
from bonecam.mesh.healing import MOST_FACES, Repair, surface_moves
from bonecam.mesh.meshlab import from_meshset, to_meshset
from bonecam.mesh.solids import half_edges, neighbour_middles, neighbours_of, self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh


def nearest_areas(mesh: TriangleMesh, points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
    """The area (mm^2) that each point stands for: that of the faces whose middles are nearer to it than to any other.

    They add up to the area of the mesh. ValueError without points.
    """
    if not len(points):
        raise ValueError("no point to share the area of the mesh among")
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    return np.bincount(KDTree(points).query(corners.mean(axis=1))[1], areas, len(points))


def heights_above(points: Float[ndarray, "k 3"], mesh: TriangleMesh) -> Float[ndarray, " k"]:
    """(p - q) . n for each point p, mm: q is the point of the mesh, open or closed, nearest to p, n the normal
    there, interpolated between the vertices. Positive above.

    Eq. 21 holds near the facets only: far out, the nearest point moves away from the contact.
    """
    nearest, faces = exact_closest(mesh, points)
    corners = mesh.faces[faces]
    shares = barycentric(mesh.vertices[corners], nearest)
    normals = unit(np.einsum("kc,kcd->kd", shares, vertex_normals(mesh)[corners]))
    return dots(points - nearest, normals)


def convex_hull(points: Float[ndarray, "n 3"]) -> TriangleMesh:
    """The closed outward mesh of the hull of points that lie in no common plane; points within the hull are
    left out."""
    import igl.copyleft.cgal as cgal

    corners, index = np.unique(cgal.convex_hull(np.array(points, dtype=np.float64)), return_inverse=True)
    return TriangleMesh(points[corners], index.reshape(-1, 3).astype(np.int32))


STEPS = 20
"""Pairs of steps: on a hand bone in voxels of 0.3 mm normals are then 7 degrees off, not 21, the mean distance is 0.028
mm, not 0.052, and the volume 0.2 % below; 40 leave 6 degrees and move the volume by 0.9 %."""
SHRINK = 0.5
SWELL = -0.53
"""Taubin's two factors, as MeshLab has them."""
HALF = 0.5
"""How far a vertex may move, in pitches."""
ALIKE = 1e-3
"""Gaps between planes of vertices are the same where they differ by less, as a share of the larger."""
MOST_OFF = 0.02
"""Share of the vertices that may lie off the planes."""


def step_pitch(mesh: TriangleMesh) -> Float[ndarray, "3"] | None:
    """The pitch (mm) along X, Y and Z of the voxels whose surface, by marching cubes or as cubes, a mesh is: its
    vertices lie in planes half a pitch or a pitch apart. None where they do not."""
    pitches = []
    for coordinates in mesh.vertices.T:
        size = float(np.ptp(coordinates))
        planes = np.sort(coordinates)
        gaps = np.diff(planes)
        gaps = gaps[gaps > ALIKE * size / 10]
        if len(gaps) < 3 or size == 0:
            return None
        least = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
        number = (coordinates - planes[0]) / least
        off = np.abs(number - np.round(number)) > 0.05
        if off.mean() > MOST_OFF:
            return None
        # Vertices of marching cubes lie halfway between voxels too
        odd = np.round(number[~off]).astype(int) % 2
        pitches.append(2 * least if min(odd.mean(), 1 - odd.mean()) > 0.05 else least)
    return np.array(pitches)


def without_steps(mesh: TriangleMesh, pitch: Float[ndarray, "3"]) -> tuple[TriangleMesh, float]:
    """A smooth surface near the surface of voxels of a `pitch` (mm), whose vertices move by half a voxel at most, and
    how far the farthest does, mm."""
    before = np.array(mesh.vertices)
    # The matrix (n, n) that takes vertices to the means of their neighbours; one without any stays
    sides = np.vstack([mesh.faces[:, [k, (k + 1) % 3]] for k in range(3)])
    start, end = np.unique(np.vstack([sides, sides[:, ::-1]]), axis=0).T
    alone = np.setdiff1d(np.arange(len(mesh.vertices)), start)
    start, end = np.r_[start, alone], np.r_[end, alone]
    weights = 1.0 / np.bincount(start, minlength=len(mesh.vertices))[start]
    means = coo_array((weights, (start, end)), shape=(len(mesh.vertices),) * 2).tocsr()
    points = before
    for _ in range(STEPS):
        for factor in (SHRINK, SWELL):
            points = points + factor * (means @ points - points)
        moved = (points - before) / pitch
        far = np.linalg.norm(moved, axis=1, keepdims=True) / HALF
        points = before + pitch * moved / np.maximum(far, 1.0)
    largest = float(np.linalg.norm(points - before, axis=1).max(initial=0.0))
    return TriangleMesh(points, mesh.faces), largest


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
        sizes = [] if self.pitch is None else [f"{size:.3g}" for size in self.pitch]
        pitch = f" (every {' x '.join(sizes)} mm)" if sizes else ""
        rough = f"steps of voxels{pitch}" if self.steps else "noise"
        also = f", {rough} of {self.bumps:.2g} mm" if self.steps or self.noise else ""
        return f"edges of {self.edge:.2g} mm with creases up to {np.degrees(self.crease):.0f} degrees{also}"

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
    # The RMS height (mm) of vertices over the middle of their neighbours, less its mean, and the correlation of the
    # heights of neighbours; 1 where all heights are equal
    start, end = half_edges(mesh).reshape(-1, 2).T
    heights = dots(vertex_normals(mesh), mesh.vertices - neighbour_middles(mesh))
    heights = heights - heights.mean()
    square = float((heights**2).mean())
    together = float((heights[start] * heights[end]).mean())
    bumps, coherence = float(np.sqrt(square)), together / square if square > 0 else 1.0
    # Whether faces follow a grid of voxels: in many planes, all along axes and diagonals
    signs = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    along = (normals @ unit(signs[signs.any(axis=1)]).T).max(axis=1) > np.cos(FLAT)
    face, side = np.nonzero(turns < FLAT)
    graph = coo_array((np.ones(len(face)), (face, across[face, side])), shape=(len(areas),) * 2)
    planes = connected_components(graph, directed=False)[0]
    steps = bool(planes > MOST_PLANES and areas[along].sum() > STEPPED * areas.sum())
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


MOST_VOXELS = 30_000_000
"""Most voxels of the box round a label: marching cubes takes 60 bytes for each."""


@dataclass(frozen=True, eq=False)
class LabelSurface:
    """The surface of a label, as voxels have it (`steps`), and smoothed (as `without_steps` does) where that was asked
    for."""

    map: LabelMap
    label: int
    cut: bool
    steps: TriangleMesh
    smoothed: tuple[TriangleMesh, float] | None

    @property
    def mesh(self) -> TriangleMesh:
        """The surface, smoothed if it was."""
        return (self.smoothed[0] if self.smoothed else self.steps).move(self.map.transform)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known of it."""
        size = " x ".join(f"{pitch:.3g}" for pitch in self.map.pitch)
        how = f"smoothed within {self.smoothed[1]:.3f} mm of them" if self.smoothed else "their steps kept as asked"
        description = f"label {self.label}, one of {len(self.map.counts)}, voxels of {size} mm, {how}"
        cut = "the label reaches the edge of its map: the scan ends there, and the part with it"
        return (description, cut) if self.cut else (description,)


def label_surface(file: Path, label: int, *, smooth: bool) -> LabelSurface:
    """The surface of a label of a file, or of its only label for 0. FileError names what is wrong."""
    import igl

    label_map = read_label_map(file)
    label = label_map.chosen(label)
    inside = label_map.labels == label
    spans = [np.flatnonzero(inside.any(axis=tuple({0, 1, 2} - {axis}))) for axis in range(3)]
    low, high = (np.array([span[end] for span in spans]) for end in (0, -1))
    if np.prod(high - low + 3) > MOST_VOXELS:
        what = f"label {label} spans {' x '.join(map(str, high - low + 1))} voxels, {MOST_VOXELS:,} are allowed"
        raise file_error(file, what, "resample the map")
    box = tuple(slice(a, b + 1) for a, b in zip(low, high))
    padded = np.pad(inside[box], 1)
    numbers = np.indices(padded.shape[::-1]).reshape(3, -1)[::-1].T  # x is the fastest
    nodes = np.ascontiguousarray((numbers + low - 1) * label_map.pitch)
    values = padded.transpose(2, 1, 0).ravel().astype(np.float64)
    vertices, faces = igl.marching_cubes(values, nodes, *padded.shape, 0.5)[:2]
    steps = TriangleMesh(vertices, faces.astype(np.int32))
    cut = bool((low == 0).any() or (high == np.array(inside.shape) - 1).any())
    mirrored = np.linalg.det(label_map.transform[:3, :3]) < 0
    if mirrored != (not steps.volume > 0):  # faces of a mirror image go round the other way in space
        steps = TriangleMesh(vertices, steps.faces[:, ::-1])
    return LabelSurface(label_map, label, cut, steps, without_steps(steps, label_map.pitch) if smooth else None)


COARSE = 0.5
"""Facets whose sagitta is more than this share of the tolerance are coarse: the fit takes the rest of it."""
ROUGH = 0.25
"""Facets with bumps of noise or voxels above this share of the tolerance are rough: peaks are two to three times the
RMS."""
STEP = 0.8
"""Share of what the surface misses a vertex by that its control point moves. Copies of five hand bones with 130 to 400
faces change their volume by -3.1 to 2.3 % with it, by 0.4 to 6.3 % with 1, by -6.4 to -0.1 % with 0.6."""
SMOOTHINGS = 10
"""Steps of Taubin's smoothing: noise of 0.08 mm on two hand bones leaves 0.03 mm and normals 5 degrees off, not 11 to
14; more steps move the bone itself."""
DRAWN, DRAWINGS = 0.9, 12
"""Share of the distance allowed to which vertices left farther behind are drawn, and steps that this takes at most: the
surface of a calcaneus with edges of 9.5 mm leaves one by 2.6 mm, and is within 1.8 mm of it after three."""
FINE = 0.1
"""Sagitta of the facets that stand for the smooth surface, as a share of the tolerance."""


@dataclass(frozen=True, eq=False)
class Smoothing:
    """A smooth surface as a `mesh`, and the mesh of facets (`faceted`) that it was fitted to.

    Distances between the two, mm: the `largest`, at `place`, and the `mean` over the surface; `outward` and `inward`
    are how far it was moved from the facets at most. `kept` is the area of facets, mm^2, that it follows exactly since
    a smooth one cuts itself there.
    """

    mesh: TriangleMesh
    faceted: TriangleMesh
    coarseness: Coarseness
    outward: float
    inward: float
    largest: float
    mean: float
    place: Float[ndarray, "3"]
    kept: float = 0.0

    @property
    def change(self) -> Repair:
        """The smoothing in a sentence."""
        what = f"fitted a smooth surface to facets that have {self.coarseness}"
        apart = f"{self.largest:.2f} mm from them at most near {place_name(self.place)}, {self.mean:.3f} mm on average"
        kept = f", {self.kept:.2g} mm2 of them kept where it would cut itself" if self.kept else ""
        return Repair(f"{what}: {apart}{kept}", self.outward, self.inward)

    @property
    def header_text(self) -> str:
        """The comment on it of a program's header."""
        return f"the part is a smooth surface near coarse facets, {self.largest:.2f} mm from them at most"

    @property
    def report(self) -> dict[str, Any]:
        """`smoothed` of the report; the place in the frame of the mesh as given."""
        return {
            "distance_max_mm": round(self.largest, 6),
            "distance_mean_mm": round(self.mean, 6),
            "outward_mm": round(self.outward, 6),
            "inward_mm": round(self.inward, 6),
            "place": [round(value, 3) for value in self.place.tolist()],
            "kept_mm2": round(self.kept, 6),
        }


def is_coarse(mesh: TriangleMesh, coarseness: Coarseness, tolerance: float) -> bool:
    """Whether facets lie farther off a smooth surface than COARSE of `tolerance` (mm), are not so many that they could
    be no more, and are no true planes."""
    many = 4 * len(mesh.faces) > MOST_FACES
    return coarseness.sagitta > COARSE * tolerance and not many and not coarseness.true_edges


def is_rough(coarseness: Coarseness, tolerance: float) -> bool:
    """Whether noise or steps of voxels stand out by more than ROUGH of `tolerance` (mm)."""
    return (coarseness.noise or coarseness.steps) and coarseness.bumps > ROUGH * tolerance


def smooth_facets(mesh: TriangleMesh, coarseness: Coarseness, job: MeshJob, tolerance: float) -> Smoothing | None:
    """The smooth surface near the vertices of a closed mesh, mm, where the job asks for one and none where facets are
    kept: fine ones, those of a part with true edges, or all of them.

    MeshError where it is farther from the facets than the job allows.
    """
    if job.facets == "exact":
        return None
    rough = is_rough(coarseness, tolerance)
    even = mesh
    if rough and coarseness.pitch is not None:
        even, _ = without_steps(mesh, coarseness.pitch)
    elif rough:
        meshset = to_meshset(mesh)
        meshset.apply_coord_taubin_smoothing(lambda_=SHRINK, mu=SWELL, stepsmoothnum=SMOOTHINGS)
        even = from_meshset(meshset)
    left = coarseness_of(even) if rough else coarseness
    coarse = is_coarse(even, left, tolerance) or (job.facets == "smooth" and not rough)
    if not (rough or coarse):
        return None
    halvings = 0
    if coarse:  # once or more: until facets are fine beside the tolerance or too many
        wanted = np.ceil(np.log2(max(left.sagitta / (FINE * tolerance), 1.0)) / 2)
        most = np.floor(np.log2(MOST_FACES / len(even.faces)) / 2)
        halvings = int(max(min(wanted, most), 1))
    smooth = _beside(_loop(even, halvings) if coarse else even, mesh, coarseness, halvings)
    if coarse and smooth.largest > job.smooth_within:
        drawn = _beside(_loop(even, halvings, job.smooth_within), mesh, coarseness, halvings)
        smooth = drawn if drawn.largest <= job.smooth_within else smooth
    if smooth.largest > job.smooth_within:
        raise MeshError(
            f"the facets are coarser or rougher than what is asked of them ({smooth.coarseness}), and a smooth surface "
            f"lies {smooth.largest:.2f} mm from them near {place_name(smooth.place)}, allowed {job.smooth_within:g}: "
            f"raise mesh.smooth_within to {hundredths(smooth.largest)}, give a finer mesh, or set mesh.facets to exact",
            place=smooth.place,
            error=smooth.largest,
        )
    return smooth


def note_on_kept_facets(mesh: TriangleMesh, coarseness: Coarseness, job: MeshJob, tolerance: float) -> str:
    """What is to be known of facets that are kept though they are coarse or rough, or have true edges and would be;
    nothing of others."""
    if coarseness.true_edges and job.facets == "found" and coarseness.sagitta > COARSE * tolerance:
        return f"facets kept, since true edges part planes: {coarseness}; mesh.facets = smooth rounds them"
    if job.facets == "exact" and (is_coarse(mesh, coarseness, tolerance) or is_rough(coarseness, tolerance)):
        return f"facets kept as asked: {coarseness}"
    return ""


def _beside(smooth: TriangleMesh, faceted: TriangleMesh, coarseness: Coarseness, halvings: int) -> Smoothing:
    """The smooth surface, whose faces are those of the facets with their edges `halvings` times halved, and its
    distances from them; where it cuts itself the facets are kept, and those round them lead over to it.

    MeshError where the facets themselves cut themselves.
    """
    facets = _halved(faceted.vertices, faceted.faces, halvings)
    surface = smooth
    kept = np.zeros((len(faceted.vertices), 3))
    cut = self_intersections(surface)
    while len(cut):
        corners = faceted.faces[cut // 4**halvings]
        if kept[corners].all():
            place = surface.vertices[surface.faces[cut[0]]].mean(axis=0)
            raise MeshError(
                f"the facets cut themselves near {place_name(place)}: mend the mesh there", place=place, faces=cut
            )
        kept[corners] = 1.0
        share = _halved(kept, faceted.faces, halvings)
        surface = TriangleMesh((1 - share) * smooth.vertices + share * facets, smooth.faces)
        cut = self_intersections(surface)

    moves = surface_moves(TriangleMesh(facets, smooth.faces), surface)
    middles = surface.vertices[surface.faces].mean(axis=1)
    away = MeshDistance(faceted).unsigned(middles)
    farthest = int(np.argmax(away))
    areas = lengths(surface.face_vectors)
    mean = float(away @ areas / areas.sum())
    largest, place = moves.largest, moves.place
    if away[farthest] > largest:
        largest = float(away[farthest])
        place = middles[farthest]
    whole = kept[faceted.faces].all(axis=(1, 2))
    return Smoothing(
        surface,
        faceted,
        coarseness=coarseness,
        outward=moves.outward,
        inward=moves.inward,
        largest=largest,
        mean=mean,
        place=place,
        kept=float(lengths(faceted.face_vectors[whole]).sum() / 2),
    )


def _loop(mesh: TriangleMesh, halvings: int, within: float = inf) -> TriangleMesh:
    """Loop's surface near the vertices, its edges `halvings` times halved; vertices that it leaves farther than
    `within` (mm) are drawn to DRAWN of that."""
    import igl

    faces = mesh.faces.astype(np.int64)
    vertices = np.array(mesh.vertices)
    missed = vertices - igl.loop(vertices, faces, halvings)[0][: len(vertices)]
    control = vertices + STEP * missed
    smooth, fine = igl.loop(control, faces, halvings)
    for _ in range(DRAWINGS):
        missed = vertices - smooth[: len(vertices)]
        away = lengths(missed)[:, None]
        if not (away > within).any():
            break
        control += np.maximum(1.0 - DRAWN * within / np.maximum(away, np.finfo(float).tiny), 0.0) * missed
        smooth, fine = igl.loop(control, faces, halvings)
    return TriangleMesh(smooth, fine.astype(np.int32))


def _halved(values: Float[ndarray, "n 3"], faces: Int[ndarray, "m 3"], halvings: int) -> Float[ndarray, "k 3"]:
    """Values at the vertices of facets, as points or shares, at those of the facets with edges `halvings` times
    halved, between which they are linear."""
    import igl

    return np.asarray(igl.upsample(np.array(values), faces.astype(np.int64), halvings)[0])
