"""Machining: the program of the levels of a part, and once more with feeds by the force that its simulation finds.

A part is read and stands on its post in its stock, then its surface and levels are made; the two halves are apart, as
strategies that are compared share the first. Tool paths on the levels are posted, read back and proved: `convert`,
`finish`, the second clamping and the filter end in `post_and_prove`.

Feeds by the force keep an even peak (`mechanics/loads.py`) where cutter and machine allow it. No tooth takes more than
the largest chip of the material's cutting data or leaves feed marks over the scallop, nor less than half of what it
takes at the cutter's feed: it would rub. No feed is raised beyond what the accelerations of the machine's axes let a
move reach, where they are known; `drivable_paths` keeps it within their speeds.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import knowing
from bonecam.job import Job, field_error
from bonecam.job.holding_section import MILLED
from bonecam.kernels.warming import warming
from bonecam.levels.job_levels import surface_and_levels
from bonecam.levels.measure import morph_surfaces
from bonecam.machine.machine import Machine, read_machine
from bonecam.mechanics.loads import LEAST, FeedSchedule, PathLoads, feed_schedule, peaks
from bonecam.mesh.part import with_filled_pits
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.feeds import drivable_paths, fastest_cut
from bonecam.nc.header import record_checks
from bonecam.nc.path_words import Posted, machine_limits, post_path
from bonecam.nc.posting import SetupTexts, write_program
from bonecam.nc.probing import check_probing, probing_file, probing_name, write_probing
from bonecam.nc.program import Program, program_name
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import check_length, check_room
from bonecam.planning.blank import check_blank, settled_neck
from bonecam.planning.chosen_cutters import leaves_cutters_open, with_chosen_cutters
from bonecam.planning.estimate import estimate
from bonecam.planning.levels import plan_paths
from bonecam.planning.neck import (
    depths_report,
    find_standing,
    leaves_depths_open,
    neck_remedies,
    neck_report,
    with_found_depths,
)
from bonecam.planning.parting import check_parting
from bonecam.planning.post_length import blocked_share, check_reached, post_advice
from bonecam.plugins import added, run_added
from bonecam.progress import Progress, part, report, silent
from bonecam.report import warnings
from bonecam.report.kept import Morphed, Result, keep_failed_level
from bonecam.report.outputs import File, refusing
from bonecam.report.page.contents import rows_of_moves
from bonecam.report.stage_reports import uncut_areas
from bonecam.report.summary import NOT_SIMULATED
from bonecam.report.typed import Report, input_report, post_report, report_to_levels, report_to_program
from bonecam.report.warnings import NOT_KNOWN
from bonecam.runtime.timing import StageTimes
from bonecam.setup.placement import Setup, place
from bonecam.setup.stock import Stock, check_cuts
from bonecam.setup.stocks.mesh import ConvexStock
from bonecam.surface.files.surface_input import read_part
from bonecam.surface.growth import Fit
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import BESIDE, MoveKind, ToolPath
from bonecam.verify.findings import GivenSurface, Removal, given_surface
from bonecam.verify.gouge import Distances
from bonecam.verify.proof import Verification, verify
from bonecam.verify.removal import prove_removal
from bonecam.workholding.post import settled_bracket


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
        with warming(progress):
            unplaced, given = read_part(mesh, job, progress)
        changes = [repair.change for repair in unplaced.repairs if repair.guessed]
        guesses = warnings.repair_warnings(unplaced.widest_hole, unplaced.guessed_share, job, changes)
        warnings.check_warnings(guesses, job, unplaced.file)
        limits = machine_limits(machine or read_machine(job.nc.machine))
        neck, job = job.holding.neck, settled_neck(job)
        seeks_post, seeks_cutters = not job.holding.length, leaves_cutters_open(job)
        filled = unplaced if seeks_cutters else with_filled_pits(unplaced, job.smallest_ball)
        placed = place(filled, job, body)
        if not job.holding.diameter:
            check_cuts(placed.part.mesh, placed.stock, job.levels)  # before cutters and necks are tried
        job, chosen = with_chosen_cutters(placed, job, limits)
        if seeks_cutters:
            filled = with_filled_pits(unplaced, job.smallest_ball)
            job = settled_neck(job.with_values(holding={"neck": neck}))  # the ball that mills it is known
            placed = place(filled, job, body)
        job = replace(job, holding=settled_bracket(job.holding, placed.part.mesh, limits.bodies.table))
        blocked = blocked_share(placed, job, limits)
        stated = job.holding
        setup, job, necks = find_standing(placed, job, limits)
        remedies = neck_remedies(setup, job, limits, necks[0]) if necks else ()
        figures = neck_report(necks, remedies, job, stated=stated.diameter > 0)
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
            check_parting(setup, job, limits, stated)
            check_blank(setup, job)
            check_room(setup.stock, job, machine)
            check_probing(setup.stock, job, machine)
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


STEP = 1.25
"""Ratio of one feed to the next: few words of F."""


def feed_report(
    schedule: FeedSchedule, before: Removal, minutes_before: float, after: Removal, minutes: float
) -> dict[str, Any]:
    """`feed` of the report: the times, and the peaks (N) of each cutter at 95 % of its time and at most, before and
    after the feeds went by the force."""
    cutters = []
    for tool, target in schedule.targets.items():
        pairs = [peaks(_loads(removal, tool), (0.95, 1.0)) for removal in (before, after)]
        (high, most), (lower, least) = ([round(peak, 2) for peak in pair] for pair in pairs)
        cutters.append(
            {"tool": tool, "target_n": round(target, 2), "peak_p95_n": [high, lower], "peak_max_n": [most, least]}
        )
    return {"by": "force", "time_min": [round(minutes_before, 3), round(minutes, 3)], "cutters": cutters}


def check_force_asked(job: Job, *, asked: bool) -> None:
    """JobError where feeds are to follow a force that is not `asked` for."""
    if job.path.feed == "force" and not asked:
        why = "the force is found by the simulation of the text: leave out --no-simulation and --no-mechanics"
        raise field_error("path", "feed", job.path.feed, why)


def check_one_feed(job: Job, why: str) -> None:
    """JobError where a job wants its feeds by the force, which what it is for does not give, as `why` says."""
    if job.path.feed == "force":
        raise field_error("path", "feed", job.path.feed, f"{why}: leave it out, or use `convert`")


def refuse_bar(job: Job, what: str) -> None:
    """JobError where a job wants what there is for a part in a bar alone, as `what` is not: a milled neck, or a probing
    program."""
    for section, name, wanted in (("holding", "neck", MILLED), ("nc", "probe", True)):
        if getattr(getattr(job, section), name) == wanted:
            raise field_error(section, name, wanted, f"{what}: leave it out, or use `convert`")


def paths_by_force(
    paths: Sequence[ToolPath], text: str, removal: Removal, machine: Machine, dialect: Dialect, job: Job
) -> tuple[tuple[ToolPath, ...], FeedSchedule]:
    """The `paths` that the `text` was posted from, with feeds by the force that its removal tells, and the schedule of
    these; ValueError where that was not asked."""
    if removal.mechanics is None:
        raise ValueError("the removal knows no force: simulate it with a workpiece")
    motions = read_program(text, machine, dialect)
    tools = [level.tool for level in removal.levels]
    schedule = feed_schedule(removal.mechanics.paths, tools, len(motions.tips))
    rows, _, away = rows_of_moves(motions, paths, dialect)
    ratios = np.full(sum(len(path.tips) for path in paths), np.inf)
    np.minimum.at(ratios, rows[~away], schedule.ratios[~away])
    ratios[~np.isfinite(ratios)] = 1.0
    around = np.vstack([path.tips for path in paths])
    before = None
    by_force = []
    first = 0
    for path in paths:
        wanted = _wanted(path, ratios[first : first + len(path.tips)], job)
        posted = post_path(wanted, machine, dialect=dialect, job=job, around=around, before=before)
        before = posted.moves.angles[-1]
        by_force.append(_reachable(path, posted))
        first += len(path.tips)
    return tuple(by_force), schedule


def _wanted(path: ToolPath, ratios: Float[ndarray, " n"], job: Job) -> ToolPath:
    """A path whose cuts have the feeds of the ratios, each no more than those of the rows beside it in its pass."""
    cuts = path.kinds == MoveKind.CUT
    goes_on = np.r_[False, cuts[1:] & cuts[:-1] & (np.diff(path.pass_index) == 0)]
    least = ratios.copy()
    least[1:] = np.where(goes_on[1:], np.minimum(least[1:], ratios[:-1]), least[1:])
    least[:-1] = np.where(goes_on[1:], np.minimum(least[:-1], ratios[1:]), least[:-1])
    feeds = path.feed_rates
    feed = path.cutter.feed
    low = np.minimum(feeds, LEAST * feed)
    high = np.maximum(feeds, fastest_cut(path.cutter, job))
    steps = _stepped(np.clip(feeds * least, low, high), feed)
    # what an axis or evenness has lowered to between two steps stays
    stepped = np.where(least < 1, np.minimum(steps, feeds), np.maximum(steps, feeds))
    changed = goes_on & (path.level not in BESIDE)
    return replace(path, feed_rates=np.where(changed, np.clip(stepped, low, high), feeds))


def _stepped(feeds: Float[ndarray, "n"], feed: float) -> Float[ndarray, "n"]:
    """The feeds rounded down to whole STEPs from the cutter's `feed`."""
    return np.asarray(feed * STEP ** np.floor(np.log(np.maximum(feeds, 1e-6) / feed) / np.log(STEP) + 1e-6))


