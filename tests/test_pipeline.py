"""The whole chain on the shipped phalanx at half its size, coarse so that it is quick; the same job serves all tests
of this file."""

import csv
import json
import re
import shutil
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from itertools import groupby
from pathlib import Path

import bonecam_meshes
import numpy as np
import pytest
from typed_values import differences

import bonecam
from bonecam import pipeline
from bonecam.cli import main
from bonecam.errors import (
    Cancelled,
    FileError,
    MachineError,
    MeshError,
    StockError,
    SurfaceError,
    UnitsError,
    VerifyError,
)
from bonecam.job import Job, write_job
from bonecam.job.materials.preset import FOLDER
from bonecam.levels import job_levels
from bonecam.machine import read_machine
from bonecam.mesh import TriangleMesh, read_mesh, write_mesh
from bonecam.nc import read_dialect, read_program
from bonecam.nc.header import UNSIMULATED
from bonecam.nc.requirements import job_dialect
from bonecam.report import Report
from bonecam.report.summary import MOST_LINES
from bonecam.runtime.own_files import OWN_FILES
from bonecam.simulation import simulation_report, simulation_text
from bonecam.surface import Deviation, Fit, TSpline, fit, part_surface
from bonecam.verify import prove_removal
from bonecam.verify.removal import check_removal_of_job

