"""What a run writes of a second clamping: the page, cutter location data, and the files that it keeps."""

import base64
import hashlib
import json
import re
import shutil
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_job import SMALL, SMALL_CAPSULE

from bonecam.cli import main
from bonecam.errors import FileError
from bonecam.job import write_job
from bonecam.machine import read_machine
from bonecam.mesh import TriangleMesh, read_mesh, write_mesh
from bonecam.nc import read_program
from bonecam.nc.requirements import job_dialect
from bonecam.report import read_apt
from bonecam.report.kept import GIVEN, SECOND_VIEW
from bonecam.report.outputs import Outputs
from bonecam.report.page.contents import unpack
from bonecam.tool import MoveKind

pytestmark = pytest.mark.whole


@pytest.fixture(scope="module")
def second(second_run):
    made = second_run[0].second
    assert made is not None
    return made


@pytest.fixture(scope="module")
def contents(second):
    return unpack(second.packed_view, "the second clamping")


@pytest.fixture
def keep(second_run, tmp_path):
    """A copy of what the run kept."""
    return Path(shutil.copytree(second_run[1] / "keep", tmp_path / "keep"))


@dataclass(frozen=True)
class Simulated:
    """What `simulate` makes of a kept text: its report, what it prints, its page."""

    report: dict[str, Any]
    told: list[str]
    page: str


@pytest.fixture(scope="module")
def simulated(second_run, tmp_path_factory):
    """Both texts of the run, simulated from its kept folder."""
    folder, found = second_run[1], {}
    keep = ["--keep", str(folder / "keep")]
    for name in ("bone.h", "bone.second.h"):
        again = tmp_path_factory.mktemp("again")
        outputs = ["--report", str(again / "again.json"), "--html", str(again / "again.html")]
        with redirect_stdout(StringIO()) as told:
            assert main(["simulate", str(folder / name), *keep, *outputs]) == 0
        report = json.loads((again / "again.json").read_text(encoding="utf-8"))
        page = (again / "again.html").read_text(encoding="utf-8")
        found[name] = Simulated(report, told.getvalue().splitlines(), page)
    return found


def test_every_output_of_the_second_clamping_lies_beside_that_of_the_first(second_run, second):
    folder = second_run[1]
    assert (folder / "bone.second.h").read_text(encoding="utf-8") == second.program.text
    assert (folder / "bone.second.html").read_text(encoding="utf-8") == second.page
    assert (folder / "bone.second.apt").read_text(encoding="utf-8") == second.apt
    keep = folder / "keep"
    assert (keep / "second.h").read_bytes() == (folder / "bone.second.h").read_bytes()
    assert (keep / "second.apt").read_bytes() == (folder / "bone.second.apt").read_bytes()
    assert (keep / SECOND_VIEW).read_bytes() == second.packed_view


def test_the_page_shows_the_moves_of_the_second_text(second, contents):
    job = second.job
    text = second.program.text
    motions = read_program(text, read_machine(job.nc.machine), job_dialect(job.nc))
    arrays, facts = contents.arrays, contents.facts
    assert arrays["text"].tobytes().decode("latin-1") == text
    np.testing.assert_allclose(arrays["move_tip"], motions.tips, atol=0.002)
    np.testing.assert_array_equal(arrays["move_line"], motions.lines)
    assert facts["program"]["time"] == str(second.program.time)
    assert facts["summary"].startswith("second    bone.second.h: ")
    assert facts["chuck"] == {"radius": 15.0, "top": 2.0, "bottom": 0.0}
    assert facts["left"]["area"] == second.removal.left.area
    np.testing.assert_allclose(arrays["solid"].min(axis=0)[2], 0.0, atol=0.001)
    zero = second.clamping.pose[2, 3]
    assert facts["turned"] == {"zero_mm": zero, "cut_off_mm": second.clamping.cut_off}
    assert zero - second.clamping.cut_off == pytest.approx(second.clamping.top)


