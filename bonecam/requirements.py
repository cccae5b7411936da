"""What a job has to meet before any work is done for it: sizes, cutters and machine that go together, a post
that meets the part.

Every refusal names the field with its value, the bound and the remedy.
"""

import numpy as np

from bonecam.errors import MachineError, place_name
from bonecam.job import Job, LevelsJob, StockJob, wrong
from bonecam.levels.solvers.clarabel import require_clarabel
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.machine import Machine
from bonecam.nc.tool_requirements import check_tools
from bonecam.setup.holding import post_below
from bonecam.setup.schedule import schedule_of
from bonecam.setup.stock import Stock
from bonecam.toolpath.zigzag import MAX_DEPTH_RADII

SIZES = {
    "capsule": "diameter length",
    "cylinder": "diameter length",
    "box": "width depth length",
    "mesh": "mesh scale",
}
"""What gives the size of each kind of stock."""
STOCK_CHORD, COARSE = 0.1, 0.002
"""Chord tolerance (mm, and of its diameter where that is more) of the stock's mesh that the number of cuts is
counted on."""


def check_job(job: Job, machine: Machine) -> None:
    """JobError where fields of the job do not go together, ask more of the machine than it has, or of a
    solver that is not installed."""
    check_sizes(job.stock)
    check_tools(job, machine)
    check_depths(job)
    check_method(job.levels)
    if abs(job.path.lead_deg) > job.path.max_tilt_deg:
        raise wrong(
            "path",
            "lead_deg",
            job.path.lead_deg,
            f"keep it within path.max_tilt_deg ({job.path.max_tilt_deg:g})",
        )


def check_method(levels: LevelsJob) -> None:
    """JobError where the solver of the levels is not installed."""
    if levels.method == "qcqp":
        require_clarabel()


def check_sizes(stock: StockJob) -> None:
    """JobError where a size is given that this kind of stock does not have: it would be ignored."""
    own = SIZES[stock.kind].split()
    for name in dict.fromkeys(" ".join(SIZES.values()).split()):
        value, default = getattr(stock, name), getattr(StockJob, name)
        if name not in own and value != default:
            kinds = " or ".join(kind for kind, sizes in SIZES.items() if name in sizes.split())
            raise wrong(
                "stock", name, value, f"a {stock.kind} has none: give {' and '.join(own)}, or kind = {kinds}"
            )


def check_depths(job: Job) -> None:
    """JobError where a cut is deeper than its ball may sink: nothing of the level would be cut."""
    first, beyond = job.levels.cuts
    listed = bool(job.levels.depths.strip())
    for level, depth in enumerate((*first, beyond)):
        section = "finishing" if job.is_finishing(level) else "roughing"
        radius = getattr(job, section).radius
        if depth > MAX_DEPTH_RADII * radius:
            name = "depths" if listed else "finishing_depth" if level < len(first) else "roughing_depth"
            bound = f"a ball of {section}.radius = {radius:g} mm sinks {MAX_DEPTH_RADII * radius:g} mm at most ({MAX_DEPTH_RADII:g} of it)"
            raise wrong(
                "levels", name, getattr(job.levels, name), f"{bound}: give shallower cuts or a larger ball"
            )


def check_room(stock: Stock, job: Job, machine: Machine) -> None:
    """MachineError where the stock on its post with a tool above it cannot be within the machine's travel."""
    needed = job.holding.length + stock.length + max(job.roughing.overhang, job.finishing.overhang)
    for axis in machine.linear:
        extent = needed if axis.letter == "Z" else stock.diameter
        if extent > axis.travel:
            raise MachineError(
                f"{machine.name}: {extent:.0f} mm are needed along {axis.letter}, its travel is {axis.travel:.0f} mm: "
                "take a larger machine (--machine), or a smaller stock, a shorter post or tool",
                axis=axis.letter,
                needed=extent,
                travel=axis.travel,
            )


def check_post(part: TriangleMesh, stock: Stock, job: Job, lying: tuple[float, float]) -> None:
    """JobError where the post is as wide as the stock, ToolPathError where it misses the part, which lies off
    the axis by `lying`."""
    width = float(np.ptp(stock.bounds[:, :2], axis=0).min())
    if job.holding.diameter >= width:
        bound = f"the stock is {width:.2f} mm wide"
        raise wrong(
            "holding",
            "diameter",
            job.holding.diameter,
            f"{bound}: give a post that is thinner than the part's lower end",
        )
    post_below(part, job.holding, lying)


def check_cuts(part: TriangleMesh, stock: Stock, job: LevelsJob) -> None:
    """JobError where the stock is so far from the part that more than `most_cuts` cuts are needed."""
    mesh = stock.mesh(max(STOCK_CHORD, COARSE * stock.diameter))
    distances = MeshDistance(part).unsigned(mesh.vertices)
    place, farthest = mesh.vertices[np.argmax(distances)], float(distances.max())
    cuts = schedule_of(job).lower_bound(farthest)
    if cuts > job.most_cuts:
        what = f"the stock at {place_name(place)} is {farthest:.1f} mm from the part, which takes {cuts} cuts or more"
        raise wrong(
            "levels",
            "most_cuts",
            job.most_cuts,
            f"{what}: give a smaller stock or a greater roughing_depth, or allow more",
        )