COARSE = Job().with_values(
    material={"name": "paper"},
    mechanics={"refuse": False},
    surface={"tolerance": 0.2},
    holding={"diameter": 2.0},
    levels={"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.02},
    roughing={"preset": "ball-4", "scallop": 0.5},
    finishing={"preset": "ball-2", "scallop": 0.2},
    path={"chord_tolerance": 0.02},
)


def comments_of(program: Path) -> str:
    """The comments of a Klartext program, those of more than one line as one."""
    return " ".join(re.findall(r"^\d+ ; (.*)$", program.read_text(encoding="utf-8"), re.MULTILINE))


@pytest.fixture(scope="module")
def phalanx(tmp_path_factory):
    whole, file = read_mesh(bonecam_meshes.path("phalanx")), tmp_path_factory.mktemp("part") / "phalanx.ply"
    write_mesh(TriangleMesh(0.5 * whole.vertices, whole.faces), file)
    return file


@pytest.fixture(scope="module")
def morphed():
    """The part with the levels of `chain`, once that is made."""
    return []


@pytest.fixture(scope="module")
def chain(tmp_path_factory, phalanx, morphed):
    folder, morph_standing = tmp_path_factory.mktemp("chain"), pipeline.morph_standing

    def told(*given, **named):
        morphed.append(morph_standing(*given, **named))
        return morphed[0]

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(pipeline, "morph_standing", told)
        result = bonecam.convert(
            phalanx, COARSE, program=folder / "bone.h", keep=folder / "keep", report=folder / "report.json"
        )
    return result, folder


@pytest.fixture(scope="module")
def again(tmp_path_factory, phalanx, chain, morphed):
    """The folder and the summary of the same job by the command line, which takes it as the part that ships, without
    simulation, from the same levels: that these come out the same again is proved of `levels`."""
    folder = tmp_path_factory.mktemp("again")
    job = folder / "job.toml"
    job.write_text(write_job(COARSE), encoding="utf-8")
    files = ["-o", str(folder / "bone.h"), "--report", str(folder / "report.json")]
    with redirect_stdout(StringIO()) as told, pytest.MonkeyPatch.context() as patched:
        patched.setattr(bonecam_meshes, "path", lambda name: {"phalanx": phalanx}[name])
        patched.setattr(pipeline, "morph_standing", lambda *_, **__: morphed[0])
        assert main(["demo", *files, "--job", str(job), "--no-simulation"]) == 0
    return folder, told.getvalue()


@pytest.mark.whole
def test_a_surface_that_misses_the_mesh_is_refused_before_the_levels(tmp_path, monkeypatch, phalanx):
    missed = Deviation(0.6, 0.1, 0.6, 0.5, np.array([1.0, 2.0, 3.0]))
    found: list[Fit] = []

    def missing_fit(*given, **named):
        found.append(replace(fit(*given, **named), deviation=missed, shortfall="raise surface.max"))
        return found[-1]

    monkeypatch.setattr(job_levels, "MOST_CHOICES", 1)  # with other rows it misses just so
    monkeypatch.setattr(part_surface, "fit", missing_fit)
    trouble = r"control points miss the mesh by 0\.60 mm near \(1\.00, 2\.00, 3\.00\): raise surface\.max"
    with pytest.raises(SurfaceError, match=trouble) as caught:
        bonecam.convert(phalanx, COARSE, program=tmp_path / "bone.h")
    assert f"{found[0].control_points} control points miss" in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_the_report_has_the_names_that_stay(chain):
    report = json.loads((chain[1] / "report.json").read_text(encoding="utf-8"))
    assert differences(report, Report) == []
    absent = {"parting", "feed", "second", "axes", "refused", "cutters", "added"}
    assert set(report) == set(Report.__annotations__) - absent
    machined = [level for level, _ in groupby(row["level"] for row in report["toolpath"])]
    assert machined == list(range(len(report["levels"]) - 2, -1, -1))


def test_what_was_expected_before_planning_comes_about_within_half(chain):
    report = chain[0].report
    expected = report["estimate"]
    pairs = (
        (expected["length_mm"], sum(row["length_mm"] for row in report["toolpath"])),
        (expected["blocks"], report["nc"]["blocks"]),
        (expected["machining_min"], report["nc"]["time_min"]),
    )
    for told, came in pairs:
        assert 1 / 1.5 < told / came < 1.5


def test_only_contacts_left_uncut_are_blocked(chain):
    for row in chain[0].report["toolpath"]:
        assert sum(row["blocked_by"].values()) <= row["uncut_reasons"].get("collision", 0)


def test_what_the_text_removes_is_told_and_shown(chain):
    result, folder = chain
    removal = result.report["removal"]
    assert removal["rapid_contact_mm3"] == 0
    assert removal["left"]["gouge_max_mm"] <= 0.01
    assert [row["index"] for row in removal["levels"]] == [path.level for path in result.paths]
    assert sum(row["removed_mm3"] for row in removal["levels"]) > 0.9 * (result.stock.volume - result.surface.volume)
    left = read_mesh(folder / "keep" / "left.ply")
    assert len(left.vertices) == len(result.removal.left.heights)


def test_what_bends_is_told_and_shown(chain):
    result, folder = chain
    found = result.report["mechanics"]
    error = found["error_kept_um"]
    assert 0 < error["median"] < error["p95"] < error["p99"]
    assert found["first_hz"] > 0
    assert [row["index"] for row in found["levels"]] == [path.level for path in result.paths]
    removed = [row["removed_mm3"] for row in result.report["removal"]["levels"]]
    cutting = [row for row, volume in zip(found["levels"], removed, strict=True) if volume]
    assert all(0 < row["force_mean_n"] < row["peak_p95_n"] <= row["peak_max_n"] for row in cutting)
    assert len(cutting) > 3
    assert all(row["peak_max_n"] == 0 for row in found["levels"] if row not in cutting), "of an idle level"
    shown = read_mesh(folder / "keep" / "error.ply")
    assert len(shown.vertices) == len(result.removal.mechanics.error.errors)
    assert f"error kept {error['median']:.1f} um, {error['p95']:.1f} at 95 %" in result.summary
    assert len(result.summary.splitlines()) <= MOST_LINES
    assert "times by author" in result.sheet


def test_a_rapid_into_the_stock_refuses_the_text(chain):
    result = chain[0]
    machine, dialect = read_machine(COARSE.nc.machine), job_dialect(COARSE.nc)
    lines = result.program.text.splitlines(keepends=True)
    # blocks of all five words whose feed is that of the block before
    cuts = [n for n, line in enumerate(lines) if re.search(r" L X.* C\S+$", line)]
    cut = cuts[len(cuts) // 4]
    planted = "".join([*lines[:cut], lines[cut].replace("\n", " FMAX\n"), *lines[cut + 1 :]])
    job = COARSE.with_values(holding={"length": result.report["post"]["length_mm"]})
    levels = result.levels.levels
    with pytest.raises(VerifyError, match=r"a rapid removes \d\.\d+ mm3") as caught:
        prove_removal(planted, machine, dialect, job, result.stock, levels)
    assert caught.value.evidence["line"] in range(cut, cut + 3)


def test_a_program_alone_is_simulated_from_its_kept_folder(chain):
    result, folder = chain
    report = simulation_report(bonecam.simulate(folder / "bone.h", folder / "keep", COARSE), COARSE)
    alone, within = report["removal"], result.report["removal"]
    assert alone["given"] == within["given"], "the mesh as given is kept to the bit"
    nc = result.report["nc"]
    assert report["nc"] == {name: nc[name] for name in nc if name.startswith("gouge_to_given")}
    assert report["nc"]["gouge_to_given_max_mm"] > 0.01
    assert alone["rapid_contact_mm3"] == 0
    assert alone["left"]["max_mm"] == pytest.approx(within["left"]["max_mm"], abs=0.002)
    one, other = (sum(row["removed_mm3"] for row in report["levels"]) for report in (alone, within))
    assert one == pytest.approx(other, rel=0.02)  # the kept stock is a mesh
    bent, told = report["mechanics"]["error_kept_um"], result.report["mechanics"]["error_kept_um"]
    assert bent["p95"] == pytest.approx(told["p95"], rel=0.02)


def test_a_part_that_bends_too_much_is_refused(chain):
    result, folder = chain
    assert result.report["mechanics"]["faults"]
    assert " BEYOND WHAT HOLDS" in comments_of(folder / "bone.h")
    found = result.removal.mechanics
    strict = replace(found, workpiece=replace(found.workpiece, limits=Job().mechanics))
    with pytest.raises(
        VerifyError, match=r"more than half of the yield strength .* would keep \d+\.\d um at \d+ MPa.*; or mechanics"
    ):
        check_removal_of_job(replace(result.removal, mechanics=strict), result.job)


def test_without_mechanics_the_figures_say_so(chain):
    _, folder = chain
    plain = bonecam.simulate(folder / "bone.h", folder / "keep", COARSE, mechanics=False)
    assert plain.mechanics is None
    assert "bending   force and bending were not asked" in simulation_text(simulation_report(plain, COARSE))


def test_a_material_that_says_not_how_stiff_it_is_is_refused_before_planning(tmp_path, phalanx, capsys):
    wax = tmp_path / "wax.toml"
    wax.write_text((FOLDER / "peek.toml").read_text().split("[stiffness]")[0])
    asked = [str(phalanx), "-o", str(tmp_path / "bone.h"), "--set", f"material.name={wax}", "-q"]
    assert main(["convert", *asked]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert re.search(r"wax\.toml'.* no table \[stiffness\].*--no-mechanics", lines[0])


@pytest.mark.parametrize(
    ("pattern", "new", "told"),
    [
        (r" B-[\d.]+ (?=C\S+ F900)", " B+45.000 ", "B goes to 45.000 deg, its limit is 30 deg"),
        (r"(?s) F900\n", " F99999\n", "a feed of 99999 mm/min"),
        (r"(TOOL 2 BALL RADIUS \S+ LENGTH )100", r"\g<1>99", "tool 2 has a length of 99 mm here, of 100 mm in the job"),
    ],
)
def test_a_text_that_the_control_would_run_otherwise_is_refused_by_simulate(chain, tmp_path, pattern, new, told):
    text = (chain[1] / "bone.h").read_text(encoding="utf-8")
    (tmp_path / "edited.h").write_text(re.sub(pattern, new, text), encoding="utf-8")
    with pytest.raises(VerifyError, match=re.escape(told)) as caught:
        bonecam.simulate(tmp_path / "edited.h", chain[1] / "keep", COARSE)
    assert re.match(rf".*edited\.h: line {caught.value.evidence['line']}: ", str(caught.value))


def test_what_cannot_be_simulated_is_one_line(chain, tmp_path, capsys):
    program, keep = str(chain[1] / "bone.h"), str(chain[1] / "keep")
    other = tmp_path / "other.h"
    text = Path(program).read_text(encoding="utf-8")
    other.write_text(re.sub(r"FROM Z -\d+", "FROM Z -5", text, count=1), encoding="utf-8")
    for arguments, told in (
        ([program, "--keep", str(tmp_path)], "give the folder that `convert"),
        ([program, "--keep", keep, "--machine", "linuxcnc-xyzbc"], "is of another control than LinuxCNC"),
        ([str(tmp_path / "none.h"), "--keep", keep], "cannot be read (No such file or directory)"),
        ([program, "--keep", keep, "--cell", "0.0005"], "give a cell of at least"),
        ([program, "--keep", keep, "--cell", "1000"], "give a cell of at most"),
        (
            [program, "--keep", keep, "--cell", "0.4", "--set", "path.fine_cutter=true", "--set", "fine.radius=0.5"],
            "rays 0.4 mm apart miss what a ball of 0.5 mm does: give a cell of at most 0.25 mm",
        ),
        ([program, "--keep", keep, "--controller", "linuxcnc"], "give its --controller"),
        ([str(other), "--keep", keep], "give the folder that `convert --keep` wrote beside the program"),
    ):
        same = ["material.name=paper", f"path.chord_tolerance={COARSE.path.chord_tolerance}"]
        assert main(["simulate", *arguments, *(word for value in same for word in ("--set", value))]) == 2
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1
        assert told in lines[0]


@pytest.mark.whole
def test_without_simulation_the_report_says_so(again):
    folder, told = again
    assert "skipped" in json.loads((folder / "report.json").read_text(encoding="utf-8"))["removal"]
    assert "removal   the removal of material was not simulated" in told
    assert "bending   force and bending are not known without a simulation of the removal" in told
    assert "; REMOVAL NOT SIMULATED\n" in (folder / "bone.h").read_text(encoding="utf-8")


def test_what_was_written_holds_its_limits(chain):
    report = chain[0].report
    assert report["nc"]["readback_tip_error_mm"] <= 0.002
    assert report["nc"]["gouge_max_mm"] <= 0.01
    assert report["levels_lower_bound"] <= len(report["levels"]) - 1 <= report["levels_lower_bound"] + 2
    for row in report["levels"][1:]:
        assert row["depth_max_mm"] <= row["limit_mm"] + 0.002
        assert row["self_intersections"] == 0


def test_the_program_moves_the_tool_where_the_path_says(chain):
    result, folder = chain
    text = (folder / "bone.h").read_text(encoding="utf-8")
    assert text == result.program.text
    assert text.startswith("0 BEGIN PGM BONE MM\n")
    assert "; PART PHALANX" in text.upper().replace(":", "")
    assert "; CHECKS PASSED: TEXT READ BACK, TIP WITHIN 0." in text
    simulated = f"REMOVAL SIMULATED IN CELLS OF {result.report['removal']['cell_mm']:g} MM BENDING KEEPS "
    kept = f"{result.report['mechanics']['error_kept_um']['p95']:.1f} UM IN 95 OF 100 PLACES"
    assert simulated + kept in comments_of(folder / "bone.h")
    motions = read_program(text, read_machine("mikron-ucp600"), read_dialect("heidenhain"))
    tips = np.vstack([path.tips for path in result.paths])
    from scipy.spatial import KDTree

    assert KDTree(motions.tips).query(tips)[0].max() <= 0.002


def test_keep_writes_levels_path_surface_and_pictures(chain):
    result, folder = chain
    count = len(result.levels.levels)
    names = {item.name for item in (folder / "keep").iterdir()} - {OWN_FILES}
    pictures = {f"{name}.png" for name in "levels coloured depths toolpath machine engagement stump axes".split()}
    assert (
        names
        == {f"level_{k:02d}.ply" for k in range(count)}
        | {"surface.tspline", "toolpath.csv", "toolpath.apt", "cones.csv", "left.ply", "given.ply", "axes.md"}
        | {"error.ply", "error.png"}
        | {"program.h", "view.gz", "job.toml", "report.json"}
        | pictures
    )
    with open(folder / "keep" / "toolpath.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(path.tips) for path in result.paths)
    assert {row["kind"] for row in rows} == {"cut", "link", "rapid"}
    assert all((folder / "keep" / name).read_bytes()[:4] == b"\x89PNG" for name in pictures)
    part = read_mesh(folder / "keep" / "level_00.ply")
    assert abs(part.volume / result.part.mesh.volume - 1) < 0.02


@pytest.mark.whole
def test_levels_alone_are_the_chain_s_and_take_the_place_of_its_levels_and_paths(chain, tmp_path, capsys, phalanx):
    result, folder = chain
    keep, job = tmp_path / "keep", tmp_path / "job.toml"
    shutil.copytree(folder / "keep", keep)
    job.write_text(write_job(COARSE), encoding="utf-8")
    assert (
        main(["levels", str(phalanx), "-o", str(keep), "--report", str(tmp_path / "levels.json"), "--job", str(job)])
        == 0
    )
    same = ["surface.tspline", *(f"level_{k:02d}.ply" for k in range(len(result.levels.levels)))]
    assert all((keep / name).read_bytes() == (folder / "keep" / name).read_bytes() for name in same)
    told = json.loads((tmp_path / "levels.json").read_text(encoding="utf-8"))
    assert told["levels"] == json.loads(json.dumps(result.report["levels"]))
    assert set(result.report) - set(told) == {"estimate", "toolpath", "uncut_mm2", "nc", "removal", "mechanics"}
    told = capsys.readouterr().out.splitlines()
    lines = [line.partition(" ")[0] for line in told if not line.startswith(" ")]
    assert lines == "verdict warning warning mesh surface stock post levels certified time".split()
    assert {item.name for item in keep.iterdir()} == {item.name for item in (folder / "keep").iterdir()} - {
        "axes.md",
        "axes.png",
        "cones.csv",
        "engagement.png",
        "error.ply",
        "error.png",
        "left.ply",
        "machine.png",
        "program.h",
        "stump.png",
        "toolpath.apt",
        "toolpath.csv",
        "toolpath.png",
    }


def test_levels_alone_need_no_room_in_a_machine(monkeypatch, phalanx):
    def reached(*_):
        raise Cancelled("at the fit")

    monkeypatch.setattr(job_levels, "fit_surface", reached)
    with pytest.raises(Cancelled, match="at the fit"):
        bonecam.morph_levels(phalanx, COARSE.with_values(holding={"length": 480.0}))


def test_the_transform_leads_from_the_file_to_the_part(chain, phalanx):
    part = chain[0].part
    moved = read_mesh(phalanx).move(part.transform)
    assert np.abs(moved.bounds - part.mesh.bounds).max() < 1e-9
    assert part.mesh.bounds[0, 2] > COARSE.holding.length


def test_a_second_run_writes_the_same_bytes_but_for_the_lines_of_the_simulation(chain, again):
    first, second = ((run / "bone.h").read_bytes().splitlines() for run in (chain[1], again[0]))
    assert len(first) == len(second)
    other = [n for n in range(len(first)) if first[n] != second[n]]
    assert b"REMOVAL SIMULATED IN CELLS OF " in first[other[0]]
    assert b"REMOVAL NOT SIMULATED" in second[other[0]]
    assert all(re.fullmatch(rb"\d+ ; -", second[n]) for n in other[1:])
    assert len(other) <= len(UNSIMULATED)


def test_progress_rises_to_its_end_and_false_cancels(phalanx):
    told: list[float] = []

    def stop(fraction, message):
        told.append(fraction)
        return fraction < 0.03

    with pytest.raises(Cancelled):
        bonecam.convert(phalanx, COARSE, progress=stop)
    assert told == sorted(told)
    assert len(told) > 2


@pytest.mark.parametrize(
    ("changes", "kind", "named"),
    [
        ({"stock": {"diameter": 4.0, "length": 40.0}}, StockError, "mm"),
        ({"stock": {"length": 37.0}}, StockError, "diameter"),
        ({"holding": {"length": 480.0}}, MachineError, "Z"),
        ({"nc": {"machine": "no-such-mill"}}, MachineError, "no-such-mill"),
        ({"nc": {"controller": "no-such-control"}}, MachineError, "no-such-control"),
        ({"mesh": {"units": "m"}}, UnitsError, "--units"),
    ],
)
def test_an_impossible_job_fails_at_once_and_leaves_no_program(tmp_path, changes, kind, named, phalanx):
    outputs = {"program": tmp_path / "out.h", "keep": tmp_path / "keep", "report": tmp_path / "report.json"}
    with pytest.raises(kind, match=named) as caught:
        bonecam.convert(phalanx, COARSE.with_values(**changes), **outputs)
    assert "\n" not in str(caught.value)
    reports = list(tmp_path.iterdir())
    assert {file.name for file in reports} <= {"report.json"}
    for file in reports:  # once the part was read the report tells of the refusal
        assert json.loads(file.read_text())["refused"]["message"] == str(caught.value)


def test_repair_troubles_name_the_file(tmp_path):
    flat = TriangleMesh(
        np.array([[0.0, 0, 0], [20, 0, 0], [20, 30, 0], [0, 30, 0]]), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    )
    write_mesh(flat, tmp_path / "flat.ply")
    with pytest.raises(MeshError, match=r"flat\.ply"):
        bonecam.convert(tmp_path / "flat.ply")


def test_a_result_is_shown_in_a_line(chain):
    result = chain[0]
    values = (result, result.program, result.surface, result.part, result.levels, *result.levels.levels, *result.paths)
    for value in values:
        assert len(repr(value)) < 200
        assert "\n" not in repr(value)
    assert f"{result.levels.cuts} cuts" in repr(result)


def test_a_mesh_in_memory_is_taken_as_its_file_is(chain, monkeypatch, phalanx):
    fitted: list[TSpline] = []

    def fitted_alone(surface, *_):
        fitted.append(surface)
        raise Cancelled("before the levels")

    monkeypatch.setattr(job_levels, "make_levels", fitted_alone)
    mesh = bonecam.mesh.read_mesh(phalanx)
    with pytest.raises(Cancelled, match="before the levels"):
        bonecam.morph_levels((mesh.vertices, mesh.faces), COARSE)
    assert np.array_equal(fitted[0].control_points, chain[0].surface.control_points)


def test_a_call_with_no_job_or_no_mesh_says_so(phalanx):
    with pytest.raises(TypeError, match=r"job 'fast\.toml': give a bonecam\.Job, such as bonecam\.read_job"):
        bonecam.convert(phalanx, "fast.toml")  # type: ignore[arg-type]
    with pytest.raises(MeshError, match="the mesh has no faces"):
        bonecam.convert(TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int32)))
    with pytest.raises(FileError, match="is no name of a file"):
        bonecam.convert("")
    with pytest.raises(TypeError, match="the mesh is of type dict: give"):
        bonecam.convert({})  # type: ignore[arg-type]


@pytest.mark.parametrize("outputs", [{"program": 3}, {"program": b"x.h"}, {"keep": 5}, {"report": [1]}])
def test_a_name_of_another_type_is_a_wrong_call(outputs, phalanx):
    with pytest.raises(TypeError, match="give the name of a file as text or a Path"):
        bonecam.convert(phalanx, COARSE, **outputs)


@pytest.mark.parametrize("outputs", [{"program": "x\0.h"}, {"keep": "\0"}, {"program": "\ud800.h"}])
def test_a_name_that_no_file_can_have_is_refused(outputs, phalanx):
    with pytest.raises(FileError, match="is no name that a file can have: choose another"):
        bonecam.convert(phalanx, COARSE, **outputs)
