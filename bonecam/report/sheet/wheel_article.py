"""The page of the sheet for a wheel: the turned blank on its post, and the wheel in it."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from bonecam.job import Job
from bonecam.machine.bodies import Table
from bonecam.machine.machine import read_machine
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.posting.header.program_zero import ZeroWords, zero_words
from bonecam.nc.posting.header.texts import setup_texts
from bonecam.nc.program import Program
from bonecam.report.pictures.views import section
from bonecam.report.sheet.drawing import Paper, draw_table, draw_zero
from bonecam.report.sheet.setup_sheet import IN_AIR, article, bending_checks, items, left_lines, proof_lines
from bonecam.report.warnings import warning_texts
from bonecam.setup.turned_blank import TurnedBlank

PROFILE = "the blank's profile stands in blank.csv of the kept folder and in the report, rows (radius, Z)"
"""Where the machinist finds what to turn."""


def wheel_article(
    name: str,
    solid: TriangleMesh,
    blank: TurnedBlank,
    job: Job,
    program: Program,
    report: Mapping[str, Any],
    version: str,
) -> str:
    """The one clamping of a wheel."""
    machine = read_machine(job.nc.machine)
    zero = zero_words(machine, job_dialect(job.nc))
    return article(
        name,
        program,
        job,
        report["nc"],
        version,
        heading="Setup sheet: wheel",
        caption="From the front (\u2212Y), sizes in mm: the blank, and the wheel in section Y 0.",
        mounted="Blank, clamping, zero",
        drawing=_drawing(solid, blank, job, machine.table, zero),
        setup=items([blank.text, PROFILE, *setup_texts(job, None, zero)]),
        checks=items(_checks(report)),
        left=items(left_lines(report, "blades and hub")),
        warnings=items([*warning_texts(report["warnings"]), IN_AIR]),
    )


def _drawing(solid: TriangleMesh, blank: TurnedBlank, job: Job, table: Table, zero: ZeroWords) -> str:
    radius = blank.diameter / 2
    top = float(blank.profile[:, 1].max())
    low = float(blank.profile[:, 1].min())
    paper = Paper(radius, top)
    draw_table(paper, table)
    paper.column(job.holding.diameter / 2, 0.0, low, "post")
    paper.path(np.vstack([blank.profile, blank.profile[::-1] * [-1.0, 1.0]]), "stock")
    for ends in section(solid, np.zeros(3), np.eye(3)[1])[:, :, [0, 2]]:
        paper.path(ends, "part", closed=False)
    paper.height(0.0, low, radius, 32.0, f"{low:.2f}")
    paper.height(low, top, radius, 32.0, f"{top - low:.2f}")
    paper.width(radius, top, f"\u2300 {blank.diameter:.2f}", 4.0)
    draw_zero(paper, zero)
    return paper.svg("Turned blank, wheel, post and table from the front")


def _checks(report: Mapping[str, Any]) -> Iterator[str]:
    """What was checked, and how well it held."""
    yield from proof_lines(report["nc"])
    wheel = report["wheel"]
    yield f"{wheel['blades']} blades, {wheel['gap_mm']:.2f} mm apart where they are nearest"
    removal = report["removal"]
    if "skipped" not in removal:
        cell = removal["cell_mm"]
        yield f"Simulated from the text (cells of {cell:g} mm): rapids cut nothing, shank and holder touch nothing"
    yield from bending_checks(report)
