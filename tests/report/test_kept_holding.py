"""A program is simulated on the neck, at the depths and with the cutters that were found for it, which its kept folder
tells.
"""

from dataclasses import replace

import pytest

from bonecam.errors import FileError
from bonecam.job import Job, write_job
from bonecam.report.kept import with_kept_cutters, with_kept_holding

OPEN = Job().with_values(holding={"diameter": 0.0}, levels={"finishing_levels": 2})
FOUND = OPEN.with_values(
    holding={
        "diameter": 6.0,
        "length": 118.0,
        "chuck_diameter": 28.0,
        "chuck_height": 100.0,
        "stub_diameter": 13.0,
        "stub_length": 15.0,
    }
)


def test_what_the_job_leaves_open_is_the_folders(tmp_path):
    (tmp_path / "job.toml").write_text(write_job(FOUND), encoding="utf-8")
    assert with_kept_holding(OPEN, tmp_path) == FOUND
    bar = OPEN.with_values(holding={"diameter": 5.0, "stub_length": 15.0})
    assert with_kept_holding(bar, tmp_path).holding == FOUND.holding
    stated = replace(FOUND, holding=replace(FOUND.holding, diameter=5.0))
    assert with_kept_holding(stated, tmp_path) is stated


def test_depths_that_were_found_are_the_folders(tmp_path):
    kept = FOUND.with_values(levels={"depths": "0.1 0.25 1", "scallop_share": 0.1})
    (tmp_path / "job.toml").write_text(write_job(kept), encoding="utf-8")
    assert with_kept_holding(Job(), tmp_path).levels == kept.levels
    asked = FOUND.with_values(levels={"depths": "found"})
    assert with_kept_holding(asked, tmp_path).levels == kept.levels
    assert with_kept_holding(OPEN, tmp_path).levels == OPEN.levels
    (tmp_path / "job.toml").unlink()
    with pytest.raises(FileError, match=r"levels.depths were found, and .*job.toml does not tell how"):
        with_kept_holding(asked, tmp_path)


def test_a_folder_that_does_not_tell_is_refused(tmp_path):
    with pytest.raises(FileError, match=r"\[holding\] was found, and .*job.toml does not tell how"):
        with_kept_holding(OPEN, tmp_path)


def test_cutters_that_were_chosen_are_the_folders(tmp_path):
    kept = Job().with_values(
        roughing={"preset": "ball-6"},
        finishing={"preset": "ball-4"},
        fine={"preset": "ball-2"},
        path={"fine_cutter": True},
    )
    assert with_kept_cutters(Job(), tmp_path) == Job()
    (tmp_path / "job.toml").write_text(write_job(kept), encoding="utf-8")
    assert with_kept_cutters(Job(), tmp_path) == kept
    own = Job().with_values(finishing={"radius": 1.5}, fine={"radius": 0.5})
    assert with_kept_cutters(own, tmp_path) == replace(own, roughing=kept.roughing)
    assert with_kept_cutters(own.with_values(roughing={"radius": 3.0}), tmp_path).roughing.radius == 3.0
