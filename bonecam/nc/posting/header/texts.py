"""The comments of a program's header, as plain texts: what a machinist must know before the start."""

import math
import textwrap
from collections.abc import Sequence

import numpy as np

from bonecam.job import Job
from bonecam.job.materials.preset import read_material
from bonecam.machine.machine import Machine
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.feeds.drivable_feeds import feed_figures
from bonecam.nc.posting.header.program_zero import ZeroWords, zero_texts
from bonecam.nc.posting.path_words import Posted
from bonecam.nc.program import ProgramTime
from bonecam.planning.passes.parting import cut_groove
from bonecam.setup.stock import Stock
from bonecam.setup.stock_kind import kind_of
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.workholding.clamping import holding_columns
from bonecam.workholding.tailstock import tailstock_columns

WIDEST = 96
"""Most characters of a comment that is divided between words."""


VECTOR = [
    "tool axis: a unit vector from the tip to the spindle, along the axes of the part with all rotary axes at 0",
    "tool axis: the control takes the angles nearest to where its axes stand, and turns them evenly between blocks",
]
"""How the control must read the tool's direction, where that is a vector."""
_CHANGES = {
    "changer": "by the machine, every length measured in its tool table before the start",
    "stop": "by hand where the program stops, every length measured in the tool table before the start",
}
"""What the header says of each `nc.tool_change`."""


def part_texts(job: Job) -> list[str]:
    """That the part is mirrored or scaled, where it is."""
    return [f"the part is {change}" for change in job.mesh.changes]


def setup_texts(job: Job, stock: Stock | None, zero: ZeroWords) -> list[str]:
    """What must be mounted and where the zero is; `stock` is None where only the paths are known."""
    top = job.holding.length if stock is None else float(stock.bounds[0, 2])
    held = holding_columns(job.holding)
    stub = held.pop("stub", None)
    name, foot = ("post", 0.0) if stub is None else ("neck", stub.top)
    post = f"{name} below it: diameter {job.holding.diameter:.2f} mm, from Z {foot:.2f} to Z {top:.2f}"
    texts = [f"{post}, turned before, {'parted at the end' if job.holding.parting else 'left uncut'}", *part_texts(job)]
    if stub is not None:
        bar = f"bar of diameter {2 * stub.radius:.2f} mm, from Z {stub.bottom:.2f} to Z {stub.top:.2f}"
        texts.append(f"stub below the neck: {bar}, stock and neck are turned from it")
    if stock is not None:
        low, high = stock.bounds[:, 2].tolist()
        sizes = ", ".join(f"{name} {size:.2f}" for name, size in stock.sizes.items())
        texts = [
            f"stock: {stock.kind}, {sizes} mm, from Z {low:.2f} to Z {high:.2f}",
            f"stock: {kind_of(job.stock).shape}, mounted so before the start",
            *texts,
        ]
    texts += _tailstock_texts(job)
    over = f"program zero: {zero.over} on the axis of the post"
    if not held:
        return [
            *texts,
            "clamping: nothing of chuck, collet or vice may stand above Z 0.00",
            f"{over}, {zero.height} on the table or on top of the clamping",
        ]
    lowest = next(iter(held))
    holds = f" round the {'post' if stub is None else 'stub'}"
    names = {"riser": "a riser", "chuck": "a chuck or collet"}
    for kind, column in held.items():
        where = holds if kind == "chuck" else ""
        size = f"of at most diameter {2 * column.radius:.2f} mm{where}, up to Z {column.top:.2f}"
        texts.append(f"clamping: {names[kind]} {size}")
    return [*texts, f"{over}, {zero.height} on the table under the {lowest}"]


