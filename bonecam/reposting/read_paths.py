"""Tool paths of a file that was written elsewhere: cutter location data, or a program of another machine and control.

The cutters are those of the job on the machine that is posted for. Where its spindle is slower, a cut that is faster
than its cutter may be there is slowed to that, so that no tooth takes a larger chip.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import ProgramError
from bonecam.files import required_text
from bonecam.job import Job, NcJob
from bonecam.machine.machine import Machine, read_machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.parts.joined import joined
from bonecam.nc.posting.feeds.drivable_feeds import fastest_cut
from bonecam.nc.reading.read import read_program
from bonecam.report.tables.cl_data import ClPath, read_apt
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.verify.removal.groups import groups_of

SAME_BALL = 1e-3
"""Radii that differ by less are of one ball, mm."""


def read_paths(
    file: Path, origin: tuple[str | Path, str | Path | None] | None, job: Job, machine: Machine
) -> list[ToolPath]:
    """The tool paths of a file: of APT statements, or of a program for the machine and controller of `origin`.
    ProgramError where it cannot be read, has no moves, or uses a cutter that the job does not have."""
    try:
        if origin is None:
            paths = list(_of_apt(required_text(file, "cutter location data"), job, machine))
        else:
            dialect = job_dialect(NcJob(machine=str(origin[0]), controller=str(origin[1] or "")))
            text = joined(file, dialect).text
            paths = list(_of_program(text, read_machine(origin[0]), dialect, job, machine))
    except ProgramError as error:
        raise ProgramError(f"{file}: {error}", **error.evidence) from error
    if not paths:
        raise ProgramError(f"{file}: it has no moves: give cutter location data with GOTO", file=str(file))
    return paths


def slowed_cuts(paths: Sequence[ToolPath], job: Job) -> tuple[list[ToolPath], int]:
    """The paths with no cut faster than the job lets its cutter cut, and how many of their moves are slowed."""
    slowed = []
    count = 0
    for path in paths:
        fast = (path.kinds == MoveKind.CUT) & (path.feed_rates > fastest_cut(path.cutter, job))
        feeds = np.where(fast, fastest_cut(path.cutter, job), path.feed_rates)
        slowed.append(replace(path, feed_rates=feeds))
        count += int(fast.sum())
    return slowed, count


def _of_apt(text: str, job: Job, machine: Machine) -> Iterator[ToolPath]:
    """The paths of APT statements; those without a level are numbered down to 0."""
    paths = read_apt(text).paths
    for left, path in zip(range(len(paths))[::-1], paths, strict=True):
        cutter = _cutter(path.tool, _ball(path), path.level, job, machine)
        links = _links(path, cutter, job)
        kinds = np.select([path.rapid, links], [int(MoveKind.RAPID), int(MoveKind.LINK)], int(MoveKind.CUT))
        level = left if path.level is None else path.level
        yield _tool_path(level, cutter, kinds=kinds, poses=(path.tips, path.axes), feeds=path.feed_rates, job=job)


def _links(path: ClPath, cutter: Cutter, job: Job) -> Bool[ndarray, " n"]:
    """The moves that lead from cut to cut: as the text tells, or else those as fast as the job's links."""
    if path.links is not None:
        return path.links
    return (path.feed_rates >= job.nc.link_feed) & (path.feed_rates > fastest_cut(cutter, job))


def _ball(path: ClPath) -> float:
    """The radius of the ball of a path's cutter, mm; ProgramError where it is none."""
    if abs(path.corner - path.diameter / 2) > SAME_BALL:
        what = f"tool {path.tool} of diameter {path.diameter:g} mm has a corner of {path.corner:g} mm and no ball"
        raise ProgramError(f"{what}: give paths of ball-end cutters")
    return path.corner


def _of_program(text: str, origin: Machine, dialect: Dialect, job: Job, machine: Machine) -> Iterator[ToolPath]:
    """The paths of a program for another machine and control, one a level and tool; feeds are those of its tip."""
    motions = read_program(text, origin, dialect)
    way = np.linalg.norm(np.diff(motions.tips, axis=0, prepend=motions.tips[:1]), axis=1)
    feeds = np.where(motions.inverse_time, motions.feed_rates * way, motions.feed_rates)
    feeds = np.where(feeds > 0, feeds, job.nc.link_feed)
    groups = list(groups_of(text, motions, dialect))
    for left, group in zip(range(len(groups))[::-1], groups, strict=True):
        rows = group.moves
        if motions.described[group.tool].corner is not None:
            what = f"tool {group.tool} is no ball: give paths of ball-end cutters"
            raise ProgramError(what, tool=group.tool)
        cutter = _cutter(group.tool, motions.controls[group.tool].radius, group.level, job, machine)
        kinds = np.select(
            [motions.rapid[rows] | ~motions.known_start[rows], motions.links[rows]],
            [int(MoveKind.RAPID), int(MoveKind.LINK)],
            int(MoveKind.CUT),
        )
        level = left if group.level is None else group.level
        poses = motions.tips[rows], motions.axes[rows]
        yield _tool_path(level, cutter, kinds=kinds, poses=poses, feeds=feeds[rows], job=job, rest=group.rest)


def _cutter(number: int, radius: float, level: int | None, job: Job, machine: Machine) -> Cutter:
    """The cutter of a job with a ball of this radius (mm), under its number there, with its feed on a level if that is
    known; `number` is that of the paths."""
    for own, name in enumerate(job.cutter_names, 1):
        tool = job.tool(name, level if job.path.strategy == "morph" else None)
        if abs(tool.radius - radius) <= SAME_BALL:
            return Cutter.from_job(own, name, tool, machine.nose)
    known = ", ".join(f"{name} {getattr(job, name).radius:g}" for name in job.cutter_names)
    what = f"tool {number} is a ball of radius {radius:g} mm, the job has {known}"
    raise ProgramError(f"{what}: describe it in the job (like --set finishing.radius={radius:g})", tool=number)


def _tool_path(
    level: int,
    cutter: Cutter,
    kinds: Int[ndarray, " n"],
    poses: tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]],
    feeds: Float[ndarray, " n"],
    job: Job,
    rest: int = 0,
) -> ToolPath:
    """The tool path of moves, each stretch of cuts a pass."""
    cut: Bool[ndarray, " n"] = kinds == MoveKind.CUT
    number = np.cumsum(cut & ~np.r_[False, cut[:-1]]) - 1
    unknown = np.full((len(kinds), 3), np.nan)
    return ToolPath(
        level=level,
        cutter=cutter,
        kinds=kinds.astype(np.int64),
        pass_index=np.where(cut, number, -1),
        parameters=unknown[:, :2],
        contacts=unknown,
        tips=poses[0],
        axes=poses[1],
        feed_rates=np.where(kinds == MoveKind.RAPID, job.nc.rapid_feed, feeds),
        uncut=np.zeros((0, 3)),
        reasons=(),
        rest=rest,
    )
