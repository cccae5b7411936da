"""Spindle speeds and feeds that come from the material."""

import math
from dataclasses import replace

import pytest
from small_parts import capsule_path

from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.job.materials.preset import FOLDER, cutting_force, material_files, read_material
from bonecam.machine import read_machine
from bonecam.machine.machine import USUAL_SPINDLE
from bonecam.nc import read_dialect, write_program

FORCE = """
[force]
ktc = 100.0
krc = 30.0
kac = 0.0
kte = 2.0
kre = 1.0
kae = 0.0
band = [1.5, 2.0]
source = "nobody"
range = "none"
"""


PAPER = Job().with_values(material={"name": "paper"})


def test_the_papers_speeds_are_a_preset_with_the_mechanics_of_aluminium():
    for name in ("roughing", "finishing"):
        tool = PAPER.tool(name)
        assert (tool.spindle, tool.feed) == (4500.0, 900.0)
    paper, aluminium = read_material("paper"), read_material("aluminium")
    assert "Gan et al. 2014" in paper.source
    assert paper.stiffness == aluminium.stiffness
    assert paper.force == aluminium.force


def test_the_mechanics_are_those_of_a_material_that_ships(monkeypatch, tmp_path):
    """Two files of a user that name each other have none."""
    monkeypatch.setenv("BONECAM_HOME", str(tmp_path))
    text = (FOLDER / "paper.toml").read_text()
    (tmp_path / "materials").mkdir()
    for name, other in (("one", "two"), ("two", "one")):
        file = tmp_path / "materials" / f"{name}.toml"
        file.write_text(text.replace('mechanics_of = "aluminium"', f'mechanics_of = "{other}"'))
    assert {"one", "two"} < set(material_files())
    with pytest.raises(JobError, match=r"mechanics_of = 'two': give one of aluminium, "):
        read_material("one")


def test_aluminium_is_cut_as_fast_as_the_machine_turns():
    """350 m/min ask 55,700 1/min of a ball of 2 mm; chips of 0.01 D at a depth of 0.1 mm: 0.02 / 0.436 mm a tooth."""
    tool = Job().tool("finishing")
    assert tool.spindle == read_machine("mikron-ucp600").spindle_speed == 20000.0
    thinner = math.sqrt(1 - 0.9**2)
    assert tool.feed == math.floor(0.02 / thinner * 2 * 20000)
    deep = Job().with_values(levels={"finishing_depth": 1.0}).tool("finishing")
    assert deep.feed == 0.02 * 2 * 20000
    thin = Job().with_values(levels={"finishing_depth": 0.005}).tool("finishing")
    assert thin.feed == 0.06 * 2 * 2 * 20000


def test_a_machine_that_states_no_speed_turns_as_motor_spindles_do():
    """A ball of 1 mm asks for 111,400 1/min, more than a job may state."""
    job = Job().with_values(nc={"machine": "linuxcnc-xyzbc"}, fine={"radius": 0.5, "preset": ""})
    assert job.tool("fine").spindle == USUAL_SPINDLE


@pytest.mark.parametrize("name", list(material_files()))
def test_every_material_says_where_it_is_from_how_it_is_cut_and_suits_the_shipped_machine(name):
    material = read_material(name)
    assert material.note == "not measured on your machine"
    assert len(material.source) > 30
    assert len(material.range) > 30
    job = Job().with_values(material={"name": name})
    for section in ("roughing", "finishing"):
        tool = job.tool(section)
        assert 1000 <= tool.spindle <= read_machine("mikron-ucp600").spindle_speed
        assert 100 <= tool.feed <= 3000
    assert material.stiffness is not None
    assert 1000 < material.stiffness.elasticity < 200_000
    assert 1000 < material.stiffness.density < 8000
    assert len(material.stiffness.source) > 30
    force = cutting_force(material.force, material.stiffness.yield_strength)
    assert force.scaled == (name in ("peek", "cortical-bone"))
    assert force.band[0] < 1 < force.band[1]
    assert 100 < force.coefficients[0] < 2500


def test_the_materials_are_there():
    assert tuple(material_files()) == ("aluminium", "cortical-bone", "paper", "peek", "titanium")


def test_speeds_follow_from_cutting_speed_and_feed_a_tooth():
    titanium = read_material("titanium")
    spindle, feed = titanium.speeds(2.0, 2.0, 20000.0)
    assert spindle == 10 * math.floor(1000 * 60.0 / (math.pi * 4.0) / 10)
    assert feed == math.floor(4.0 * 0.005 * 2 * spindle)
    assert titanium.speeds(1.0, 1.0, 20000.0)[0] == 9540.0
    assert titanium.speeds(1.0, 1.0, 6000.0)[0] == 6000.0


