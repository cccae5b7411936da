"""The setup sheet as HTML: what the machinist mounts, sets and checks, on one page of A4 for each clamping."""

import hashlib
import html
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

from bonecam.job import Job
from bonecam.job.materials.preset import read_material
from bonecam.machine.machine import read_machine
from bonecam.mesh.part import Part
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.posting.header.program_zero import zero_words
from bonecam.nc.posting.header.texts import setup_texts
from bonecam.nc.program import Program
from bonecam.nc.reading.read import read_program
from bonecam.report.mechanics_lines import bending_text
from bonecam.report.sheet.axes import AxisRange, axis_ranges
from bonecam.report.sheet.drawing import clamping_drawing
from bonecam.report.stage_reports import parting_text
from bonecam.report.summary import certified_text, uncut_lines
from bonecam.report.warnings import warning_texts
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter
from bonecam.verify.removal.of_job import cutters_of
from bonecam.workholding.post import post_below

ASSETS = Path(__file__).parent / "assets"
CHANGES = {
    "changer": "tools by the changer, lengths measured in the tool table",
    "stop": "the program stops for every tool; lengths measured in the tool table",
}
"""What is told of each `nc.tool_change`."""


def setup_sheet(title: str, articles: Sequence[str]) -> str:
    """The text of the sheet's HTML file, a page an article."""
    template = Template((ASSETS / "sheet.html").read_text(encoding="utf-8"))
    style = (ASSETS / "sheet.css").read_text(encoding="utf-8")
    return template.substitute(title=html.escape(f"{title}: setup sheet"), style=style, articles="".join(articles))


def setup_article(part: Part, stock: Stock, job: Job, program: Program, report: Mapping[str, Any], version: str) -> str:
    """The first clamping."""
    machine = read_machine(job.nc.machine)
    zero = zero_words(machine, job_dialect(job.nc))
    post = post_below(part.mesh, job.holding)
    return article(
        Path(part.file).name,
        program,
        job,
        report["nc"],
        version,
        heading="Setup sheet",
        caption="From the front (\u2212Y), sizes in mm. Inside the stock: the part in section Y 0.",
        mounted="Stock, clamping, zero",
        drawing=clamping_drawing(
            part.mesh,
            stock,
            post=post,
            holding=job.holding,
            table=machine.table,
            zero=zero,
            parting=report.get("parting"),
        ),
        setup=items(setup_texts(job, stock, zero)),
        checks=items(_checks(report)),
        left=items(_left(report)),
        warnings=items(_warnings(job, report)),
    )


def article(part: str, program: Program, job: Job, nc: Mapping[str, Any], version: str, **told: str) -> str:
    """The page of one clamping: what every clamping tells of its `program`, `nc` of the report, and what is `told`."""
    machine = read_machine(job.nc.machine)
    motions = read_program(program.text, machine, job_dialect(job.nc))
    cutters = {cutter.number: cutter for cutter in cutters_of(job, machine)}
    template = Template((ASSETS / "article.html").read_text(encoding="utf-8"))

    # Coolant, tool change and feeds in one line
    coolant = "coolant on while cutting" if job.nc.coolant else "no coolant"
    feeds = f"feeds: median {nc['feed_median_mm_min']:.0f}, a tenth below {nc['feed_low_mm_min']:.0f} mm/min"
    return template.substitute(
        part=html.escape(part),
        program=html.escape(nc["file"] or program.name),
        machine=html.escape(machine.title),
        controller=html.escape(program.controller),
        minutes=html.escape("; ".join(program.time.texts)),
        tools=_tool_rows([cutters[number] for number in program.tools], program.time.tools),
        cutting=html.escape(f"{_sentence(coolant)}; {CHANGES[job.nc.tool_change]}; {feeds}."),
        axes=_axis_rows(axis_ranges(motions, machine)),
        air_check=items(program.air_check),
        checksum=hashlib.sha256(program.text.encode()).hexdigest(),
        version=html.escape(version),
        **told,
    )


def items(texts: Iterable[str]) -> str:
    """The items of a list, each beginning with a capital."""
    return "\n".join(f"<li>{html.escape(_sentence(text))}</li>" for text in texts)


def _sentence(text: str) -> str:
    """A text of the program's header, beginning with a capital."""
    return text[:1].upper() + text[1:]


def _cells(values: Iterable[str]) -> str:
    return "<tr>" + "".join(f"<td>{html.escape(value)}</td>" for value in values) + "</tr>"


def _tool_rows(cutters: Sequence[Cutter], minutes: Sequence[float]) -> str:
    """A row a tool: number, ball, shank, stick-out, holder, length, speeds, time."""
    return "\n".join(
        _cells(
            [
                f"T{cutter.number} {cutter.name}",
                f"{cutter.radius:g}" + (f", corner {cutter.corner:g}" if cutter.is_bull else ""),
                f"{cutter.flute_length:g}",
                _shank(cutter),
                f"{cutter.overhang:g}",
                _holder(cutter),
                f"{cutter.length:g}",
                f"{cutter.spindle:.0f}",
                f"{cutter.feed:.0f}",
                f"{time:.1f}",
            ]
        )
        for cutter, time in zip(cutters, minutes, strict=True)
    )


