import math
import pickle
import re
from dataclasses import fields
from inspect import signature
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bonecam.errors import JobError, LevelError
from bonecam.job import Job, read_job, write_job, write_short_job
from bonecam.job.files.job_file import OFTEN, PATHS, from_anywhere, named_files
from bonecam.job.materials.preset import read_material
from bonecam.job.parameter import record


@pytest.mark.parametrize("text_of", [write_job, write_short_job])
def test_a_written_job_reads_back_equal(tmp_path, text_of):
    file = tmp_path / "job.toml"
    for values in (
        {},
        {"stock": {"diameter": 15.0, "offset_x": 1.0}, "nc": {"coolant": False, "controller": "linuxcnc"}},
        {"finishing": {"radius": 1.5, "neck_diameter": 1.9, "neck_length": 11.0}, "roughing": {"feed": 500.0}},
        {"roughing": {"preset": "ball-4", "number": 7}, "fine": {"scallop": 0.05}, "levels": {"finishing_levels": 4}},
    ):
        job = Job().with_values(**values)
        file.write_text(text_of(job), encoding="utf-8")
        assert read_job(file) == job


def test_a_short_job_has_what_is_set_often_and_what_was_set():
    job = Job().with_values(stock={"offset_x": 1.0})
    added = set(write_short_job(job).splitlines()) - set(write_short_job(Job()).splitlines())
    assert [line.partition(" #")[0].strip() for line in added] == ["offset_x = 1.0"]
    for name, often in OFTEN.items():
        assert set(often.split()) <= vars(getattr(job, name)).keys()


TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))


@pytest.mark.whole
@settings(max_examples=1000, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    mesh=TEXT | st.sampled_from(["C:\\bones\\new", 'the "left" one.stl', "a'b#c=d", "\r\n\t\x7f\u2028", '"""']),
    diameter=st.floats(0.0, 500.0),
    control_points=st.integers(40, 20000),
    coolant=st.booleans(),
)
def test_any_value_of_a_written_job_reads_back_equal(tmp_path, mesh, diameter, control_points, coolant):
    job = Job().with_values(
        stock={"mesh": mesh, "diameter": diameter},
        surface={"max_control_points": control_points},
        nc={"coolant": coolant, "machine": mesh},
    )
    file = tmp_path / "job.toml"
    file.write_text(write_job(job), encoding="utf-8")
    assert read_job(file) == from_anywhere(job)


def test_a_name_of_a_file_that_is_no_unicode_is_refused():
    with pytest.raises(JobError, match=r"\[stock\] mesh = '.*udcff.stl': rename the file"):
        write_job(Job().with_values(stock={"mesh": "\udcff.stl"}))
    with pytest.raises(JobError, match=r"\[stock\] mesh = 'a\\x00b': leave the zero character out"):
        Job().with_values(stock={"mesh": "a\0b"})


def test_all_faults_of_a_job_file_are_told_with_their_lines(tmp_path):
    file = tmp_path / "job.toml"
    file.write_text(
        "colour = 1\n[stock]\ndiameter = -1\nbreadth = 2\n\n[nc]\ncoolant = 1\n[nocs]\nx = 1\n"
        '[levels]\ndepths = "0.1 x"\n[finishing]\nfeed = inf\n'
    )
    with pytest.raises(JobError) as caught:
        read_job(file)
    place, *told = str(caught.value).removeprefix(f"{file}: ").split("; ")
    assert place == "line 1: 'colour' stands outside a section: put it below one like [path]"
    assert [text.split(":")[0] for text in told] == [f"line {n}" for n in (3, 4, 7, 8, 11, 13)]
    assert "line 3: [stock] diameter = -1.0: keep it within 0 .. 500 mm" in told
    assert "line 7: [nc] coolant = 1: give true or false" in told
    assert len(caught.value.evidence["faults"]) == 7