def test_the_page_s_stump_is_there_before_the_first_layer_and_gone_behind_the_last(second, contents):
    arrays = contents.arrays
    layers = [layer["level"] for layer in contents.facts["program"]["layers"]]
    assert layers == sorted(path.level for path in second.paths)
    place = arrays["level_0"]
    under = np.hypot(place[:, 0], place[:, 1]) < 0.5
    under &= place[:, 2] > place[:, 2].max() - 0.2
    assert arrays[f"before_{layers[-1]}"][under].min() > 1.0, "the stump is 1 mm high"
    assert arrays["after_0"][under].max() < 0.16, "a scallop of 0.1 mm, told in half cells of 0.05"
    beside = place[:, 2] < place[:, 2].max() - 5.0
    assert arrays["before_0"][beside].max() < 0.2
    assert (arrays["cut_at_0"][beside] == len(arrays["move_kind"])).all(), "no move cuts the finished side"
    cut_at = arrays["cut_at_0"][under]
    assert (arrays["move_kind"][cut_at] == MoveKind.CUT).all()


def test_the_page_of_the_second_clamping_draws_without_a_post(second_run, browser):
    opened = browser.new_page(viewport={"width": 900, "height": 600})
    troubles: list[str] = []
    asked: list[str] = []
    opened.on("pageerror", lambda error: troubles.append(str(error)))
    opened.on("request", lambda request: asked.append(request.url))
    place = (second_run[1] / "bone.second.html").as_uri()
    opened.goto(place)
    for _ in range(600):
        if opened.evaluate("Boolean(page.ready)"):
            break
        opened.wait_for_timeout(50)
    names = opened.locator("#body-list").inner_text().split("\n")
    assert {"shell", "chuck", "table"} <= {name.strip() for name in names}
    assert "post" not in names
    seen = set()
    for mode in ("path", "program", "left"):
        opened.locator(f"#modes button[data-mode={mode}]").click()
        opened.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        seen.add(bytes(opened.locator("#canvas").screenshot()))
    opened.close()
    assert len(seen) == 3
    assert not troubles
    assert asked == [place]


def test_cutter_location_data_has_the_moves_of_the_second_clamping(second):
    read = read_apt(second.apt)
    assert read.name == second.program.name
    assert [path.level for path in read.paths] == [path.level for path in second.paths]
    for found, path in zip(read.paths, second.paths, strict=True):
        np.testing.assert_allclose(found.tips, path.tips, atol=1e-6)
        np.testing.assert_allclose(found.axes, path.axes, atol=1e-8)


def test_view_makes_both_pages_again(second_run, tmp_path, capsys):
    folder = second_run[1]
    assert main(["view", str(folder / "keep"), "-o", str(tmp_path / "again.html")]) == 0
    pages = [tmp_path / "again.html", tmp_path / "again.second.html"]
    assert capsys.readouterr().out.split() == [str(page) for page in pages]
    for page, first in zip(pages, ("bone.html", "bone.second.html"), strict=True):
        assert page.read_bytes() == (folder / first).read_bytes()


def test_a_second_output_that_cannot_be_written_is_refused_before_the_work(tmp_path):
    for name, file in (("program", "bone.h"), ("html", "bone.html"), ("apt", "bone.apt")):
        (tmp_path / file.replace(".", ".second.")).mkdir()
        with pytest.raises(FileError, match=r"bone\.second\."):
            Outputs(**{name: tmp_path / file}, second=True).check()
        Outputs(**{name: tmp_path / file}).check()


def test_the_sheet_has_a_page_for_each_clamping(second_run, second, browser):
    sheet = second_run[1] / "sheet.html"
    opened = browser.new_page()
    opened.goto(sheet.as_uri())
    printed = opened.pdf(format="A4", prefer_css_page_size=True)
    words = [article.inner_text() for article in opened.locator("article").all()]
    turned_drawing = opened.locator("article").nth(1)
    stump = turned_drawing.locator("path.post").bounding_box()
    part = turned_drawing.locator("path.part").evaluate_all(
        "all => Math.min(...all.map(p => p.getBoundingClientRect().top))"
    )
    opened.close()
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 2
    assert stump["y"] < part <= stump["y"] + stump["height"], "the stump stands on the part"
    first, turned = words
    assert "Setup sheet: second clamping" in turned
    assert "is removed in the second clamping, see its page" in first
    for made, told in ((second_run[0].program, first), (second.program, turned)):
        assert hashlib.sha256(made.text.encode()).hexdigest() in told
        for minutes in made.time.tools:
            assert f"\t{minutes:.1f}" in told
    report = second.report
    for figure in (
        "bone.second.h",
        *report["time_texts"],
        f"stump \u2300 {second.job.holding.diameter:g}",
        f"Z {second.clamping.top - second.program.zero_height:.2f}",
        "chuck \u2300 30 x 2",
        f"Gouge of the part by the ball: {1000 * report['gouge_max_mm']:.2f} µm at most",
        f"A ball goes {report['gouge_to_given_max_mm']:.3f} mm into the mesh as given at most",
        f"The tool stays {report['removal']['clearance_mm']['shell']:.2f} mm from the shell",
        f"{report['at_post_after_mm2']:.1f} of {report['at_post_before_mm2']:.1f} mm² still keep",
        "Turned about X alone",
    ):
        assert figure in turned, figure


