"""Programs are named for their controller, and never as a file of another kind; APT files hold the tool path.

What is kept of a run whose program its own proof refuses.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bonecam
from bonecam import pipeline
from bonecam.errors import Cancelled, FileError, JobError, LevelError, LimitError, ToolPathError, VerifyError, knowing
from bonecam.machine import read_machine
from bonecam.nc import read_dialect, read_program, write_program
from bonecam.nc.parts import check_apart, joined
from bonecam.nc.requirements import job_dialect
from bonecam.report import read_apt
from bonecam.report.outputs import (
    FAULT,
    Outputs,
    check_ending,
    code_of,
    keep_refused,
    refused_figures,
    refusing,
    report_refused,
)
from bonecam.runtime.own_files import OWN_FILES
from bonecam.runtime.timing import StageTimes
from bonecam.verify import Tolerances
from bonecam.verify.readback import compare_moves


@pytest.mark.parametrize(
    ("controller", "name", "told"),
    [
        ("heidenhain", "a.ngc", "name it a.h"),
        ("heidenhain", "a.gcode", "name it a.h"),
        ("linuxcnc", "a.H", "name it a.ngc"),
        ("siemens-840d", "a.h", "name it a.mpf"),
        ("fanuc-30i", "a.mpf", "name it a.nc"),
        ("heidenhain", "bone.stl", r"name it bone\.h"),
        *(
            ("heidenhain", name, rf"has no ending, heidenhain programs end in \.h: name it {proposed}$")
            for name, proposed in (("p", "p.h"), ("out/p.", "p.h"), (".h", "h.h"), ("-", "-.h"))
        ),
    ],
)
def test_a_program_of_another_ending_is_refused_with_the_name_that_fits(controller, name, told):
    with pytest.raises(FileError, match=told):
        check_ending(Path(name), read_dialect(controller))


def test_parts_of_both_clampings_do_not_share_a_file():
    first, second = ({Path(name): "" for name in names.split()} for names in ("a.nc O0078.nc", "b.nc O0078.nc"))
    with pytest.raises(FileError, match=r"O0078\.nc: both clampings have a part of this name: give another"):
        check_apart(first, second)
    check_apart(first, {Path("b.nc"): ""})


@pytest.mark.parametrize("name", ["a.h", "a.H", "a.nc", "a.i"])
def test_a_control_s_own_endings_are_free(name):
    check_ending(Path(name), read_dialect("heidenhain"))


def test_the_apt_file_has_every_move_of_the_tool_paths(small_run):
    made, folder = small_run
    read = read_apt((folder / "bone.apt").read_text(encoding="utf-8"))
    assert read.name == made.program.name
    for name in ("tips", "axes"):
        found = np.vstack([getattr(path, name) for path in read.paths])
        assert np.abs(found - np.vstack([getattr(path, name) for path in made.paths])).max() < 1e-6


@pytest.mark.parametrize("name", ["a.h", "a", "a.stl"])
def test_an_apt_file_with_another_ending_is_refused(name):
    with pytest.raises(FileError, match=rf"name it {name}\.apt"):
        Outputs(apt=name).check()


def test_a_split_program_is_written_as_caller_and_parts_that_join_to_what_was_proved(small_run, tmp_path):
    made, _ = small_run
    job = made.job.with_values(nc={"split": "level"})
    machine, dialect = read_machine(job.nc.machine), job_dialect(job.nc)
    program = write_program(made.paths, machine, dialect, job, name="BONE")
    place = tmp_path / f"bone{program.extension}"
    Outputs(program=place).write(replace(made, program=program, job=job, second=None))
    assert len(list(tmp_path.iterdir())) == len(made.paths) + 1
    whole = joined(place, dialect).text
    assert whole == program.text
    compare_moves(read_program(whole, machine, dialect), made.paths, dialect, Tolerances())


def refuse(result: bonecam.Result, folder: Path | None) -> VerifyError:
    """The error of a run whose program is refused at a place on its side."""
    with (
        pytest.raises(VerifyError) as caught,
        keep_refused(result, folder, StageTimes()),
        refusing(result.program, result.paths),
    ):
        raise VerifyError("line 7: too deep: go slower", line=7, place=(2.5, 0.0, 65.0), error=0.02)
    return caught.value


def test_a_refusal_of_a_program_of_ours_is_kept_with_program_place_and_picture(small_run, tmp_path):
    result, _ = small_run
    error = refuse(result, tmp_path / "keep")
    assert str(error).startswith("line 7: too deep: go slower (")
    assert FAULT in str(error)
    assert str(tmp_path / "keep") in str(error)
    assert error.evidence["line"] == 7
    names = {item.name for item in (tmp_path / "keep").iterdir()} - {OWN_FILES}
    levels = {f"level_{level.index:02d}.ply" for level in result.levels.levels}
    pictures = {"levels.png", "coloured.png", "depths.png", "refused.png"}
    texts = {"refused.txt", "report.json", "job.toml", "given.ply", "surface.tspline", "program.h", "toolpath.csv"}
    assert names == levels | pictures | texts
    assert (tmp_path / "keep" / "program.h").read_text() == result.program.text
    assert (tmp_path / "keep" / "refused.txt").read_text() == "line 7: too deep: go slower\n"
    assert bonecam.read_job(tmp_path / "keep" / "job.toml") == result.job
    report = json.loads((tmp_path / "keep" / "report.json").read_text())
    assert report["refused"]["message"] == "line 7: too deep: go slower"
    assert report["levels"] == result.report["levels"]


def test_without_a_folder_the_refusal_tells_how_to_get_one(small_run):
    assert "--keep DIR" in str(refuse(small_run[0], None))


def test_a_folder_that_cannot_be_written_does_not_hide_the_refusal(small_run, tmp_path):
    (tmp_path / "file").touch()
    error = refuse(small_run[0], tmp_path / "file")
    assert str(error).startswith("line 7: too deep")
    assert "nothing could be kept" in str(error)


def test_other_errors_pass(small_run, tmp_path):
    with pytest.raises(LevelError, match=r"^no level$"), keep_refused(small_run[0], tmp_path / "keep", StageTimes()):
        raise LevelError("no level")
    assert not list(tmp_path.iterdir())


def test_convert_keeps_what_its_simulation_refuses(small_run, tmp_path, monkeypatch):
    result, _ = small_run

    def refuse(*_, **__):
        raise VerifyError("line 9: a cut is too deep: report it", line=9, place=(2.5, 0.0, 65.0))

    for stage in ("with_second", "morph_standing", "machine_levels"):
        monkeypatch.setattr(pipeline, stage, lambda *_, **__: result)
    monkeypatch.setattr(pipeline, "prove_removal", refuse)
    with pytest.raises(VerifyError, match="a fault of bonecam"):
        bonecam.convert(
            result.part.placed_given,
            result.job,
            program=tmp_path / "bone.h",
            keep=tmp_path / "keep",
            report=tmp_path / "bone.json",
        )
    assert not (tmp_path / "bone.h").exists()
    assert (tmp_path / "keep" / "program.h").read_text() == result.program.text
    assert (tmp_path / "keep" / "refused.png").is_file()
    written, kept = (json.loads(file.read_text()) for file in (tmp_path / "bone.json", tmp_path / "keep/report.json"))
    assert (
        written["refused"]
        == kept["refused"]
        == {
            "code": "verify",
            "stage": "simulation",
            "message": "line 9: a cut is too deep: report it",
            "remedy": "report it",
            "place": [2.5, 0.0, 65.0],
            "line": 9,
        }
    )
    assert written["nc"] == result.report["nc"]


def refuse_in(stage: str, error: Exception, report: Path | None) -> None:
    """A run that ends with an error in one of its stages, and knows the section `input`."""
    with report_refused(report) as times:
        with times.stage("mesh"):
            pass
        with times.stage(stage), knowing({"input": {"faces": 12}}):
            raise error


def test_a_refused_run_reports_how_far_it_came(tmp_path):
    error = LevelError("level 3: too thin: a thicker stock", level=3, place=np.array([0.0, 1.0, 2.0]))
    with pytest.raises(LevelError) as caught:
        refuse_in("levels", error, tmp_path / "r.json")
    report = json.loads((tmp_path / "r.json").read_text())
    assert (
        report["refused"]
        == caught.value.evidence["refused"]
        == {
            "code": "level",
            "stage": "levels",
            "message": "level 3: too thin: a thicker stock",
            "remedy": "a thicker stock",
            "place": [0.0, 1.0, 2.0],
            "level": 3,
        }
    )
    assert report["input"] == {"faces": 12}
    assert list(report["seconds"]) == ["mesh"]


def test_a_run_that_is_stopped_or_breaks_reports_nothing(tmp_path):
    for error in (Cancelled("stopped"), ZeroDivisionError("a bug")):
        with pytest.raises(type(error)):
            refuse_in("levels", error, tmp_path / "r.json")
    assert not list(tmp_path.iterdir())


def test_a_report_that_cannot_be_written_does_not_hide_the_refusal(tmp_path):
    (tmp_path / "r.json").mkdir()
    with pytest.raises(JobError, match=r"^a = 1: give 2 \(.*r\.json: is a folder"):
        refuse_in("mesh", JobError("a = 1: give 2"), tmp_path / "r.json")
    assert not list((tmp_path / "r.json").iterdir())


def test_a_limit_is_refused_by_the_code_of_its_warning_with_the_warning_s_remedy():
    error = LimitError("20 mm (allowed 5): mend it: now; or say so", code="hole", remedy="mend it: now")
    figures = refused_figures(error, "mesh")
    assert (figures["code"], figures["remedy"]) == ("hole", "mend it: now")
    assert code_of(ToolPathError("")) == "tool_path"


def test_sections_of_a_part_of_the_report_stay_apart():
    with pytest.raises(JobError) as caught, knowing({"nc": 1}, part="second"), knowing({"nc": 2}):
        raise JobError("")
    assert caught.value.evidence["report"] == {"nc": 1, "second": {"nc": 2}}
