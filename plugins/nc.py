"""Filters of the nc and verify stages: the posted and verified program. Stages are imported when a filter
runs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from bonecam.files import write_whole
from bonecam.filters.filter import Filter
from bonecam.filters.layers import Layers
from bonecam.filters.parameter import FilterParameter, Kind, parameters_of, section_of
from bonecam.job import NcJob
from bonecam.progress import Progress, part

CATEGORY = "Bonecam: NC"


def save_program(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    """Filter `save_nc_program`: the program of the kept tool paths, written where its proof holds."""
    from bonecam.levels.measure.level import morph_surfaces
    from bonecam.levels.sequences.begun_morph import Morph
    from bonecam.machine.machine import read_machine
    from bonecam.nc.dialect import read_dialect
    from bonecam.nc.posting.feeds import drivable_paths
    from bonecam.nc.posting.header.header import record_checks
    from bonecam.nc.posting.write import write_program
    from bonecam.report.figures import nc_report
    from bonecam.setup.stock import Stock
    from bonecam.verify.proof import verify
    from bonecam.verify.readback import Tolerances

    planned = layers.kept("toolpath", tuple, "generate_toolpath")
    morph = layers.kept("morph", Morph, "generate_morph_levels")
    stock = layers.kept("stock", Stock, "generate_stock")  # type: ignore[type-abstract]
    job = replace(layers.job(), nc=section_of(layers.job().nc, values))
    machine = read_machine(job.nc.machine)
    dialect = read_dialect(job.nc.controller)

    paths = drivable_paths(planned, machine, dialect, job)
    program = write_program(paths, machine, dialect, job, stock=stock, progress=part(progress, 0.0, 0.5))
    design = morph_surfaces(morph.levels)[0]
    tolerances = Tolerances(gouge=job.path.gouge_tolerance)
    proof = verify(program.text, paths, machine, dialect, design, tolerances, part(progress, 0.5, 1.0))
    target = layers.target(values["file"])
    write_whole(target, record_checks(program, dialect, str(proof)).text)
    return {**nc_report(program, proof), "file": str(target)}


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
            *parameters_of(NcJob(), without=("machine", "part_zero")),
        ),
        save_program,
        after=("generate_stock", "compute_tspline_surface", "generate_morph_levels", "generate_toolpath"),
    ),
)