def _shank(cutter: Cutter) -> str:
    """Diameter of the shank, and of the neck below it with the place where that ends."""
    neck = f"{cutter.neck_diameter:g} to {cutter.neck_length:g}, " if cutter.neck_length else ""
    return f"{neck}{cutter.shank_diameter:g}"


def _holder(cutter: Cutter) -> str:
    """The pieces of the holder: diameters x length, from its nose on."""
    pieces = []
    for piece in cutter.holder:
        wide = f"-{piece.top_diameter:g}" if piece.top_diameter != piece.diameter else ""
        pieces.append(f"\u2300 {piece.diameter:g}{wide} x {piece.length:g}")
    return ", ".join(pieces)


def _axis_rows(ranges: Sequence[AxisRange]) -> str:
    return "\n".join(
        _cells([item.letter, f"{item.low:.2f}", f"{item.high:.2f}", f"{item.high - item.low:.2f}", item.room])
        for item in ranges
    )


def bending_checks(report: Mapping[str, Any]) -> Iterator[str]:
    """What bends, where that is known and no warning tells it."""
    mechanics = report["mechanics"]
    if "skipped" not in mechanics and "bending" not in {each["code"] for each in report["warnings"]}:
        low, up = mechanics["band"]
        yield f"Bending, {low:g} to {up:g} times by author: {bending_text(mechanics)}"


def _checks(report: Mapping[str, Any]) -> Iterator[str]:
    """What was checked, and how well it held."""
    removal = report["removal"]
    yield from proof_lines(report["nc"])
    yield f"Levels: {certified_text(report['levels'], report['levels_method'])}"
    if "skipped" not in removal:
        cell = removal["cell_mm"]
        yield f"Simulated from the text (cells of {cell:g} mm): rapids cut nothing, shank and holder touch nothing"
    yield from bending_checks(report)
    deviation = report["surface"]["given_deviation_max_mm"]
    deepest = report["nc"]["gouge_to_given_max_mm"]
    yield f"Fitted surface within {deviation:.3f} mm of the mesh as given; a ball goes {deepest:.3f} mm into it"
    smoothed = report["input"]["smoothed"]
    if smoothed:
        most, mean = smoothed["distance_max_mm"], smoothed["distance_mean_mm"]
        apart = f"{most:.2f} mm from them at most, {mean:.3f} mm on average"
        yield f"Coarse facets of the mesh as given were taken as samples of a smooth surface: {apart}"


def proof_lines(nc: Mapping[str, Any]) -> Iterator[str]:
    """What reading the text back proved; `nc` of the report."""
    tip, gouge = 1000 * nc["readback_tip_error_mm"], 1000 * nc["gouge_max_mm"]
    axis = nc["readback_axis_error_deg"]
    yield f"Text read back: tip within {tip:.2f} µm, axis within {axis:.4f} degrees of the path"
    yield f"Gouge of the part by the ball: {gouge:.2f} µm at most"


def left_lines(report: Mapping[str, Any], body: str, *, post: bool = False) -> Iterator[str]:
    """What is left on the `body`, and at its `post` if that is told, and which contacts are not cut, with their
    reasons."""
    left = report["removal"].get("left")
    if left:
        most = f"{left['max_mm']:.2f} mm at most"
        at_post = f"; at the post {left['by_reason']['post']:.1f} mm²" if post else ""
        yield f"On the {body} {left['area_over_0_02_mm2']:.1f} mm² keep more than 0.02 mm, {most}{at_post}"
    for line in uncut_lines(report["toolpath"], report["uncut_mm2"]):
        yield f"Uncut: {line}"


def _left(report: Mapping[str, Any]) -> Iterator[str]:
    """What is left on the part and of its post."""
    yield from left_lines(report, "part", post=True)
    if "parting" in report:
        yield f"Parting: {parting_text(report['parting'])}"
    how = "in the second clamping, see its page" if "second" in report else "by hand"
    yield f"The stump of the post, over {report['post']['footprint_mm2']:.1f} mm² of the part, is removed {how}"
    above = report["post"].get("tailstock")
    if above:
        yield f"What stays at the {above['kind']} of the tailstock, {_at_tailstock(report)} mm², is removed by hand"


def _at_tailstock(report: Mapping[str, Any]) -> str:
    """The area that stays at the free end: of the simulation, or else that under pin or upper neck, mm²."""
    left = report["removal"].get("left")
    area = left["by_reason"]["tailstock"] if left else report["post"]["tailstock"]["footprint_mm2"]
    return f"{area:.1f}"


def _warnings(job: Job, report: Mapping[str, Any]) -> Iterator[str]:
    """What the machinist must look at before the start."""
    yield from warning_texts(report["warnings"])
    yield IN_AIR
    if not all(getattr(job, name).spindle and getattr(job, name).feed for name in job.cutter_names):
        material = read_material(job.material.name)
        yield f"Speeds of {material.title}: {material.note}"


IN_AIR = "The program has not run on a control: run it in the air first, and check datum and tool lengths"
"""What is told of every program."""
