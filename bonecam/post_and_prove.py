"""From planned paths to a proved program: `convert`, `finish`, the second clamping and the filter end in it."""

from collections.abc import Sequence
from dataclasses import dataclass

from bonecam.job import Job
from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.feeds import drivable_paths
from bonecam.nc.header import record_checks
from bonecam.nc.posting import write_program
from bonecam.nc.program import Program
from bonecam.progress import Progress, part, silent
from bonecam.report.outputs import refusing
from bonecam.runtime.timing import StageTimes
from bonecam.setup.stock import Stock
from bonecam.surface.tspline import TSpline
from bonecam.tool.path import ToolPath
from bonecam.verify.findings import GivenSurface
from bonecam.verify.gouge import Distances
from bonecam.verify.proof import Verification, verify


@dataclass(frozen=True, eq=False)
class ProvedProgram:
    """The paths as the machine can drive them, their program, whose header says what was checked, and the proof."""

    paths: tuple[ToolPath, ...]
    program: Program
    proof: Verification


def post_and_prove(
    planned: Sequence[ToolPath],
    machine: Machine,
    dialect: Dialect,
    job: Job,
    design: TSpline | Distances,
    *,
    given: GivenSurface | None = None,
    name: str = "BONE",
    comments: Sequence[str] = (),
    setup: Sequence[str] = (),
    stock: Stock | None = None,
    times: StageTimes | None = None,
    progress: Progress = silent,
) -> ProvedProgram:
    """Post the paths as a program of this `name`, read it back, and prove it against the `design`: a surface, or the
    distances to what must not be gouged.

    `given`, `comments`, `setup` and `stock` are those of `verify` and `write_program`, and so are the errors; `times`
    takes the seconds of the stages nc and verify.
    """
    times = times or StageTimes()
    with times.stage("nc"):
        paths = tuple(drivable_paths(planned, machine, dialect, job))
        share = part(progress, 0.0, 0.5)
        program = write_program(
            paths, machine, dialect, job, name=name, comments=comments, stock=stock, setup=setup, progress=share
        )

    with times.stage("verify"):
        share = part(progress, 0.5, 1.0)
        with refusing(program, paths):
            proof = verify(program.text, paths, machine, dialect, design, job=job, given=given, progress=share)
    return ProvedProgram(paths, record_checks(program, dialect, str(proof)), proof)
