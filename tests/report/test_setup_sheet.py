"""The setup sheet: what it tells is that of the run, and it prints on one page."""

import hashlib
import html
import re
from dataclasses import replace

import numpy as np
import pytest

import bonecam
from bonecam.cli import main
from bonecam.machine import read_machine
from bonecam.nc import read_program
from bonecam.nc.header import ZeroWords
from bonecam.nc.requirements import job_dialect
from bonecam.report.sheet.setup_sheet import Paper, axis_ranges, draw_zero
from bonecam.report.summary import NOT_SIMULATED
from bonecam.report.warnings import with_warnings

pytestmark = pytest.mark.whole


def pages(pdf: bytes) -> int:
    """How many pages a PDF has."""
    return len(re.findall(rb"/Type\s*/Page\b", pdf))


def test_it_prints_on_one_page_and_asks_for_nothing(small_run, browser):
    asked: list[str] = []
    opened = browser.new_page()
    opened.on("request", lambda request: asked.append(request.url))
    opened.goto((small_run[1] / "sheet.html").as_uri())
    printed = opened.pdf(format="A4", prefer_css_page_size=True)
    opened.close()
    assert pages(printed) == 1
    assert asked == [(small_run[1] / "sheet.html").as_uri()]


def test_it_tells_the_checksum_the_tools_and_the_clamping(small_run):
    made, folder = small_run
    text = (folder / "sheet.html").read_text(encoding="utf-8")
    assert hashlib.sha256((folder / "bone.h").read_bytes()).hexdigest() in text
    job = made.job
    for tool, minutes in zip((job.roughing, job.finishing), made.program.time.tools, strict=True):
        row = next(row for row in text.split("<tr>") if f"<td>{tool.radius:g}</td>" in row)
        neck = f"{tool.neck_diameter:g} to {tool.neck_length:g}, " if tool.neck_length else ""
        for value in (f"{tool.overhang:g}", f"{neck}{tool.shank_diameter:g}", f"{minutes:.1f}"):
            assert f"<td>{value}</td>" in row
    assert sum(made.program.time.tools) == pytest.approx(made.program.time.axes)
    for told in (
        f"<dd>{'; '.join(made.program.time.texts)}</dd>",
        ">71.00</text>",
        "touch Z 0.00",
        "<dt>datum</dt><dd>1: preset row or work offset, 1 is G54</dd>",
        "chuck \u2300 12 x 6",
        "zero: X 0 Y 0 Z 0",
        "post 60.00",
        f"bonecam {bonecam.__version__}",
    ):
        assert told in text


def test_axes_travel_what_the_program_s_header_says(small_run):
    made = small_run[0]
    machine = read_machine(made.job.nc.machine)
    motions = read_program(made.program.text, machine, job_dialect(made.job.nc))
    found = {item.letter: item for item in axis_ranges(motions, machine)}
    header = re.search(r"TRAVEL, MM: X ([\d.]+) OF [\d.]+, Y ([\d.]+) OF", made.program.text)
    assert header
    for letter, told in zip("XY", header.groups()):
        assert found[letter].high - found[letter].low == pytest.approx(float(told), abs=0.11)
    rotary = np.degrees(motions.words[:, 3])
    assert found["B"].low == pytest.approx(rotary.min())
    assert found["B"].high == pytest.approx(rotary.max())


def test_a_sheet_without_simulation_warns(small_run):
    made = small_run[0]
    report = with_warnings({**made.report, "removal": NOT_SIMULATED}, made.job)
    blind = replace(made, report=report, removal=None)
    assert "was not simulated" in blind.sheet
    assert "touch nothing" not in blind.sheet


def test_what_bends_is_the_first_warning(small_run):
    warnings = small_run[0].sheet.split("Before the start")[1]
    first = warnings.split("<li>")[1]
    assert first.startswith("Stress at the peaks is ")
    assert "0.6 to 1.9 times by author" in first


def test_a_sheet_that_is_no_page_is_refused(tmp_path, capsys):
    assert main(["demo", "-o", str(tmp_path / "p.h"), "--sheet", str(tmp_path / "sheet.pdf")]) == 2
    assert "ends in .html" in capsys.readouterr().err


def test_it_tells_the_air_check_of_the_program_s_header(small_run):
    made, folder = small_run
    text = html.unescape((folder / "sheet.html").read_text(encoding="utf-8"))
    assert any("a mark at X+ of the table must go to Z+" in line for line in made.program.air_check)
    for line in made.program.air_check:
        assert f"<li>{line[0].upper()}{line[1:]}</li>" in text
        assert f" AIR CHECK: {line.upper()}" in re.sub(r"\n\d+ ;", "", made.program.text)


def test_the_drawing_marks_the_zero_by_the_words_of_the_control():
    paper = Paper(10.0, 80.0)
    draw_zero(paper, ZeroWords("-310", "-205", "-402.5"))
    assert "zero: X-310 Y-205 Z-402.5" in paper.svg("drawing")
