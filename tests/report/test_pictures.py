"""Pictures: what is drawn is all there, to one scale, and nothing covers anything else.

The picture of the machine's bodies: the pose that it shows is the lowest one, told with its height.

The picture of a machine file.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from small_parts import capsule_path, path_of, pebble

from bonecam.job import HoldingJob, Job
from bonecam.levels import Level, PartLevel, RoundedLevel, StockLevel, rounding_cuts
from bonecam.levels.measure import NO_CUT
from bonecam.machine import machine_names, read_machine
from bonecam.machine.bodies import Frustum, Table
from bonecam.mesh import TriangleMesh
from bonecam.report import draw_machine, draw_machine_file, machine_picture
from bonecam.report.pictures import (
    corner_normals,
    draw_coloured,
    draw_depths,
    draw_engagement,
    draw_levels,
    draw_toolpath,
    label_places,
    view,
)
from bonecam.setup import Box, Capsule, Stock
from bonecam.surface import TSpline
from bonecam.tool import Cutter, MoveKind, ToolPath
from bonecam.tool.path import BLANK, PARTING

POST = (4.0, 45.0)


def capsule(radius: float) -> Capsule:
    return Capsule(np.array([0.0, 0.0, 45.0]), np.array([0.0, 0.0, 65.0]), radius)


MEASURES = replace(NO_CUT, depth_max=0.5, depth_mean=0.4, depth_shares=(0.5, 0.5))


def level(k: int, body: Stock) -> StockLevel:
    return StockLevel(k, body.mesh(0.05), 0.5, MEASURES)


def rounded_level(k: int, surface: TSpline, body: Stock, stock: Stock) -> RoundedLevel:
    return RoundedLevel(k, surface, body.mesh(0.05), 0.5, MEASURES, stock, surface.control_points)


def sheet(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> TriangleMesh:
    """A bent square of 10 mm away from the axis, facing where the sizes grow that are given."""
    up = np.array([x, y, z])
    right = np.roll(up, 1)
    forth = np.cross(up, right)
    u, v = (k.ravel() for k in np.meshgrid(np.linspace(0, 10, 6), np.linspace(0, 10, 6)))
    points = 20 + np.outer(u, right) + np.outer(v, forth) + np.outer(u * (10 - u) / 50, up)
    a = np.add.outer(6 * np.arange(5), np.arange(5)).ravel()
    faces = np.vstack([np.column_stack([a, a + 1, a + 7]), np.column_stack([a, a + 7, a + 6])])
    return TriangleMesh(points, faces.astype(np.int32))


def boxed(wide: float, deep: float, high: float) -> list[Level]:
    """The part, two levels of the morph, of which the last is rounded to the box by two cuts more."""
    box = Box(np.array([-wide, -deep, 55.0 - high]), np.array([wide, deep, 55.0 + high]))
    first = PartLevel(pebble(), capsule(5.0).mesh(0.05), NO_CUT)
    return [
        first,
        level(1, capsule(5.4)),
        rounded_level(2, first.surface, capsule(5.8), box),
        rounded_level(3, first.surface, capsule(6.0), box),
        level(4, box),
    ]


def path(k: int) -> ToolPath:
    """A helix with contacts, where the tip is."""
    made = capsule_path(k)
    return replace(made, contacts=np.where((made.kinds == MoveKind.CUT)[:, None], made.tips, np.nan))


@pytest.fixture
def drawn(monkeypatch):
    """The figures that were saved."""
    figures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: figures.append(figure))
    return figures


def texts(figure: Figure) -> list[str]:
    return [plot.get_title() for plot in figure.axes if plot.get_title()]


def extents(items: Any) -> list[Bbox]:
    return [item.get_window_extent() for item in items if item.get_text()]


STOCKS = [(8.0, 8.0, 18.0), (40.0, 10.0, 18.0), (9.0, 30.0, 18.0), (7.0, 7.0, 120.0)]


def test_rest_paths_take_the_place_of_no_level(drawn):
    outer, middle, inner = (path(level) for level in (3, 1, 0))
    rests = [replace(middle, rest=number) for number in (1, 2, 3)]
    draw_toolpath([outer, middle, *rests, inner, path(PARTING)], boxed(*STOCKS[0]), "")
    titles = [plot.get_title().partition("\n")[0] for plot in drawn[0].axes]
    assert [title for title in titles if title] == [f"level {level}" for level in (3, 3, 1, 1, 0, 0)]


def test_what_mills_the_blank_is_drawn_on_the_stock_before_the_levels(drawn):
    blank = [replace(path(BLANK), rest=number) for number in (1, 2)]
    draw_toolpath([*blank, path(3), path(0)], boxed(*STOCKS[0]), "")
    titles = [plot.get_title().partition("\n")[0] for plot in drawn[0].axes]
    assert [title for title in titles if title][::2] == ["blank", "level 3", "level 0"]


def test_engagement_is_drawn_on_levels_with_the_share_of_cuts_in_air(drawn):
    """Of level 3 all is air, of level 0 nothing; links are not drawn."""
    moves = [path(level) for level in (3, 1, 0)]
    levels = np.repeat([3, 1, 0], [len(each.tips) for each in moves])
    tips, axes, kinds = (np.concatenate([getattr(each, name) for each in moves]) for name in ("tips", "axes", "kinds"))
    cuts = kinds == MoveKind.CUT
    sections = np.where(levels == 3, 0.0, 0.2)
    draw_engagement(boxed(*STOCKS[0]), levels, tips, axes, sections, cuts, "")
    titles = [plot.get_title() for plot in drawn[0].axes if plot.get_title()]
    assert titles[::2] == ["level 3\n100% in air", "level 1\n0% in air", "level 0\n0% in air"]
    segments = [len(plot.collections[-1].get_segments()) for plot in drawn[0].axes[:6]]
    assert 0 < sum(segments) <= cuts.sum()


@pytest.mark.parametrize("sizes", STOCKS, ids=str)
def test_panels_have_one_scale_and_nothing_is_clipped_or_covered(sizes, drawn):
    levels = boxed(*sizes)
    draw_levels(levels, POST, "")
    draw_coloured(levels, "")
    draw_toolpath([path(3), path(1), path(0)], levels, "")
    for figure in drawn:
        FigureCanvasAgg(figure).draw()
        panels = [plot for plot in figure.axes if plot.get_xlabel().endswith(("x (mm)", "y (mm)"))]
        per_mm = [plot.transData.transform([[0, 0], [1, 1]]) for plot in panels]
        assert np.ptp([np.diff(pair, axis=0) for pair in per_mm]) < 0.01
        assert len({plot.get_ylim() for plot in panels}) == 1
        assert len({round(plot.get_window_extent().y0, 6) for plot in panels}) == 1
        assert all(plot.dataLim.y1 <= plot.get_ylim()[1] and plot.dataLim.y0 >= plot.get_ylim()[0] for plot in panels)
        titles, labels = extents(plot.title for plot in panels), extents(plot.xaxis.label for plot in panels)
        ticks = [box for plot in panels for box in extents(plot.get_xticklabels())]
        assert len(ticks) >= len(panels)
        assert all(left.x1 < right.x0 for left, right in pairwise(ticks))
        heading = extents(figure.texts)
        legends = [legend.get_window_extent() for legend in figure.legends]
        bars = [plot.get_tightbbox() for plot in figure.axes if plot not in panels]
        whole = figure.bbox
        for box in [*titles, *labels, *legends, *bars, *heading]:
            assert whole.x0 <= box.x0 < box.x1 <= whole.x1
            assert whole.y0 <= box.y0 < box.y1 <= whole.y1
        assert all(left.x1 <= right.x0 for left, right in pairwise(titles))
        assert not any(title.overlaps(other) for title in titles for other in heading)
        assert not any(label.overlaps(other) for label in labels for other in [*legends, *bars])


def test_depths_beyond_the_limit_are_shown_and_titles_say_which_cuts_and_which_line(drawn):
    levels = boxed(8.0, 8.0, 18.0)
    draw_depths(levels, np.array([[0.4, 0.5, 0.4], [0.4, 0.9, 0.4]]), "")
    above = drawn[0].axes[0]
    assert above.get_ylim()[1] > 0.9
    assert list(rounding_cuts(levels)) == [3, 4]
    assert (
        "cuts 1 to 2 along the line s = 0.7 (cuts 3 to 4, which only round the stock, not shown)" in above.get_title()
    )
    assert any("cuts 1 to 4" in title for title in texts(drawn[0])[1:])


def test_depths_are_drawn_over_the_way_along_the_part_in_the_colours_of_the_cuts_drawn(drawn):
    levels = boxed(8.0, 8.0, 18.0)
    part = levels[0].surface
    assert part is not None
    draw_depths(levels, np.full((2, 1000), [[0.2], [0.4]]), "", 0.25)
    above, below, bar, shares = drawn[0].axes
    assert "along the line s = 0.25" in above.get_title()
    points = part.positions(np.full(1000, 0.25), np.linspace(0, 1, 1000))
    assert np.isclose(above.get_xlim()[1], np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    assert {text.get_text() for text in above.texts} == {"1", "2"}
    first, second = (line.get_color() for line in above.lines[:2])
    assert np.abs(np.array(first) - second).max() > 0.5
    assert below.images[0].get_clim() == (0, 100)
    assert (bar.get_ylim(), shares.get_ylim()) == ((1, 2), (0, 100))


@pytest.mark.parametrize("cuts", [1, 2, 9, 10, 11, 37])
def test_some_lines_are_labelled_apart_from_each_other_each_on_its_own(cuts):
    line = np.random.default_rng(cuts).random((cuts, 1000))
    found = label_places(line)
    assert len(found) <= 10
    assert min(cuts, 6) <= len(found)
    assert len({b[0] - a[0] for a, b in pairwise(found)}) <= 1
    assert all(b[1] - a[1] > 30 for a, b in pairwise(found))
    assert all(0 <= place < 1000 and 1 <= k <= cuts for k, place in found)


@pytest.mark.parametrize("towards", ["x", "y", "z"])
def test_an_open_mesh_is_seen_from_where_it_faces_and_cut_through_its_middle(towards, drawn):
    mesh = sheet(**{towards: 1.0})
    assert np.allclose(view(mesh)[1], [-1.0 * (axis == towards) for axis in "xyz"])
    assert np.isclose(np.linalg.det(view(mesh)[[0, 1, 2]]), 1.0)
    levels = [
        replace(
            level(k, capsule(5.0)),
            mesh=TriangleMesh(mesh.vertices + 0.4 * k * np.eye(3)["xyz".index(towards)], mesh.faces),
        )
        for k in range(3)
    ]
    draw_levels(levels, None, "")
    middle = levels[-1].mesh.bounds.mean(axis=0).round(2)
    assert texts(drawn[0]) == [f"section y = {middle[1]:g}", f"section x = {middle[0]:g}"]


def test_a_closed_mesh_is_seen_from_the_front():
    assert np.allclose(view(Box(np.zeros(3), np.array([9.0, 1.0, 1.0])).mesh(0.1)), np.eye(3))
    assert np.allclose(view(Box(np.zeros(3), np.array([1.0, 9.0, 1.0])).mesh(0.1)), np.eye(3))


def test_the_sections_are_named(drawn):
    draw_levels(boxed(8.0, 8.0, 18.0), POST, "")
    assert texts(drawn[0]) == ["section y = 0", "section x = 0"]


def test_the_coloured_levels_go_out_to_the_stock(drawn):
    draw_coloured(boxed(8.0, 8.0, 18.0), "")
    behind = "from behind"
    assert texts(drawn[0]) == ["level 1", behind, "level 2", behind, "level 4, the stock", behind]
    draw_coloured([level(k, capsule(5.0 + 0.4 * k)) for k in range(3)], "")
    assert texts(drawn[1]) == ["level 1", behind, "level 2, the stock", behind]


def test_a_box_is_shaded_by_its_faces_and_a_round_body_smoothly():
    box = Box(np.zeros(3), np.array([1.0, 2.0, 3.0])).mesh(0.1)
    own = box.face_vectors / np.linalg.norm(box.face_vectors, axis=1, keepdims=True)
    assert np.allclose(corner_normals(box), own[:, None])
    body = capsule(5.0)
    mesh = body.mesh(0.02)
    assert (corner_normals(mesh) * body.normals(mesh.vertices)[mesh.faces]).sum(axis=2).min() > 0.99


def test_pictures_are_written(tmp_path):
    draw_levels(boxed(8.0, 8.0, 18.0), POST, tmp_path / "levels.png")
    assert (tmp_path / "levels.png").read_bytes().startswith(b"\x89PNG")


TOOL = Cutter.from_job(2, "finishing", Job().tool("finishing"), [Frustum(35.0, 80.0, 60.0)])


@pytest.fixture
def leaning_path():
    """Cuts whose axes lean ever more, the first row being a rapid that leans most."""
    polar = np.radians([110.0, 10, 50, 90, 100, 30])
    axes = np.column_stack([np.sin(polar), 0 * polar, np.cos(polar)])
    return path_of(np.tile([3.0, 0, 120], (6, 1)), axes, tool=TOOL)


def test_the_height_told_is_that_of_the_body_drawn(leaning_path):
    heights = machine_picture._lowest(leaning_path)
    assert np.isinf(heights[0])
    assert heights.argmin() == 4
    for row in range(1, 6):
        bodies = machine_picture._tool(leaning_path.cutter, leaning_path.tips[row], leaning_path.axes[row])
        drawn = min(mesh.vertices[:, 2].min() for name, mesh in bodies if name in ("holder", "spindle"))
        assert heights[row] == pytest.approx(drawn, abs=0.3)


def test_the_picture_is_written_from_both_sides_with_what_there_is(leaning_path, tmp_path):
    part = Capsule(np.array([0.0, 0, 108]), np.array([0.0, 0, 120]), 3.0).mesh(0.1)
    holding = HoldingJob(diameter=4.0, length=105.0)
    table = Table(radius=100.0, standing=(Frustum(20.0, 40.0, 30.0),))
    machine = replace(read_machine("mikron-ucp600"), table=table)
    draw_machine([leaning_path, leaning_path], part, holding, machine, tmp_path / "machine.png")
    assert (tmp_path / "machine.png").read_bytes().startswith(b"\x89PNG")


def test_a_table_is_drawn_as_wide_as_it_is():
    drawn = machine_picture.table_bodies(Table(radius=140.0))[0][1]
    assert drawn.bounds[1, 0] == pytest.approx(140.0)


@pytest.mark.parametrize("name", [name for name in machine_names() if name in ("mill-4axis", "dmu-45")])
def test_a_machine_file_is_drawn(name, tmp_path):
    draw_machine_file(read_machine(name), tmp_path / "machine.png")
    assert (tmp_path / "machine.png").read_bytes().startswith(b"\x89PNG")