def test_a_section_may_be_given_as_a_table_to_a_job():
    made = Job(stock={"diameter": 15.0}, finishing={"feed": 800})  # type: ignore[arg-type]
    assert made == Job().with_values(stock={"diameter": 15.0}, finishing={"feed": 800})
    for wrong in ({"diameter": -1.0}, {"breadth": 1.0}, 15.0, Job().nc, None):
        with pytest.raises(JobError, match=r"^\[stock\] .*: (keep it|use one|give its values)"):
            Job(stock=wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"stock": 15}, r"\[stock\] = 15: give its values by name"),
        *(
            ({"levels": {"depths": depths}}, r"\[levels\] depths = .*: give numbers like '0\.1 0\.1 0\.5'")
            for depths in ([0.1, "x"], [[0.1]], True)
        ),
        ({"stck": {}}, r"\[stck\] is no section of a job \(did you mean 'stock'\?\): use one of mesh, "),
        ({"stock": {"kind": "cylindr"}}, r"kind = 'cylindr' \(did you mean 'cylinder'\?\): choose one of capsule, "),
        ({"nc": {"controller": 5}}, r"\[nc\] controller = 5: give a text$"),
        (
            {"levels": {"depths": "a b", "most_cuts": 0}, "roughing": {"holder": "a", "feed": -1.0}},
            r"\[levels\] depths = 'a b': give numbers like '0.1 0.1 0.5', or 'found'; "
            r"\[levels\] most_cuts = 0: keep .*; "
            r"\[roughing\] holder = 'a': 'a' is no number: give rows like '35 10 17, 20 40'; \[roughing\] feed = ",
        ),
    ],
)
def test_what_is_wrong_in_a_job_is_told_at_once_with_the_word_that_was_meant(wrong, told):
    for make in (Job, Job().with_values):
        with pytest.raises(JobError, match=told):
            make(**wrong)  # type: ignore[arg-type]
    assert next(iter(signature(Job).parameters)) == "mesh"


def test_a_job_file_that_is_no_sane_text_is_refused(tmp_path):
    file = tmp_path / "job.toml"
    for text in ("a = " + "[\n" * 10_000, "[stock]\nlength = " + "9" * 30, "a = '" + "x" * 20_000, "\n" * 200_000):
        file.write_text(text)
        with pytest.raises(JobError, match=r"job\.toml: .*correct the TOML there") as caught:
            read_job(file)
        assert len(str(caught.value)) < 300


def test_every_parameter_states_label_tooltip_and_a_default_within_its_range():
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
def test_a_wrong_job_file_is_refused_with_its_name_and_place(tmp_path, text, named):
    file = tmp_path / "job.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(JobError, match=named) as caught:
        read_job(file)
    assert "job.toml" in str(caught.value)


@pytest.mark.parametrize(
    ("given", "cuts"),
    [([0.1, 0.3], ((0.1,), 0.3)), ((np.float64(0.2), 1), ((0.2,), 1.0)), (0.3, ((), 0.3)), ("0.1, 0.3", ((0.1,), 0.3))],
)
def test_depths_are_a_text_or_numbers(given, cuts):
    job = Job().with_values(levels={"depths": given})
    assert job.levels.cuts == cuts
    assert isinstance(job.levels.depths, str)


def test_what_a_finishing_cut_takes_off_may_be_rougher_than_the_part():
    job = Job().with_values(levels={"depths": "0.1, 0.1, 0.5"}, finishing={"scallop": 0.01}, roughing={"scallop": 0.05})
    assert [job.scallop(level) for level in range(4)] == pytest.approx([0.01, 0.02, 0.02, 0.05])
    smooth = job.with_values(finishing={"scallop": 0.04}, roughing={"scallop": 0.02})
    assert [smooth.scallop(level) for level in range(4)] == pytest.approx([0.04, 0.04, 0.02, 0.02])


def test_a_roughing_level_leaves_scallops_that_fit_the_cut_that_takes_them():
    job = Job(levels={"depths": "0.1 0.25 1", "scallop_share": 0.2}, roughing={"scallop": 0.04})
    assert [job.scallop(level) for level in range(5)] == pytest.approx([0.01, 0.02, 0.05, 0.2, 0.2])
    assert Job(levels={"depths": "0.1 0.25 1"}).scallop(3) == 0.05


def test_depths_to_be_found_count_as_the_numbers_until_they_are():
    job = Job(levels={"depths": "found", "roughing_depth": 0.4})
    assert job.levels.found
    assert job.levels.cuts == ((0.1,) * 4, 0.4)
    assert not job.is_finishing(4)
    with pytest.raises(JobError, match="fewest"):
        Job(levels={"depths": "found", "schedule": "fewest"})
    with pytest.raises(JobError, match=r"finishing_levels = 3: .* leave one of them out"):
        Job(levels={"depths": "found", "finishing_levels": 3})


