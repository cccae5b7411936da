"""The second program of a part that was parted: it stands turned over in its shell, and its stump is cut off.

The material at its start is what the simulation of the first program left above the middle of the groove, where the
bridge is broken or sawn. Its text is proved like the first one: read back, checked for gouges of part and shell, and
simulated, on the same rays and normal probes.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
from jaxtyping import Bool
from numpy import ndarray
from scipy.spatial import KDTree

from bonecam.errors import BendingError, BonecamError, Cancelled, JobError, VerifyError, file_error
from bonecam.files import check_files
from bonecam.job import Job, field_error
from bonecam.job.holding_section import LEAST_POST
from bonecam.levels.measure import morph_surfaces
from bonecam.machine.machine import Machine
from bonecam.machining import ProvedProgram, Standing, post_and_prove
from bonecam.material.dexels import Dexels
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.facets import vertex_areas, vertex_normals
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.mesh.part import Part, with_filled_pits
from bonecam.mesh.triangle_mesh import MeshLike, TriangleMesh, mesh_from
from bonecam.mesh.units import mm_of
from bonecam.nc.dialect import Dialect
from bonecam.nc.header import record_simulation, second_setup_texts
from bonecam.nc.path_words import machine_limits
from bonecam.nc.program import program_name, second_program_file
from bonecam.nc.requirements import job_dialect, second_job
from bonecam.planning.contacts import POST_CLEARANCE, at_post
from bonecam.planning.scene import PART_CHORD
from bonecam.planning.stump import (
    StumpPlaces,
    check_second,
    cut_groove,
    groove_below,
    parting_cutters,
    second_paths,
    stump_balls,
)
from bonecam.progress import Progress, part, report, silent
from bonecam.report.kept import Result, SecondProgram
from bonecam.report.outputs import File
from bonecam.report.stage_reports import nc_report, toolpath_report
from bonecam.report.typed import SecondFigures
from bonecam.report.warnings import NOT_ASKED, with_warnings
from bonecam.runtime.timing import StageTimes
from bonecam.setup.placement import place
from bonecam.surface.files.surface_input import read_part
from bonecam.tool.path import ToolPath
from bonecam.verify.findings import LEFT, GivenSurface, Removal, given_surface
from bonecam.verify.proof import solids_stock
from bonecam.verify.removal import beside_given, check_removal_of_job, simulate_stump
from bonecam.verify.sweeping import NormalProbes, SimulatedStock, height_field_of_rays
from bonecam.workholding.post import Column, Post, post_below
from bonecam.workholding.shell import PrintedShell, SecondClamping, check_shell, printed_shell, read_shell, turned_over

WALL, GAP = 3.0, 0.1
"""Least wall of a shell and what it keeps from the part where nothing else is said, mm."""
CENTRES = 0.25
"""Balls that leave the fillet at the post are so far apart, mm: cusps of 0.01 mm under a ball of 4 mm."""
OVER = 1.0
"""The foretold stump goes so far below the place where it is cut off, mm."""
MOST_COVERED, LEAST_COVERED, COVERED_STEP = 0.8, 0.2, 0.1
"""Share of the part's height that a shell is tried to cover, from the most down to the least."""
SHELL_ROOM = 1.0
"""The tool stays so far from a printed shell, mm: its print and screws may be off by some tenths."""
THINNER = 0.7
"""A thinner post that is tried, as a share of that which is refused."""
MOST_FORETOLD = 3
"""So many shells are foretold at most: each takes as long as the second program."""
BESIDE = 0.1
"""Rim of a shell over what the ball needs, mm: what its mesh may be off."""


