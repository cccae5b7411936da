"""The probing program: run once after clamping, it finds axis and end of the bar and writes the datum that the program
calls.

The end is touched from above, and the side at two heights from four directions each. The axis at the upper height and
the end become the datum. The control stops where the bar leans so that at the lower end of the stock its axis is off by
more than its run-out allows. Where words are machine coordinates the datum belongs to the
pivots of the machine, not to the bar: there it is written from the machine's file, and the bar is only checked.

The words are the dialect's ([probe] of its file). No reader of ours proves them.

The probe goes down beside the bar only, from a height over its end, and comes no nearer to what clamps it than the
tool does.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bonecam.errors import MachineError
from bonecam.job import Job, field_error
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.header import check_at_zero, of_machine, table_reach, touch_heights
from bonecam.nc.path_words import APPROACH_HEIGHT
from bonecam.nc.program import Program, program_name, program_number
from bonecam.nc.words import comments_of, number_blocks, word_texts
from bonecam.planning.blank import bar_of
from bonecam.setup.stock import Stock
from bonecam.workholding.clamping import holding_columns

ROUND = ("capsule", "cylinder")
"""Kinds of stock whose side is round."""
ROUGH = 3.0
"""By hand the datum is set within so much before, mm."""
CLEAR = 20.0
"""The probe crosses over the end of the bar so far above it, mm."""
SIDE = 5.0
"""It goes down so far beside the bar, and looks for it over twice this, mm: more than ROUGH."""
SHORTEST = 5.0
"""Heights that are nearer to one another tell no lean, mm: a probe repeats to some um."""


@dataclass(frozen=True)
class Probing:
    """The text of a probing program, ending with a newline, and its name."""

    text: str
    name: str


@dataclass(frozen=True)
class ProbedBar:
    """What is touched, mm in the part's frame: the `end`, the side of this `radius` at the heights of the ball's centre
    `upper` and `lower`, at which the axis may be off by `lean`; `clamped` is the top of what clamps it."""

    end: float
    radius: float
    upper: float
    lower: float
    lean: float
    clamped: float


def probing_file(file: str | Path) -> Path:
    """The file of the probing program beside that of a program: bone_probe.h beside bone.h."""
    path = Path(file)
    return path.with_name(f"{path.stem}_probe{path.suffix}")


def probing_name(name: str, dialect: Dialect) -> str:
    """The name of the probing program of a program of this `name`."""
    return program_name(f"{name}_probe", dialect)


def check_probing(stock: Stock, job: Job, machine: Machine) -> None:
    """JobError or MachineError where a job wants a probing program and there is none for its bar or its machine."""
    if job.nc.probe:
        probed_bar(stock, job)
        check_upright(machine)


def check_upright(machine: Machine) -> None:
    """MachineError where a machine cannot stand with all rotary axes at zero, or the bar does not stand upright so."""
    check_at_zero(machine, "nc.probe", ", where a bar is probed")
    if not np.allclose(machine.in_machine(np.array([[0.0, 0.0, 1.0]])), [[0.0, 0.0, 1.0]]):
        what = f"the bar does not stand along Z of {machine.name} with all rotary axes at zero, so no cycle probes it"
        raise MachineError(f"{what}: leave nc.probe out", machine=machine.name)


def probed_bar(stock: Stock, job: Job) -> ProbedBar:
    """Where the bar of a job is touched: as high and as low as the header tells for a dial, but the ball stays off what
    clamps the bar, and the body of the probe off its end. JobError where the probe does not get there."""
    nc, holding = job.nc, job.holding
    bar = bar_of(stock, holding)
    cutters = len(job.cutter_names)
    what = ""
    if nc.part_zero != "bar":
        what = 'the end of the bar is the datum that is probed: give nc.part_zero = "bar"'
    elif holding.has_tailstock:
        what = "the bracket of the tailstock stands over the end of the bar: leave it out"
    elif bar is None and stock.kind not in ROUND:
        what = f"the side of a {stock.kind} is not round: leave it out, or give stock.kind = 'capsule' or 'cylinder'"
    if what:
        raise field_error("nc", "probe", nc.probe, what)
    if nc.probe_tool <= cutters:
        raise field_error("nc", "probe_tool", nc.probe_tool, f"tools 1 to {cutters} are cutters: give more")

    columns = holding_columns(holding)
    clamped = max((column.top for name, column in columns.items() if name != "stub"), default=0.0)
    end = bar.top if bar else float(stock.bounds[1, 2])
    highest, lowest = touch_heights(job, stock)
    foot = lowest
    if bar is None:
        # on the stock alone, which has one diameter: the stub below the neck has another
        foot = float(stock.bounds[:, 2].sum()) - highest
    upper = highest - nc.probe_radius
    lower = max(foot, clamped + nc.probe_radius + holding.clearance, end - nc.probe_length + holding.clearance)
    if upper - lower < SHORTEST:
        where = f"the side can be touched from {lower:.1f} to {upper:.1f} mm over the table, two heights are wanted"
        raise field_error(
            "nc",
            "probe_length",
            nc.probe_length,
            f"{where} that are {SHORTEST:g} mm apart: give a longer stylus, a smaller ball (probe_radius), a bar that "
            "stands out farther (holding.length), or leave nc.probe out",
        )
    radius = bar.radius if bar else stock.diameter / 2
    # no farther off than the run-out allows down to where the part's neck begins
    lean = job.path.gouge_tolerance * min((upper - lower) / (upper - float(stock.bounds[0, 2])), 1.0)
    return ProbedBar(end, radius, upper, lower, lean, clamped)


def write_probing(program: Program, stock: Stock, job: Job, machine: Machine, dialect: Dialect) -> Probing:
    """The probing program of a program on the `stock` of a job. JobError or MachineError as of `check_probing`."""
    nc = job.nc
    check_upright(machine)
    bar = probed_bar(stock, job)
    length = dialect.numbers.length
    name = probing_name(program.name, dialect)
    shift = machine.in_machine(np.array([[0.0, 0.0, program.zero_height]]))[0]
    zero = np.zeros(3) if dialect.tool_centre else np.array(machine.part_zero)
    # heights over the table as words
    over = float(zero[2]) - program.zero_height
    reaches = [bar.end + float(machine.part_zero[2])]
    if machine.part_axes:
        # what swings as the rotary axes go to zero stays below the probe
        pivot = np.array(machine.part_axes[-1].pivot)
        to_end = np.array(machine.part_zero) + np.array([0.0, 0.0, bar.end]) - pivot
        reaches.append(pivot[2] + max(float(np.linalg.norm(to_end)) + bar.radius, table_reach(machine, job)))
    retract = np.ceil(max(reaches) + CLEAR + APPROACH_HEIGHT) - (machine.part_zero[2] if dialect.tool_centre else 0.0)
    numbers = {
        "x": zero[0],
        "y": zero[1],
        "end": bar.end + over,
        "near": bar.end + over + SIDE,
        "search": bar.end + over - SIDE,
        "upper": bar.upper + over,
        "lower": bar.lower + over,
        "clear": bar.end + over + CLEAR,
        "upper_drop": bar.upper - bar.end - CLEAR,
        "lower_drop": bar.lower - bar.end - CLEAR,
        "retract": retract - program.zero_height,
        "diameter": 2 * bar.radius,
        "radius": nc.probe_radius,
        "side": SIDE,
        "start": bar.radius + nc.probe_radius + SIDE,
        "beyond": bar.radius + nc.probe_radius - SIDE,
        "off": job.path.gouge_tolerance,
        "lean": bar.lean,
        "room": job.holding.clearance,
    }
    texts = {key: length.text(float(value)) for key, value in numbers.items()}
    datum = " ".join(f"{letter}{length.text(float(value))}" for letter, value in zip("XYZ", shift, strict=True))
    switch = dialect.tool_centre_switch(machine)
    lines = dialect.probe.program.format(
        **texts,
        name=name,
        number=program_number(name),
        comments="\n".join(
            line
            for text in _header_texts(program, bar, job, machine, dialect, datum=datum, over=over)
            for line in comments_of(text, dialect)
        ),
        tool_centre_off=switch.off if switch else "",
        endless=dialect.endless_block,
        rotary=" ".join(word_texts(machine, dialect, np.zeros(5))[3:]),
        tool=nc.probe_tool,
        stop="\n".join(dialect.lines("stop", tool=nc.probe_tool) if nc.tool_change == "stop" else []),
        row=nc.work_offset,
        datum=datum,
    ).split("\n")
    text, _ = number_blocks([line for line in lines if line], dialect)
    return Probing(text, name)


def _header_texts(
    program: Program, bar: ProbedBar, job: Job, machine: Machine, dialect: Dialect, *, datum: str, over: float
) -> list[str]:
    """What must be known before the start; heights (mm) are told as words, `over` them those over the table."""
    nc = job.nc
    end, upper, lower, clamped = (
        f"Z {round(height + over, 2) + 0.0:.2f}" for height in (bar.end, bar.upper, bar.lower, bar.clamped)
    )
    before = [
        f"before: set datum {nc.work_offset} by hand, X 0 Y 0 on the axis of the bar, Z 0 on its end, "
        f"within {ROUGH:g} mm",
        "it writes this datum: X Y from the axis at the upper height, Z from the end",
    ]
    if not dialect.tool_centre:
        before = [
            f"it writes datum {nc.work_offset} as the words want it: {datum} in machine coordinates of its file",
            f"it stops where the axis of the bar is off by more than {job.path.gouge_tolerance:.3f} mm, "
            f"or its end by more than {job.holding.clearance:g}",
        ]
    return [
        f"probing program of {program.name}: run it once after clamping, before that program",
        f"machine {machine.title}",
        f"control {dialect.title}",
        "unproved: no line of this program was read back or simulated, run it block by block in the air first",
        *(f"needs: {of_machine(need, machine)}" for need in dialect.probe.needs),
        *before,
        f"probe: tool {nc.probe_tool}, ball radius {nc.probe_radius:.3f} mm, stylus {nc.probe_length:.1f} mm or longer "
        "from the middle of the ball to the body, calibrated; the spindle stands",
        f"bar: diameter {2 * bar.radius:.2f} mm, its end at {end}, what clamps it up to {clamped}",
        f"touched: the end, and the side at {upper} and {lower}, from {SIDE:g} mm beside it",
        f"lean: the axis at {lower} within {bar.lean:.3f} mm of that at {upper}, else it stops",
    ]
