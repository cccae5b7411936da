"""Graphs under the slider and the search for a block, in a browser."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bonecam
from bonecam.machine.machine import read_machine
from bonecam.nc.motions import Motions
from bonecam.nc.reading import read_program
from bonecam.nc.requirements import job_dialect

pytestmark = pytest.mark.whole

Run = tuple[bonecam.Result, Path]
READY = """new Promise((done) => { const ask = () => (page.ready ? done() : setTimeout(ask, 50)); ask(); })"""


@pytest.fixture(scope="module")
def page(small_run: Run, browser: Any) -> Iterator[Any]:
    """The page of the small run in its view of the program."""
    opened = browser.new_page(viewport={"width": 1100, "height": 700})
    opened.goto((small_run[1] / "bone.html").as_uri())
    opened.evaluate(READY)
    opened.keyboard.press("4")
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def motions(small_run: Run) -> Motions:
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


def test_graphs_tell_feed_and_rotary_words_with_ranges(page: Any, small_run: Run, motions: Motions) -> None:
    told = page.evaluate("page.tracks.map((track) => [track.name, track.low, track.high])")
    axes = read_machine(small_run[0].job.nc.machine).own_rotary
    assert [name for name, *_ in told] == ["feed", *(axis.letter for axis in axes)]
    angles = np.degrees(motions.words[:, 3:5])
    assert np.allclose([row[1:] for row in told[1:]], np.c_[angles.min(0), angles.max(0)], atol=0.01)
    feeds = motions.feed_rates[~motions.rapid & ~motions.inverse_time]
    assert told[0][2] >= feeds.max() * 0.999
    at = 400
    page.evaluate(f"goTo({at})")
    labels = page.locator("#tracks").inner_text()
    assert labels.count("mm/min") == 1
    assert labels.count("°") == len(axes)
    for axis, angle in zip(axes, angles[at], strict=True):
        assert re.search(rf"{axis.letter} {0.0 if abs(angle) < 0.05 else angle:.1f}".replace("-", "\u2212"), labels)


def test_a_column_has_least_and_greatest_of_its_moves(page: Any) -> None:
    values = np.random.default_rng(1).normal(size=5000)
    values[::7] = np.nan
    low, high = page.evaluate(
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
def test_a_click_on_the_graph_goes_there(page: Any, motions: Motions, over: str) -> None:
    page.locator("#over").select_option(over)
    box = page.locator("#graph").bounding_box()
    page.mouse.click(box["x"] + 0.6 * box["width"], box["y"] + 5)
    last = len(motions.rapid) - 1
    minutes = page.evaluate("Array.from(page.arrays.move_minute)")
    share = step(page) / last if over == "blocks" else minutes[step(page)] / minutes[-1]
    assert abs(share - 0.6) < 0.01
    cursor = page.evaluate("document.getElementById('cursor').getBoundingClientRect().left")
    assert abs(cursor - box["x"] - 0.6 * box["width"]) < 0.01 * box["width"]


def test_enter_goes_from_match_to_match_and_round(page: Any, small_run: Run, motions: Motions) -> None:
    lines = small_run[0].program.text.split("\n")
    page.evaluate("goTo(0)")
    matches = [n for n, line in enumerate(lines, 1) if "LEVEL" in line]
    ahead = [n for n in matches if n >= motions.lines[0]]
    assert len(ahead) > 1
    for line in (*ahead, *matches, matches[0]):
        assert seek(page, "Level") == f"line {line}: {lines[line - 1]}"
        assert step(page) == min(np.searchsorted(motions.lines, line), len(motions.lines) - 1)


def test_a_number_is_that_of_a_block(page: Any, small_run: Run, motions: Motions) -> None:
    lines = small_run[0].program.text.split("\n")
    at = motions.lines[len(motions.lines) // 2]
    number = re.match(r"N?(\d+)", lines[at - 1])
    assert number is not None
    page.evaluate("goTo(0)")
    assert seek(page, number[1]).startswith(f"line {at}: ")
    assert motions.lines[step(page)] == at
    assert page.locator("#blocks b").inner_text().strip() == lines[at - 1].strip()


def test_what_is_not_there_is_told_and_moves_nothing(page: Any) -> None:
    page.evaluate("goTo(300)")
    assert seek(page, "no such words") == "nothing found: no such words"
    assert seek(page, "99999999") == "nothing found: 99999999"
    assert step(page) == 300


def test_keys_typed_into_the_search_are_not_commands(page: Any) -> None:
    page.locator("#canvas").focus()
    page.keyboard.press("/")
    page.keyboard.type("1c v")
    assert page.evaluate("page.state.mode") == "program"
    assert page.locator("#find").input_value().endswith("1c v")
    page.locator("#canvas").focus()


def test_many_moves_draw_no_more_lines_than_the_graph_is_wide(page: Any) -> None:
    lines, most = page.evaluate("""() => {
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
