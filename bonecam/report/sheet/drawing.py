"""The drawing of the sheet: stock, part, post, chuck and table from the front, to scale, with their sizes, as SVG."""

import html
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import ConvexHull

from bonecam.job import HoldingJob
from bonecam.machine.bodies import Table
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.posting.header.program_zero import ZeroWords
from bonecam.planning.passes.parting import Groove
from bonecam.report.pictures.views import section
from bonecam.setup.stock import Stock
from bonecam.workholding.clamping import holding_columns
from bonecam.workholding.post import Post
from bonecam.workholding.tailstock import tailstock_bodies

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


def clamping_drawing(
    part: TriangleMesh,
    stock: Stock,
    post: Post,
    holding: HoldingJob,
    table: Table,
    zero: ZeroWords,
    parting: Mapping[str, Any] | None = None,
) -> str:
    """The drawing as the text of an SVG element of WIDTH x HEIGHT mm; `zero` are the words of the program's zero,
    `parting` is that section of the report."""
    low, high = (float(value) for value in stock.bounds[:, 2])
    held = holding_columns(holding)
    widest = max([float(np.abs(stock.bounds[:, 0]).max()), *(column.radius for column in held.values())])
    beside = tailstock_bodies(holding)
    # the column of a bracket stands beside the paper: header and list tell where
    paper = Paper(widest, max([high, *(column.top for column in beside)]))
    draw_table(paper, table)
    _draw_post(paper, post, low + post.radius, parting, widest)
    for name, column in held.items():
        paper.column(column.radius, column.bottom, column.top, "stock" if name == "stub" else "chuck")
    for column in (*beside, *post.solids[1:]):
        paper.column(column.radius, column.bottom, column.top, "chuck", column.x)
    outline = stock.mesh(CHORD).vertices[:, [0, 2]]
    paper.path(outline[ConvexHull(outline).vertices], "stock")
    for ends in section(part, np.zeros(3), np.eye(3)[1])[:, :, [0, 2]]:
        paper.path(ends, "part", closed=False)
    x, bottom = paper.at(0.0, -2.0 / paper.scale)
    paper.line(x, bottom, x, paper.at(0.0, high)[1] - 3, "axis")
    _draw_sizes(paper, stock, post, holding, widest)
    draw_zero(paper, zero)
    return paper.svg("Stock, post, chuck and table from the front")


def _draw_post(paper: Paper, post: Post, top: float, parting: Mapping[str, Any] | None, widest: float) -> None:
    """The post up to a height, with its parting groove and the height of that, beside the sizes right of what is
    `widest`."""
    if parting is None:
        paper.column(post.radius, 0.0, top, "post")
        return
    groove = Groove(parting["z_mm"], parting["width_mm"] / 2, parting["bridge_diameter_mm"] / 2, post.radius)
    side = np.vstack([[[post.radius, 0.0]], groove.outline(post.radius), [[post.radius, max(top, groove.middle)]]])
    paper.path(np.vstack([side, (side * [-1.0, 1.0])[::-1]]), "post")
    x, y = paper.at(groove.bridge, groove.middle)
    beside = paper.at(widest, 0.0)[0] + SIZES
    paper.line(x + 1, y, beside + 1, y, "extension")
    paper.text(beside + 1.6, y + 3.5, f"parting Z {groove.middle:.2f}", "start")


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
    paper.text(WIDTH - 5, y + TABLE_THICKNESS + 3.2, _table_words(table), "end")


def _table_words(table: Table) -> str:
    """The table with its sizes."""
    if np.isfinite(table.radius):
        return f"table, diameter {2 * table.radius:g}"
    if np.isfinite(table.half_width) and np.isfinite(table.half_depth):
        return f"table, {2 * table.half_width:g} x {2 * table.half_depth:g}"
    return "table"


def _draw_sizes(paper: Paper, stock: Stock, post: Post, holding: HoldingJob, widest: float) -> None:
    """Sizes of stock, post and what holds it, mm."""
    low, high = (float(value) for value in stock.bounds[:, 2])
    right = paper.scale * widest
    paper.height(low, high, float(stock.bounds[1, 0]), right + SIZES, f"{high - low:.2f}")
    foot = holding.support_height if holding.stub_length else 0.0
    name = "neck" if holding.stub_length else "post"
    paper.height(foot, low, post.radius, right + SIZES, f"{name} {low - foot:.2f}")
    paper.height(0.0, high, -float(stock.bounds[1, 0]), -right - SIZES, f"Z {high:.2f}")
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


def draw_zero(paper: Paper, zero: ZeroWords) -> None:
    """The program's zero and its words."""
    x, y = paper.at(0.0, 0.0)
    paper.elements.append(
        f'<g transform="translate({x:.2f} {y:.2f})"><circle r="2" class="zero"/>'
        '<path class="quarter" d="M0 0V-2A2 2 0 0 1 2 0Z M0 0V2A2 2 0 0 1 -2 0Z"/></g>'
    )
    paper.line(x - 3, y + 1, x - 9, y + TABLE_THICKNESS + 2, "extension")
    paper.text(x - 9.5, y + TABLE_THICKNESS + 3.2, f"zero: {zero.over} {zero.height}", "end", "strong")
