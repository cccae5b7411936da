import pickle
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import JobError, LevelError
from bonecam.job import Job, read_job, write_job
from bonecam.job.parameter import record


def test_a_written_job_reads_back_equal(tmp_path: Path) -> None:
    job = Job().with_values(stock={"diameter": 15.0}, nc={"coolant": False, "controller": "linuxcnc"})
    file = tmp_path / "job.toml"
    file.write_text(write_job(job), encoding="utf-8")
    assert read_job(file) == job


def test_every_parameter_states_label_tooltip_and_a_default_within_its_range() -> None:
    for section in fields(Job):
        for item in fields(getattr(Job(), section.name)):
            known = record(item)
            assert known.label
            assert known.tooltip.endswith(".")
            assert not isinstance(item.default, float) or known.low <= item.default <= known.high


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[stock]\ndiameter = -1", "diameter"),
        ("[stock]\nbreadth = 1", "breadth"),
        ("[stok]\ndiameter = 1", "stok"),
        ('[stock]\ndiameter = "15"', "diameter"),
        ("diameter = 1", "diameter"),
        ("[stock", "correct the TOML"),
        ('[mesh]\nunits = "feet"', "units"),
        ("[nc]\ncoolant = 1", "coolant"),
        ("[stock]\ndiameter = nan", "diameter"),
        ("[finishing]\nradius = -1", r"\[finishing\] radius = -1"),
        ("[mesh]\nrows = 48.0", "give a whole number"),
        ("[stock]\ndiameter = " + "9" * 400, "give a number"),
        ("[stock]\ndiameter = " + "9" * 5000, "correct the TOML"),
        ("[[stock]]\ndiameter = 1", "stock"),
        ('[levels]\ndepths = "0.1 x"', r"\[levels\] depths"),
    ],
)
def test_a_wrong_job_file_is_refused_with_its_name_and_place(tmp_path: Path, text: str, named: str) -> None:
    file = tmp_path / "job.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(JobError, match=named) as caught:
        read_job(file)
    assert "job.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("given", "cuts"),
    [
        ([0.1, 0.3], ((0.1,), 0.3)),
        ((np.float64(0.2), 1), ((0.2,), 1.0)),
        (0.3, ((), 0.3)),
        ("0.1, 0.3", ((0.1,), 0.3)),
    ],
)
def test_depths_are_a_text_or_numbers(given: object, cuts: object) -> None:
    job = Job().with_values(levels={"depths": given})
    assert job.levels.cuts == cuts
    assert isinstance(job.levels.depths, str)


def test_depths_that_are_no_numbers_are_refused_with_an_example() -> None:
    for given in ([0.1, "x"], [[0.1]], True):
        with pytest.raises(JobError, match=r"\[levels\] depths = .*: give numbers like '0\.1 0\.1 0\.5'"):
            Job().with_values(levels={"depths": given})


def test_numbers_of_numpy_and_paths_are_taken_for_python_s() -> None:
    job = Job().with_values(
        stock={"diameter": np.float64(15), "length": np.int64(37), "mesh": Path("a.stl")},
        nc={"coolant": np.bool_(False)},
    )
    assert job == Job().with_values(
        stock={"diameter": 15.0, "length": 37.0, "mesh": "a.stl"}, nc={"coolant": False}
    )
    assert type(job.stock.diameter) is float
    assert write_job(job).count("diameter = 15.0") == 1


def test_a_section_that_is_no_table_is_refused() -> None:
    with pytest.raises(JobError, match=r"\[stock\] = 15: give its values by name"):
        Job().with_values(stock=15)  # type: ignore[arg-type]


def test_a_byte_order_mark_before_the_job_is_no_matter(tmp_path: Path) -> None:
    (tmp_path / "job.toml").write_bytes(b"\xef\xbb\xbf[stock]\ndiameter = 15\n")
    assert read_job(tmp_path / "job.toml").stock.diameter == 15.0


def test_a_missing_job_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(JobError, match=r"none\.toml"):
        read_job(tmp_path / "none.toml")


def test_errors_survive_the_way_between_processes() -> None:
    error = pickle.loads(pickle.dumps(LevelError("level 3 folds", level=3)))
    assert (type(error), str(error), error.evidence) == (LevelError, "level 3 folds", {"level": 3})