def _reachable(path: ToolPath, posted: Posted) -> ToolPath:
    """The path with the feeds of its posted form, those that are raised no higher than the axes get to."""
    feeds = posted.path.feed_rates
    if posted.control.machine.knows_accelerations:
        rows = posted.moves.rows
        count = len(path.tips)
        way = np.bincount(rows, posted.lengths, count)
        minutes = np.bincount(rows, posted.driven_minutes, count)
        reached = np.where(minutes > 0, way / np.where(minutes > 0, minutes, 1.0), feeds)
        reached = _stepped(reached, path.cutter.feed)
        raised = feeds > path.feed_rates
        feeds = np.where(raised, np.clip(reached, path.feed_rates, np.maximum(feeds, path.feed_rates)), feeds)
    return replace(path, feed_rates=feeds)


def _loads(removal: Removal, tool: int) -> list[PathLoads]:
    """The loads of the paths of a cutter, but of those that part."""
    assert removal.mechanics is not None
    both = zip(removal.mechanics.paths, removal.levels, strict=True)
    return [path for path, level in both if level.tool == tool and path.index not in BESIDE]


class ProvedProgram(NamedTuple):
    """The paths as the machine can drive them, their program, whose header says what was checked, and the proof."""

    paths: tuple[ToolPath, ...]
    program: Program
    proof: Verification


