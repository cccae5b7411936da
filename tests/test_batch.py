import csv
from pathlib import Path

import pytest

from bonecam.batch import Outcome, convert_many
from bonecam.errors import JobError
from bonecam.job import Job


def bad_meshes(folder: Path, count: int) -> list[Path]:
    files = [folder / f"bad{k}.stl" for k in range(count)]
    for file in files:
        file.write_text("no mesh at all", encoding="utf-8")
    return files


def test_bad_meshes_fail_one_by_one_and_the_table_names_each(tmp_path: Path) -> None:
    told: list[Outcome] = []
    outcomes = convert_many(bad_meshes(tmp_path, 2), tmp_path / "out", Job(), jobs=2, told=lambda outcome, left: told.append(outcome))
    assert [outcome.state for outcome in outcomes] == ["failed", "failed"]
    assert all(Path(outcome.mesh).name in outcome.message for outcome in outcomes)
    with open(tmp_path / "out" / "batch.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["state"] for row in rows] == ["failed", "failed"]
    assert {outcome.mesh for outcome in told} == {row["mesh"] for row in rows}
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["batch.csv"]


def test_two_meshes_of_one_name_are_refused_before_anything_runs(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="bone"):
        convert_many([tmp_path / "a" / "bone.stl", tmp_path / "b" / "bone.ply"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("jobs", [0, -3])
def test_no_process_at_all_is_refused(tmp_path: Path, jobs: int) -> None:
    with pytest.raises(JobError, match="jobs"):
        convert_many([tmp_path / "bone.stl"], tmp_path / "out", jobs=jobs)
