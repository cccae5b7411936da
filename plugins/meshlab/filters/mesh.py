"""Filters of the mesh stage: units, repair, pose, rows. Stages are imported when a filter runs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from bonecam_plugins.meshlab.filter import Filter, FilterParameter, Kind, parameters_of, section_of
from bonecam_plugins.meshlab.layers import Layers

from bonecam.job import MeshJob, SurfaceJob
from bonecam.job.tool_section import FINISHING
from bonecam.progress import Progress

CATEGORY = "Bonecam: Mesh"
MEASURES = ("mean", "gaussian", "k1", "k2", "shape")


def scale_to_mm(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `apply_units_in_mm`: the layer scaled to mm, mirrored and scaled."""
    from bonecam.mesh.units import mm_of, signs_of, to_mm

    scaled = to_mm(layers.mesh(), values["units"], layers.name, 'give units="{}"')
    factor = mm_of(values["units"]) * values["scale"]
    layers.transform(np.diag([*(signs_of(values["mirror"]) * factor), 1.0]))
    return {"scale": factor, "diagonal_mm": scaled.diagonal * values["scale"]}


def repair_bone(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `meshing_repair_bone`: a layer of the repaired mesh."""
    from bonecam.mesh.healing import repair

    mesh, changes = repair(layers.bone(), progress=progress)
    layers.add(mesh, "repaired")
    return {"repairs": [str(change) for change in changes], "faces": len(mesh.faces)}


def smooth_facets_layer(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `meshing_smooth_facets`: a layer of the mesh with a smooth surface in place of coarse facets."""
    from bonecam.mesh.smooth_surface import coarseness_of, note_on_kept_facets, smooth_facets

    mesh = layers.bone()
    job = section_of(MeshJob(), values)
    coarseness = coarseness_of(mesh)
    tolerance = section_of(SurfaceJob(), values).tolerance_for(coarseness.sagitta)
    found = smooth_facets(mesh, coarseness, job, tolerance)
    layers.add(found.mesh if found else mesh, "smoothed")
    reported = [str(found.change)] if found else [note_on_kept_facets(mesh, coarseness, job, tolerance)]
    measured = {name: value for name, value in coarseness.report.items() if value is not None}
    return {"told": [*filter(None, reported)], **measured, **(found.report if found else {})}


def fill_pits_layer(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `meshing_fill_pits`: a layer of the mesh without its pits."""
    from bonecam.mesh.hollows import fill_pits

    fill = fill_pits(layers.bone(), values["pit_radius"])
    layers.add(fill.mesh, "filled")
    return {"filled": [str(repair) for repair in fill.repairs], **fill.report}


def stand_upright(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `apply_upright_pose`: the layer with its longest axis along Z."""
    from bonecam.mesh.pose import upright

    _, matrix = upright(layers.mesh())
    layers.transform(matrix)
    return {"transform": np.asarray(matrix)}


def harmonic_rows_layer(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `compute_harmonic_rows`: a layer of closed polylines."""
    from bonecam.mesh.rows import harmonic_rows

    job = section_of(MeshJob(), values)
    mesh = layers.bone()
    rows = harmonic_rows(mesh, rows=job.rows, progress=progress)
    count, points = rows.points.shape[:2]
    index = np.arange(count * points).reshape(count, points)
    edges = np.stack([index, np.roll(index, -1, axis=1)], axis=-1).reshape(-1, 2)
    layers.add_polyline(
        rows.points.reshape(-1, 3), edges, "rows", np.repeat(np.arange(count, dtype=np.float64), points)
    )
    layers.keep(rows=rows, job=replace(layers.job(), mesh=job))
    return {"rows": count, "row_points": points, "poles": np.asarray(rows.poles)}


def curvature_layer(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `compute_mls_curvature`: the mesh as a new layer, coloured by its curvature."""
    from bonecam.mesh.facets import mls_curvature

    mesh = layers.mesh()
    found = mls_curvature(mesh, values["radius"] or None)
    measured = (found.mean, found.gaussian, found.k1, found.k2, found.shapes)
    shown = np.asarray(dict(zip(MEASURES, measured))[values["measure"]], dtype=np.float64)
    layers.add(mesh, "curvature", quality=shown)
    return {"minimum": float(shown.min()), "maximum": float(shown.max())}


FILTERS = (
    Filter(
        "apply_units_in_mm",
        "Apply Units in Millimetres",
        "Scales the layer from its file's unit to mm, which all bonecam filters work in. A size that is "
        "no bone's in the stated unit "
        "is refused, with the unit that would fit. The layer may be mirrored and scaled with it.",
        CATEGORY,
        parameters_of(MeshJob(), only=("units", "mirror", "scale")),
        scale_to_mm,
        changes_layer=True,
    ),
    Filter(
        "meshing_repair_bone",
        "Repair Bone",
        "Makes one closed genus-0 mesh of the layer, as a new layer: duplicates, null faces, "
        "non-manifold edges, orientation, holes, "
        "in that order. What was changed is in the result; what cannot be mended is an error with the place.",
        CATEGORY,
        (),
        repair_bone,
    ),
    Filter(
        "meshing_smooth_facets",
        "Smooth Facets",
        "Fits a smooth surface near the vertices of facets that are coarser than half the tolerance, as a new layer; "
        "fine facets, and those of parts with true edges, stay as they are. The layer is closed and in mm.",
        CATEGORY,
        (
            *parameters_of(MeshJob(), only=("facets", "smooth_within")),
            *parameters_of(SurfaceJob(), only=("tolerance",)),
        ),
        smooth_facets_layer,
        references=(
            "Cheng, Fan, Lai, Huang, Wang, Yong: Loop subdivision surface based progressive interpolation. JCST 24 "
            "(2009).",
        ),
    ),
    Filter(
        "meshing_fill_pits",
        "Fill Pits",
        "Fills hollows that a ball of the given radius cannot reach up to that ball (the closing of the part by it), "
        "as a new layer: the cutter leaves that material anyway, and levels over a pit would fold. The layer is "
        "closed and in mm; nothing moves inward.",
        CATEGORY,
        (
            FilterParameter(
                "pit_radius",
                Kind.LENGTH,
                FINISHING.radius,
                "Pit radius",
                "Radius of the ball that pits are filled up to.",
                unit="mm",
                low=0.0,
                high=50.0,
            ),
        ),
        fill_pits_layer,
    ),
    Filter(
        "apply_upright_pose",
        "Apply Upright Pose",
        "Turns the layer's longest principal axis to +Z and centres it on the Z axis.",
        CATEGORY,
        (),
        stand_upright,
        changes_layer=True,
    ),
    Filter(
        "compute_harmonic_rows",
        "Compute Harmonic Rows",
        "Rows of points round the bone: isolines of the harmonic field that is 0 at the one end and 1 at "
        "the other. On a closed genus-0 "
        "mesh each isoline is one loop. They come as a layer of closed polylines coloured by row.",
        CATEGORY,
        parameters_of(MeshJob(), only=("rows",)),
        harmonic_rows_layer,
        references=(
            "Dong, Kircher, Garland: Harmonic functions for quadrilateral remeshing of arbitrary "
            "manifolds. CAGD 22 (2005).",
        ),
    ),
    Filter(
        "compute_mls_curvature",
        "Compute Curvature by Moving Least Squares",
        "Principal curvatures at the vertices from quadratic patches, as a new layer with the chosen measure as "
        "quality and colour. Curvatures are in 1/mm, positive where the surface bulges outward.",
        CATEGORY,
        (
            FilterParameter(
                "measure",
                Kind.ENUM,
                "mean",
                "Measure",
                "Principal curvatures k1 >= k2, their mean, their product, or the shape (0 convex, 1 concave, "
                "2 saddle, 3 parabolic, 4 planar).",
                choices=MEASURES,
            ),
            FilterParameter(
                "radius",
                Kind.FLOAT,
                0.0,
                "Radius",
                "Radius of a patch, 2.5 edges or more; 0: two edges from vertex to vertex.",
                unit="mm",
                low=0.0,
                high=1000.0,
            ),
        ),
        curvature_layer,
        references=(
            "Xu, Zhang, Tan, Liu: Collisionless tool orientation smoothing above blade stream surface using NURBS "
            "envelope. JZUS-A 2013, section 4",
        ),
    ),
)
