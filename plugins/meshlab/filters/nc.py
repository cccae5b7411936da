"""Filters of the nc and verify stages: the posted and verified program. Stages are imported when a filter
runs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from bonecam_plugins.meshlab.filter import Filter, FilterParameter, Kind, parameters_of, section_of
from bonecam_plugins.meshlab.layers import Layers

from bonecam.files import write_whole
from bonecam.job import NcJob
from bonecam.progress import Progress

CATEGORY = "Bonecam: NC"


def save_program(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `save_nc_program`: the program of the kept tool paths, written where its proof holds."""
    from bonecam.levels.measure import morph_surfaces
    from bonecam.levels.sequences import Morph
    from bonecam.machine.machine import read_machine
    from bonecam.machining import post_and_prove
    from bonecam.nc.requirements import job_dialect
    from bonecam.report.stage_reports import nc_report
    from bonecam.setup.stock import Stock

    planned = layers.kept("toolpath", tuple, "generate_toolpath")
    morph = layers.kept("morph", Morph, "generate_morph_levels")
    stock = layers.kept("stock", Stock, "generate_stock")  # type: ignore[type-abstract]
    job = replace(layers.job(), nc=section_of(layers.job().nc, values))
    machine = read_machine(job.nc.machine)
    dialect = job_dialect(job.nc)

    design = morph_surfaces(morph.levels)[0]
    proved = post_and_prove(planned, machine, dialect, job, design, stock=stock, progress=progress)
    target = layers.target(values["file"])
    write_whole(target, proved.program.text)
    return {**nc_report(proved.program, proved.proof), "file": str(target)}


FILTERS = (
    Filter(
        "save_nc_program",
        "Save NC Program",
        "Posts the kept tool paths for the machine they were planned on, reads the text back through "
        "forward kinematics, checks that no "
        "move enters the part, and writes the program only where that holds.",
        CATEGORY,
        (
            FilterParameter("file", Kind.SAVE_FILE, "program.h", "File", "The NC program to write."),
            *parameters_of(
                NcJob(), without=("machine", "part_zero", "probe", "probe_tool", "probe_radius", "probe_length")
            ),
        ),
        save_program,
        after=("generate_stock", "compute_tspline_surface", "generate_morph_levels", "generate_toolpath"),
    ),
)