def test_values_of_the_job_win_each_for_itself():
    job = PAPER.with_values(roughing={"spindle": 9000.0}, finishing={"feed": 500.0})
    assert (job.tool("roughing").spindle, job.tool("roughing").feed) == (9000.0, 900.0)
    assert (job.tool("finishing").spindle, job.tool("finishing").feed) == (4500.0, 500.0)
    in_titanium = job.with_values(material={"name": "titanium"})
    assert (in_titanium.tool("roughing").spindle, in_titanium.tool("roughing").feed) == (9000.0, 544.0)
    assert (in_titanium.tool("finishing").spindle, in_titanium.tool("finishing").feed) == (9540.0, 500.0)


def test_a_material_may_be_a_file(tmp_path):
    file = tmp_path / "wax.toml"
    file.write_text((FOLDER / "peek.toml").read_text().replace("cutting_speed = 100.0", "cutting_speed = 50.0"))
    job = Job().with_values(material={"name": str(file)})
    assert job.tool("roughing").spindle == 3970.0


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("teeth = 2", "teeth = 0", "teeth = 0: give a positive number"),
        ("teeth = 2", "", "give spindle and feed, or cutting_speed, feed_per_tooth, teeth"),
        ("teeth = 2", "teeth = 2\nspindle = 10.0", "give spindle and feed, or"),
        ("teeth = 2", 'teeth = "two"', "teeth: .*give a whole number"),
        ("teeth = 2", "teeth = 2\ncoolant = 1", "coolant: unknown key"),
        ("teeth = 2", "teeth = ", "wrong.toml: "),
        ("teeth = 2", 'teeth = 2\nmechanics_of = "wrong.toml"', "mechanics_of = 'wrong.toml': give one of al"),
        ("elasticity = 4000.0", "elasticity = 0.0", r"\[stiffness\] elasticity = 0: give a positive number"),
        ("elasticity = 4000.0", "", "stiffness.elasticity: missing: add it"),
        ("[stiffness]", FORCE + "[stiffness]", r"\[force\] band = \[1.5, 2.0\]: give two multiples with 1 between"),
        ("[stiffness]", FORCE.replace("kre = 1.0", "kre = -1.0") + "[stiffness]", r"\[force\] kre = -1: give a"),
    ],
)
def test_a_wrong_material_file_is_refused_with_file_and_key(old, new, told, tmp_path):
    file = tmp_path / "wrong.toml"
    file.write_text((FOLDER / "peek.toml").read_text().replace(old, new))
    with pytest.raises(JobError, match=told) as caught:
        Job().with_values(material={"name": str(file)}).tool("roughing")
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_material_is_refused_with_the_known_ones():
    with pytest.raises(
        JobError, match=r"'titan' is unknown.*use one of aluminium, cortical-bone, paper, peek, titanium"
    ):
        Job().with_values(material={"name": "titan"}).tool("roughing")
    with pytest.raises(JobError, match="give a readable material file"):
        Job().with_values(material={"name": "nowhere/none.toml"}).tool("finishing")


def test_the_header_tells_the_source_of_speeds_that_the_job_does_not_give():
    machine, dialect = read_machine("mikron-ucp600"), read_dialect("heidenhain")
    path = capsule_path(count=60)
    job = Job().with_values(material={"name": "titanium"})
    text = write_program([replace(path)], machine, dialect, job).text
    assert "SPEEDS NOT IN THE JOB ARE OF TITANIUM ALLOY TI-6AL-4V: TUNGALOY" in text
    assert "NOT MEASURED ON YOUR MACHINE" in text
    given = {"spindle": 9000.0, "feed": 400.0}
    own = write_program([path], machine, dialect, job.with_values(roughing=given, finishing=given)).text
    assert "SPEEDS NOT IN THE JOB" not in own


def test_without_coefficients_those_of_aluminium_are_scaled_and_told():
    aluminium = read_material("aluminium")
    assert aluminium.force is not None
    assert aluminium.stiffness is not None
    own = cutting_force(aluminium.force, aluminium.stiffness.yield_strength)
    scaled = cutting_force(None, 2 * aluminium.stiffness.yield_strength)
    assert scaled.array == pytest.approx(2 * own.array)
    assert "no coefficients are known" in scaled.source
