"""Kept paths posted for the machines that come with bonecam, read back and held against their limits.

    python tests/benchmarks/bench_machines.py FOLDER[:PART] ...

FOLDER is what `--keep` of a run wrote; its surface, or PART, must not be gouged. Columns: moving blocks; minutes with
the accelerations that the machine file knows; error of tip and gouge as read back; the largest speed that a feed block
asks of an axis, as a share of what it can; the share of the cutting time that is lost to the axes, beyond the length
over the feed that the cutter asks for: by their speeds / with their accelerations too; cutting blocks, and those driven
at less than half of that feed, which the summary tells. A machine that refuses the paths tells why.
"""

import sys
from pathlib import Path

import numpy as np
from bonecam_plugins.reposting import Posted, post

import bonecam
from bonecam.job import read_job
from bonecam.machine.kinematics import inverse_linear
from bonecam.machine.machine import read_machine
from bonecam.nc.motions import Motions
from bonecam.nc.path_words import post_path
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect
from bonecam.tool.path import MoveKind

PAIRS = (
    ("mikron-ucp600", "heidenhain"),
    ("mikron-ac", "siemens-840d"),
    ("dmu-45", "heidenhain"),
    ("dmu-45", "siemens-840d"),
    ("hermle-c600u", "heidenhain"),
    ("haas-umc750", "fanuc-30i"),
    ("haas-umc750", "makino"),
    ("haas-umc750", "mitsubishi"),
    ("hms125u", "siemens-840d"),
    ("linuxcnc-xyzac", "linuxcnc"),
    ("linuxcnc-xyzbc", "linuxcnc"),
    ("pocket-nc", "linuxcnc"),
)
"""Machines and controls of their kind."""
LARGEST_TIP = 1.0
"""Of a tip error as read back, um, beyond half of the last decimal of each of its three words."""
SHORTEST = 0.01
"""The rounding of words makes the speed of a shorter block, mm."""
ROUNDED = 1e-5
"""rad."""
COLUMNS = "paths | machine | control | blocks | minutes | tip um | gouge um | axis speed | lost | cuts | slow cuts"


def speed_share(motions: Motions) -> float:
    """The largest speed that a feed block asks of an axis, as a share of what it can."""
    joints = np.zeros((len(motions.rapid), 5))
    for number, control in motions.controls.items():
        rows = motions.tools == number
        joints[rows] = inverse_linear(control.machine, motions.tips[rows], motions.words[rows, 3:], control.tool_length)
    machine = control.machine
    speeds = np.array([axis.speed for axis in (*machine.linear, *machine.rotary)])
    driven = np.flatnonzero(~motions.rapid & motions.known_start & (np.diff(motions.tools, prepend=-1) == 0))
    steps = joints[driven] - joints[driven - 1]
    length = np.linalg.norm(motions.tips[driven] - motions.tips[driven - 1], axis=1)
    minutes = np.where(motions.inverse_time[driven], 1.0, length) / motions.feed_rates[driven]
    told = length > SHORTEST
    return float((np.abs(steps[told]) / minutes[told, None] / speeds).max())


def outside(motions: Motions) -> int:
    """How many moves leave the limits of a rotary axis."""
    machine = next(iter(motions.controls.values())).machine
    low, high = np.array([axis.limits for axis in machine.rotary]).T
    rotary = motions.words[:, 3:]
    return int(np.count_nonzero((rotary < low - ROUNDED) | (rotary > high + ROUNDED)))


def times(made: Posted) -> tuple[float, float, float, int]:
    """Minutes of the program with accelerations; the shares of the cutting time that are lost to the axes without these
    and with them; and the number of cutting blocks."""
    machine, dialect = read_machine(made.job.nc.machine), job_dialect(made.job.nc)
    around = np.vstack([path.tips for path in made.proved.paths])
    before = None
    whole = asked = slowed = taken = 0.0
    count = 0
    for path in made.proved.paths:
        posted = post_path(path, machine, dialect, made.job, around, before=before)
        before = posted.moves.angles[-1]
        minutes = posted.driven_minutes
        cuts = posted.moves.kinds == MoveKind.CUT
        whole += minutes.sum()
        asked += posted.lengths[cuts].sum() / path.cutter.feed
        slowed += posted.minutes[cuts].sum()
        taken += minutes[cuts].sum()
        count += int(np.count_nonzero(cuts))
    return whole, 1 - asked / slowed, 1 - asked / taken, count


def row(folder: Path, part: Path, machine: str, controller: str) -> list[str]:
    """One line of the table; AssertionError where the program is not what it must be."""
    job = read_job(folder / "job.toml").with_values(nc={"machine": machine, "controller": controller})
    head = [folder.parent.name if folder.name == "kept" else folder.name, machine, controller]
    try:
        made = post(folder / "toolpath.apt", part, job)
    except bonecam.BonecamError as error:
        return [*head, f"refused: {str(error).split(':')[0]}: {str(error).split(':')[1].strip()}"]
    dialect = job_dialect(job.nc)
    motions = read_program(made.program.text, read_machine(machine), dialect)
    proof, feeds = made.proved.proof, made.program.feeds
    tip = 1000 * proof.readback_tip_error_mm
    speed = speed_share(motions)
    assert tip <= LARGEST_TIP + 1000 * 3**0.5 * dialect.numbers.length.step / 2
    assert outside(motions) == 0
    assert speed <= 1 + 1e-3
    minutes, lost, lost_too, cuts = times(made)
    return [
        *head,
        *(f"{made.program.moves}", f"{minutes:.1f}", f"{tip:.2f}", f"{1000 * max(proof.gouge.depth, 0):.1f}"),
        *(f"{speed:.2f}", f"{100 * lost:.0f} / {100 * lost_too:.0f} %", f"{cuts}", f"{feeds.under_half}"),
    ]


if __name__ == "__main__":
    print(COLUMNS)
    for given in sys.argv[1:]:
        place, _, solid = given.partition(":")
        for machine, controller in PAIRS:
            print(" | ".join(row(Path(place), Path(solid or place), machine, controller)), flush=True)
