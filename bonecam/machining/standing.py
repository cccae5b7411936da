"""The first half of the flow: a part is read and stands on its post in its stock, then its surface and levels are made.

The two halves are apart, as strategies that are compared share the first.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from bonecam.errors import knowing
from bonecam.job import Job
from bonecam.levels.job_levels import surface_and_levels
from bonecam.machine.machine import Machine, read_machine
from bonecam.mesh.part import with_filled_pits
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.posting.rotary.machine_limits import machine_limits
from bonecam.nc.requirements import check_length, check_room
from bonecam.planning.chosen_cutters import leaves_cutters_open, with_chosen_cutters
from bonecam.planning.holding.found_depths import depths_report, leaves_depths_open, with_found_depths
from bonecam.planning.holding.neck import find_standing
from bonecam.planning.holding.neck_remedies import neck_remedies, neck_report
from bonecam.planning.holding.parting_paths import check_parting
from bonecam.planning.holding.post_length import check_reached
from bonecam.planning.holding.reach import post_advice
from bonecam.planning.holding.stump_paths import check_second
from bonecam.planning.holding.tailstock_room import blocked_share
from bonecam.progress import Progress, part, report
from bonecam.report import warnings
from bonecam.report.files.kept_folder import keep_failed_level
from bonecam.report.files.output_files import File
from bonecam.report.files.result import Morphed
from bonecam.report.typed.report import Report
from bonecam.report.typed.run_report import input_report, post_report, report_to_levels
from bonecam.runtime.timing import StageTimes
from bonecam.setup.placement import Setup, place
from bonecam.setup.schedule import check_cuts
from bonecam.setup.stocks.mesh import ConvexStock
from bonecam.surface.files.surface_input import read_part
from bonecam.surface.fitting.fit import Fit
from bonecam.workholding.tailstock import settled_bracket


@dataclass(frozen=True, eq=False)
class Standing:
    """A part on its post in its stock, the job with cutters and holding that were found, and what the report tells of
    these; the surface that was `given` in the place of a mesh, if it was."""

    setup: Setup
    job: Job
    given: Fit | None
    post: dict[str, Any]
    cutters: dict[str, Any]


def stand_part(
    mesh: str | Path | TriangleMesh,
    job: Job,
    machine: Machine | None,
    times: StageTimes,
    progress: Progress,
    body: ConvexStock | None = None,
) -> Standing:
    """The part in a stock for which `machine` has room, the `body` where one is given, on the post that the job gives
    or that is found."""
    with times.stage("mesh"):
        unplaced, given = read_part(mesh, job, progress)
        changes = [repair.change for repair in unplaced.repairs if repair.guessed]
        guesses = warnings.repair_warnings(unplaced.widest_hole, unplaced.guessed_share, job, changes)
        warnings.check_warnings(guesses, job, unplaced.file)
        limits = machine_limits(machine or read_machine(job.nc.machine))
        seeks_post, seeks_cutters = not job.holding.length, leaves_cutters_open(job)
        filled = unplaced if seeks_cutters else with_filled_pits(unplaced, job.mesh, job.smallest_ball)
        placed = place(filled, job, body)
        if not job.holding.diameter:
            check_cuts(placed.part.mesh, placed.stock, job.levels)  # before cutters and necks are tried
        job, chosen = with_chosen_cutters(placed, job, limits)
        if seeks_cutters:
            filled = with_filled_pits(unplaced, job.mesh, job.smallest_ball)
            placed = place(filled, job, body)
        job = replace(job, holding=settled_bracket(job.holding, placed.part.mesh, limits.bodies.table))
        blocked = blocked_share(placed, job, limits)
        stated = job.holding.diameter > 0
        setup, job, necks = find_standing(placed, job, limits)
        remedies = neck_remedies(setup, job, limits, necks[0]) if necks else ()
        figures = neck_report(necks, remedies, job, stated=stated)
        for warned in warnings.holding_warnings(figures, job):
            report(progress, 1.0, f"{warned.text}: {warned.remedy}")
            with knowing({"input": input_report(filled), "post": figures}):
                warnings.check_warnings([warned], job, filled.file)
        if leaves_depths_open(job, neck_found=bool(necks)):
            job = with_found_depths(setup, job, limits)
            figures |= depths_report(job)
        if machine is not None:
            if not seeks_post and job.path.strategy == "morph":
                check_reached(setup, job, limits)
            check_parting(setup, job, limits)
            check_second(setup.part, setup.post, job)
            check_room(setup.stock, job, machine)
        check_cuts(setup.part.mesh, setup.stock, job.levels)
        if machine is not None:
            check_length(setup.part.mesh, setup.stock, job, part(progress, 1.0, 1.0))
        advice = post_advice(setup, job, limits) if seeks_post and machine else {}
    figures |= post_report(setup.post, setup.part.mesh, job.holding) | advice
    if "tailstock" in figures:
        figures["tailstock"]["blocked_share"] = round(blocked, 3)
    return Standing(setup, job, given, figures, chosen)


def morph_standing(standing: Standing, keep: File, times: StageTimes, progress: Progress) -> Morphed:
    """Surface and levels of a part that stands in its stock."""
    setup, job = standing.setup, standing.job
    with keep_failed_level(keep):
        fitted, morph = surface_and_levels(setup, job, times, progress, standing.given)

    figures = report_to_levels(setup.part, fitted, setup.stock, morph, job)
    figures |= {"strategy": job.path.strategy, "post": standing.post}
    if standing.cutters:
        figures["cutters"] = standing.cutters
    figures |= {"seconds": times.seconds, "cpu_seconds": times.cpu_seconds}
    reported = cast(Report, warnings.with_warnings(figures, job))
    return Morphed(setup.part, fitted.surface, stock=setup.stock, levels=morph, report=reported, job=job)
