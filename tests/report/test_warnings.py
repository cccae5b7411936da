"""Nothing important is quiet: each figure beyond its first limit is told with a remedy, beyond its second refused."""

import json
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest

import bonecam
from bonecam.cli import main
from bonecam.errors import JobError, LimitError
from bonecam.machine import read_machine
from bonecam.mesh import TriangleMesh, repair, write_mesh
from bonecam.mesh.triangle_mesh import keep_faces
from bonecam.report.warnings import (
    check_warnings,
    header_texts,
    holding_warnings,
    repair_warnings,
    spindle_warnings,
    warnings_of,
    with_warnings,
)
from bonecam.setup import Capsule

JOB = bonecam.Job()
LEFT = {"part_mm2": 710.0, "max_mm": 3.1, "areas_over_mm2": {"0.02": 276.0, "0.05": 200.0, "0.2": 20.0}}
NECK = {
    "diameter_mm": 10.0,
    "length_mm": 3.0,
    "shift_um": 60.0,
    "shift_p99_um": 90.0,
    "stress_mpa": 29.0,
    "first_hz": 1165.0,
    "um_per_n": 2.0,
    "left_mm2": 50.0,
}
GIVES_WAY = {
    "neck_stated": False,
    "necks": [{**NECK, "holds": False}, {**NECK, "diameter_mm": 8.0, "holds": False}],
    "neck_wanted": {"shift_um": 16.0, "stress_mpa": 83.3, "first_hz": 1000.0},
    "holds_with": [{"change": 'holding.tailstock = "pin"', **NECK, "shift_um": 15.0, "holds": True}],
}
CASES: dict[str, dict[str, Any]] = {
    "holding": {"post": GIVES_WAY},
    "left": {"removal": {"left": LEFT, "levels": []}},
    "hole": {"input": {"hole_max_mm": 7.3}},
    "guessed": {"input": {"guessed_share": 0.31}},
    "fit": {"surface": {"tolerance_reached": False, "deviation_max_mm": 0.6, "tolerance_mm": 0.08}},
    "slender": {"post": {"diameter_mm": 2.0, "length_mm": 200.0}},
}


def test_a_neck_that_would_yield_is_refused_though_its_error_may_be_kept():
    neck = {**NECK, "shift_p99_um": 20.0, "holds": False}
    for stress, refused in ((160.0, False), (170.0, True)):
        post = {**GIVES_WAY, "neck_stated": True, "necks": [{**neck, "stress_mpa": stress}]}
        warned = list(holding_warnings(post, JOB))
        assert any(one.refused for one in warned) == refused
        assert all("give holding.diameter = 0, which finds one" in one.remedy for one in warned), (
            "the job states this one"
        )


@pytest.mark.parametrize("code", CASES)
def test_each_figure_is_told_with_a_remedy_and_refused_beyond_its_second_limit(code):
    (warned,) = warnings_of(CASES[code], JOB)
    assert warned.code == code
    assert warned.remedy
    assert warned.figure is not None
    assert warned.limit is not None
    assert warned.figure > warned.limit
    with pytest.raises(LimitError, match=r"bone\.stl: .*\(allowed .*\): .*; or warnings.refuse = false"):
        check_warnings([warned], JOB, "bone.stl")
    told = JOB.with_values(warnings={"refuse": False})
    assert with_warnings(CASES[code], told)["warnings"] == [asdict(warned)]


def test_what_lies_below_the_first_limit_is_not_told():
    few = {**LEFT, "areas_over_mm2": {"0.02": 7.0}}
    report = {
        "removal": {"left": few, "levels": [{"index": 0, "over_limit_mm": 0.04}]},
        "input": {"hole_max_mm": 0.9, "guessed_share": 0.019},
    }
    assert warnings_of(report, JOB) == []


def test_a_cut_is_too_deep_beyond_the_scallops_that_the_path_before_it_left():
    job = JOB.with_values(levels={"depths": "0.1 1.5 1.5", "scallop_share": 0.1})
    deep = {"index": 1, "over_limit_mm": 0.19}
    assert warnings_of({"removal": {"levels": [deep]}}, job) == [], "level 2 leaves scallops of 0.15"
    for row in ({**deep, "over_limit_mm": 0.22}, {**deep, "index": 0}):
        (warned,) = warnings_of({"removal": {"levels": [row]}}, job)
        assert warned.code == "depth"