def test_simulate_finds_in_the_kept_texts_what_the_run_found(simulated, second):
    found = simulated["bone.second.h"].report["removal"]
    told = second.report["removal"]
    assert found["clearance_mm"]["shell"] == pytest.approx(told["clearance_mm"]["shell"], abs=0.01)
    assert found["left"]["area_over_0_02_mm2"] == pytest.approx(told["left"]["area_over_0_02_mm2"], abs=0.01)
    for again, level in zip(found["levels"], told["levels"], strict=True):
        assert again["index"] == level["index"]
        assert again["removed_mm3"] == pytest.approx(level["removed_mm3"], abs=0.01)
        assert again["depth_max_mm"] == pytest.approx(level["depth_max_mm"], abs=0.005)
        assert again["over_limit_mm"] == pytest.approx(level["over_limit_mm"], abs=0.005)
    page = simulated["bone.second.h"].page
    packed = base64.b64decode(page.split('<script id="payload" type="text/plain">')[1].split("<")[0])
    shown = unpack(packed, "again.html")
    assert shown.facts["solid"] == "shell"
    assert [layer["level"] for layer in shown.facts["program"]["layers"]] == sorted(path.level for path in second.paths)


def test_simulate_begins_the_first_text_with_the_exact_stock(second_run, simulated):
    found = simulated["bone.h"].report["removal"]
    assert found["levels"] == second_run[0].report["removal"]["levels"]


def test_simulate_finds_what_each_text_does_to_the_mesh_as_given(second_run, second, simulated):
    result = second_run[0]
    for name, nc, removal in (
        ("bone.h", result.report["nc"], result.report["removal"]),
        ("bone.second.h", second.report, second.report["removal"]),
    ):
        found = simulated[name].report
        assert found["removal"]["given"] == removal["given"]
        assert found["nc"] == {key: nc[key] for key in nc if key.startswith("gouge_to_given")}
        assert found["nc"]["gouge_to_given_line"] > 0
        told = [line for line in simulated[name].told if not line.startswith(("job ", "warning ", "   "))]
        assert told[0] == f"cut in    {nc['gouge_to_given_max_mm']:.3f} mm into the mesh as given at most"
        assert f"{removal['given']['gouge_max_mm']:.3f} mm inside the mesh as given at most" in "".join(told)


@pytest.mark.parametrize("name", ["bone.h", "bone.second.h"])
def test_simulate_refuses_a_text_that_goes_too_deep_into_the_mesh_as_given(second_run, keep, tmp_path, name, capsys):
    """A mesh as given that is 1.5 times as large: every ball would be in it, and nothing was left on it."""
    given = read_mesh(keep / GIVEN)
    middle = given.bounds.mean(axis=0)
    write_mesh(TriangleMesh(middle + 1.5 * (given.vertices - middle), given.faces), keep / GIVEN)
    report = tmp_path / "again.json"
    outputs = ["--report", str(report), "--cell", "0.2"]
    assert main(["simulate", str(second_run[1] / name), "--keep", str(keep), *outputs]) == 2
    assert re.search(
        r"line \d+: the ball goes [12]\.\d+ mm into the mesh as given at .*, allowed 0\.5\d+: mend the mesh there",
        capsys.readouterr().err,
    )
    assert json.loads(report.read_text(encoding="utf-8"))["removal"]["given"]["gouge_max_mm"] > 1.0


