"""The dialect of a job: that of its controller, with the axes, work offset, coolant, block numbers and decimals
it asks for.

The texts of a dialect that name its first work offset are replaced in all of its file, so that what is written, what
is read back and what must be stated are of the offset that the job asks for.

What a machine must have for a job: the speeds of its spindle and axes, the travel for stock and tool, and
the time for the passes.
"""

import json
import re
from dataclasses import replace

import numpy as np

from bonecam.errors import MachineError
from bonecam.job import Job, NcJob, field_error
from bonecam.job.nc_section import HOME
from bonecam.machine.limits import ANGLE_ROUNDING, farthest_side
from bonecam.machine.machine import Machine, read_machine
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect, read_dialect
from bonecam.nc.header import table_reach
from bonecam.nc.path_words import machine_limits
from bonecam.nc.rotary import choose_angles
from bonecam.planning.axes.lead import check_lead
from bonecam.planning.collision import check_bodies
from bonecam.planning.spacing import side_step
from bonecam.progress import Progress, report, silent
from bonecam.setup.stock import STOCK_CHORD_SHARE, Stock
from bonecam.text.numbers import told_apart
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind

FIRST_CODE = 53
"""Work offset n is the code of this and n: G54 is the first."""


USUAL = "heidenhain"
"""The controller of machines whose files name none."""


def controller_of(nc: NcJob) -> str:
    """The controller of the section [nc] of a job: the stated one, or the usual one of its machine."""
    return nc.controller or read_machine(nc.machine).controller or USUAL


def job_dialect(nc: NcJob) -> Dialect:
    """The dialect of the section [nc] of a job. MachineError where it has no such work offset, coolant or axes, or
    cannot leave its block numbers out."""
    try:
        dialect = read_dialect(controller_of(nc)).in_form(nc.axes)
    except MachineError as error:
        place = "" if nc.controller else f"{nc.machine}: "
        raise MachineError(f"{place}{error}", **error.evidence) from error
    if nc.work_offset > dialect.work_offsets:
        most = f"give 1 to {dialect.work_offsets}" if dialect.work_offsets > 1 else "leave it out"
        raise _refused(dialect, f"nc.work_offset = {nc.work_offset}", most)
    if nc.work_offset != 1:
        text = json.dumps(dialect.model_dump(exclude={"name"}, exclude_unset=True))
        for first, form in dialect.work_offset.items():
            own = form.format(number=nc.work_offset, code=FIRST_CODE + nc.work_offset)
            text = re.sub(rf"(?<![A-Z0-9.]){re.escape(first)}(?![0-9.])", own, text)
        dialect = Dialect.model_validate({**json.loads(text), "name": dialect.name})
    changes: dict[str, object] = {}
    if nc.coolant and nc.coolant_kind != "flood":
        if nc.coolant_kind not in dialect.coolants:
            raise _refused(dialect, f"nc.coolant_kind = {nc.coolant_kind!r}", "add it to [coolants] of its file")
        changes["templates"] = dialect.templates.model_copy(update={"coolant_on": dialect.coolants[nc.coolant_kind]})
    # what needs words that a dialect may not have: as the job says it, whether they are missing, and what has them
    templates = dialect.templates
    parks = HOME if nc.park.strip() == HOME else "park"
    name = "split" if nc.split != "none" else "split_blocks"
    split = f"nc.{name} = {getattr(nc, name)!r}"
    stops = nc.optional_stop != "none" and not templates.optional_stop
    for asked, missing, template in (
        (split, nc.is_split and dialect.calls is None, "a table [calls]"),
        (split, nc.is_split and not templates.restart, "a template restart"),
        (f"nc.optional_stop = {nc.optional_stop!r}", stops, "a template optional_stop"),
        (f"nc.park = {nc.park!r}", nc.park.strip() and not getattr(templates, parks), f"a template {parks}"),
        ("nc.probe = true", nc.probe and not dialect.probe.program, "a table [probe]"),
    ):
        if missing:
            raise _refused(dialect, asked, f"leave it out, or add {template} to its file")
    if nc.is_split and dialect.calls is not None:
        changes["needs"] = [*dialect.needs, *dialect.calls.needs]
    if not nc.block_numbers:
        if dialect.grammar == "klartext":
            raise _refused(dialect, "nc.block_numbers = false", "leave it out, its blocks have numbers")
        changes["numbering"] = dialect.numbering.model_copy(update={"format": None})
    if nc.decimals:
        numbers = dialect.numbers
        fine = {"decimals": nc.decimals}
        lengths = numbers.length.model_copy(update=fine), numbers.angle.model_copy(update=fine)
        changes["numbers"] = numbers.model_copy(update={"length": lengths[0], "angle": lengths[1]})
    return dialect.model_copy(update=changes) if changes else dialect


