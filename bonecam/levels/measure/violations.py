"""The measures of a cut that are out of tolerance, and the error of a level that has such a cut."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import LevelError, place_name
from bonecam.levels.measure.cut_measures import Measures
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE, NESTING_TOLERANCE, STOCK_TOLERANCE
from bonecam.mesh.triangle_mesh import TriangleMesh

PATCH = 2.0
"""The faces within this distance (mm) of a violation are kept with its error, so that it can be looked at."""
REMEDY = "give a higher stiffness or more control points there"
"""What to do about a level that breaks its limits."""

Violation = tuple[str, Float[ndarray, "3"]]
"""What is out of tolerance, in words, and where that is worst."""


def violations(
    measures: Measures,
    limit: float,
    mesh: TriangleMesh,
    *,
    nesting_tolerance: float = NESTING_TOLERANCE,
    stock_tolerance: float = STOCK_TOLERANCE,
) -> list[Violation]:
    """All measures of a cut that are out of tolerance; `mesh` is the tessellation of its outer level, `limit`
    its depth in mm."""
    out_of_tolerance = []
    depths = ((measures.depth_max, measures.depth_place), (measures.reverse_depth_max, measures.reverse_depth_place))
    for depth, place in depths:
        if depth > limit + DEPTH_TOLERANCE:
            out_of_tolerance.append((f"is {depth:.4f} mm deep, more than {limit} mm,", place))

    if measures.nesting_min < -nesting_tolerance:
        what = f"falls {-measures.nesting_min:.4f} mm behind the level before"
        out_of_tolerance.append((what, measures.nesting_place))

    if measures.outside > stock_tolerance:
        out_of_tolerance.append((f"leaves the stock by {measures.outside:.4f} mm", measures.outside_place))

    if measures.self_intersections:
        place = mesh.vertices[mesh.faces[measures.crossing_faces[0]]].mean(0)
        out_of_tolerance.append((f"cuts itself in {measures.self_intersections} faces", place))

    return out_of_tolerance


def require_none(index: int, found: list[Violation], mesh: TriangleMesh, remedy: str = REMEDY) -> None:
    """Raise LevelError for the first violation of level `index`, with its place and the patch of the mesh
    round it; without violations nothing is raised."""
    if found:
        trouble, place = found[0]
        raise LevelError(
            f"level {index} {trouble} at {place_name(place)}: {remedy}",
            level=index,
            place=place,
            patch=patch_of(mesh, place),
        )


def patch_of(mesh: TriangleMesh, place: Float[ndarray, "3"]) -> TriangleMesh:
    """The faces of a mesh within PATCH mm of a place (at least the nearest one), without the other
    vertices."""
    distance = np.linalg.norm(mesh.vertices[mesh.faces] - place, axis=2).min(1)
    faces = mesh.faces[distance <= max(PATCH, float(distance.min()))]
    kept, faces = np.unique(faces, return_inverse=True)
    return TriangleMesh(mesh.vertices[kept], faces.reshape(-1, 3).astype(np.int32))
