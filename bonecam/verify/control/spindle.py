"""Whether the spindle turns and the coolant runs while a text cuts.

All cutters cut clockwise: what turns a spindle the other way is no word of any dialect.
"""

import numpy as np

from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.motions import Motions
from bonecam.tool.cutter import Cutter
from bonecam.verify.control.first_wrong import refuse_first


def check_spindle(motions: Motions, machine: Machine, dialect: Dialect) -> None:
    """VerifyError at the first feed move while the spindle stands, or turns faster than the machine or the words of
    the control allow."""
    feed = ~motions.rapid
    stands = "a feed move while the spindle stands: start it before (M3, with S)"
    refuse_first(motions, feed & (motions.spindle == 0), lambda _: stands)

    most = min(machine.spindle_speed, dialect.numbers.spindle.highest)
    bound = f"{machine.title} makes {most:g} 1/min at most: give less"
    refuse_first(motions, feed & (motions.spindle > most), lambda at: f"S{motions.spindle[at]:g}: {bound}")


def check_spindle_of_job(motions: Motions, dialect: Dialect, cutters: dict[int, Cutter]) -> None:
    """VerifyError at the first feed move with a spindle that turns faster than the job says for its cutter."""
    most = np.full(len(motions.tools), np.inf)
    for number, cutter in cutters.items():
        most[motions.tools == number] = cutter.spindle + dialect.numbers.spindle.step

    def why(at: int) -> str:
        cutter = cutters[int(motions.tools[at])]
        return f"S{motions.spindle[at]:g}: the job has {cutter.spindle:g} 1/min for {cutter.name}: give less"

    refuse_first(motions, ~motions.rapid & (motions.spindle > most), why)


def check_coolant(motions: Motions) -> None:
    """VerifyError at the first cut without coolant."""
    dry = ~motions.rapid & ~motions.links & ~motions.coolant
    why = "a cut without coolant, which the job asks for: switch it on before (M8), or nc.coolant = false"
    refuse_first(motions, dry, lambda _: why)
