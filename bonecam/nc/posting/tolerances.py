"""The tolerances that a program gives the control, level by level.

The contour tolerance of a finishing level is a multiple of the path's chord tolerance (the dialect's
`tolerance_factor`; a control smooths best between 1.1 and 2 of it: Heidenhain, iTNC 530 cycle programming, section
12.5 on cycle 32), that of a roughing level the job's `nc.roughing_tolerance`.

The rotary tolerance: with tool-centre control the programmed tip stays while the rotary axes deviate, and the
centre of the ball, R above it, swings by R sin(TA). So TA is at most asin(T / R), T being the chord tolerance
(finishing) or the roughing tolerance.
"""

import math

from bonecam.job import Job
from bonecam.nc.dialect import Dialect


def contour_tolerance(dialect: Dialect, job: Job, finishing: bool) -> float:
    """How far the control may leave the programmed points, mm."""
    fine = dialect.tolerance_factor * job.path.chord_tolerance
    return fine if finishing else max(job.nc.roughing_tolerance, fine)


def rotary_tolerance_deg(dialect: Dialect, job: Job, finishing: bool, radius: float) -> float:
    """How far the rotary axes may leave their words, degrees, for a ball of `radius` mm; rounded down, but at least
    one last decimal of an angle."""
    allowed = job.path.chord_tolerance if finishing else max(job.nc.roughing_tolerance, job.path.chord_tolerance)
    step = dialect.numbers.angle.step
    angle = math.degrees(math.asin(min(allowed / radius, 1.0)))
    return max(math.floor(angle / step + 1e-9) * step, step)