def post_and_prove(
    planned: Sequence[ToolPath],
    machine: Machine,
    dialect: Dialect,
    job: Job,
    design: TSpline | Distances,
    *,
    given: GivenSurface | None = None,
    name: str = "BONE",
    comments: Sequence[str] = (),
    setup: SetupTexts | None = None,
    touched: float | None = None,
    stock: Stock | None = None,
    times: StageTimes | None = None,
    progress: Progress = silent,
) -> ProvedProgram:
    """Post the paths as a program of this `name`, read it back, and prove it against the `design`: a surface, or the
    distances to what must not be gouged.

    `given`, `comments`, `setup`, `touched` and `stock` are those of `verify` and `write_program`, and so are the
    errors; `times` takes the seconds of the stages nc and verify.
    """
    times = times or StageTimes()
    with times.stage("nc"):
        paths = tuple(drivable_paths(planned, machine, dialect, job))
        share = part(progress, 0.0, 0.5)
        program = write_program(
            paths,
            machine,
            dialect,
            job,
            name=name,
            comments=comments,
            stock=stock,
            setup=setup,
            touched=touched,
            progress=share,
        )

    with times.stage("verify"):
        share = part(progress, 0.5, 1.0)
        with refusing(program, paths):
            proof = verify(program.text, paths, machine, dialect, design, job=job, given=given, progress=share)
    return ProvedProgram(paths, record_checks(program, dialect, str(proof)), proof)


