"""A batch consists of files, folders and tables, each part with its job; what is wrong is told before any work."""

from pathlib import Path

import pytest
from batch_orders import meshes

from bonecam.batch import BatchPart, batch_parts, convert_many
from bonecam.errors import JobError
from bonecam.job import Job


def written(folder: Path, text: str) -> Path:
    (folder / "parts.csv").write_text(text, encoding="utf-8")
    return folder / "parts.csv"


def test_a_table_gives_each_part_its_job_units_stock_and_name(tmp_path):
    meshes(tmp_path, p1="", p2="", bar="")
    (tmp_path / "jobs").mkdir()
    (tmp_path / "jobs" / "hard.toml").write_text('[material]\nname = "titanium"\n[mesh]\nunits = "inch"\n')
    table = written(
        tmp_path,
        "\ufefffile,job,Units,stock,output,stock.diameter,nc.coolant\n"
        "p1.stl,jobs/hard.toml,,cylinder,left,20,false\n\n"
        "p1.stl,,m,bar.stl,,,\n"
        "p2.stl\n",
    )
    first, second, third = batch_parts([table], Job().with_values(levels={"roughing_depth": 0.7}))
    assert (first.name, first.file, first.job_file) == (
        "left",
        tmp_path / "p1.stl",
        str(tmp_path / "jobs" / "hard.toml"),
    )
    assert (first.job.material.name, first.job.mesh.units) == ("titanium", "inch")
    assert (first.job.stock.kind, first.job.stock.diameter, first.job.nc.coolant) == ("cylinder", 20.0, False)
    assert (second.name, second.job.mesh.units) == ("p1", "m")
    assert (second.job.stock.kind, second.job.stock.mesh) == ("mesh", str(tmp_path / "bar.stl"))
    assert third.job == Job().with_values(levels={"roughing_depth": 0.7})
    assert {part.job.levels.roughing_depth for part in (first, second, third)} == {0.7}


def test_a_table_of_a_spreadsheet_may_have_semicolons(tmp_path):
    meshes(tmp_path, p1="")
    (part,) = batch_parts([written(tmp_path, 'file;stock\n"p1.stl";cylinder\n')], Job())
    assert (part.name, part.job.stock.kind) == ("p1", "cylinder")


def test_a_job_beside_a_part_is_its_own(tmp_path):
    files = meshes(tmp_path, patient_06="", patient_07="")
    beside = tmp_path / "patient_07.toml"
    beside.write_text('[nc]\nmachine = "mill.toml"\n', encoding="utf-8")
    for given in (files, [tmp_path]):
        plain, own = batch_parts(given, Job())
        assert (plain.job, plain.job_file) == (Job(), "")
        assert (own.job.nc.machine, own.job_file) == (str(tmp_path / "mill.toml"), str(beside))


def test_a_label_map_is_named_without_its_double_ending(tmp_path):
    (part,) = batch_parts([tmp_path / "hand.nii.gz"], Job())
    assert part.name == "hand"


def test_a_part_of_a_program_is_taken_as_it_is(tmp_path):
    part = BatchPart(tmp_path / "a.stl", "other", Job())
    assert batch_parts([part], Job().with_values(mesh={"units": "m"})) == [part]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("file\np1.stl\nnone.stl\n", r"parts\.csv: line 3: .*none\.stl is missing: give the file of a part$"),
        ("file,job\np1.stl,none.toml\n", r"line 2: .*none\.toml: No such file or directory"),
        ("file,job\np1.stl,bad.toml\n", r"line 2: .*bad\.toml: line 2: \[levels\] knows no 'depth'"),
        ("file,unit\np1.stl,m\n", r"column 'unit' is unknown: use file, .* \(did you mean 'units'\?\)$"),
        ("file,units\np1.stl,miles\n", r"line 2: \[mesh\] units = 'miles'"),
        ("file,stock.diameter\np1.stl,wide\n", r"line 2: \[stock\] diameter = 'wide': give a number"),
        ("file,stock.girth\np1.stl,3\n", r"line 2: \[stock\] knows no 'girth'"),
        ("file,output\np1.stl,../a\n", r"line 2: output '\.\./a' is no name"),
        ("file,output\np1.stl,a\np1.stl,a\n", r"would both write a: rename one, name its `output` in a table"),
        ("file,units\np1.stl,mm,x\n", r"line 2 has 3 cells and the header 2: quote"),
        ('file,units\n"p1.stl,mm\n', r"line 2: .*correct the quotes"),
        ("file\n", "no part given"),
        ("file,units\nnone.stl,mm\np1.stl,miles\n", r"line 2: .*none\.stl is missing.*; line 3: \[mesh\] units"),
    ],
)
def test_a_wrong_table_is_one_line_that_names_the_place(text, told, tmp_path):
    meshes(tmp_path, p1="")
    (tmp_path / "bad.toml").write_text("[levels]\ndepth = 3\n")
    with pytest.raises(JobError, match=told) as caught:
        batch_parts([written(tmp_path, text)], Job())
    assert "\n" not in str(caught.value)


def test_a_table_in_a_folder_is_not_taken_for_a_part(tmp_path):
    meshes(tmp_path, p1="")
    (tmp_path / "batch.csv").write_text("name,mesh\n")
    assert [part.name for part in batch_parts([tmp_path], Job())] == ["p1"]
    written(tmp_path, "file\np1.stl\n")
    with pytest.raises(JobError, match=r"parts\.csv in it is a table of parts: give the table itself"):
        batch_parts([tmp_path], Job())


def test_a_table_without_the_column_file_is_not_taken_for_points(tmp_path):
    with pytest.raises(JobError, match=r"parts\.csv: line 1: no column `file`"):
        batch_parts([written(tmp_path, "name,job\np1.stl,a.toml\n")], Job())
    cloud = tmp_path / "cloud.csv"
    cloud.write_text("1,2,3\n4,5,6\n")
    assert [part.name for part in batch_parts([cloud], Job())] == ["cloud"]


def test_one_name_is_one_part_and_not_its_letters(tmp_path):
    meshes(tmp_path, p1="")
    with pytest.raises(JobError, match=r"p1\.stl and .*p1\.stl would both write"):
        convert_many([tmp_path / "p1.stl"] * 2, tmp_path / "out")
    (outcome,) = convert_many(str(tmp_path / "p1.stl"), tmp_path / "out", jobs=1)
    assert outcome.name == "p1"


def test_an_executor_that_is_none_is_refused(tmp_path):
    with pytest.raises(TypeError, match="executor is a int: give an object whose submit"):
        convert_many(["p1.stl"], tmp_path / "out", executor=3)  # type: ignore[arg-type]
