"""A smooth surface near the vertices of facets that are coarser, or rougher, than what is asked of them.

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
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import MeshError, hundredths, place_name
from bonecam.job import MeshJob
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets.coarseness import Coarseness, coarseness_of
from bonecam.mesh.facets.voxel_steps import without_steps
from bonecam.mesh.healing.decimation import MOST_FACES
from bonecam.mesh.healing.repair_state import Repair
from bonecam.mesh.healing.surface_moves import surface_moves
from bonecam.mesh.meshlab import from_meshset, to_meshset
from bonecam.mesh.solids.intersections import self_intersections
from bonecam.mesh.triangle_mesh import TriangleMesh

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
SHRINK = 0.5
SWELL = -0.53
"""Taubin's two factors, as MeshLab has them."""
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
    even = _without_bumps(mesh, coarseness) if rough else mesh
    left = coarseness_of(even) if rough else coarseness
    coarse = is_coarse(even, left, tolerance) or (job.facets == "smooth" and not rough)
    if not (rough or coarse):
        return None
    halvings = _halvings(even, left, tolerance) if coarse else 0
    smooth = _beside(_loop(even, halvings) if coarse else even, mesh, coarseness, halvings)
    if coarse and smooth.largest > job.smooth_within:
        drawn = _beside(_loop(even, halvings, job.smooth_within), mesh, coarseness, halvings)
        smooth = drawn if drawn.largest <= job.smooth_within else smooth
    _require_near(smooth, job.smooth_within)
    return smooth


def note_on_kept_facets(mesh: TriangleMesh, coarseness: Coarseness, job: MeshJob, tolerance: float) -> str:
    """What is to be known of facets that are kept though they are coarse or rough, or have true edges and would be;
    nothing of others."""
    if coarseness.true_edges and job.facets == "found" and coarseness.sagitta > COARSE * tolerance:
        return f"facets kept, since true edges part planes: {coarseness}; mesh.facets = smooth rounds them"
    if job.facets == "exact" and (is_coarse(mesh, coarseness, tolerance) or is_rough(coarseness, tolerance)):
        return f"facets kept as asked: {coarseness}"
    return ""


def _without_bumps(mesh: TriangleMesh, coarseness: Coarseness) -> TriangleMesh:
    """The mesh without the steps of voxels, within half of their pitch where that is known, or without noise."""
    if coarseness.pitch is not None:
        return without_steps(mesh, coarseness.pitch).mesh
    meshset = to_meshset(mesh)
    meshset.apply_coord_taubin_smoothing(lambda_=SHRINK, mu=SWELL, stepsmoothnum=SMOOTHINGS)
    return from_meshset(meshset)


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


def _halvings(mesh: TriangleMesh, coarseness: Coarseness, tolerance: float) -> int:
    """How often edges are halved, once or more: until facets are fine beside the tolerance or too many."""
    wanted = np.ceil(np.log2(max(coarseness.sagitta / (FINE * tolerance), 1.0)) / 2)
    most = np.floor(np.log2(MOST_FACES / len(mesh.faces)) / 2)
    return int(max(min(wanted, most), 1))


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


def _require_near(smooth: Smoothing, within: float) -> None:
    if smooth.largest > within:
        raise MeshError(
            f"the facets are coarser or rougher than what is asked of them ({smooth.coarseness}), and a smooth surface "
            f"lies {smooth.largest:.2f} mm from them near {place_name(smooth.place)}, allowed {within:g}: raise "
            f"mesh.smooth_within to {hundredths(smooth.largest)}, give a finer mesh, or set mesh.facets to exact",
            place=smooth.place,
            error=smooth.largest,
        )