def machine_and_dialect(nc: NcJob) -> tuple[Machine, Dialect]:
    """The machine and the dialect of the section [nc] of a job; MachineError as in `job_dialect`."""
    return read_machine(nc.machine), job_dialect(nc)


def second_job(job: Job) -> Job:
    """The job of the second clamping: what holds the shell, the next work offset (the only one of a control that has no
    other), and no number of the program, which is that of the first one. JobError where the control has no next one."""
    dialect = read_dialect(controller_of(job.nc))
    offset = job.nc.work_offset + (dialect.work_offsets > 1)
    if offset > dialect.work_offsets:
        bound = f"the second clamping takes the next one, which {dialect.name} has not: give 1 to {offset - 2}"
        raise field_error("nc", "work_offset", job.nc.work_offset, bound)
    return replace(job, holding=job.holding.turned_over, nc=replace(job.nc, program_number=0, work_offset=offset))


def _refused(dialect: Dialect, what: str, remedy: str) -> MachineError:
    return MachineError(f"{what}: {dialect.name} has no such: {remedy}", dialect=dialect.name)


ROUND = 360
"""Steps in which the way round a part is tried."""
LOOPS = np.radians([30.0, 60.0, 90.0])
"""Polar angles of the tool axis at which it is tried, rad."""
LEVEL = 0.5
"""An axis whose direction rises by less, as a unit vector, tilts the table rather than turns it."""


def check_tools(job: Job, machine: Machine) -> None:
    """JobError where a cutter cannot be made, is driven faster or slower than the machine can, or enters a flat
    part."""
    for section in job.cutter_names:
        tool = job.tool(section)
        cutter = Cutter.from_job(0, section, tool, machine.nose)
        if tool.spindle > machine.spindle_speed:
            bound = f"{machine.name} turns at {machine.spindle_speed:g} 1/min at most: give less"
            raise field_error(section, "spindle", tool.spindle, bound)
        slowest = min(axis.speed for axis in machine.linear)
        if tool.feed > slowest:
            bound = f"an axis of {machine.name} makes {slowest:g} mm/min at most: give less"
            raise field_error(section, "feed", tool.feed, bound)
        check_lead(cutter, job.path.lead_deg)


def check_reach(job: Job, machine: Machine) -> None:
    """MachineError where the rotary axes of the machine cannot lean the tool all round as far as the sides of a stock
    need, or come to their limits on the way round where no rewind helps."""
    limits = machine_limits(machine)
    bounds = [(axis.letter, *np.degrees(axis.limits)) for axis in machine.own_rotary if axis.bounded]
    room = ", ".join(f"{letter} {low:g} to {high:g} deg" for letter, low, high in bounds)
    named = f"with {room} " if room else ""
    needed = 90.0 if job.path.strategy != "morph" else 90.0 - job.path.max_tilt_deg
    reached = float(np.degrees(limits.largest))
    if limits.reached is not None:
        # some side of a stock may be farther than the tilt from all of these tool axes
        off = float(np.degrees(farthest_side(limits.reached.samples)))
        if off > 90.0 - needed:
            what = "the tool axis leans to some sides only"
            remedy = "give wider limits, correct part_z, or take another machine (--machine)"
            raise MachineError(f"{machine.name}: {named}{what}: {remedy}", off=off)
        return
    if np.radians(needed) > limits.largest + ANGLE_ROUNDING:
        leans, sides = told_apart(max(reached, 0.0), needed)
        what = f"leans by {leans} deg all round at most, the sides of the stock need {sides}"
        remedy = "take another machine (--machine)" + (
            ", or a larger path.max_tilt_deg" if job.path.strategy == "morph" else ""
        )
        raise MachineError(f"{machine.name}: {named}the tool axis {what}: {remedy}", reached=reached)

    for tilt in LOOPS[(limits.largest >= LOOPS) & (limits.smallest <= LOOPS)]:
        # MachineError where the tool axis does not go all round at this polar angle unless the table is turned over
        azimuths = np.radians(np.arange(ROUND + 1.0))
        level = np.sin(tilt) * np.column_stack([np.cos(azimuths), np.sin(azimuths)])
        axes = np.column_stack([level, np.full(len(level), np.cos(tilt))])
        everywhere = np.ones(len(axes), dtype=bool)
        choice = choose_angles(machine, axes, np.full(len(axes), int(MoveKind.CUT)), 0.0, liftable=everywhere)
        turns = np.diff(choice.angles, axis=0)[choice.rewinds[1:]]
        for axis in machine.part_axes:
            turned = float(np.abs(turns[:, machine.column(axis) - 3]).max(initial=0.0))
            along = abs(float(machine.in_part(np.array([axis.direction]))[0, 2]))
            if along < LEVEL and turned > np.pi:
                what = f"{axis.letter} must be rewound by {np.degrees(turned):.0f} deg to go round a part"
                raise MachineError(
                    f"{machine.name}: {named}{what}, which turns the table over under the tool: take another "
                    f"machine (--machine), or give {axis.letter} limits with zero between them, if it has such",
                    axis=axis.letter,
                    turned=turned,
                )