def _tailstock_texts(job: Job) -> list[str]:
    """What holds the free end, and where its bracket stands."""
    bodies = tailstock_columns(job.holding)
    if not bodies:
        return []
    holding = job.holding
    (column,) = bodies["column"]
    under = bodies["arm"][0]
    at = f"at X {holding.tailstock_x:.2f} Y {holding.tailstock_y:.2f}"
    what = {
        "pin": f"a steel pin of {holding.tailstock_diameter:.2f} mm {at} in a hole of the bar, drilled before",
        "neck": f"a neck of {holding.tailstock_diameter:.2f} mm {at}, turned on the bar before and held above",
    }[holding.tailstock]
    foot = f"column of diameter {2 * column.radius:.2f} mm at X {column.x:.2f} Y {column.y:.2f} on the table"
    arm = f"arm at most {holding.tailstock_arm:.2f} mm wide, from Z {under.bottom:.2f} to Z {under.top:.2f}"
    return [f"tailstock: {what}", f"tailstock: {foot}, turning with it", f"tailstock: {arm}"]


def second_setup_texts(job: Job, shell: TriangleMesh, top: float, zero: ZeroWords) -> list[str]:
    """What must be mounted and where the zero is in the second clamping: the part with a stump up to the height `top`
    (mm) in its `shell`, which the job's [holding] holds."""
    holding = job.holding
    low, high = shell.bounds[:, 2].tolist()
    chuck = "nothing of chuck or vice may stand above Z 0.00"
    if holding.chuck_height:
        size = f"diameter {holding.chuck_diameter:.2f} mm, up to Z {holding.chuck_height:.2f}"
        chuck = f"a chuck or vice of at most {size}"
    return [
        "second clamping: the parted part, turned over about X, stands in its shell",
        f"shell: from Z {low:.2f} to Z {high:.2f}, round the finished end of the part",
        f"stump: broken or sawn off, up to Z {top:.2f} at most",
        f"clamping: {chuck}",
        f"program zero: {zero.over} on the axis of the stump, {zero.height} on the table under the shell",
        "turned about X alone: +X of the part stays where it was, +Y comes to -Y",
        *part_texts(job),
    ]


def parting_texts(paths: Sequence[ToolPath]) -> list[str]:
    """What the last paths do to the post, if they part."""
    groove = cut_groove(paths)
    if groove is None:
        return []
    where = f"parting: at the end a groove of {2 * groove.radius:.2f} mm round the post at Z {groove.middle:.2f}"
    bridge = f"parting: a bridge of diameter {2 * groove.bridge:.2f} mm holds the part, break or saw it there"
    return [where, bridge]


def tool_texts(job: Job, posted: Sequence[Posted], time: ProgramTime) -> list[str]:
    """Every tool: a line that the reader takes, its shapes, its time; and where its length is measured."""
    texts = []
    own_posted = {one.path.cutter.number: one for one in posted}
    for (number, one), minutes in zip(own_posted.items(), time.tools, strict=True):
        cutter = one.path.cutter
        own = [each for each in posted if each.path.cutter.number == number]
        cuts = [each.path.feed_rates[each.path.kinds == MoveKind.CUT] for each in own]
        fastest = float(np.concatenate(cuts).max(initial=0.0))
        texts += [
            tool_text(cutter, one.control.tool_length),
            *(f"tool {number}: {text}" for text in _shapes(cutter)),
            f"tool {number}: stick-out {cutter.overhang:.2f} mm, S{cutter.spindle:.0f}, F{fastest:.0f} at most, "
            f"about {minutes:.1f} min",
        ]
    figures = feed_figures(posted, job.path.feed_at)
    source = ""
    if not all(getattr(job, name).spindle and getattr(job, name).feed for name in job.cutter_names):
        material = read_material(job.material.name)
        source = f"speeds not in the job are of {material.title}: {material.source}; {material.note}"
    return [
        *texts,
        "tool lengths: planned, from the spindle nose to the tip of the ball; enter the measured ones",
        *textwrap.wrap(source, WIDEST),
        f"tool change: {_CHANGES[job.nc.tool_change]}",
        "holders and shanks: none wider, no stick-out shorter than above",
        f"cutting feeds: median {figures.median:.0f}, a tenth below {figures.low:.0f} mm/min: "
        f"an axis limits {100 * figures.limited:.0f} percent",
    ]


