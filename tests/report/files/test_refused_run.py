"""What is kept of a run whose program its own proof refuses."""

from pathlib import Path

import pytest

import bonecam
from bonecam import pipeline
from bonecam.errors import LevelError, VerifyError
from bonecam.report.files.refused_run import FAULT, keep_refused, refusing
from bonecam.runtime.own_files import OWN_FILES

Run = tuple[bonecam.Result, Path]


def refuse(result: bonecam.Result, folder: Path | None) -> VerifyError:
    """The error of a run whose program is refused at a place on its side."""
    with (
        pytest.raises(VerifyError) as caught,
        keep_refused(result, folder),
        refusing(result.program, result.paths),
    ):
        raise VerifyError("line 7: too deep: go slower", line=7, place=(2.5, 0.0, 65.0), error=0.02)
    return caught.value


def test_a_refusal_of_a_program_of_ours_is_kept_with_program_place_and_picture(
    small_run: Run, tmp_path: Path
) -> None:
    result, _ = small_run
    error = refuse(result, tmp_path / "keep")
    assert str(error).startswith("line 7: too deep: go slower (")
    assert FAULT in str(error)
    assert str(tmp_path / "keep") in str(error)
    assert error.evidence["line"] == 7
    names = {item.name for item in (tmp_path / "keep").iterdir()} - {OWN_FILES}
    levels = {f"level_{level.index:02d}.ply" for level in result.levels.levels}
    pictures = {"levels.png", "coloured.png", "depths.png", "refused.png"}
    texts = {"refused.txt", "job.toml", "given.ply", "surface.tspline", "program.h", "toolpath.csv"}
    assert names == levels | pictures | texts
    assert (tmp_path / "keep" / "program.h").read_text() == result.program.text
    assert (tmp_path / "keep" / "refused.txt").read_text() == "line 7: too deep: go slower\n"
    assert bonecam.read_job(tmp_path / "keep" / "job.toml") == result.job


def test_without_a_folder_the_refusal_tells_how_to_get_one(small_run: Run) -> None:
    assert "--keep DIR" in str(refuse(small_run[0], None))


def test_a_folder_that_cannot_be_written_does_not_hide_the_refusal(small_run: Run, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    error = refuse(small_run[0], tmp_path / "file")
    assert str(error).startswith("line 7: too deep")
    assert "nothing could be kept" in str(error)


def test_other_errors_pass(small_run: Run, tmp_path: Path) -> None:
    with pytest.raises(LevelError, match=r"^no level$"), keep_refused(small_run[0], tmp_path / "keep"):
        raise LevelError("no level")
    assert not list(tmp_path.iterdir())


def test_convert_keeps_what_its_simulation_refuses(
    small_run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result, _ = small_run

    def refuse(*_: object, **__: object) -> None:
        raise VerifyError("line 9: a cut is too deep: report it", line=9, place=(2.5, 0.0, 65.0))

    for stage in ("morph_part", "machine_levels"):
        monkeypatch.setattr(pipeline, stage, lambda *_: result)
    monkeypatch.setattr(pipeline, "prove_removal", refuse)
    with pytest.raises(VerifyError, match="a fault of bonecam"):
        bonecam.convert(
            result.part.placed_given, result.job, program=tmp_path / "bone.h", keep=tmp_path / "keep"
        )
    assert not (tmp_path / "bone.h").exists()
    assert (tmp_path / "keep" / "program.h").read_text() == result.program.text
    assert (tmp_path / "keep" / "refused.png").is_file()