def second_program(
    first: Result,
    machine: Machine,
    dialect: Dialect,
    program: File,
    progress: Progress = silent,
    *,
    mechanics: bool = True,
) -> SecondProgram:
    """The program that cuts the stump off a part that `first` parted, and whose job has a second clamping; `program` is
    the file of the first one, `dialect` has the work offset of `second_job`. Without `mechanics` force and bending are
    not asked.

    OrientationError, MachineError or VerifyError where there is no such program, or it is not proved.
    """
    job = second_job(first.job)

    # The part that `first` parted, turned over in its shell
    shell, groove = read_shell(first.job, first.part), cut_groove(first.paths)
    assert shell is not None
    assert groove is not None
    design = morph_surfaces(first.levels.levels)[0].tessellate(PART_CHORD)
    clamping = turned_over(design, shell, first.job.holding, groove.middle)

    # What stands, and its normal probes that a finishing ball left at the post
    assert first.removal is not None
    before = first.removal.remaining.probes
    post = post_below(first.part.mesh, first.job.holding)
    held = at_post(before.points, before.normals, post.alone, job.tool("finishing").radius)
    given = given_surface(first.part, first.job, first.report).move(clamping.pose)
    file = second_program_file(program, dialect) if program else None
    proved, removal = _stump_program(
        clamping,
        first.removal.remaining,
        held,
        job,
        machine,
        dialect,
        name=program_name(file or "second", dialect),
        given=given,
        mechanics=mechanics,
        progress=progress,
    )
    after = removal.remaining.probes
    paths = tuple(_told(path, after) for path in proved.paths)
    posted = record_simulation(proved.program, dialect, removal.cell, str(removal.mechanics or NOT_ASKED["skipped"]))
    reported = {
        "file": file.name if file else "",
        **nc_report(posted, proved.proof),
        # what kept more than LEFT at the post before and behind the second program
        "at_post_before_mm2": round(float(before.areas[held & (before.heights > LEFT)].sum()), 3),
        "at_post_after_mm2": round(float(after.areas[held & (after.heights > LEFT)].sum()), 3),
        "at_post_after_max_mm": round(float(after.heights[held].max(initial=0.0)), 4),
        "at_tailstock_mm2": round(first.removal.left.by_reason["tailstock"], 3) if first.removal.left else 0.0,
        "toolpath": toolpath_report(paths, float(np.radians(job.path.least_lead_deg))),
        "mechanics": NOT_ASKED,
        **removal.sections,
    }
    figures = cast(SecondFigures, with_warnings(reported, job))
    return SecondProgram(Path(first.part.file).name, clamping, paths, posted, removal, report=figures, job=job)


def _stump_program(
    clamping: SecondClamping,
    standing: SimulatedStock,
    held: Bool[ndarray, " n"],
    job: Job,
    machine: Machine,
    dialect: Dialect,
    *,
    name: str,
    given: GivenSurface | None,
    mechanics: bool,
    progress: Progress,
) -> tuple[ProvedProgram, Removal]:
    """The program of a second clamping for what is `standing` on the post, with its proof, and what it removes; `held`
    are the normal probes that stayed at the post."""
    material = standing.above(clamping.cut_off).move(clamping.pose)
    planned = second_paths(
        clamping,
        StumpPlaces(material.probes.points[held], material.probes.normals[held]),
        top=clamping.top,
        fields=partial(height_field_of_rays, sets=material.sets, grid=material.grid),
        job=job,
        limits=machine_limits(machine),
        progress=part(progress, 0.0, 0.7),
    )
    proved = post_and_prove(
        planned,
        machine,
        dialect,
        job,
        MeshDistance(clamping.solids),
        given=given,
        name=name,
        setup=partial(second_setup_texts, job, clamping.shell, clamping.top),
        touched=float(clamping.shell.bounds[1, 2]),
    )
    solids = clamping.part, clamping.shell
    cut = proved.program.text, machine, dialect, job, material, *solids, part(progress, 0.8, 1.0)
    removal = simulate_stump(*cut, mechanics=mechanics)
    if given is not None:
        removal = beside_given(removal, given, None, job)
    check_removal_of_job(removal, job)
    return proved, removal