def test_cuts_that_follow_no_level_are_no_deeper_than_the_roughing_depth():
    deep, shallow = Job(levels={"depths": "0.1 1"}), Job(levels={"depths": "0.1 0.3"})
    assert (deep.levels.layer_depth, shallow.levels.layer_depth) == (0.5, 0.3)


def test_numbers_of_numpy_and_paths_are_taken_for_python_s():
    job = Job().with_values(
        stock={"diameter": np.float64(15), "length": np.int64(37), "mesh": Path("a.stl")},
        nc={"coolant": np.bool_(False)},
    )
    assert job == Job().with_values(stock={"diameter": 15.0, "length": 37.0, "mesh": "a.stl"}, nc={"coolant": False})
    assert type(job.stock.diameter) is float
    assert write_job(job).count("diameter = 15.0") == 1


def test_a_byte_order_mark_before_the_job_is_no_matter(tmp_path):
    (tmp_path / "job.toml").write_bytes(b"\xef\xbb\xbf[stock]\ndiameter = 15\n")
    assert read_job(tmp_path / "job.toml").stock.diameter == 15.0


def test_the_paper_s_figures_are_a_job_of_that_name_and_user_s_jobs_have_names_too(tmp_path, monkeypatch):
    job = read_job("paper")
    depths = job.levels.finishing_depth, job.levels.finishing_levels, job.levels.roughing_depth
    cutters = [(tool.radius, tool.scallop) for tool in (job.roughing, job.finishing)]
    material = read_material(job.material.name)
    assert (job.stock.diameter, job.stock.length, depths) == (15.0, 37.0, (0.1, 4, 0.5))
    assert (cutters, material.spindle, material.feed) == ([(2.0, 0.05), (1.0, 0.01)], 4500.0, 900.0)
    monkeypatch.setenv("BONECAM_HOME", str(tmp_path))
    (tmp_path / "jobs").mkdir()
    (tmp_path / "jobs" / "ours.toml").write_text("[stock]\ndiameter = 14.0\n")
    assert read_job("ours").stock.diameter == 14.0
    with pytest.raises(JobError, match=r"^papr: .*names paper-coarse, paper, ours$"):
        read_job("papr")


def test_errors_survive_the_way_between_processes():
    error = pickle.loads(pickle.dumps(LevelError("level 3 folds", level=3)))
    assert (type(error), str(error), error.evidence) == (LevelError, "level 3 folds", {"level": 3})


HOSTILE = (np.array(1.0), np.array([[1.0]]), object(), {}, b"x", 1j, np.nan, 10**400, -1, "\0", "\ud800", None)


def refusal(section: str, name: str, value: object) -> str:
    """How a value of a parameter is refused; empty where it is taken."""
    try:
        Job().with_values(**{section: {name: value}})
    except JobError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("section", [item.name for item in fields(Job)])
def test_every_parameter_takes_or_refuses_a_hostile_value_in_one_line(section):
    for item in fields(getattr(Job(), section)):
        told = [refusal(section, item.name, value) for value in HOSTILE]
        assert all(not text or text.startswith(f"[{section}] ") for text in told), told
        assert not any("\n" in text for text in told), told


@pytest.mark.parametrize(
    ("path", "told"),
    [
        pytest.param(
            {"strategy": "rotary", "pattern": "spiral"},
            r"pattern = 'spiral': strategy = 'rotary' has passes",
            marks=pytest.mark.plugged,
        ),
        pytest.param(
            {"strategy": "iso-height", "fine_cutter": True},
            "fine_cutter = True: strategy = 'iso-height' has",
            marks=pytest.mark.plugged,
        ),
        ({"certify": "fcl", "orientation": "lead"}, "certify = 'fcl': orientation = 'lead' makes no cones"),
    ],
)
def test_what_a_strategy_does_not_heed_is_refused(path, told):
    with pytest.raises(JobError, match=rf"\[path\] {told}"):
        Job().with_values(path=path)


def test_paths_of_a_job_file_count_from_it_and_names_stay_names(tmp_path, monkeypatch):
    (tmp_path / "jobs").mkdir()
    file = tmp_path / "jobs" / "a.toml"
    file.write_text(
        '[nc]\nmachine = "mill.toml"\ncontroller = "linuxcnc"\n[stock]\nmesh = "/stocks/bar.stl"\n', encoding="utf-8"
    )
    monkeypatch.chdir(tmp_path)
    job = read_job("jobs/a.toml", Job().with_values(material={"name": "own.toml"}))
    assert (job.nc.machine, job.nc.controller) == ("jobs/mill.toml", "linuxcnc")
    assert (job.stock.mesh, job.material.name) == ("/stocks/bar.stl", "own.toml")
    written = write_job(job)
    monkeypatch.chdir(tmp_path / "jobs")
    (tmp_path / "b.toml").write_text(written, encoding="utf-8")
    found = {name: path for _, name, path in named_files(read_job("../b.toml"))}
    assert found == {
        "machine": tmp_path / "jobs" / "mill.toml",
        "mesh": Path("/stocks/bar.stl"),
        "name": tmp_path / "own.toml",
    }


