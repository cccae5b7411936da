"""What cannot come to a program is refused at once: the field with its value, the bound and the remedy, in
one line, and no file."""

import sys

import numpy as np
import pytest
from bonecam_meshes import path as shipped

import bonecam
from bonecam.batch import convert_many
from bonecam.errors import BonecamError, JobError, MachineError, ToolPathError
from bonecam.job import Job
from bonecam.levels import job_levels
from bonecam.machine import machine_names, read_machine
from bonecam.mesh import prepare_part, read_mesh
from bonecam.nc import read_dialect
from bonecam.nc.dialect import DIALECTS
from bonecam.pipeline import check_job
from bonecam.setup import place


@pytest.fixture
def no_work(monkeypatch):
    def fitted(*given, **named):
        raise AssertionError("the surface was fitted before the job was refused")

    monkeypatch.setattr(job_levels, "fit_surface", fitted)


CUTTERS = {"roughing": {"preset": "ball-4"}, "finishing": {"preset": "ball-2"}, "fine": {"preset": "ball-1"}}
"""Those of the default sections, so that none are sought."""


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"holding": {"diameter": 100.0}}, r"\[holding\] diameter = 100: the stock is 1\d\.\d\d mm wide: give"),
        (
            {"stock": {"diameter": 300.0, "length": 320.0}},
            r"\[levels\] most_cuts = 250: the stock at .* takes 2\d\d cuts or more: give a smaller",
        ),
        (
            {"stock": {"diameter": 300.0, "length": 320.0}, "levels": {"depths": "0.1 0.3"}},
            r"\[levels\] most_cuts = 250: .* cuts or more: give a smaller stock or greater depths, or allow more",
        ),
        (
            {"stock": {"diameter": 200.0, "length": 220.0}, "levels": {"roughing_depth": 1.0}},
            r"the stock at .* mm from the part, more than 3 times the part's diagonal of 3\d\.\d mm: give a smaller",
        ),
        (
            {"stock": {"width": 20.0}},
            r"\[stock\] width = 20: a capsule has none: give diameter and length, or kind = box",
        ),
        ({"stock": {"mesh": "block.stl"}}, r"\[stock\] mesh = 'block\.stl': a capsule has none"),
        ({"stock": {"kind": "box", "diameter": 15.0}}, r"\[stock\] diameter = 15: a box has none"),
        ({"finishing": {"scallop": 1.5}}, r"\[finishing\] scallop = 1\.5: give less than the ball's radius \(1 mm\)"),
        ({"roughing": {"flute_length": 1.5}}, r"\[roughing\] flute_length = 1\.5: give at least the ball's radius"),
        ({"roughing": {"overhang": 6.0}}, r"\[roughing\] overhang = 6: give more than flute_length \(8 mm\)"),
        (
            {"finishing": {"shank_diameter": 25.0}},
            r"\[finishing\] shank_diameter = 25: give at most holder_diameter \(10 mm\)",
        ),
        (
            {"finishing": {"shank_diameter": 50.0, "holder_diameter": 60.0}},
            r"\[finishing\] shank_diameter = 50: at the lead of 10 degrees the shank would cut into a flat part",
        ),
        (
            {"roughing": {"spindle": 60000.0}},
            r"\[roughing\] spindle = 60000: mikron-ucp600 turns at 20000 1/min at most",
        ),
        (
            {"finishing": {"feed": 25000.0}},
            r"\[finishing\] feed = 25000: an axis of mikron-ucp600 makes 22000 mm/min at most",
        ),
        (
            {"levels": {"roughing_depth": 5.0}},
            r"\[levels\] roughing_depth = 5: a ball of roughing\.radius = 2 mm sinks 1\.5 mm at most",
        ),
        (
            {"levels": {"finishing_depth": 0.8}},
            r"\[levels\] finishing_depth = 0\.8: a ball of finishing\.radius = 1 mm",
        ),
        ({"levels": {"depths": "0.1 2.5"}}, r"\[levels\] depths = '0\.1 2\.5': a ball"),
        (
            {"path": {"lead_deg": 60.0, "max_tilt_deg": 30.0}},
            r"\[path\] lead_deg = 60: keep it within path\.max_tilt_deg \(30\)",
        ),
        (
            {"holding": {"riser_diameter": 900.0, "riser_height": 50.0}},
            r"\[holding\] riser_diameter = 900: the table of mikron-ucp600 is \d+ mm across: give less",
        ),
        (
            {"holding": {"stub_diameter": 8.0, "stub_length": 15.0, "chuck_diameter": 22.0, "chuck_height": 90.0}},
            r"\[holding\] stub_diameter = 8: the stock that is turned from this bar is 1\d\.\d\d mm wide: give",
        ),
        ({"holding": {"length": -1.0}}, r"\[holding\] length = -1\.0: keep it within"),
        ({"roughing": {"feed": -900.0}}, r"\[roughing\] feed = -900\.0: keep it within"),
        (
            {
                "roughing": {"overhang": 400.0, "holder_diameter": 20.0},
                "holding": {"diameter": 4.0, "length": 107.0},
                "levels": {"roughing_depth": 0.5},
                "mechanics": {"refuse": False},
            },
            r"539 mm are needed along Z, its travel is 450 mm: .* a shorter post or tool",
        ),
        (
            {"holding": {"diameter": 4.0, "length": 107.0}},
            r"the neck does not hold: .* that of 4 x 107 mm .*: give holding\.diameter = 0, which finds one",
        ),
        ({"stock": {"offset_x": 40.0}}, r"the post of diameter 10 mm on the Z axis misses the part: .*stock\.offset_x"),
    ],
)
def test_an_absurd_job_is_refused_before_the_surface_is_fitted(changes, named, tmp_path):
    with pytest.raises(BonecamError, match=named) as caught:
        bonecam.convert(shipped("phalanx"), Job().with_values(**CUTTERS | changes), program=tmp_path / "bone.h")
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.plugged
@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(("field", "value"), [("method", "qcqp"), ("method", "published"), ("solver", "clarabel")])
def test_a_solver_that_is_not_installed_is_named_before_the_surface_is_fitted(field, value, monkeypatch):
    monkeypatch.setitem(sys.modules, "clarabel", None)
    monkeypatch.delitem(sys.modules, "bonecam_plugins.study.levels", raising=False)
    job = Job().with_values(levels={field: value})
    missing = "bonecam_plugins.study.levels:.* of bonecam: cannot be loaded: ModuleNotFoundError: import of clarabel"
    with pytest.raises(JobError, match=missing):
        bonecam.convert(shipped("phalanx"), job)
    with pytest.raises(JobError, match=missing):
        bonecam.morph_levels(shipped("phalanx"), job)


