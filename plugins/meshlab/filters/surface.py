"""Filters of the surface stage: a T-spline from the layer. Stages are imported when a filter runs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from bonecam_plugins.meshlab.filter import Filter, FilterParameter, Kind, parameters_of, section_of
from bonecam_plugins.meshlab.layers import Layers

from bonecam.job import LevelsJob, MeshJob, SurfaceJob
from bonecam.progress import Progress
from bonecam.surface.tspline import TSpline

CATEGORY = "Bonecam: T-Spline Surface"


def fit_tspline(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `compute_tspline_surface`: a layer of the tessellated T-spline, which is kept beside it."""
    from bonecam.mesh.part import Part
    from bonecam.report.stage_reports import surface_report
    from bonecam.surface.part_surface import fit_surface

    before = layers.job()
    job = replace(before, mesh=section_of(before.mesh, values), surface=section_of(SurfaceJob(), values))
    mesh = layers.bone()
    part = Part(mesh, layers.name, len(mesh.faces), "mm", (), np.eye(4), mesh)
    fit = fit_surface(part, job, progress)
    layers.add(fit.surface.tessellate(values["chord_tolerance"]), "surface", keep={"surface": fit.surface, "job": job})
    return surface_report(fit)


def save_tspline(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `save_tspline_surface`: the kept T-spline as a file."""
    from bonecam.surface import save_surface

    surface = layers.kept("surface", TSpline, "compute_tspline_surface")
    target = layers.target(values["file"])
    save_surface(surface, target)
    return {"file": str(target)}


FILTERS = (
    Filter(
        "compute_tspline_surface",
        "Compute T-Spline Surface",
        "Fits one row-structured bicubic T-spline to the layer, periodic round the bone with a pole at "
        "either end, and adds its "
        "tessellation as a layer, which keeps the T-spline for the filters after it.",
        CATEGORY,
        (
            *parameters_of(SurfaceJob()),
            *parameters_of(MeshJob(), only=("rows",)),
            *parameters_of(LevelsJob(), only=("chord_tolerance",)),
        ),
        fit_tspline,
        references=(
            "Yang, Zheng: Approximate T-spline surface skinning. Computer-Aided Design 44 (2012) "
            "1269-1276, doi:10.1016/j.cad.2012.07.003",
            "Gan, Fu, Shen, Lin: A morphing machining strategy for artificial bone. JZUS-A 2014, "
            "doi:10.1631/jzus.A1300274, section 3",
        ),
    ),
    Filter(
        "save_tspline_surface",
        "Save T-Spline Surface",
        "Writes the T-spline that is kept with the layer. The ending decides: .tspline is bonecam's own "
        "text form, bit for bit; "
        ".step, .stp, .iges and .igs hold one exact periodic B-spline face in mm, for CAD systems (needs "
        "the extra bonecam[cad]).",
        CATEGORY,
        (FilterParameter("file", Kind.SAVE_FILE, "surface.tspline", "File", "The file to write."),),
        save_tspline,
        after=("compute_tspline_surface",),
    ),
)
