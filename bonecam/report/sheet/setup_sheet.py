"""The setup sheet as HTML: what the machinist mounts, sets and checks, on one page of A4 for each clamping.

Its drawing shows stock, part, post, chuck and table from the front, to scale, with their sizes, as SVG; a second
clamping shows the part turned over in its shell, and its stump. What the axes travel is read back from the program's
text.
"""

import hashlib
import html
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import ConvexHull

import bonecam
from bonecam.job import HoldingJob, Job
from bonecam.machine.bodies import Table
from bonecam.machine.kinematics import inverse_linear
from bonecam.machine.machine import Machine
from bonecam.mesh.part import Part
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.header import ZeroWords, asked_material, second_setup_texts, setup_texts, zero_words
from bonecam.nc.motions import Motions
from bonecam.nc.program import Program
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import machine_and_dialect
from bonecam.planning.blank import bar_of
from bonecam.planning.stump import Groove
from bonecam.report.pictures import outline
from bonecam.report.stage_reports import parting_text
from bonecam.report.summary import certified_text, left_text, uncut_lines
from bonecam.report.warnings import bending_text, warning_texts
from bonecam.setup.stock import Stock
from bonecam.tool.cutter import Cutter
from bonecam.verify.removal import cutters_of
from bonecam.workholding.clamping import holding_columns
from bonecam.workholding.post import Post, post_below, tailstock_bodies
from bonecam.workholding.shell import SecondClamping


@dataclass(frozen=True)
class AxisRange:
    """Lowest and highest value of an axis: mm of the spindle nose with the planned tool lengths, degrees unwound; and
    the room there is, in words."""

    letter: str
    low: float
    high: float
    room: str


def axis_ranges(motions: Motions, machine: Machine) -> list[AxisRange]:
    """The range of every axis over all moves to known places."""
    lengths = {number: control.tool_length for number, control in motions.controls.items()}
    parts = []
    for number in np.unique(motions.tools).tolist():
        moves = motions.tools == number
        nose = inverse_linear(machine, motions.tips[moves], motions.words[moves, 3:], lengths[number])
        nose[:, 2] += lengths[number]
        parts.append(nose)
    joints = np.vstack(parts)
    joints[:, 3:] = np.degrees(joints[:, 3:])
    lows, highs = joints.min(axis=0), joints.max(axis=0)
    rooms = []
    for axis in machine.own_rotary:
        lowest, highest = np.degrees(axis.limits)
        endless = axis.endless and not np.isfinite(lowest)
        rooms.append("endless" if endless else f"{lowest:g} to {highest:g} degrees")
    rooms = [*(f"{axis.travel:g} mm of travel" for axis in machine.linear), *rooms]
    return [
        AxisRange(letter, float(low), float(high), room)
        for letter, low, high, room in zip(machine.letters, lows, highs, rooms, strict=False)
    ]


WIDTH, HEIGHT = 86.0, 102.0
"""Of the drawing on paper, mm."""
MARGIN = 5.0
"""Above and below what is drawn, mm on paper."""
DIMENSIONS = 24.0
"""Room for dimensions to either side, mm on paper."""
SIZES = 6.0
"""The lines of sizes are so far beside what is drawn, mm on paper."""
TABLE_THICKNESS = 3.0
"""Of the table as drawn, mm on paper."""
CHORD = 0.05
"""Chord tolerance of the stock's outline, mm."""


