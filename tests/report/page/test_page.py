"""The page in a browser: it draws, answers, and asks the network for nothing.

The machine that moves in the page's view of the program, against its kinematics.

Graphs under the slider and the search for a block, in a browser.
"""

import base64
import gzip
import json
import re
import shutil
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from machine_files import CHAINS, write_machine
from numpy import ndarray
from scipy.spatial.transform import Rotation

import bonecam
from bonecam.cli import main
from bonecam.errors import FileError
from bonecam.machine import Machine, forward, read_machine
from bonecam.machine.kinematics import inverse_linear
from bonecam.nc import read_program
from bonecam.nc.requirements import job_dialect
from bonecam.report.kept import kept_contents
from bonecam.report.page.contents import Contents, machine_facts, pack, rotary_angles, unpack
from bonecam.tool import MoveKind

pytestmark = pytest.mark.whole


Run = tuple[bonecam.Result, Path]


@pytest.fixture(scope="module")
def page(small_run, browser):
    """The page of the small run, drawn; what it asked for and what went wrong are in `asked` and `troubles`."""
    opened = browser.new_page(viewport={"width": 1100, "height": 700})
    opened.asked, opened.troubles = [], []
    opened.on("request", lambda request: opened.asked.append(request.url))
    opened.on("pageerror", lambda error: opened.troubles.append(str(error)))
    opened.on("console", lambda told: told.type == "error" and opened.troubles.append(told.text))
    opened.goto((small_run[1] / "bone.html").as_uri())
    wait_until(opened, "page.ready")
    yield opened
    opened.close()


def wait_until(page: Any, condition: str, tries: int = 600) -> None:
    """Wait till a condition holds in the page, whose own policy forbids the library's way to wait."""
    for _ in range(tries):
        if page.evaluate(f"Boolean({condition})"):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"{condition} did not come true")