@pytest.mark.parametrize(
    ("machine", "controller"),
    [
        ("mikron-ucp600", "heidenhain"),
        ("linuxcnc-xyzbc", "linuxcnc"),
        ("mikron-ucp600", "siemens-840d"),
        ("linuxcnc-xyzbc", "siemens-840d"),
        ("mikron-ucp600", "fanuc-30i"),
        ("mikron-ucp600", "makino"),
        ("linuxcnc-xyzbc", "mitsubishi"),
    ],
)
def test_the_default_job_suits_every_machine(machine, controller):
    assert {"mikron-ucp600", "linuxcnc-xyzbc"} <= {*machine_names()}
    job = Job().with_values(nc={"machine": machine, "controller": controller})
    check_job(job, read_machine(machine), read_dialect(controller))


HEIDENHAIN = (DIALECTS / "heidenhain.toml").read_text()


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("length = { decimals = 3", "length = { decimals = 0", "trial program"),
        ("length = { decimals = 3, sign = true", "length = { decimals = 3, sign = false", "unknown block 'BLK FORM"),
        ("length = { decimals = 3, sign = true", "length = { decimals = 3, sign = true, highest = 20.0", "leaves the"),
        (
            "angle = { decimals = 3, sign = true, lowest = -99999.999",
            "angle = { decimals = 3, sign = true, lowest = 1.0",
            "leaves the",
        ),
        (
            "feed = { decimals = 0, sign = false, lowest = 1.0, highest = 99999.0",
            "feed = { decimals = 0, sign = false, highest = 500.0",
            "feed is 500 mm/min, meant",
        ),
        ('tool_end = ""', 'tool_end = "M99"', "line .*unknown block 'M99'"),
        ("; {text}", "(* {text} *)", "line .*unknown block"),
        ('format = "{number} {text}"', 'format = "N{number} {text}"', "block number 0 expected, found 'N0'"),
    ],
)
def test_a_dialect_that_cannot_write_the_job_is_refused_before_the_surface_is_fitted(old, new, named, tmp_path):
    assert old in HEIDENHAIN
    file = tmp_path / "mine.toml"
    file.write_text(HEIDENHAIN.replace(old, new))
    with pytest.raises(MachineError, match=named) as caught:
        bonecam.convert(shipped("phalanx"), Job().with_values(nc={"controller": file}))
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("no_work")
def test_a_machine_that_the_dialect_does_not_know_is_refused_before_the_surface_is_fitted(tmp_path):
    job = Job().with_values(nc={"machine": "linuxcnc-xyzbc", "controller": "heidenhain"})
    with pytest.raises(MachineError, match="tool_centre_control '' is none of heidenhain's"):
        bonecam.convert(shipped("phalanx"), job)
    with pytest.raises(MachineError, match="tool_centre_control '' is none of heidenhain's"):
        convert_many([shipped("phalanx")], tmp_path / "out", job)
    assert not list(tmp_path.iterdir())


