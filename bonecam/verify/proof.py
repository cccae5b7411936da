"""The proof of a posted text: read back (`nc/reading`), judged as its control would run it (`control`), compared with
the tool paths (`readback.py`), and checked for gouges of the part (`gouge.py`)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.mesh.distance import MeshDistance
from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.read import read_program
from bonecam.progress import Progress, report, silent
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ToolPath
from bonecam.verify.control.check import check_control
from bonecam.verify.gouge import Distances, Gouge, measure_gouge
from bonecam.verify.readback import Tolerances, compare_moves
from bonecam.verify.removal.given import GivenSurface

DESIGN_CHORD = 0.001
"""Largest chord tolerance (mm) of the tessellated design surface: DESIGN_SHARE of the gouge allowed by
default."""
DESIGN_SHARE = 0.1
"""Part of the gouge allowed that the tessellated design surface may deviate by."""


@dataclass(frozen=True)
class Verification:
    """What was measured on the text; `gouge`: where the ball enters the part deepest, or least clears it; `given`: the
    same of the mesh as given, None where none was."""

    moves: int
    rows: int
    readback_tip_error_mm: float
    readback_axis_error_deg: float
    gouge: Gouge
    given: Gouge | None = None

    def __str__(self) -> str:
        """What was proved, in the words of the program's header."""
        tip = f"tip within {1000 * self.readback_tip_error_mm:.2f} um"
        axis = f"axis within {self.readback_axis_error_deg:.4f} deg of the path"
        gouge = f"gouge {1000 * max(self.gouge.depth, 0.0):.2f} um"
        if self.given is not None:
            gouge += f", {1000 * max(self.given.depth, 0.0):.1f} um of the mesh as given"
        return f"text read back, {tip}, {axis}, {gouge}"


def verify(
    text: str,
    paths: Sequence[ToolPath],
    machine: Machine,
    dialect: Dialect,
    part: TSpline | Distances,
    *,
    job: Job | None = None,
    given: GivenSurface | None = None,
    progress: Progress = silent,
) -> Verification:
    """Read `text` back and prove that the control runs it as the `job` means, against the paths and the part.

    `part` is the design surface, or the distances to what must not be gouged. A surface is tessellated finely: the
    tessellation's own deviation is not seen, but in the gouge of the mesh as `given`.
    ProgramError where the text cannot be read, VerifyError (with `line`, `place`, `error`) where it is wrong.
    """
    report(progress, 0.0, "reading the program back")
    allowed = Tolerances(gouge=job.path.gouge_tolerance) if job else Tolerances()
    if isinstance(part, TSpline):
        part = MeshDistance(part.tessellate(min(DESIGN_CHORD, DESIGN_SHARE * allowed.gouge)))
    motions = read_program(text, machine, dialect)
    check_control(motions, machine, dialect, job)
    checked = compare_moves(motions, paths, dialect, allowed)
    gouge = measure_gouge(motions, part)
    if gouge.depth > allowed.gouge:
        place = ", ".join(f"{value:.3f}" for value in gouge.place)
        raise VerifyError(
            f"line {gouge.line}: the ball enters the part by {gouge.depth:.4f} mm at ({place}), "
            f"allowed {allowed.gouge:g}: make path.chord_tolerance and path.max_step smaller",
            line=gouge.line,
            place=gouge.place,
            error=gouge.depth,
        )
    into_given = None
    if given is not None:
        into_given = measure_gouge(motions, given)
        given.check_gouge(into_given)
    return Verification(
        moves=motions.blocks,
        rows=checked.rows,
        readback_tip_error_mm=float(checked.tip_error.max(initial=0.0)),
        readback_axis_error_deg=float(np.degrees(checked.axis_error.max(initial=0.0))),
        gouge=gouge,
        given=into_given,
    )