def foretell_second(
    standing: Standing, shell: TriangleMesh, machine: Machine, progress: Progress = silent, *, mechanics: bool = True
) -> float:
    """How near (mm) the tool of the second program comes to the shell, and the errors of that program, of a part that
    stands on its post, before its first one is planned: the second one is made for a part that is finished but for the
    fillet that the finishing ball leaves at the post, and the stump."""
    setup, job = standing.setup, standing.job
    body, post, limits = setup.part.mesh, setup.post, machine_limits(machine)
    lowest = float(body.bounds[0, 2])
    cutters = parting_cutters(job, limits.bodies)
    cut_off = min(groove_below(lowest, post, job.holding, cutter).middle for cutter in cutters)
    clamping = turned_over(body, shell, job.holding, cut_off)
    normals = vertex_normals(body)
    probes = NormalProbes(body, body.vertices, normals, vertex_areas(body))
    radius = job.tool("finishing").radius
    corner = Column(post.radius + radius, post.top, cut_off - OVER)
    stands = _with_fillet(solids_stock([body], [corner], probes), body, post.alone, corner, radius)
    held = at_post(body.vertices, normals, post.alone, radius)
    second = second_job(job)
    _, removal = _stump_program(
        clamping,
        stands,
        held,
        second,
        machine,
        job_dialect(second.nc),
        name="second",
        given=None,
        mechanics=mechanics,
        progress=progress,
    )
    nearest = removal.shell.least if removal.shell is not None else None
    return nearest.value if nearest is not None else np.inf


def _with_fillet(
    stands: SimulatedStock, body: TriangleMesh, post: Post, corner: Column, radius: float
) -> SimulatedStock:
    """What balls of a `radius` (mm) leave of a part and a thick column, its `corner` at the post: the fillet."""
    wide = corner.radius + radius
    sides = np.arange(-wide, wide + CENTRES, CENTRES)
    heights = np.arange(corner.bottom, corner.top + radius, CENTRES)
    centres = np.stack(np.meshgrid(sides, sides, heights, indexing="ij"), axis=-1).reshape(-1, 3)
    off = np.minimum(post.distance(centres) - POST_CLEARANCE, MeshDistance(body).signed(centres, 2 * radius)) - radius
    centres = centres[(off >= 0) & (off < 2 * CENTRES)]
    balls = centres, np.broadcast_to([0.0, 0.0, 1.0], centres.shape)
    return replace(stands, sets=Dexels(tuple(stands.sets), stands.grid).without(balls, balls, radius).sets)


def with_second(
    stand: Callable[[Job], Standing],
    stated: Job,
    machine: Machine,
    times: StageTimes,
    progress: Progress,
    *,
    whole: bool,
    mechanics: bool,
) -> Standing:
    """The part that `stand` puts on its post as the job `stated` says, whose second program is foretold to be proved,
    if its job has one; if it is to be made `whole`, with the shell that is made for it and written to `holding.second`
    and beside it: the highest of those tried with which the second program is proved.

    Errors of `stand`, `read_shell` and `foretell_second`, with the first of `_changes` with which it is proved.
    """
    standing = stand(stated)
    job, body = standing.job, standing.setup.part
    if not job.holding.second:
        return standing
    with times.stage("foretold"):
        refused: tuple[BonecamError, Standing, TriangleMesh] | None = None
        foretold = 0
        for made in _shells(standing) if whole else [None]:
            job = shell_job(made, job, job.holding.second) if made is not None else job
            shell = made.solid if made is not None else read_shell(job, body)
            assert shell is not None
            tried = replace(standing, job=job)
            report(progress, 0.0, f"foretelling the second clamping in a shell of {np.ptp(shell.bounds[:, 2]):.1f} mm")
            before = foretold
            try:
                if made is not None:  # one that is read has been checked
                    check_shell(shell, body.mesh, job.holding)
                check_second(shell, body.mesh, standing.setup.post, job)
                foretold += 1
                room = foretell_second(tried, shell, machine, progress, mechanics=mechanics)
                if made is not None and room < SHELL_ROOM:
                    what = f"the tool comes within {room:.2f} mm of the shell, a printed one keeps {SHELL_ROOM:g} mm"
                    raise VerifyError(f"{what}: leave more of the part free", line=0)
            except Cancelled:
                raise
            except BonecamError as error:
                if refused is None or foretold > before == 0:
                    refused = error, tried, shell
                if isinstance(error, BendingError) or foretold == MOST_FORETOLD:
                    break  # a lower shell bends more
                continue
            if made is not None:
                write_shell(made, body, job)
            return tried
        if refused is None:
            what = "--whole: no shell holds the part and leaves the ball its room at the post"
            remedy = "give a thinner post (holding.diameter) or a smaller finishing ball, or leave it out"
            raise JobError(f"{what}: {remedy}", section="holding", field="second")
        wrong, tried, shell = refused
        if not foretold:
            raise wrong
        names = []
        helps = ""
        for change, values in _changes(tried.job, wrong):
            report(progress, 0.5, f"foretelling the second clamping with {change}")
            names.append(change)
            try:
                if "holding" in values:
                    tried = stand(stated.with_values(**values))
                    made = next(_shells(tried), None) if whole else None
                    other = made.solid if made is not None else read_shell(tried.job, tried.setup.part)
                    assert other is not None
                    check_second(other, tried.setup.part.mesh, tried.setup.post, tried.job)
                    shell = other
                changed = replace(tried, job=tried.job.with_values(**values))
                room = foretell_second(changed, shell, machine, progress, mechanics=mechanics)
            except Cancelled:
                raise
            except BonecamError:
                continue
            if whole and room < SHELL_ROOM:
                continue
            helps = f"give {change}, with which it is proved"
            break
        helps = helps or f"neither with {', nor with '.join(names)}: cut the stump off by hand"
        found = str(wrong).split(": ")[0] if isinstance(wrong, BendingError) else str(wrong)
        raise type(wrong)(f"the second program is refused before planning: {found}: {helps}", **wrong.evidence)