def test_a_batch_refuses_an_absurd_job_before_its_first_mesh(tmp_path):
    with pytest.raises(JobError, match="scallop"):
        convert_many(["bone.stl"], tmp_path / "out", Job().with_values(finishing={"scallop": 1.5}))
    assert not list(tmp_path.iterdir())


@pytest.mark.plugged
def test_the_filters_refuse_a_post_beside_the_part():
    mesh = read_mesh(shipped("phalanx"))
    meshes = bonecam.MeshSet()
    from bonecam.mesh.meshlab import meshlab

    meshes.add_mesh(meshlab().Mesh(mesh.vertices, mesh.faces))
    with pytest.raises(ToolPathError, match="misses the part"):
        meshes.apply_filter("generate_stock", offset_x=40.0)
    assert meshes.mesh_number() == 1


@pytest.mark.parametrize("kind", ["capsule", "cylinder", "box"])
def test_an_offset_that_takes_the_part_off_its_post_is_to_be_left_out(kind):
    part = prepare_part(shipped("phalanx"), Job().mesh)
    with pytest.raises(ToolPathError, match=r"misses the part: leave out stock\.offset_x = 100$") as caught:
        place(part, Job().with_values(stock={"kind": kind, "offset_x": 100.0, "offset_z": 1.0}))
    x, y = caught.value.evidence["offset"]
    place(part, Job().with_values(stock={"kind": kind, "offset_x": x, "offset_y": y, "offset_z": 1.0}))


@pytest.mark.parametrize("stock", [{}, {"tilt_x_deg": 20.0}, {"diameter": 90.0, "length": 90.0, "offset_y": -30.0}])
def test_the_offset_that_is_told_brings_the_part_over_its_post(stock):
    aside = np.eye(4)
    aside[0, 3] = 20.0
    part = prepare_part(shipped("phalanx"), Job().mesh).move(aside)
    job = Job().with_values(mesh={"upright": False}, stock=stock)
    told = r"with stock\.offset_x = -?\d+\.\d\d and stock\.offset_y = "
    with pytest.raises(ToolPathError, match=told) as caught:
        place(part, job)
    x, y = caught.value.evidence["offset"]
    place(part, job.with_values(stock={**stock, "offset_x": x, "offset_y": y}))