class Paper:
    """SVG elements in mm on paper, from coordinates x (right) and z (up) of the part's frame, mm."""

    def __init__(self, half_width: float, top: float) -> None:
        self.scale = min((WIDTH / 2 - DIMENSIONS) / half_width, (HEIGHT - 2 * MARGIN - TABLE_THICKNESS) / top)
        self.zero = HEIGHT - MARGIN - TABLE_THICKNESS
        self.elements: list[str] = []

    def at(self, x: float, z: float) -> tuple[float, float]:
        """The place on paper."""
        return WIDTH / 2 + self.scale * x, self.zero - self.scale * z

    def path(self, points: Float[ndarray, "n 2"], kind: str, closed: bool = True) -> None:
        """A line through points (x, z)."""
        coordinates = " L".join(f"{x:.2f} {y:.2f}" for x, y in (self.at(*point) for point in points.tolist()))
        self.elements.append(f'<path class="{kind}" d="M{coordinates}{"Z" if closed else ""}"/>')

    def column(self, radius: float, low: float, high: float, kind: str, x: float = 0.0) -> None:
        """An upright cylinder, or its upper part."""
        corners = [[-radius, low], [radius, low], [radius, high], [-radius, high]]
        self.path(np.array(corners) + np.array([x, 0.0]), kind)

    def text(self, x: float, y: float, words: str, anchor: str = "middle", kind: str = "size") -> None:
        """Words at a place on paper."""
        reported = html.escape(words)
        self.elements.append(f'<text class="{kind}" x="{x:.2f}" y="{y:.2f}" text-anchor="{anchor}">{reported}</text>')

    def line(self, x1: float, y1: float, x2: float, y2: float, kind: str) -> None:
        """A line between places on paper."""
        self.elements.append(f'<line class="{kind}" x1="{x1:.2f}" y1="{y1:.2f}" x2="{x2:.2f}" y2="{y2:.2f}"/>')

    def axis(self, top: float) -> None:
        """The axis of what is drawn up to a height."""
        x, bottom = self.at(0.0, -2.0 / self.scale)
        self.line(x, bottom, x, self.at(0.0, top)[1] - 3, "axis")

    def height(self, low: float, high: float, from_x: float, column: float, words: str) -> None:
        """A dimension between two heights, `column` mm of paper right of the middle; its words beside it."""
        x = WIDTH / 2 + column
        start, end = self.at(from_x, low), self.at(from_x, high)
        for _, y in (start, end):
            self.line(start[0] + np.sign(column), y, x + np.sign(column) * 1.5, y, "extension")
        self.line(x, start[1], x, end[1], "dimension")
        anchor = "start" if column > 0 else "end"
        self.text(x + np.sign(column) * 1.6, (start[1] + end[1]) / 2 + 1, words, anchor)

    def svg(self, label: str) -> str:
        """All that was drawn as the text of an SVG element of WIDTH x HEIGHT mm."""
        body = "\n".join(self.elements)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" width="{WIDTH:g}mm" '
            f'height="{HEIGHT:g}mm" role="img" aria-label="{html.escape(label)}">\n{body}\n</svg>'
        )

    def width(self, radius: float, z: float, words: str, above: float = 0.0) -> None:
        """A dimension across at height z, its words above it."""
        (left, y) = self.at(-radius, z)
        (right, _) = self.at(radius, z)
        self.line(left, y - above, right, y - above, "dimension")
        self.text((left + right) / 2, y - above - 1.2, words)


def _clamping_drawing(
    part: TriangleMesh,
    stock: Stock,
    post: Post,
    holding: HoldingJob,
    table: Table,
    zero: ZeroWords,
    zero_height: float,
    parting: Mapping[str, Any] | None,
) -> str:
    """The drawing as the text of an SVG element of WIDTH x HEIGHT mm; `zero` are the words of the program's zero
    at `zero_height` (mm), `parting` is that section of the report."""
    low, high = (float(value) for value in stock.bounds[:, 2])
    held = holding_columns(holding)
    widest = max([float(np.abs(stock.bounds[:, 0]).max()), *(column.radius for column in held.values())])
    beside = tailstock_bodies(holding)
    # the column of a bracket stands beside the paper: header and list tell where
    bar = bar_of(stock, holding)
    paper = Paper(widest, max([high, *(column.top for column in (*beside, *([bar] if bar else [])))]))
    draw_table(paper, table)
    if bar:
        paper.column(bar.radius, bar.bottom, bar.top, "stock")

    # The post, with its parting groove and the height of that, beside the sizes right of what is widest
    top = low + post.radius
    if parting is None:
        paper.column(post.radius, 0.0, top, "post")
    else:
        groove = Groove(parting["z_mm"], parting["width_mm"] / 2, parting["bridge_diameter_mm"] / 2, post.radius)
        side = np.vstack([[[post.radius, 0.0]], groove.outline(post.radius), [[post.radius, max(top, groove.middle)]]])
        paper.path(np.vstack([side, (side * [-1.0, 1.0])[::-1]]), "post")
        x, y = paper.at(groove.bridge, groove.middle)
        beside_sizes = paper.at(widest, 0.0)[0] + SIZES
        paper.line(x + 1, y, beside_sizes + 1, y, "extension")
        paper.text(beside_sizes + 1.6, y + 3.5, f"parting Z {groove.middle - zero_height:.2f}", "start")

    for name, column in held.items():
        paper.column(column.radius, column.bottom, column.top, "stock" if name == "stub" else "chuck")
    for column in (*beside, *post.solids[1:]):
        paper.column(column.radius, column.bottom, column.top, "chuck", column.x)
    places = stock.mesh(CHORD).vertices[:, [0, 2]]
    paper.path(places[ConvexHull(places).vertices], "stock")
    for ends in outline(part):
        paper.path(ends, "part", closed=False)
    paper.axis(high)
    _draw_sizes(paper, stock, post, holding, widest)
    _draw_touches(paper, stock, holding, zero_height)
    draw_zero(paper, zero, zero_height)
    return paper.svg("Stock, post, chuck and table from the front")