def _shells(standing: Standing) -> Iterator[PrintedShell]:
    """Shells round a standing part from the highest down that leaves the ball its room at the post."""
    job, part = standing.job, standing.setup.part.mesh
    low, high = part.bounds[:, 2].tolist()
    balls = stump_balls(part, standing.setup.post, job)[:, 2]
    rim = float(balls.max(initial=low)) + job.tool("finishing").radius + job.path.clearance + BESIDE
    most = min(MOST_COVERED, (high - rim) / (high - low))
    for covered in np.arange(most, LEAST_COVERED, -COVERED_STEP).tolist():
        yield printed_shell(part, covered, WALL, GAP)


def _changes(job: Job, error: BonecamError) -> Iterator[tuple[str, dict[str, dict[str, float]]]]:
    """Changes of a job in words that may help against what refuses its second program, and their values."""
    rough, fine = round(job.levels.layer_depth / 2, 3), round(job.levels.finishing_depth / 2, 3)
    lighter = {"roughing_depth": rough}
    if isinstance(error, BendingError):
        feeds = {name: round(job.tool(name).feed / 2, 1) for name in ("roughing", "finishing")}
        slower = {name: {"feed": feed} for name, feed in feeds.items()}
        yield " and ".join(f"{name}.feed = {feed:g}" for name, feed in feeds.items()), slower
        yield f"levels.roughing_depth = {rough:g}", {"levels": lighter}
        lighter |= {"finishing_depth": fine}
        yield f"levels.roughing_depth = {rough:g} and levels.finishing_depth = {fine:g}", {"levels": lighter}
        return
    scallop = round(job.roughing.scallop / 2, 3) or fine
    yield f"roughing.scallop = {scallop:g}", {"roughing": {"scallop": scallop}}
    deeper = round(2 * job.levels.finishing_depth, 3)
    yield f"levels.finishing_depth = {deeper:g}", {"levels": {"finishing_depth": deeper}}
    thinner = round(THINNER * job.holding.diameter, 1)
    if thinner >= LEAST_POST:
        yield f"holding.diameter = {thinner:g}", {"holding": {"diameter": thinner}}