@pytest.mark.parametrize("name", ["bone.h", "bone.second.h"])
def test_simulate_tells_that_it_has_no_mesh_as_given(second_run, keep, tmp_path, name, capsys):
    (keep / GIVEN).unlink()
    report = tmp_path / "again.json"
    outputs = ["--report", str(report), "--cell", "0.2"]
    assert main(["simulate", str(second_run[1] / name), "--keep", str(keep), *outputs]) == 0
    told = f"not judged against the mesh as given: {keep} has no given.ply"
    assert f"as given  {told}" in capsys.readouterr().out
    found = json.loads(report.read_text(encoding="utf-8"))
    assert found["removal"]["given"]["skipped"].startswith(told)
    assert "nc" not in found


def test_the_second_proof_knows_the_mesh_as_given(second):
    assert 0 < second.report["gouge_to_given_max_mm"] < 0.2, "the fit is within 0.2 mm"
    assert "OF THE MESH AS GIVEN" in second.program.text.upper()
    assert second.summary.count("the mesh as given at most") == 2
    assert second.report["removal"]["given"]["left_max_mm"] < 0.3


@pytest.mark.parametrize("change", ["gone", "no stock", "another stock", "no deviation"])
def test_simulate_refuses_a_kept_folder_that_tells_no_stock_or_not_how_deep_a_program_may_go(
    second_run, keep, change, capsys
):
    report = json.loads((keep / "report.json").read_text(encoding="utf-8"))
    if change == "another stock":
        report["stock"]["diameter_mm"] = 9.0
    elif change == "no deviation":
        del report["surface"]["deviation_max_mm"]
    else:
        del report["stock"]
    (keep / "report.json").write_text(json.dumps(report), encoding="utf-8")
    if change == "gone":
        (keep / "report.json").unlink()
    assert main(["simulate", str(second_run[1] / "bone.h"), "--keep", str(keep), "-q"]) == 2
    told = capsys.readouterr().err
    assert "report.json: tells" in told
    no_deviation, no_stock = "tells no deviation of the fit", "give the folder that `convert --keep` wrote"
    assert (no_deviation if change == "no deviation" else no_stock) in told


def test_simulate_refuses_a_second_text_that_is_not_the_kept_one_or_cuts_with_a_rapid(
    second_run, second, tmp_path, capsys
):
    folder = second_run[1]
    keep = folder / "keep"
    top = f"UP TO Z {second.clamping.top - second.program.zero_height:.2f} AT MOST"
    assert top in second.program.text
    other = tmp_path / "empty"
    other.mkdir()
    for text, folder_kept, told in (
        (second.program.text.replace(top, "UP TO Z 40.00 AT MOST"), keep, "stump reaches up to z 40.00 mm"),
        (re.sub(r"( L X.*?)( F\w+)?\n", r"\1 FMAX\n", second.program.text), keep, "a rapid removes"),
        (second.program.text, other, "of a second clamping, of which"),
    ):
        (tmp_path / "bone.h").write_text(text, encoding="utf-8")
        options = ["--keep", str(folder_kept), "--job", str(keep / "job.toml"), "--cell", "0.2"]
        assert main(["simulate", str(tmp_path / "bone.h"), *options]) == 2
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1
        assert told in lines[0]


def test_one_command_makes_shell_and_both_programs(tmp_path, capsys):
    part, job = tmp_path / "bone.stl", tmp_path / "job.toml"
    write_mesh(SMALL_CAPSULE.mesh(0.05), part)
    job.write_text(write_job(SMALL), encoding="utf-8")
    command = ["convert", str(part), "-o", str(tmp_path / "bone.h"), "--whole", "--job", str(job)]
    assert main(command) == 0
    printed = {"bone.shell.print.stl", "bone.shell.print.3mf"}
    assert {"bone.h", "bone.second.h", "bone.shell.stl", *printed} <= {path.name for path in tmp_path.iterdir()}
    text = (tmp_path / "bone.second.h").read_text(encoding="utf-8")
    assert re.search(r"DATUM: THE FLAT OF THE SHELL, TO WHICH ITS\b", re.sub(r"\s+\d+ ;\s*", " ", text).upper())
    assert "A PIN OF 4.00 MM" in text.upper()
    assert main([*command, "--set", "holding.parting=true", "--set", "holding.second=own.stl"]) == 2
    assert "--whole makes a shell: leave one of them out" in capsys.readouterr().err