@dataclass(frozen=True, eq=False)
class Posting:
    """The machine and the language that programs are posted for, the files of the part (`source`) and of the program
    (`file`) that name them, and the `times` that take the seconds of each stage."""

    machine: Machine
    dialect: Dialect
    source: File = None
    file: File = None
    times: StageTimes = field(default_factory=StageTimes)


def machine_levels(made: Morphed, posting: Posting, progress: Progress) -> Result:
    """Tool paths on the levels, their program, and its proof; nothing is simulated."""
    job, machine = made.job, posting.machine
    levels = made.levels.levels
    foretold: dict[str, Any] = {}
    with posting.times.stage("toolpath"):
        share = part(progress, 0.0, 0.82)
        if job.path.strategy == "morph":
            expected = estimate(levels, job, machine.bodies)
            report(share, 0.0, f"expected: {expected}")
            foretold["estimate"] = expected.report
            planned = plan_paths(levels, made.stock, job, machine_limits(machine), share)
        else:
            plan = added("strategies", job.path.strategy)
            with run_added("strategies", job.path.strategy):
                planned = plan(levels, made.stock, job, machine_limits(machine), share)
        foretold["uncut_mm2"] = uncut_areas(planned, levels[0].mesh) if job.path.strategy == "morph" else {}
    known = {**made.report, **foretold}
    with knowing(known):
        return _posted(made, planned, known, posting, part(progress, 0.82, 1.0))


def _posted(
    morphed: Morphed, planned: Sequence[ToolPath], foretold: Mapping[str, Any], posting: Posting, progress: Progress
) -> Result:
    """The planned paths as a proved program, as in `machine_levels`; `foretold` is the report so far."""
    job = morphed.job
    levels = morphed.levels.levels
    source = posting.source
    warning_texts = warnings.header_texts(foretold, job)
    name = program_name(posting.file or source or "", posting.dialect)
    told = [f"part: {Path(source).name}"] if source else []
    if job.nc.probe:
        told.append(f"datum: {probing_name(name, posting.dialect)} writes it, run once after clamping")
    proved = post_and_prove(
        planned,
        posting.machine,
        posting.dialect,
        job,
        morph_surfaces(levels)[0],
        given=given_surface(morphed.part, job, morphed.report),
        name=name,
        comments=[*warning_texts, *told, *morphed.part.header_texts],
        stock=morphed.stock,
        times=posting.times,
        progress=progress,
    )
    reported = report_to_program(posting.file, *proved, job=job.path, part=levels[0].mesh)
    probing = None
    if job.nc.probe:
        probing = write_probing(proved.program, morphed.stock, job, posting.machine, posting.dialect)
        reported["nc"]["probe"] = probing_file(posting.file).name if posting.file else probing.name
    figures = {**foretold, **reported, "removal": NOT_SIMULATED, "mechanics": NOT_KNOWN}
    checked = cast(Report, warnings.with_warnings(figures, job))
    return Result(
        part=morphed.part,
        surface=morphed.surface,
        stock=morphed.stock,
        levels=morphed.levels,
        report=checked,
        job=job,
        paths=proved.paths,
        program=proved.program,
        probing=probing,
    )


def post_by_force(
    result: Result, posting: Posting, progress: Progress
) -> tuple[Result, Callable[[Removal, float], dict[str, Any]]]:
    """The result with feeds by the force that the simulation of its text finds, posted and proved again; and what makes
    `feed` of the report of its own removal and minutes."""
    by_force = replace(result, job=replace(result.job, path=replace(result.job.path, feed="force")))
    machine, dialect, text = posting.machine, posting.dialect, result.program.text
    with posting.times.stage("simulation"):
        cut = text, machine, dialect, result.job, result.stock, result.levels.levels
        removal = prove_removal(*cut, part(progress, 0.0, 0.6), check=False)
    paths, schedule = paths_by_force(result.paths, text, removal, machine, dialect, job=by_force.job)
    feed = partial(feed_report, schedule, removal, result.program.time_min)
    return _posted(by_force, paths, result.report, posting, part(progress, 0.6, 1.0)), feed