def draw_table(paper: Paper, table: Table) -> None:
    """The top of the table, as wide as the paper, and what stands on it."""
    y = paper.zero
    paper.elements.append(f'<rect class="table" x="4" y="{y:.2f}" width="{WIDTH - 8:g}" height="{TABLE_THICKNESS:g}"/>')
    height = 0.0
    for piece in table.standing:
        bottom, top = piece.diameter / 2, piece.top_diameter / 2
        corners = [[-bottom, height], [bottom, height], [top, height + piece.length], [-top, height + piece.length]]
        paper.path(np.array(corners), "chuck")
        height += piece.length
    words = "table"
    if np.isfinite(table.radius):
        words = f"table, diameter {2 * table.radius:g}"
    elif np.isfinite(table.half_width) and np.isfinite(table.half_depth):
        words = f"table, {2 * table.half_width:g} x {2 * table.half_depth:g}"
    paper.text(WIDTH - 5, y + TABLE_THICKNESS + 3.2, words, "end")


def _draw_sizes(paper: Paper, stock: Stock, post: Post, holding: HoldingJob, widest: float) -> None:
    """Sizes of stock, post and what holds it, mm."""
    low, high = (float(value) for value in stock.bounds[:, 2])
    right = paper.scale * widest
    paper.height(low, high, float(stock.bounds[1, 0]), right + SIZES, f"{high - low:.2f}")
    foot = holding.support_height if holding.stub_length else 0.0
    name = "neck" if holding.stub_length else "post"
    paper.height(foot, low, post.radius, right + SIZES, f"{name} {low - foot:.2f}")
    paper.height(0.0, high, -float(stock.bounds[1, 0]), -right - SIZES, f"{high:.2f}")
    half = float(np.ptp(stock.bounds[:, 0])) / 2
    name = "\u2300 " if "diameter" in stock.sizes else ""
    depth = f" x {np.ptp(stock.bounds[:, 1]):.2f}" if "depth" in stock.sizes else ""
    paper.width(half, high, f"{name}{2 * half:.2f}{depth}", above=1.5)
    x, y = paper.at(post.radius, foot + (low - foot) * 0.55)
    paper.text(x + 1.5, y, f"\u2300 {2 * post.radius:g}", "start")
    for name, column in holding_columns(holding).items():
        x, y = paper.at(-column.radius, column.top)
        height = column.top - column.bottom if name == "stub" else column.top
        paper.text(x - 1.5, y + 3, f"{name} \u2300 {2 * column.radius:g} x {height:g}", "end")