def check_table(job: Job, machine: Machine) -> None:
    """JobError where what a job puts on the table is wider than that; MachineError as in `check_bodies`."""
    check_bodies(machine)
    table, holding = machine.table, job.holding
    across = 2 * min(table.radius, table.half_width, table.half_depth)
    for name in ("riser", "chuck", "second_chuck"):
        diameter = getattr(holding, f"{name}_diameter")
        if diameter > across:
            bound = f"the table of {machine.name} is {across:g} mm across: give less"
            raise field_error("holding", f"{name}_diameter", diameter, bound)


def check_room(stock: Stock, job: Job, machine: Machine) -> None:
    """MachineError where an axis of the machine travels less than the post, the stock on it and a tool
    need, or where what stands on the table reaches into the stock."""
    standing = sum(piece.length for piece in machine.table.standing)
    if standing > job.holding.length:
        what = f"what stands on the table reaches to z {standing:g} mm, the stock begins at {job.holding.length:g}"
        raise MachineError(
            f"{machine.name}: {what}: give a longer post (holding.length), or correct table.standing", standing=standing
        )
    height = job.holding.length + stock.length + max(job.tool(name).overhang for name in job.cutter_names)
    room = np.abs(machine.in_machine(np.diag([stock.diameter, stock.diameter, height]))).max(axis=0)
    for axis, needed in zip(machine.linear, room.tolist(), strict=True):
        if needed > axis.travel:
            asked, has = told_apart(needed, axis.travel)
            bound = f"{asked} mm are needed along {axis.letter}, its travel is {has} mm"
            remedy = "take a larger machine (--machine), or a smaller stock, a shorter post or tool"
            evidence = {"axis": axis.letter, "needed": needed, "travel": axis.travel}
            raise MachineError(f"{machine.name}: {bound}: {remedy}", **evidence)
    if machine.part_axes:
        # MachineError where Z travels less than from the part to above all that table and chuck sweep as they turn
        from_pivot = np.subtract(machine.part_zero, machine.part_axes[-1].pivot)
        farthest = float(np.linalg.norm(from_pivot)) + job.holding.length + stock.length + stock.diameter
        reach = table_reach(machine, job)
        (travel,) = (axis.travel for axis in machine.linear if axis.letter == "Z")
        if reach - farthest > travel:
            clears = f"table and chuck reach {reach:.0f} mm from the pivot, the tool clears that"
            remedy = "correct the machine's [table], or give a smaller chuck (holding.chuck_diameter)"
            message = f"{machine.name}: {clears}, Z travels {travel:.0f} mm: {remedy}"
            raise MachineError(message, axis="Z", reach=reach, travel=travel)


def check_length(part: TriangleMesh, stock: Stock, job: Job, progress: Progress = silent) -> None:
    """JobError where passes longer than `path.most_length` (m) are needed for what the stock has round the part; else
    `progress` is told their least length, and the time at the feed."""
    mesh = stock.mesh(STOCK_CHORD_SHARE * stock.diameter)
    lengths = least_lengths(part, mesh.volume, job)
    length = sum(lengths.values())
    hours = sum(lengths[name] / job.tool(name).feed for name in lengths) / 60
    if length > 1000 * job.path.most_length:
        around = f"the stock has {mesh.volume - part.volume:.3g} mm3 more than the part"
        shares = " and ".join(f"{lengths[name] / 1000:.0f} m in {name} cuts" for name in lengths)
        what = f"{around}, which takes {length / 1000:.0f} m of passes or more ({shares}), {hours:.0f} h"
        remedy = "give a smaller stock, deeper cuts with larger balls or scallops, or allow more"
        raise field_error("path", "most_length", job.path.most_length, f"{what}: {remedy}")
    report(progress, 1.0, f"{length / 1000:.0f} m of passes or more, {hours:.1f} h of cutting")


def least_lengths(part: TriangleMesh, volume: float, job: Job) -> dict[str, float]:
    """About the least length (mm) of all passes of the roughing and the finishing cuts that leave `part` of a stock of
    `volume` (mm^3).

    A cut of depth e whose passes lie L apart takes e L mm^3 a mm; the first cuts have the area of the part. Steps are
    those on a plane.
    """
    first, beyond = job.levels.cuts
    lengths = {"roughing": 0.0, "finishing": 0.0}
    left = max(volume - part.volume, 0.0)
    for level, depth in enumerate((*first, beyond)):
        name = "finishing" if job.is_finishing(level) else "roughing"
        taken = left if level == len(first) else min(depth * part.area, left)
        step = float(side_step(job.tool(name).radius, job.scallop(level + (level == len(first))), np.zeros(1))[0])
        lengths[name] += taken / (depth * step)
        left -= taken
    return lengths
