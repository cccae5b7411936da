"""One surface machined alone is kept, and seen in a browser, as the run of a part is."""

import json

import numpy as np
import pytest

import bonecam
from bonecam.cli import main
from bonecam.surface import skin

pytestmark = pytest.mark.whole

JOB = bonecam.Job().with_values(
    finishing={"radius": 2.0, "flute_length": 6.0, "shank_diameter": 3.6, "overhang": 45.0, "scallop": 0.5},
    path={"max_tilt_deg": 85.0},
)


@pytest.fixture(scope="module")
def tube(tmp_path_factory):
    """An elliptic tube of 12 mm, finished, and the folder with all that was written."""
    folder = tmp_path_factory.mktemp("tube")
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rows = [np.column_stack([6 * np.cos(angle), 3 * np.sin(angle), np.full(24, z)]) for z in np.linspace(0, 12, 5)]
    files = {"program": folder / "tube.h", "keep": folder / "keep", "html": folder / "tube.html"}
    return bonecam.finish(skin(rows, 0.01), job=JOB, **files), folder


def test_a_closed_surface_needs_no_part_and_finds_its_post(tube):
    made, _ = tube
    assert made.report["surface"]["kind"] == "closed round s"
    assert made.report["post"]["length_mm"] == made.workpiece.solid.bounds[0, 2] > 0
    assert made.report["nc"]["gouge_max_mm"] <= JOB.path.gouge_tolerance


def test_the_page_from_kept_files_is_that_of_the_run(tube, tmp_path):
    made, folder = tube
    assert main(["view", str(folder / "keep"), "-o", str(tmp_path / "again.html")]) == 0
    text = (tmp_path / "again.html").read_text(encoding="utf-8")
    assert text == (folder / "tube.html").read_text(encoding="utf-8")
    assert made.view(tmp_path / "third.html").read_text(encoding="utf-8") == text
    kept = folder / "keep"
    assert (kept / "program.h").read_text(encoding="utf-8") == made.program.text
    assert bonecam.read_job(kept / "job.toml") == made.job


def test_axes_are_compared_with_normals_and_lead_at_the_same_contacts(tube):
    """On a tube whose walls stand the holder keeps off whatever the axis: smooth axes are free, no slower than the
    others, and off the normal; with an axis along the feed the shank meets the post."""
    made, folder = tube
    compared = made.compare_axes()
    by_name = {row["axes"]: row for row in compared.report}
    assert list(by_name) == ["surface normal", "lead 10 deg", "lead 10 deg, turned free", "this path"]
    assert by_name["this path"]["collide"] == by_name["this path"]["beyond_limits"] == 0
    assert by_name["lead 10 deg"]["collide"] > 0
    assert by_name["lead 10 deg, turned free"]["collide"] == 0
    assert by_name["this path"]["seconds"] <= by_name["lead 10 deg, turned free"]["seconds"]
    assert (folder / "keep" / "axes.md").read_text(encoding="utf-8") == compared.table
    assert (folder / "keep" / "axes.png").read_bytes().startswith(b"\x89PNG")
    kept = json.loads((folder / "keep" / "report.json").read_text(encoding="utf-8"))["axes"]
    assert kept == compared.report
    for row in kept:
        at_feeds = [row[f"seconds_at_{feed}"] for feed in (900, 1200, 3000)]
        assert at_feeds == sorted(at_feeds, reverse=True)
        assert at_feeds[0] >= 60 * compared.steps.sum() / 900 - 1e-3
    normals = compared.choices[0].axes
    found = made.workpiece.surface.project(compared.contacts)
    true = made.workpiece.surface.normals(found.parameters[:, 0], found.parameters[:, 1])
    assert np.allclose(normals, true, atol=1e-6)


def test_a_notebook_shows_summary_and_page(tube):
    shown = tube[0]._repr_html_()
    assert tube[0].summary.split("\n")[0] in shown
    assert "<iframe" in shown


def test_the_page_shows_path_and_program_and_asks_for_nothing(tube, browser):
    page = browser.new_page(viewport={"width": 1000, "height": 640})
    asked: list[str] = []
    troubles: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: troubles.append(str(error)))
    page.on("console", lambda told: told.type == "error" and troubles.append(told.text))
    page.goto((tube[1] / "tube.html").as_uri())
    for _ in range(600):
        if page.evaluate("page.ready") or troubles:
            break
        page.wait_for_timeout(50)
    assert page.locator("#modes button").all_inner_texts() == ["Paths", "Program", "Leftover"]
    before = page.locator("#canvas").screenshot()
    page.locator("#body-solid").uncheck()
    page.wait_for_timeout(100)
    assert page.locator("#canvas").screenshot() != before
    page.keyboard.press("4")
    page.evaluate("goTo(200)")
    shown = page.evaluate("page.arrays.move_line[200]")
    text = tube[0].program.text.split("\n")[shown - 1]
    assert page.locator("#blocks b").inner_text().strip() == text
    assert asked == [(tube[1] / "tube.html").as_uri()]
    assert troubles == []
    page.close()