def _draw_touches(paper: Paper, stock: Stock, holding: HoldingJob, zero_height: float) -> None:
    """Where a probe touches the end of the bar and the shoulder, with the heights that the program has for them."""
    bar, stub = bar_of(stock, holding), holding_columns(holding).get("stub")
    high = bar.top if bar else float(stock.bounds[1, 2])
    places = [(0.0, high)]
    if stub is not None and bar is None:
        places.append(((holding.diameter / 2 + stub.radius) / 2, stub.top))
    for across, height in places:
        x, y = paper.at(across, height)
        paper.elements.append(f'<path class="touch" d="M{x:.2f} {y:.2f}l-1 -2h2Z"/>')
        words = f"touch Z {round(height - zero_height, 2) + 0.0:.2f}"
        paper.text(x + 2.5, y - (4.5 if height == high else 0.8), words, "start", "strong")


def draw_zero(paper: Paper, zero: ZeroWords, height: float = 0.0) -> None:
    """The program's zero at a height (mm) and its words."""
    x, y = paper.at(0.0, height)
    paper.elements.append(
        f'<g transform="translate({x:.2f} {y:.2f})"><circle r="2" class="zero"/>'
        '<path class="quarter" d="M0 0V-2A2 2 0 0 1 2 0Z M0 0V2A2 2 0 0 1 -2 0Z"/></g>'
    )
    paper.line(x - 3, y + 1, x - 9, y + TABLE_THICKNESS + 2, "extension")
    paper.text(x - 9.5, y + TABLE_THICKNESS + 3.2, f"zero: {zero.over} {zero.height}", "end", "strong")


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


def setup_article(part: Part, stock: Stock, job: Job, program: Program, report: Mapping[str, Any]) -> str:
    """The first clamping."""
    machine, dialect = machine_and_dialect(job.nc)
    zero = zero_words(machine, dialect)
    post = post_below(part.mesh, job.holding)
    material = asked_material(job)
    speeds = [f"Speeds of {material.title}: {material.note}"] if material is not None else []
    probe = report["nc"].get("probe")
    probing = [f"datum: run {probe} once with the touch probe, it stops where the bar leans"] if probe else []
    return article(
        Path(part.file).name,
        program,
        job,
        report["nc"],
        heading="Setup sheet",
        caption="From the front (\u2212Y), sizes in mm. Inside the stock: the part in section Y 0.",
        mounted="Stock, clamping, zero",
        drawing=_clamping_drawing(
            part.mesh,
            stock,
            post,
            job.holding,
            table=machine.table,
            zero=zero,
            zero_height=program.zero_height,
            parting=report.get("parting"),
        ),
        setup=items([*setup_texts(job, stock, zero, program.zero_height), *probing]),
        checks=items(_checks(report)),
        left=items(_left(report, program.zero_height)),
        warnings=items([*warning_texts(report["warnings"]), IN_AIR, *speeds]),
    )


def article(part: str, program: Program, job: Job, nc: Mapping[str, Any], **told: str) -> str:
    """The page of one clamping: what every clamping tells of its `program`, `nc` of the report, and what is `told`."""
    machine, dialect = machine_and_dialect(job.nc)
    motions = read_program(program.text, machine, dialect)
    cutters = {cutter.number: cutter for cutter in cutters_of(job, machine)}
    used = zip((cutters[number] for number in program.tools), program.time.tools, strict=True)
    axes = [
        _cells([item.letter, f"{item.low:.2f}", f"{item.high:.2f}", f"{item.high - item.low:.2f}", item.room])
        for item in axis_ranges(motions, machine)
    ]
    template = Template((ASSETS / "article.html").read_text(encoding="utf-8"))

    # Coolant, tool change and feeds in one line
    coolant = "Coolant on while cutting" if job.nc.coolant else "No coolant"
    feeds = f"feeds: median {nc['feed_median_mm_min']:.0f}, a tenth below {nc['feed_low_mm_min']:.0f} mm/min"
    return template.substitute(
        part=html.escape(part),
        program=html.escape(nc["file"] or program.name),
        machine=html.escape(machine.title),
        controller=html.escape(program.controller),
        datum=f"{job.nc.work_offset}: preset row or work offset, 1 is G54",
        minutes=html.escape("; ".join(program.time.texts)),
        tools="\n".join(_tool_row(cutter, minutes) for cutter, minutes in used),
        cutting=html.escape(f"{coolant}; {CHANGES[job.nc.tool_change]}; {feeds}."),
        axes="\n".join(axes),
        air_check=items(program.air_check),
        checksum=hashlib.sha256(program.text.encode()).hexdigest(),
        version=html.escape(bonecam.__version__),
        **told,
    )


