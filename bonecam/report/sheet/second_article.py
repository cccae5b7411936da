"""The page of the sheet for the second clamping: the part turned over in its shell, and its stump."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import Job
from bonecam.machine.bodies import Table
from bonecam.machine.machine import read_machine
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.posting.header.program_zero import ZeroWords, zero_words
from bonecam.nc.posting.header.texts import second_setup_texts
from bonecam.nc.program import Program
from bonecam.report.pictures.views import section
from bonecam.report.sheet.drawing import Paper, draw_table, draw_zero
from bonecam.report.sheet.setup_sheet import IN_AIR, article, bending_checks, items, proof_lines
from bonecam.report.summary import uncut_lines
from bonecam.report.warnings import warning_texts
from bonecam.workholding.shell import SecondClamping


def second_article(
    name: str, clamping: SecondClamping, job: Job, program: Program, report: Mapping[str, Any], version: str
) -> str:
    """The second clamping of the part in the file `name`; `report` is `second` of the run's, the job's [holding] that
    of the shell."""
    machine = read_machine(job.nc.machine)
    zero = zero_words(machine, job_dialect(job.nc))
    return article(
        name,
        program,
        job,
        report,
        version,
        heading="Setup sheet: second clamping",
        caption="From the front (\u2212Y), sizes in mm: part and shell in section Y 0, and the stump.",
        mounted="Part, shell, clamping, zero",
        drawing=_drawing(clamping, job, machine.table, zero),
        setup=items(second_setup_texts(job, clamping.shell, clamping.top, zero)),
        checks=items(_checks(report)),
        left=items(_left(report)),
        warnings=items([*warning_texts(report["warnings"]), IN_AIR, *WARNINGS]),
    )


WARNINGS = (
    "How exactly the part lies in its shell is not known here: it shows as a step round the place of the post",
    "A stump that is left higher than the drawing tells is met by the tool where nothing is expected",
)
"""What the machinist must look at before the start."""


def _checks(report: Mapping[str, Any]) -> Iterator[str]:
    """What was checked, and how well it held."""
    removal = report["removal"]
    yield from proof_lines(report)
    yield (
        f"Simulated from the text (cells of {removal['cell_mm']:g} mm), beginning with what the first program left: "
        "rapids cut nothing, shank and holder touch nothing"
    )
    yield from bending_checks(report)
    yield f"A ball goes {report['gouge_to_given_max_mm']:.3f} mm into the mesh as given at most"
    yield f"The tool stays {removal['clearance_mm']['shell']:.2f} mm from the shell"


def _left(report: Mapping[str, Any]) -> Iterator[str]:
    """What stays where the post stood."""
    before, after = report["at_post_before_mm2"], report["at_post_after_mm2"]
    most = f"{report['at_post_after_max_mm']:.2f} mm at most"
    yield f"At the post {after:.1f} of {before:.1f} mm² still keep more than 0.02 mm, {most}"
    if report.get("at_tailstock_mm2"):
        yield f"At the tailstock {report['at_tailstock_mm2']:.1f} mm² stay, to be cut by hand"
    for line in uncut_lines(report["toolpath"], {}):
        yield f"Uncut: {line}"


def _section(solid: TriangleMesh) -> Float[ndarray, "n 2 2"]:
    """The lines, from end to end (x, z), on which the plane Y 0 meets a solid."""
    return section(solid, np.zeros(3), np.eye(3)[1])[:, :, [0, 2]]


def _drawing(clamping: SecondClamping, job: Job, table: Table, zero: ZeroWords) -> str:
    """Part, shell, stump, chuck and table from the front, to scale, with their sizes, as SVG."""
    holding, shell, part = job.holding, clamping.shell, clamping.part
    low, high = shell.bounds[:, 2].tolist()
    widest = max(float(np.abs(clamping.solids.bounds[:, 0]).max()), holding.chuck_diameter / 2)
    paper = Paper(widest, clamping.top)
    draw_table(paper, table)
    if holding.chuck_height:
        paper.column(holding.chuck_diameter / 2, 0.0, holding.chuck_height, "chuck")
    post = holding.diameter / 2
    outlines = {"shell": _section(shell), "part": _section(part)}

    # The lowest place (z) at which a stump of `radius` stands on the outline of the part
    outline = outlines["part"].reshape(-1, 2)
    sides = np.linspace(-post, post, 9)
    tops = [outline[np.abs(outline[:, 0] - x) < post / 4, 1] for x in sides]
    paper.column(post, float(min(top.max() for top in tops if len(top))), clamping.top, "post")
    for kind, pieces in outlines.items():
        for ends in pieces:
            paper.path(ends, kind, closed=False)
    x, bottom = paper.at(0.0, -2.0 / paper.scale)
    paper.line(x, bottom, x, paper.at(0.0, clamping.top)[1] - 3, "axis")
    right = paper.scale * widest
    paper.height(low, high, float(shell.bounds[1, 0]), right + 6, f"shell {high - low:.2f}")
    paper.height(0.0, clamping.top, -post, -right - 6, f"Z {clamping.top:.2f}")
    if low:
        paper.height(0.0, low, float(shell.bounds[1, 0]), right + 6, f"{low:.2f}")
    paper.width(post, clamping.top, f"stump \u2300 {holding.diameter:g}", above=1.5)
    if holding.chuck_height:
        x, y = paper.at(-holding.chuck_diameter / 2, holding.chuck_height)
        size = f"chuck \u2300 {holding.chuck_diameter:g} x {holding.chuck_height:g}"
        paper.text(x - 1.5, y + 3, size, "end")
    draw_zero(paper, zero)
    return paper.svg("Part, shell, stump, chuck and table of the second clamping from the front")