def _shapes(cutter: Cutter) -> list[str]:
    """The shapes of a cutter from the tip up, mm, two cylinders or cones a line; without the spindle. Of a bull
    nose or flat end first what a tool table with corners must have: texts of dialects speak of balls."""
    reported = []
    for section in cutter.profile:
        end = f" to {2 * section.end_radius:.2f}" if section.end_radius != section.radius else ""
        if section.name != "spindle":
            reported.append(f"{section.name} to {section.end:.2f} diameter {2 * section.radius:.2f}{end}")
    table = f"a {cutter.end_name}: R {cutter.radius:.4f}, corner R2 {cutter.corner:.4f} in the tool table, no ball"
    shapes = [", ".join(reported[at : at + 2]) for at in range(0, len(reported), 2)]
    return [table, *shapes] if cutter.is_bull else shapes


def tool_text(cutter: Cutter, tool_length: float) -> str:
    """The comment of the header that describes a cutter, mm; `reading.modal_state` reads it."""
    kind, sizes = "BALL", f"RADIUS {cutter.radius:.4f}"
    if cutter.is_bull:
        kind = "BULL" if cutter.corner else "FLAT"
        sizes += f" CORNER {cutter.corner:.4f}" if cutter.corner else ""
        sizes += f" LEAD {math.degrees(cutter.lead):.4f}"
    return f"TOOL {cutter.number} {kind} {sizes} LENGTH {tool_length:.4f}"


def control_texts(machine: Machine, dialect: Dialect, posted: Sequence[Posted]) -> list[str]:
    """What the control must have and how it must be set: the programmed point, rapids, words of endless axes."""
    centre = posted[0].control.programs_centre
    point = "BALL CENTRE" if centre else "TOOL TIP"
    where = "IN THE PART" if dialect.tool_centre else "IN MACHINE COORDINATES"
    switch = dialect.tool_centre_switch(machine)
    notes = (switch.centre if centre else switch.tip) if switch else []
    rapids = "rapids: the control must drive them straight, all axes arriving together"
    if not dialect.straight_rapids:
        rapids = "rapids: only above the part, elsewhere feeds, as the control may bend them"
    return [
        *(f"needs: {_of_machine(need, machine)}" for need in dialect.needs),
        f"programmed point: {point} {where}",
        *zero_texts(machine, dialect),
        *(VECTOR if dialect.vector else []),
        *(_of_machine(note, machine) for note in notes),
        rapids,
        *_body_texts(machine),
    ]


def _of_machine(text: str, machine: Machine) -> str:
    """A line of a dialect with the axes of the machine in the place of its fields."""
    letters = [axis.letter for axis in machine.own_rotary]
    wound = [axis.letter for axis in machine.own_rotary if axis.endless] or letters
    fields = {
        "{count}": {4: "four", 5: "five"}[len(machine.letters)],
        "{rotary}": " and ".join(letters),
        "{zero}": " ".join(f"{letter} 0" for letter in letters),
        "{wound}": " and ".join(wound),
    }
    for field, value in fields.items():
        text = text.replace(field, value)
    return text


def _body_texts(machine: Machine) -> list[str]:
    """The bodies of the machine that the paths were kept clear of."""
    nose = ", ".join(
        f"{piece.length:.0f} mm of diameter {max(piece.diameter, piece.top_diameter):.0f}" for piece in machine.nose
    )
    table = machine.table
    size = "of any size"
    if math.isfinite(table.radius):
        size = f"of diameter {2 * table.radius:.0f}"
    elif math.isfinite(table.half_width):
        size = f"of {2 * table.half_width:.0f} x {2 * table.half_depth:.0f}"
    return [f"kept clear of: a spindle nose of {nose or 'no known size'}; a table {size} mm"]
