"""The blocks behind the last retract: the table levelled and the spindle parked, where a job asks for it."""

import math

import numpy as np

from bonecam.errors import MachineError
from bonecam.job import Job, NcJob, field_error
from bonecam.job.nc_section import HOME, park_position
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.axis_words import word_texts


def check_end(job: Job, machine: Machine) -> None:
    """JobError where the park position is outside the limits of X or Y, or these are not known; MachineError where a
    rotary axis that is to be levelled cannot stand at zero."""
    position = park_position(job.nc.park) or ()
    for axis, value in zip(machine.linear, position, strict=False):
        low, high = axis.limits
        if not math.isfinite(high - low):
            why = f"{machine.name} states the travel of {axis.letter}, not its limits: give these in a machine file"
            raise field_error("nc", "park", job.nc.park, why)
        if not low <= value <= high:
            why = f"{axis.letter} of {machine.name} runs from {low:g} to {high:g} mm: give a place within"
            raise field_error("nc", "park", job.nc.park, why)
    if job.nc.table_level:
        for rotary in machine.own_rotary:
            low, high = np.degrees(rotary.limits)
            if not low <= 0.0 <= high:
                what = f"{rotary.letter} of {machine.name} cannot stand at zero ({low:g} to {high:g} deg)"
                raise MachineError(
                    f"{what}: leave nc.table_level out", machine=machine.name, axis=rotary.letter
                )


def end_blocks(machine: Machine, dialect: Dialect, nc: NcJob) -> list[str]:
    """The blocks of the end, the tool being above everything: rotary axes to zero, then X and Y."""
    lines = list[str]()
    length = dialect.numbers.length
    if nc.table_level:
        rotary = word_texts(machine, dialect, np.zeros(5))[3:]
        lines += dialect.lines("position", rotary=" ".join(rotary))
    if nc.park.strip() == HOME:
        lines += dialect.lines("home")
    position = park_position(nc.park)
    if position is not None:
        x, y = map(length.text, position)
        lines += dialect.lines("park", linear=f"X{x} Y{y}")
    return lines
