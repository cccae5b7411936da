"""What would make a neck hold that gives way, and what the report tells of the necks that were tried.

Tried are a pin at the free end, shallower finishing cuts with lower scallops, stiffer finishing cutters of the same
ball, slower spindles where part and stock swing too near to the teeth; pin, cuts and spindles together where nothing
alone is enough.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.job.tool_list import known_cutters
from bonecam.machine.limits import MachineLimits
from bonecam.mechanics.cutter import cutter_compliance
from bonecam.mechanics.strip import lighter_jobs
from bonecam.planning.estimate import LayersToCut
from bonecam.planning.holding.neck_figures import FREQUENCY_MULTIPLE, Neck, neck_figures, wanted_of
from bonecam.planning.holding.post_length import STOCK_CHORD
from bonecam.setup.placement import Setup
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import post_below
from bonecam.workholding.tailstock import settled_bracket, with_pin

STEP = 100.0
"""Spindle speeds that are told are multiples of this, 1/min."""


@dataclass(frozen=True)
class NeckRemedy:
    """A change of the job in words, and the neck that is taken, with it."""

    change: str
    neck: Neck


def neck_remedies(setup: Setup, job: Job, limits: MachineLimits, taken: Neck) -> tuple[NeckRemedy, ...]:
    """The changes with which the neck of a job holds that is `taken` and gives way; where none alone is enough, the
    first few together that are, or what comes nearest. None where the neck holds."""
    if taken.holds:
        return ()
    layers = LayersToCut.between(setup.part.mesh, setup.stock.mesh(STOCK_CHORD))

    def figures(change: str, one: Setup, changed: Job) -> NeckRemedy:
        return NeckRemedy(change, neck_figures(one, changed, limits, layers))

    pinned = _pinned(setup, job, limits)
    tried = [figures(*pinned)] if pinned else []
    for change, lighter in lighter_jobs(job):
        tried.append(figures(change, setup, lighter))
        if tried[-1].neck.holds:
            break
    for change, stiffer in _stiffer(job, limits):
        tried.append(figures(change, setup, stiffer))
        if tried[-1].neck.holds:
            break
    tried += [figures(change, setup, slower) for change, slower in _slower(job, taken)]
    enough = tuple(one for one in tried if one.neck.holds)
    if enough:
        return enough
    standings = [("", setup, job), *([pinned] if pinned else [])]
    for before, one, asked in standings:
        for change, lighter in lighter_jobs(asked):
            both = figures(f"{before} and {change}" if before else change, one, lighter)
            slow = [figures(f"{both.change} and {what}", one, slower) for what, slower in _slower(lighter, both.neck)]
            for remedy in (both, *slow):
                if remedy.neck.holds:
                    return (remedy,)
                tried.append(remedy)
    return tuple(sorted(tried, key=lambda one: one.neck.shift_um)[:1])


def _stiffer(job: Job, limits: MachineLimits) -> Iterator[tuple[str, Job]]:
    """The job with finishing cutters that are known by name, of its ball and stiffer than its own, and these in words,
    the stiffest last. Their scallop, speed and feed stay those of the job."""

    def compliance(one: Job) -> float:
        return cutter_compliance(Cutter.from_job(2, "finishing", one.tool("finishing"), limits.bodies.nose))

    found = list[tuple[float, str, Job]]()
    for listed in known_cutters(job.nc.tools):
        if (listed.tool.shape, listed.tool.radius) == ("ball", job.finishing.radius):
            other = replace(job, finishing=listed.in_section(job.finishing))
            found.append((compliance(other), f'finishing.preset = "{listed.name}"', other))
    own = compliance(job)
    for gives, change, other in sorted(found, key=lambda one: -one[0]):
        if gives < own:
            yield change, other


def _slower(job: Job, taken: Neck) -> Iterator[tuple[str, Job]]:
    """The job whose teeth pass as slowly as a neck asks, and its spindles in words; none where they do."""
    if taken.first_hz >= wanted_of(job).first_hz:
        return
    edges = 60 * taken.first_hz / FREQUENCY_MULTIPLE  # a minute
    tools = {name: job.tool(name) for name in job.cutter_names}
    slower = {
        name: {"spindle": float(np.floor(edges / tool.flutes / STEP)) * STEP}
        for name, tool in tools.items()
        if tool.flutes * tool.spindle > edges
    }
    try:
        yield (
            " and ".join(f"{name}.spindle = {value['spindle']:g}" for name, value in slower.items()),
            job.with_values(**slower),
        )
    except JobError:  # slower than a spindle turns
        return


def _pinned(setup: Setup, job: Job, limits: MachineLimits) -> tuple[str, Setup, Job] | None:
    """A pin at the free end in words, and setup and job with it; None where a tailstock is there, or the table has no
    room for it."""
    given = with_pin(job.holding)
    if given is None:
        return None
    change, holding = given
    part = setup.part.mesh
    try:
        holding = settled_bracket(holding, part, limits.bodies.table)
        return change, replace(setup, post=post_below(part, holding)), replace(job, holding=holding)
    except JobError:
        return None


def neck_report(necks: Sequence[Neck], remedies: Sequence[NeckRemedy], job: Job, *, stated: bool) -> dict[str, Any]:
    """`necks` of the report's section `post`, and whether the one that is taken was `stated`; where it gives way what
    is wanted of it and with what it `holds_with`. Nothing where no neck was judged."""
    if not necks:
        return {}
    told: dict[str, Any] = {"neck_stated": stated, "necks": [neck.report for neck in necks]}
    if necks[0].holds:
        return told
    helps = [{"change": one.change, **one.neck.report} for one in remedies]
    return told | {"neck_wanted": asdict(wanted_of(job)), "holds_with": helps}