def test_a_neck_that_gives_way_is_told_with_what_would_hold_until_the_error_is_known():
    (warned,) = warnings_of(CASES["holding"], JOB)
    figures = "60.0 um of error at 95 % (16 at most), 90 at 99 %; 29 MPa at peaks (83 at most); 1165 Hz (1000 at least)"
    assert warned.text == f"no neck holds: foretold on that of 10 x 3 mm are {figures}"
    assert warned.remedy == 'holds with holding.tailstock = "pin": 15.0 um, 29 MPa, 1165 Hz'
    alone = {**GIVES_WAY, "necks": GIVES_WAY["necks"][:1]}
    assert warnings_of({"post": alone}, JOB) == [warned], "one that was found, where no other meets the part"

    def simulated(p95):
        bent = {"error_kept_um": {"p95": p95, "p99": 25.0}, "faults": [], "remedies": [], "band": [0.6, 1.9]}
        told = warnings_of(CASES["holding"] | {"mechanics": bent}, JOB)
        assert not any(one.refused for one in told), "the error is known: [mechanics] refuses it, or none does"
        return [one.code for one in told]

    bent = {"error_kept_um": {"p95": 19.0, "p99": 45.0}, "faults": [], "remedies": [], "band": [0.6, 1.9]}
    (bending,) = warnings_of(CASES["holding"] | {"mechanics": bent}, JOB)
    assert bending.code == "bending"
    assert bending.remedy == warned.remedy, "a thicker neck was tried"
    assert "holding" not in simulated(19.0)
    assert "holding" in simulated(21.0)
    assert not next(iter(warnings_of(CASES["holding"], JOB.with_values(mechanics={"refuse": False})))).refused


def test_what_a_scallop_leaves_is_not_left_uncut():
    coarse = JOB.with_values(finishing={"scallop": 0.1})
    assert warnings_of(CASES["left"], coarse) == [], "20 of 710 mm2 keep more than the next height, 0.2 mm"


def test_what_was_planned_to_stay_is_told_in_the_header_but_for_the_post():
    report = {"input": {"area_mm2": 100.0}, "uncut_mm2": {"post": 60.0, "collision": 20.0, "gouge": 1.0}}
    told = " ".join(header_texts(report, JOB))
    assert told == "warning: 21.0 of 100.0 mm2 of the part (21%) stay uncut (collision 20.0, gouge 1.0)"


def test_a_spindle_below_its_lowest_speed_is_told_and_refused_below_half_of_it():
    machine = read_machine("mikron-ucp600")
    slow = JOB.with_values(roughing={"spindle": 1500.0, "feed": 300.0}, finishing={"spindle": 400.0, "feed": 100.0})
    found = list(spindle_warnings(slow, replace(machine, spindle_lowest=1000.0)))
    assert [warned.text.split()[0] for warned in found] == ["[finishing]"]
    assert found[0].refused
    near = slow.with_values(finishing={"spindle": 900.0})
    (warned,) = spindle_warnings(near, replace(machine, spindle_lowest=1000.0))
    assert not warned.refused


def test_a_second_limit_below_the_first_is_refused():
    with pytest.raises(JobError, match=r"\[warnings\] hole_refused = 0.5: give at least hole \(1\)"):
        bonecam.Job(warnings={"hole": 1.0, "hole_refused": 0.5})


def test_a_wide_hole_is_refused_in_one_line_before_the_fit(tmp_path, capsys):
    mesh = Capsule(np.array([0.0, 0, 10]), np.array([0.0, 0, 30]), 8.0).mesh(0.05)
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    open_mesh = keep_faces(mesh, np.linalg.norm(middles - [8.0, 0.0, 20.0], axis=1) > 3.5)
    write_mesh(TriangleMesh(open_mesh.vertices, open_mesh.faces), tmp_path / "hole.stl")
    assert main(["levels", str(tmp_path / "hole.stl"), "-o", str(tmp_path / "out")]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "hole.stl: a hole of the mesh" in line
    assert "closed flat" in line


def test_a_wide_face_that_is_missing_alone_is_put_back_without_a_warning():
    whole = Capsule(np.array([0.0, 0, 10]), np.array([0.0, 0, 30]), 8.0).mesh(1.0)
    areas = np.linalg.norm(whole.face_vectors, axis=1)
    for missing, told in ((1, False), (2, True)):
        beside = np.isin(whole.faces, whole.faces[areas.argmax()]).sum(axis=1)
        removed = np.argsort(-beside, kind="stable")[:missing]
        mesh, repairs = repair(keep_faces(whole, ~np.isin(np.arange(len(whole.faces)), removed)))
        width = max(change.hole for change in repairs)
        assert mesh.volume == pytest.approx(whole.volume, rel=0.05)
        assert bool(list(repair_warnings(width, 0.0, bonecam.Job()))) is told


def test_warnings_stand_first_in_report_page_and_sheet_and_below_the_verdict(small_run):
    made, folder = small_run
    assert next(iter(made.report)) == "warnings"
    kept = json.loads((folder / "keep" / "report.json").read_text(encoding="utf-8"))["warnings"]
    assert kept == made.report["warnings"]
    assert {warned["code"] for warned in kept} == {"bending", "slender"}
    told = made.summary.splitlines()
    assert told[0].startswith("verdict   bone.h is proven from its text and simulated; 2 warnings")
    assert told[1].startswith("warning   ")
    assert "; WARNING: THE POST IS SLENDER: 3 X 54 MM" in made.program.text
    for warned in kept:
        assert warned["text"][1:] in made.sheet
