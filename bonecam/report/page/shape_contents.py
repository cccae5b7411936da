"""What a page shows before there is a program: levels, the mesh as given, deviation, and the bodies round the part."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots, lengths
from bonecam.job import Job
from bonecam.levels.measure.level import Level, rounding_cuts
from bonecam.machine.bodies import Table
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.facets.vertex_normals import vertex_normals
from bonecam.mesh.part import Part
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.report.page.packing import Contents
from bonecam.setup.stock import Stock, stock_figures, stock_text
from bonecam.workholding.clamping import holding_columns
from bonecam.workholding.post import Post, post_below
from bonecam.workholding.tailstock import tailstock_bodies

MOST_FACES = 100_000
"""A mesh as given with more faces is shown as it was after repair and decimation."""


def shape_contents(part: Part, levels: Sequence[Level], stock: Stock, job: Job, table: Table, name: str) -> Contents:
    """Levels with the depth of their cuts, part as given and as fitted, stock, post, what holds it, and table."""
    facts, arrays = _levels(levels, job)
    shown, which = _given(part)
    # How far each vertex of the fitted mesh lies outside the given one, mm
    fitted = levels[0].mesh
    away = fitted.vertices - exact_closest(shown, fitted.vertices)[0]
    arrays |= {
        "given": shown.vertices,
        "given_faces": shown.faces,
        "given_deviation": _outside(shown, levels[0].mesh),
        "deviation": np.sign(dots(away, vertex_normals(fitted))) * lengths(away),
    }
    post = post_below(part.mesh, job.holding)
    facts |= {
        "name": name,
        "file": part.file,
        "given": which,
        "stock": {**stock_figures(stock), "text": stock_text(stock_figures(stock))},
        "stock_bounds": stock.bounds.tolist(),
        "post": {"radius": post.radius, "top": post.top},
        **bodies(job, table),
        **_tailstock(post, job),
    }
    return Contents(facts, arrays)


def _levels(levels: Sequence[Level], job: Job) -> tuple[dict[str, Any], dict[str, ndarray]]:
    rounding = rounding_cuts(levels)
    reported = []
    arrays: dict[str, ndarray] = {}
    faces: dict[bytes, str] = {}
    before = levels[0].mesh
    for level in levels:
        shape = level.mesh.faces.tobytes()
        if shape not in faces:
            faces[shape] = f"faces_{len(faces)}"
            arrays[faces[shape]] = level.mesh.faces
        arrays[f"level_{level.index}"] = level.mesh.vertices
        arrays[f"depth_{level.index}"] = lengths(level.mesh.vertices - exact_closest(before, level.mesh.vertices)[0])
        before = level.mesh
        reported.append(
            {
                "index": level.index,
                "name": _name(level, len(levels), job, rounding),
                "faces": faces[shape],
                "limit": level.limit,
                "deepest": level.deepest,
                "mean": level.depth_mean,
                "certified": level.certified,
            }
        )
    return {"levels": reported}, arrays


def _name(level: Level, count: int, job: Job, rounding: range) -> str:
    """What a level is, in a word or two."""
    if level.index == 0:
        return "the part"
    if level.index == count - 1:
        return "the stock"
    if level.index in rounding:
        return "rounds the stock"
    return "finishing" if job.is_finishing(level.index) else "roughing"


def _given(part: Part) -> tuple[TriangleMesh, str]:
    """The mesh to show as the one given, and what it is."""
    if len(part.given.faces) <= MOST_FACES:
        return part.placed_given, "as given"
    return part.mesh, "as repaired: the given one has too many faces to show"


def _outside(given: TriangleMesh, fitted: TriangleMesh) -> Float[ndarray, " n"]:
    """How far the fitted mesh lies outside each vertex of the given one, mm."""
    closest, faces = exact_closest(fitted, given.vertices)
    away = closest - given.vertices
    return np.sign(dots(away, fitted.face_vectors[faces])) * lengths(away)


def bodies(job: Job, table: Table) -> dict[str, Any]:
    """Sizes of riser, chuck, stub (None or absent where the job has none) and table, mm."""
    held = {
        name: {"radius": column.radius, "top": column.top, "bottom": column.bottom}
        for name, column in holding_columns(job.holding).items()
    }
    return {"chuck": None, **held, "table": _table(table)}


def _tailstock(post: Post, job: Job) -> dict[str, Any]:
    """Pin or upper neck with arm and column, if there are any, mm."""
    if post.pin is None:
        return {}
    columns = [post.pin, *tailstock_bodies(job.holding)]
    return {"tailstock": [asdict(column) for column in columns]}


def _table(table: Table) -> dict[str, Any]:
    """The table's sizes, None where it has no edge, and what stands on it as (length, radius, upper radius)."""
    sizes = {"radius": table.radius, "half_width": table.half_width, "half_depth": table.half_depth}
    return {
        **{name: float(size) if np.isfinite(size) else None for name, size in sizes.items()},
        "standing": [[piece.length, piece.diameter / 2, piece.top_diameter / 2] for piece in table.standing],
    }