def items(texts: Iterable[str]) -> str:
    """The items of a list, each beginning with a capital."""
    return "\n".join(f"<li>{html.escape(text[:1].upper() + text[1:])}</li>" for text in texts)


def _cells(values: Iterable[str]) -> str:
    return "<tr>" + "".join(f"<td>{html.escape(value)}</td>" for value in values) + "</tr>"


def _tool_row(cutter: Cutter, minutes: float) -> str:
    """Number, ball, flutes, shank and the neck below it with its end, stick-out, pieces of the holder (diameters x
    length, from its nose on), length, speeds, time."""
    pieces = []
    for piece in cutter.holder:
        wide = f"-{piece.top_diameter:g}" if piece.top_diameter != piece.diameter else ""
        pieces.append(f"\u2300 {piece.diameter:g}{wide} x {piece.length:g}")
    neck = f"{cutter.neck_diameter:g} to {cutter.neck_length:g}, " if cutter.neck_length else ""
    return _cells(
        [
            f"T{cutter.number} {cutter.name}",
            f"{cutter.radius:g}",
            f"{cutter.flute_length:g}",
            f"{neck}{cutter.shank_diameter:g}",
            f"{cutter.overhang:g}",
            ", ".join(pieces),
            f"{cutter.length:g}",
            f"{cutter.spindle:.0f}",
            f"{cutter.feed:.0f}",
            f"{minutes:.1f}",
        ]
    )


def simulated_lines(report: Mapping[str, Any], beginning: str = "") -> Iterator[str]:
    """What the simulation found, where there was one, and what bends, where that is known and no warning tells it."""
    if "skipped" not in report["removal"]:
        how = f"cells of {report['removal']['cell_mm']:g} mm){beginning}"
        yield f"Simulated from the text ({how}: rapids cut nothing, shank and holder touch nothing"
    mechanics = report["mechanics"]
    if "skipped" not in mechanics and "bending" not in {each["code"] for each in report["warnings"]}:
        low, up = mechanics["band"]
        yield f"Bending, {low:g} to {up:g} times by author: {bending_text(mechanics)}"


def _checks(report: Mapping[str, Any]) -> Iterator[str]:
    """What was checked, and how well it held."""
    yield from proof_lines(report["nc"])
    yield f"Levels: {certified_text(report['levels'], report['levels_method'])}"
    yield from simulated_lines(report)
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
        at_post = f"; at the post {left['by_reason']['post']:.1f} mm²" if post else ""
        yield f"On the {body} {left_text(left).replace('mm2', 'mm²')}{at_post}"
    for line in uncut_lines(report["toolpath"], report["uncut_mm2"]):
        yield f"Uncut: {line}"


def _left(report: Mapping[str, Any], zero_height: float) -> Iterator[str]:
    """What is left on the part and of its post; heights as the program has them."""
    yield from left_lines(report, "part", post=True)
    if "parting" in report:
        groove = {**report["parting"], "z_mm": report["parting"]["z_mm"] - zero_height}
        yield f"Parting: {parting_text(groove)}"
    how = "in the second clamping, see its page" if "second" in report else "by hand"
    yield f"The stump of the post, over {report['post']['footprint_mm2']:.1f} mm² of the part, is removed {how}"
    above = report["post"].get("tailstock")
    if above:
        # that of the simulation, or else that under pin or upper neck
        left = report["removal"].get("left")
        area = left["by_reason"]["tailstock"] if left else above["footprint_mm2"]
        yield f"What stays at the {above['kind']} of the tailstock, {area:.1f} mm², is removed by hand"


IN_AIR = "The program has not run on a control: run it in the air first, and check datum and tool lengths"
"""What is told of every program."""


