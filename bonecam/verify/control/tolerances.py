"""Whether a text lets its control leave the programmed points by no more than its job does."""

import numpy as np

from bonecam.job import Job
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.tolerances import contour_tolerance
from bonecam.nc.reading.motions import Motions
from bonecam.verify.control.first_wrong import refuse_first


def check_tolerance(motions: Motions, dialect: Dialect, job: Job) -> None:
    """VerifyError at the first feed move under a contour tolerance (mm) larger than the job's for roughing, or left to
    the control. Nothing is known where the dialect has no words for it."""
    most = contour_tolerance(dialect, job, finishing=False)
    wide = ~motions.rapid & (motions.tolerances > most + dialect.numbers.length.step)

    def why(at: int) -> str:
        value = motions.tolerances[at]
        message = f"is {value:g} mm" if np.isfinite(value) else "is left to the control"
        return f"the contour tolerance {message}, the job allows {most:g} mm: correct it in a line before"

    refuse_first(motions, wide, why)