def clamping_shell(
    mesh: "str | Path | MeshLike",  # a text, as help() would write the union out
    job: Job | None = None,
    *,
    output: str | Path,
    covered: float = 0.5,
    wall: float = WALL,
    gap: float = GAP,
) -> Job:
    """Write a shell to print for the second clamping of a part that is placed as the job says, and return the job that
    names it: `holding.parting`, `second`, `second_flat` and `second_pin`.

    It is a cylinder about the axis of the post round the upper `covered` share of the part, at least `wall` mm thick,
    `gap` mm off the part, in two halves that two screws M3 x 10 draw together, with a flat, a hole for a pin and an
    arrow. `output` (.stl or .ply) has both halves where they stand, in frame and unit of the part's file; for shell.stl
    shell.print.stl and shell.print.3mf have them on a printer's bed, mm. ValueError where these make no shell,
    FileError where a file cannot be written.
    """
    job = job or Job()
    file = Path(output)
    check_shell_files(file, [mesh])
    given = mesh if isinstance(mesh, str | Path) else mesh_from(mesh)
    part, _ = read_part(given, job)
    part = with_filled_pits(part, job.smallest_ball)
    placed = place(part, job).part
    made = printed_shell(placed.mesh, covered, wall, gap)
    job = shell_job(made, job, str(file))
    write_shell(made, placed, job)
    return job


def shell_job(made: PrintedShell, job: Job, file: str) -> Job:
    """The job with a printed shell of this `file`."""
    values = {"parting": True, "second": file, "second_flat": made.flat, "second_pin": made.pin}
    return job.with_values(holding=values)


def write_shell(made: PrintedShell, placed: Part, job: Job) -> None:
    """Write a printed shell of a placed part to the file `holding.second` of a job, in frame and unit of the part's
    file, and beside it to two files to print, mm."""
    file = Path(job.holding.second)
    shell = made.solid.move(np.linalg.inv(placed.transform))
    write_mesh(TriangleMesh(shell.vertices / mm_of(job.mesh.units), shell.faces), file)
    for to_print in printed_files(file):
        write_mesh(made.to_print, to_print)


def printed_files(file: Path) -> tuple[Path, ...]:
    """The files to print beside that of a shell: shell.print.stl and shell.print.3mf."""
    return tuple(file.with_suffix(f".print{ending}") for ending in (".stl", ".3mf"))


def check_shell_files(file: Path, inputs: Sequence[object]) -> None:
    """FileError where a shell cannot be written to a file, and beside it to be printed."""
    if file.suffix.lower() not in (".stl", ".ply"):
        raise file_error(file, "is no file for a shell", "end its name in .stl or .ply")
    check_files([file, *printed_files(file)], [each for each in inputs if isinstance(each, str | Path)])


def whole_job(job: Job | None, program: File) -> Job:
    """The job of a part that is made whole: it parts, and its shell is written beside the `program`.

    JobError where the job has a shell already, or nothing is written."""
    job = job or Job()
    if job.holding.second:
        raise field_error("holding", "second", job.holding.second, "--whole makes a shell: leave one of them out")
    if program is None:
        raise JobError("whole: the shell is written beside the program: name its file (program)")
    return job.with_values(holding={"parting": True, "second": str(Path(program).with_suffix(".shell.stl"))})


def check_simulated(job: Job, *, simulation: bool) -> None:
    """JobError where a job wants a second program, which begins with what the simulation of the first leaves, and no
    simulation."""
    if job.holding.second and not simulation:
        why = "the second program begins with what the simulation of the first leaves: simulate it"
        raise field_error("holding", "second", job.holding.second, why)


def _told(path: ToolPath, probes: NormalProbes) -> ToolPath:
    """The path without those of its hidden places that nothing stays on: the ball that cuts beside them took it."""
    hidden = np.array([reason == "hidden" for reason in path.reasons], dtype=bool)
    if not hidden.any():
        return path
    kept = ~hidden | (probes.heights[KDTree(probes.points).query(path.uncut)[1]] > LEFT)
    reasons = tuple(reason for reason, known in zip(path.reasons, kept, strict=True) if known)
    return replace(path, uncut=path.uncut[kept], reasons=reasons)