def picture(page: Any) -> bytes:
    """What the canvas shows once all is drawn."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return bytes(page.locator("#canvas").screenshot())


def test_levels_differ_in_the_picture_and_in_the_words(page):
    page.keyboard.press("2")
    seen = {}
    for level in range(3):
        page.locator("#level").fill(str(level))
        seen[picture(page)] = page.locator("#controls").inner_text()
    assert len(seen) == 3
    words = list(seen.values())
    assert "the part" in words[0]
    assert "cut 2" in words[2]
    assert "the stock" in words[2]


@pytest.mark.parametrize("mode", ["fit", "levels", "path", "program", "left"])
def test_every_view_draws_with_its_legend(page, mode):
    page.evaluate("change({level: 1})")
    page.locator(f"#modes button[data-mode={mode}]").click()
    empty = picture(page)
    page.evaluate("page.content.visible = false; page.redraw()")
    assert picture(page) != empty
    page.evaluate("page.content.visible = true; page.redraw()")
    assert page.locator("#legend").inner_text()


@pytest.mark.parametrize("colouring", ["kind", "feed", "tilt", "depth", "section", "force"])
def test_each_colouring_of_the_path_is_another_picture_with_its_unit(page, colouring):
    units = {"kind": "rapid", "feed": "mm/min", "tilt": "degrees", "depth": "mm", "section": "mm²", "force": "(n)"}
    page.keyboard.press("3")
    page.evaluate("change({level: 0, colouring: 'kind'})")
    plain = picture(page)
    page.locator("#colouring").select_option(colouring)
    assert (picture(page) == plain) == (colouring == "kind")
    assert units[colouring].lower() in page.locator("#legend").inner_text().lower()


def test_links_can_be_hidden(page):
    page.keyboard.press("3")
    page.evaluate("change({level: 0, colouring: 'kind', links: true})")
    with_links = page.evaluate("movesOf(0, page.state).length")
    page.locator("#links").click()
    assert page.evaluate("movesOf(0, page.state).length") < with_links


def test_cones_are_drawn_at_contacts_of_the_level_and_under_the_tool(page, small_run):
    page.keyboard.press("3")
    page.evaluate("change({level: 0, chosen: -1})")
    without = picture(page)
    page.locator("#cones").check()
    assert picture(page) != without

    path = small_run[0].paths[-1]
    inside = path.cones.cone_of >= 0
    chosen = path.cones.cone_of[inside]
    shapes = path.cones.shapes.take(chosen)
    assert (shapes.off(path.axes[inside]) < shapes.mean_angles).mean() > 0.95
    assert inside.sum() > 0.9 * (path.kinds == MoveKind.CUT).sum()

    shown = page.evaluate("someCones(movesOf(0, page.state))")
    assert 10 < len(shown) <= 40
    axes = page.evaluate(
        "(moves) => moves.map((i) => [axisOf(page.arrays.cone_axis, coneOf(i)).toArray(), ballOf(i).toArray()])", shown
    )
    balls = path.balls[inside]
    for axis, ball in axes:
        row = np.linalg.norm(balls - ball, axis=1).argmin()
        assert np.allclose(balls[row], ball, atol=0.01)
        assert np.allclose(path.cones.shapes.axes[chosen[row]], axis, atol=1e-3)

    page.keyboard.press("4")
    page.evaluate(f"goTo({shown[5]})")
    with_cone = picture(page)
    page.locator("#cones").uncheck()
    assert picture(page) != with_cone


def test_axes_of_a_level_are_free_where_they_are_compared(small_run):
    compared = small_run[0].compare_axes(0)
    assert len(compared.contacts) == (small_run[0].paths[-1].kinds == MoveKind.CUT).sum()
    row = compared.report[-1]
    assert row["axes"] == "this path"
    assert row["collide"] == row["beyond_limits"] == 0
    with pytest.raises(ValueError, match="give 0 to 1"):
        small_run[0].compare_axes(7)


def test_a_click_on_the_path_tells_the_block_there(page, small_run):
    page.keyboard.press("3")
    page.evaluate("change({level: 0})")
    move = page.evaluate("""() => {
        const box = page.canvas.getBoundingClientRect();
        return [box.left + box.width / 2, box.top + box.height / 2];
    }""")
    page.mouse.click(*move)
    told = page.locator("#picked").inner_text()
    block = told.split("block: ")[1].split("\n")[0]
    assert block in small_run[0].program.text
    assert "mm/min" in told


def test_play_moves_the_tool_and_shows_the_block(page, small_run):
    page.keyboard.press("4")
    page.evaluate("goTo(0)")
    before = page.evaluate("page.tool.body.position.toArray()")
    page.locator("#play").click()
    wait_until(page, "page.state.step > 20")
    page.locator("#play").click()
    assert not page.evaluate("page.playing")
    assert page.evaluate("page.tool.body.position.toArray()") != before

    page.evaluate("goTo(700)")
    text = small_run[0].program.text
    job = small_run[0].job
    motions = read_program(text, read_machine(job.nc.machine), job_dialect(job.nc))
    shown = page.evaluate("page.arrays.move_line[700]")
    assert page.locator("#blocks b").inner_text().strip() == text.split("\n")[shown - 1]
    at = page.evaluate("page.tool.body.position.toArray()")
    assert np.allclose(at, motions.tips[700], atol=0.002)


def test_the_standing_stock_shrinks_to_what_the_simulation_tells(page, small_run):
    page.keyboard.press("4")
    level = small_run[0].removal.standing[-1].level
    last = page.evaluate(f"page.arrays.move_level.lastIndexOf({level})")
    heights = []
    for step in (page.evaluate(f"firstMoveOf({level})"), last):
        page.evaluate(f"goTo({step})")
        heights.append(
            page.evaluate("""() => {
            const s = page.standing, p = s.mesh.geometry.attributes.position.array;
            return Array.from(s.base, (b, i) => (p[i] - b) * s.normals[i]);
        }""")
        )
    told = [np.array(h).reshape(-1, 3).sum(1) for h in heights]
    standing = small_run[0].removal.standing[-1]
    assert np.allclose(told[0], standing.before, atol=0.005)
    assert np.allclose(told[1], standing.after, atol=0.005)


def test_keys_turn_pages_and_levels(page):
    page.locator("#canvas").focus()
    page.keyboard.press("2")
    page.evaluate("change({level: 0, open: false})")
    page.locator("#canvas").focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate("page.state.level") == 1
    page.keyboard.press("c")
    assert page.evaluate("page.state.open")
    page.keyboard.press("v")
    assert abs(page.evaluate("page.orbit.elevation")) < 1e-9


def test_nothing_was_asked_of_the_network_and_nothing_went_wrong(page, small_run):
    assert page.asked == [(small_run[1] / "bone.html").as_uri()]
    assert page.troubles == []


def test_the_page_from_kept_files_is_that_of_the_run(small_run, tmp_path):
    made, folder = small_run
    assert main(["view", str(folder / "keep"), "-o", str(tmp_path / "again.html")]) == 0
    text = (tmp_path / "again.html").read_text(encoding="utf-8")
    assert text == (folder / "bone.html").read_text(encoding="utf-8") == made.page
    assert made.view(tmp_path / "third.html").read_text(encoding="utf-8") == text
    assert (folder / "keep" / "program.h").read_text(encoding="utf-8") == made.program.text
    report = json.loads((folder / "keep" / "report.json").read_text(encoding="utf-8"))
    assert report["levels"] == made.report["levels"]
    assert report["nc"] == made.report["nc"]
    cones = np.loadtxt(folder / "keep" / "cones.csv", delimiter=",", skiprows=1)
    assert np.allclose(np.linalg.norm(cones[:, 5:8], axis=1), 1, atol=1e-5)
    assert cones[:, 13].min() >= 1
    assert cones[:, 13].sum() == sum((path.cones.cone_of >= 0).sum() for path in made.paths)


def test_a_simulated_program_has_a_page_of_its_own(small_run, tmp_path):
    made, folder = small_run
    page = tmp_path / "page.html"
    keep = folder / "keep"
    removal = bonecam.simulate(keep / "program.h", keep, made.job, html=page)
    payload = page.read_text(encoding="utf-8").split('type="text/plain">')[1].split("</script>")[0]
    shown = unpack(base64.b64decode(payload), "page")
    whole = kept_contents(keep)[1]
    assert shown.facts["report"]["removal"] == removal.report
    assert shown.facts["program"]["blocks"] == whole.facts["program"]["blocks"]
    assert np.array_equal(shown.arrays["move_tip"], whole.arrays["move_tip"])
    away = np.hypot(*whole.arrays["level_0"][:, :2].T) > made.job.holding.diameter / 2 + 0.5
    assert away.sum() > 100
    assert np.allclose(shown.arrays["after_0"][away], whole.arrays["after_0"][away], atol=0.051)
    assert not any(name.startswith("uncut") for name in shown.arrays)


def test_bad_folders_and_names_are_one_line(small_run, tmp_path, capsys):
    keep = tmp_path / "keep"
    shutil.copytree(small_run[1] / "keep", keep)
    (keep / "view.gz").unlink()
    page = str(tmp_path / "p.html")
    for arguments, told in (
        ([str(keep), "-o", page], "view.gz cannot be read"),
        ([str(tmp_path / "none"), "-o", page], "is no folder"),
        ([str(small_run[1] / "keep"), "-o", str(tmp_path / "p.png")], "ends in .html"),
        ([str(small_run[1] / "keep"), "-o", str(tmp_path / "no" / "p.html")], "does not exist"),
    ):
        assert main(["view", *arguments]) == 2
        error = capsys.readouterr().err
        assert told in error
        assert error.count("\n") == 1
    assert not Path(page).exists()


@pytest.mark.parametrize("fault", ["name", "levels", "level_0", "version"])
def test_a_view_of_another_version_or_without_what_it_needs_is_one_line(fault, small_run, tmp_path, capsys):
    packed, contents = kept_contents(small_run[1] / "keep")
    facts = {name: fact for name, fact in contents.facts.items() if name != fault}
    arrays = {name: array for name, array in contents.arrays.items() if name != fault}
    changed = pack(Contents(facts, arrays))
    if fault == "version":
        data = gzip.decompress(packed)
        changed = gzip.compress(data.replace(b'"bonecam_view": 1', b'"bonecam_view": 7', 1))
    (tmp_path / "view.gz").write_bytes(changed)
    assert main(["view", str(tmp_path), "-o", str(tmp_path / "page.html")]) == 2
    error = capsys.readouterr().err
    assert ("has version 7" if fault == "version" else "is damaged") in error
    assert error.count("\n") == 1
    assert not (tmp_path / "page.html").exists()


def test_a_page_whose_name_is_no_page_is_refused_before_the_work(small_run, tmp_path):
    with pytest.raises(FileError, match=r"ends in \.html"):
        bonecam.convert(small_run[0].part.given, html=tmp_path / "bone.htmls")


def test_a_notebook_shows_summary_and_page(small_run, browser, tmp_path):
    (tmp_path / "cell.html").write_text(small_run[0]._repr_html_(), encoding="utf-8")
    cell = browser.new_page()
    cell.goto((tmp_path / "cell.html").as_uri())
    assert small_run[0].summary in cell.locator("pre").first.inner_text()
    cell.frame_locator("iframe").locator("#modes button").first.wait_for()
    cell.close()


def test_a_page_too_large_for_a_notebook_is_a_picture(small_run, monkeypatch):
    monkeypatch.setattr("bonecam.report.kept.INLINE", 1000)
    shown = small_run[0]._repr_html_()
    assert 'src="data:image/png;base64,' in shown
    assert "MB: show() opens it" in shown


READY = """new Promise((done) => { const ask = () => (page.ready ? done() : setTimeout(ask, 50)); ask(); })"""
MARK = [7.0, -3.0, 20.0]
"""A point of the part, mm."""
STAND = """(steps) => steps.map((step) => {
    page.state.step = step;
    setTool(page.tool.body, step);
    moveWorld();
    page.scene.updateMatrixWorld(true);
    const tip = page.tool.body.getWorldPosition(new THREE.Vector3());
    const end = page.tool.body.localToWorld(new THREE.Vector3(0, 0, 1));
    const mark = page.world.localToWorld(new THREE.Vector3(7, -3, 20));
    return [tip.toArray(), end.sub(tip).toArray(), mark.toArray()];
})"""
"""Where the tip of the tool, its axis and the MARK stand at moves."""
KINDS = {
    "a trunnion": "table-table",
    "head and table": "head-table",
    "a head": "head-head",
    "a nutating table": "nutating",
    "a nutating head": "dmu-45",
    "four axes along X": "mill-4axis",
    "a spindle that lies": "lying",
}


def opened_page(small_run: Run, browser: Any) -> Any:
    """The page of the small run, opened in its view of the program."""
    opened = browser.new_page(viewport={"width": 1100, "height": 700})
    opened.goto((small_run[1] / "bone.html").as_uri())
    opened.evaluate(READY)
    opened.keyboard.press("4")
    return opened


@pytest.fixture(scope="module")
def machine_page(small_run, browser):
    """The page of the small run in its view of the program, the machine moving."""
    with closing(opened_page(small_run, browser)) as opened:
        opened.locator("#machine").check()
        yield opened


@pytest.fixture(params=KINDS.values(), ids=KINDS)
def machine(request, tmp_path):
    # Z along a spindle that lies: the table's normal is the machine's Y
    lying = CHAINS["table-table"].replace("part_zero", "part_x = [1.0, 0.0, 0.0]\npart_z = [0.0, 1.0, 0.0]\npart_zero")
    text = {**CHAINS, "lying": lying}.get(request.param)
    return read_machine(request.param if text is None else write_machine(tmp_path, text))


def turned(points: ndarray, machine_axes: Any, machine: Machine, rotary: ndarray) -> ndarray:
    """A point turned about axes one behind the other, at each row of angles (rad)."""
    for axis in machine_axes:
        pivot = np.array(axis.pivot)
        turns = Rotation.from_rotvec(rotary[:, [machine.column(axis) - 3]] * np.array(axis.direction))
        points = pivot + turns.apply(points - pivot)
    return points


def test_any_chain_stands_as_its_kinematics(machine_page, machine):
    count = 6
    rng = np.random.default_rng(1)
    joints = np.c_[rng.uniform(-90, 90, (count, 3)), rng.uniform(-3, 3, (count, 2))]
    for axis in machine.rotary:
        if axis.locked:
            joints[:, machine.column(axis)] = axis.limits[0]
    of_tool = "page.facts.tools.find((tool) => tool.number === page.arrays.move_tool[0])"
    length = float(machine_page.evaluate(f"{of_tool}.length"))
    tips, axes = forward(machine, joints, length)
    arrays = {"move_tip": tips, "move_axis": axes, **rotary_angles(machine, joints)}
    machine_page.evaluate(
        """([facts, arrays]) => {
            page.kept = [page.facts, page.arrays];
            page.facts = { ...page.facts, program: { ...page.facts.program, ...facts } };
            const flat = Object.entries(arrays).map(([name, rows]) => [name, Float32Array.from(rows.flat())]);
            page.arrays = { ...page.arrays, ...Object.fromEntries(flat) };
        }""",
        [machine_facts(machine), {name: values.tolist() for name, values in arrays.items()}],
    )
    found = np.array(machine_page.evaluate(STAND, list(range(count))))
    machine_page.evaluate("[page.facts, page.arrays] = page.kept")

    rotary = joints[:, 3:]
    zero = np.array(machine.part_zero)
    height = np.c_[np.zeros((count, 2)), joints[:, 2] - zero[2]]
    head = machine.tool_axes[::-1]
    swung, above = (turned(np.tile([0.0, 0.0, z], (count, 1)), head, machine, rotary) for z in (-length, 1 - length))
    part = np.tile(machine.in_machine(np.array([MARK]))[0] + zero, (count, 1))
    mark = turned(part, machine.part_axes, machine, rotary)
    assert np.allclose(found[:, 0], height + swung + [0, 0, length], atol=1e-3)
    assert np.allclose(found[:, 1], above - swung, atol=1e-5)
    assert np.allclose(found[:, 2], mark - np.c_[joints[:, :2], np.tile(zero[2], count)], atol=1e-3)


def test_the_program_moves_the_table_under_a_head_that_goes_up_and_down(machine_page, small_run):
    result = small_run[0]
    machine = read_machine(result.job.nc.machine)
    motions = read_program(result.program.text, machine, job_dialect(result.job.nc))
    assert len(machine.part_axes) == 2
    steps = [100, 400, 700]
    assert abs(motions.axes[700, 2]) < 0.99
    found = np.array(machine_page.evaluate(STAND, steps))
    joints = inverse_linear(machine, motions.tips[steps], motions.words[steps, 3:])
    zero = np.array(machine.part_zero)
    assert np.allclose(found[:, 0], np.c_[np.zeros((3, 2)), joints[:, 2] - zero[2]], atol=0.1)
    assert np.allclose(found[:, 1], [0, 0, 1], atol=2e-3)
    moved = machine_page.evaluate("page.world.matrix.toArray()")
    machine_page.locator("#machine").uncheck()
    assert machine_page.evaluate("page.world.matrix.toArray()") == np.eye(4).ravel().tolist() != moved
    machine_page.locator("#machine").check()


def test_it_is_told_what_moves_and_stands_in_other_views(machine_page, small_run):
    axes = ", ".join(axis.letter for axis in read_machine(small_run[0].job.nc.machine).part_axes)
    assert f"the machine moves: table X, Y, {axes}, head Z" in machine_page.locator("#controls").inner_text()
    machine_page.keyboard.press("3")
    assert machine_page.evaluate("page.world.matrix.toArray()") == np.eye(4).ravel().tolist()
    machine_page.keyboard.press("4")


@pytest.fixture(scope="module")
def program_page(small_run, browser):
    """The page of the small run in its view of the program."""
    with closing(opened_page(small_run, browser)) as opened:
        yield opened


@pytest.fixture(scope="module")
def motions(small_run):
    """The moves of its program."""
    nc = small_run[0].job.nc
    return read_program(small_run[0].program.text, read_machine(nc.machine), job_dialect(nc))


def seek(page: Any, sought: str) -> str:
    """Ask for a block or a text; what the page tells."""
    page.locator("#find").fill(sought)
    page.locator("#find").press("Enter")
    return str(page.locator("#found").inner_text())


def step(page: Any) -> int:
    return int(page.evaluate("page.state.step"))


def test_graphs_tell_feed_and_rotary_words_with_ranges(program_page, small_run, motions):
    told = program_page.evaluate("page.tracks.map((track) => [track.name, track.low, track.high])")
    axes = read_machine(small_run[0].job.nc.machine).own_rotary
    assert [name for name, *_ in told] == ["feed", *(axis.letter for axis in axes)]
    angles = np.degrees(motions.words[:, 3:5])
    assert np.allclose([row[1:] for row in told[1:]], np.c_[angles.min(0), angles.max(0)], atol=0.01)
    feeds = motions.feed_rates[~motions.rapid & ~motions.inverse_time]
    assert told[0][2] >= feeds.max() * 0.999
    at = 400
    program_page.evaluate(f"goTo({at})")
    labels = program_page.locator("#tracks").inner_text()
    assert labels.count("mm/min") == 1
    assert labels.count("°") == len(axes)
    for axis, angle in zip(axes, angles[at], strict=True):
        assert re.search(rf"{axis.letter} {0.0 if abs(angle) < 0.05 else angle:.1f}".replace("-", "\u2212"), labels)


def test_a_column_has_least_and_greatest_of_its_moves(program_page):
    values = np.random.default_rng(1).normal(size=5000)
    values[::7] = np.nan
    low, high = program_page.evaluate(
        """(values) => {
            const shares = values.map((_, i) => i / values.length);
            const found = extremes(values.map((v) => (v === null ? NaN : v)), shares, 50);
            return [Array.from(found.low), Array.from(found.high)];
        }""",
        [None if np.isnan(value) else value for value in values],
    )
    assert np.allclose(low, np.nanmin(values.reshape(50, 100), axis=1), atol=1e-6)
    assert np.allclose(high, np.nanmax(values.reshape(50, 100), axis=1), atol=1e-6)


@pytest.mark.parametrize("over", ["blocks", "time"])
def test_a_click_on_the_graph_goes_there(program_page, motions, over):
    program_page.locator("#over").select_option(over)
    box = program_page.locator("#graph").bounding_box()
    program_page.mouse.click(box["x"] + 0.6 * box["width"], box["y"] + 5)
    last = len(motions.rapid) - 1
    minutes = program_page.evaluate("Array.from(page.arrays.move_minute)")
    share = step(program_page) / last if over == "blocks" else minutes[step(program_page)] / minutes[-1]
    assert abs(share - 0.6) < 0.01
    cursor = program_page.evaluate("document.getElementById('cursor').getBoundingClientRect().left")
    assert abs(cursor - box["x"] - 0.6 * box["width"]) < 0.01 * box["width"]


def test_enter_goes_from_match_to_match_and_round(program_page, small_run, motions):
    lines = small_run[0].program.text.split("\n")
    program_page.evaluate("goTo(0)")
    matches = [n for n, line in enumerate(lines, 1) if "LEVEL" in line]
    ahead = [n for n in matches if n >= motions.lines[0]]
    assert len(ahead) > 1
    for line in (*ahead, *matches, matches[0]):
        assert seek(program_page, "Level") == f"line {line}: {lines[line - 1]}"
        assert step(program_page) == min(np.searchsorted(motions.lines, line), len(motions.lines) - 1)


def test_a_number_is_that_of_a_block(program_page, small_run, motions):
    lines = small_run[0].program.text.split("\n")
    at = motions.lines[len(motions.lines) // 2]
    number = re.match(r"N?(\d+)", lines[at - 1])
    assert number is not None
    program_page.evaluate("goTo(0)")
    assert seek(program_page, number[1]).startswith(f"line {at}: ")
    assert motions.lines[step(program_page)] == at
    assert program_page.locator("#blocks b").inner_text().strip() == lines[at - 1].strip()


def test_what_is_not_there_is_told_and_moves_nothing(program_page):
    program_page.evaluate("goTo(300)")
    assert seek(program_page, "no such words") == "nothing found: no such words"
    assert seek(program_page, "99999999") == "nothing found: 99999999"
    assert step(program_page) == 300


def test_keys_typed_into_the_search_are_not_commands(program_page):
    program_page.locator("#canvas").focus()
    program_page.keyboard.press("/")
    program_page.keyboard.type("1c v")
    assert program_page.evaluate("page.state.mode") == "program"
    assert program_page.locator("#find").input_value().endswith("1c v")
    program_page.locator("#canvas").focus()


def test_many_moves_draw_no_more_lines_than_the_graph_is_wide(program_page):
    lines, most = program_page.evaluate("""() => {
        const kept = [page.arrays, page.tracks], count = 200000;
        page.arrays = { ...page.arrays, move_minute: Float32Array.from({ length: count }, (_, i) => i) };
        const waves = ({ low, high }) =>
            Float32Array.from({ length: count }, (_, i) => low + (high - low) * Math.abs(Math.sin(i)));
        page.tracks = kept[1].map((track) => ({ ...track, values: waves(track) }));
        const pens = CanvasRenderingContext2D.prototype, lineTo = pens.lineTo;
        let lines = 0;
        pens.lineTo = function (...place) { lines++; lineTo.apply(this, place); };
        drawGraph();
        pens.lineTo = lineTo;
        const most = 2 * document.getElementById("graph").width * page.tracks.length;
        [page.arrays, page.tracks] = kept;
        drawGraph();
        return [lines, most];
    }""")
    assert most / 4 < lines <= most