def test_every_parameter_that_speaks_of_a_file_is_a_path():
    speaking = {
        (section.name, item.name)
        for section in fields(Job)
        for item in fields(getattr(Job(), section.name))
        if re.search(r"\bfile of a closed|\.toml file|\(\.mlx\)", record(item).tooltip, re.IGNORECASE)
    }
    assert speaking == set(PATHS)


def test_the_deepest_roughing_cut_needs_no_finishing_levels():
    job = Job().with_values(levels={"finishing_levels": 0, "roughing_depth": 0.7})
    assert job.deepest("roughing") == 0.7


@pytest.mark.parametrize(
    "levels", [{"depths": "0.5 1"}, {"schedule": "fewest"}, {"finishing_levels": 0, "roughing_depth": 0.5}]
)
def test_the_feed_of_the_finishing_cutter_is_for_the_cut_that_it_takes_onto_the_part(levels):
    """However deep that is: the finishing depth tells which of the cuts outside it are its too."""
    job, by_depth = Job(levels=levels), Job(levels={"finishing_depth": 0.5})
    assert job.deepest("finishing") == 0.5
    assert job.tool("finishing").feed == by_depth.tool("finishing").feed < Job().tool("finishing").feed
    assert Job(levels={"depths": "0.05 1"}).deepest("finishing") == 0.1


def test_each_level_has_the_feed_that_its_own_chip_bears():
    job = Job().with_values(levels={"depths": "0.1 0.3 1"})
    deep, shallow, part = (
        job.tool(name, level).feed for name, level in (("roughing", 2), ("roughing", 1), ("finishing", 0))
    )
    assert job.tool("roughing").feed == deep < shallow == job.fastest_feed("roughing")
    # the chip at the depth a of a ball of radius R is sin(acos(1 - a / R)) of the feed of a tooth
    thinner = [np.sin(np.arccos(1 - depth / 2)) for depth in (1.0, 0.3)]
    assert shallow / deep == pytest.approx(thinner[0] / thinner[1], rel=1e-3)
    assert job.tool("finishing").feed == part == job.fastest_feed("finishing")
    stated = job.with_values(roughing={"feed": 700.0})
    assert stated.tool("roughing", 1).feed == stated.fastest_feed("roughing") == 700.0


@pytest.mark.parametrize(
    ("sagitta", "tolerance", "why"),
    [
        (0.004, 0.02, "twice the sagitta of the facets, 0.0040 mm, but no narrower"),
        (0.01205, 0.025, "twice the sagitta of the facets, 0.0120 mm"),
        (0.0125, 0.025, "twice the sagitta of the facets, 0.0125 mm"),
        (0.3, 0.08, "twice the sagitta of the facets, 0.3000 mm, but no wider"),
        (math.inf, 0.08, "the widest, since no facets came"),
    ],
)
def test_a_tolerance_that_is_not_stated_is_twice_the_sagitta_of_the_facets_within_bounds(sagitta, tolerance, why):
    found = Job().surface
    assert found.tolerance_for(sagitta) == tolerance
    assert found.tolerance_why(sagitta, tolerance) == why
    assert tolerance == 0.08 or sagitta <= tolerance / 2, "facets are not coarse beside it"


def test_a_tolerance_that_is_stated_is_kept():
    stated = Job().with_values(surface={"tolerance": 0.05}).surface
    assert {stated.tolerance_for(sagitta) for sagitta in (0.001, 0.02, 1.0, math.inf)} == {0.05}
    assert stated.tolerance_why(0.02, 0.05) == "as the job states"
    assert Job().surface.tolerance_why(0.02, 0.08) == "the widest, since a narrower fit failed"
    with pytest.raises(JobError, match=r"tolerance = 0\.0005: give 0\.001 mm or more, or 0 for twice"):
        Job().with_values(surface={"tolerance": 0.0005})
