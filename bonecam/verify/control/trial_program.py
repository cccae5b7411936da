"""A trial program before the first stage: whether a machine and a control's dialect fit one another and the job.

A few moves of every cutter at the height of the part, posted and read back as the program will be. What a dialect
cannot write (too few decimals, a range that the feeds leave), what its own grammar cannot read, and a machine that
it does not know show here in a few milliseconds instead of after all paths.
"""

from itertools import cycle

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import MachineError, ProgramError, VerifyError
from bonecam.job import Job
from bonecam.machine.kinematics import tool_axes
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.write import write_program
from bonecam.nc.reading.read import read_program
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.verify.control.check import check_control
from bonecam.verify.readback import Tolerances, compare_moves

LEAN = np.radians(5.0)
"""Turn of both rotary axes between the two trial paths, rad."""
STEPS = np.array([[0.0, 0.0, 0.0], [1.2345, 0.4567, -0.7891], [2.6543, -0.3217, 0.1239]])
"""Cuts of the trial, mm from the first: with more decimals than a control needs."""
ABOVE = (12.3456, 2.3457)
"""Heights of the rapid and the link above the first and the last cut, mm along the tool axis."""


def check_posting(job: Job, machine: Machine, dialect: Dialect) -> None:
    """MachineError where no program of this job can be written for the machine in the dialect, or not be read back."""
    names = job.cutter_names
    # two tool axes that the machine reaches: at its zero, or the limits next to it, and a little further
    low, high = np.array([axis.limits for axis in machine.rotary]).T
    zero = np.clip(0.0, low, high)
    further = np.where(zero + LEAN <= high, zero + LEAN, np.maximum(zero - LEAN, low))
    axes = tool_axes(machine, np.array([zero, further]))
    cutters = [Cutter.from_job(number, name, job.tool(name)) for number, name in enumerate(names, 1)]
    paths = [
        _path(cutter, level, axis, job) for cutter, level, axis in zip(cutters, range(len(names))[::-1], cycle(axes))
    ]
    try:
        program = write_program(paths, machine, dialect, job, name="TRIAL", comments=["trial"])
        motions = read_program(program.text, machine, dialect)
        check_control(motions, machine, dialect, job)
        compare_moves(motions, paths, dialect, Tolerances())
    except (ProgramError, VerifyError) as error:
        what = f"a trial program of {machine.name} in the dialect {dialect.name} is wrong: {error}"
        remedy = "take a machine and a controller that fit one another and the job, or correct their files"
        raise MachineError(f"{what}: {remedy}", machine=machine.name, dialect=dialect.name) from error


def _path(cutter: Cutter, level: int, axis: Float[ndarray, "3"], job: Job) -> ToolPath:
    """Cuts beside the middle of the stock's lower end, with the rapids and links before and after them."""
    cuts = STEPS + np.array([0.1237, 0.2346, job.holding.length + 0.3459])
    above = [cuts[end] + height * axis for end in (0, -1) for height in ABOVE]
    tips = np.vstack([above[:2], cuts, above[:1:-1]])
    kinds = np.array(
        [MoveKind.RAPID, MoveKind.LINK, *[MoveKind.CUT] * len(cuts), MoveKind.LINK, MoveKind.RAPID], dtype=np.int64
    )
    nc = job.nc
    feeds = [nc.rapid_feed, nc.plunge_feed, *[cutter.feed] * len(cuts), nc.link_feed, nc.rapid_feed]
    unknown = np.full((len(tips), 3), np.nan)
    return ToolPath(
        level=level,
        cutter=cutter,
        kinds=kinds,
        pass_index=np.where(kinds == MoveKind.CUT, 0, -1),
        parameters=unknown[:, :2],
        contacts=unknown,
        tips=tips,
        axes=np.tile(axis, (len(tips), 1)),
        feed_rates=np.array(feeds),
        uncut=np.zeros((0, 3)),
        reasons=(),
    )