def second_article(name: str, clamping: SecondClamping, job: Job, program: Program, report: Mapping[str, Any]) -> str:
    """The second clamping of the part in the file `name`; `report` is `second` of the run's, the job's [holding] that
    of the shell."""
    machine, dialect = machine_and_dialect(job.nc)
    zero = zero_words(machine, dialect)
    # what stays where the post stood
    before, after = report["at_post_before_mm2"], report["at_post_after_mm2"]
    most = f"{report['at_post_after_max_mm']:.2f} mm at most"
    tailstock = report.get("at_tailstock_mm2")
    return article(
        name,
        program,
        job,
        report,
        heading="Setup sheet: second clamping",
        caption="From the front (\u2212Y), sizes in mm: part and shell in section Y 0, and the stump.",
        mounted="Part, shell, clamping, zero",
        drawing=_second_drawing(clamping, job, machine.table, zero, program.zero_height),
        setup=items(second_setup_texts(job, clamping.shell, clamping.top, zero, program.zero_height)),
        checks=items(
            [
                *proof_lines(report),
                *simulated_lines(report, ", beginning with what the first program left"),
                f"A ball goes {report['gouge_to_given_max_mm']:.3f} mm into the mesh as given at most",
                f"The tool stays {report['removal']['clearance_mm']['shell']:.2f} mm from the shell",
            ]
        ),
        left=items(
            [
                f"At the post {after:.1f} of {before:.1f} mm² still keep more than 0.02 mm, {most}",
                *([f"At the tailstock {tailstock:.1f} mm² stay, to be cut by hand"] if tailstock else []),
                *(f"Uncut: {line}" for line in uncut_lines(report["toolpath"], {})),
            ]
        ),
        warnings=items([*warning_texts(report["warnings"]), IN_AIR, *WARNINGS]),
    )


WARNINGS = (
    "How exactly the part lies in its shell is not known here: it shows as a step round the place of the post",
    "A stump that is left higher than the drawing tells is met by the tool where nothing is expected",
)
"""What the machinist must look at before the start."""


def _second_drawing(clamping: SecondClamping, job: Job, table: Table, zero: ZeroWords, zero_height: float) -> str:
    """Part, shell, stump, chuck and table from the front, to scale, with their sizes, as SVG."""
    holding, shell, part = job.holding, clamping.shell, clamping.part
    low, high = shell.bounds[:, 2].tolist()
    widest = max(float(np.abs(clamping.solids.bounds[:, 0]).max()), holding.chuck_diameter / 2)
    paper = Paper(widest, clamping.top)
    draw_table(paper, table)
    if holding.chuck_height:
        paper.column(holding.chuck_diameter / 2, 0.0, holding.chuck_height, "chuck")
    post = holding.diameter / 2
    outlines = {"shell": outline(shell), "part": outline(part)}

    # The lowest place (z) at which a stump of `radius` stands on the outline of the part
    places = outlines["part"].reshape(-1, 2)
    sides = np.linspace(-post, post, 9)
    tops = [places[np.abs(places[:, 0] - x) < post / 4, 1] for x in sides]
    paper.column(post, float(min(top.max() for top in tops if len(top))), clamping.top, "post")
    for kind, pieces in outlines.items():
        for ends in pieces:
            paper.path(ends, kind, closed=False)
    paper.axis(clamping.top)
    right = paper.scale * widest
    paper.height(low, high, float(shell.bounds[1, 0]), right + 6, f"shell {high - low:.2f}")
    paper.height(0.0, clamping.top, -post, -right - 6, f"{clamping.top:.2f}")
    if low:
        paper.height(0.0, low, float(shell.bounds[1, 0]), right + 6, f"{low:.2f}")
    paper.width(post, clamping.top, f"stump \u2300 {holding.diameter:g}", above=1.5)
    if holding.chuck_height:
        x, y = paper.at(-holding.chuck_diameter / 2, holding.chuck_height)
        size = f"chuck \u2300 {holding.chuck_diameter:g} x {holding.chuck_height:g}"
        paper.text(x - 1.5, y + 3, size, "end")
    draw_zero(paper, zero, zero_height)
    return paper.svg("Part, shell, stump, chuck and table of the second clamping from the front")
