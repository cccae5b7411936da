"""A wheel from its turned blank: every channel and blade is cut, nothing collides, wrong wheels are refused."""

import re
from functools import wraps
from types import SimpleNamespace

import bonecam_meshes
import numpy as np
import pytest
from small_wheel import HALF, blade, hub, job, sections

import bonecam
from bonecam.cli import main
from bonecam.errors import BendingError, JobError, SurfaceError, VerifyError
from bonecam.machine import read_machine
from bonecam.mesh import MeshDistance, write_mesh
from bonecam.mesh.solids import cylinder
from bonecam.nc import write_program
from bonecam.nc.requirements import job_dialect
from bonecam.report.page.contents import unpack
from bonecam.surface import save_surface, skin
from bonecam.tool import MoveKind, ToolPath
from bonecam.verify import verify
from bonecam.wheels import blading
from bonecam.wheels.channels import require_room
from bonecam.wheels.proof import RepeatedDistance, prove_removal_of_wheel
from bonecam.wheels.tables import read_blade, read_hub
from bonecam.wheels.wheel import wheel_of

pytestmark = pytest.mark.whole

COUNT = 2


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return tmp_path_factory.mktemp("wheel")


@pytest.fixture(scope="module")
def made(files):
    save_surface(blade(), files / "blade.tspline")
    write_mesh(hub(), files / "hub.ply")
    outputs = {name: files / f"wheel.{ending}" for name, ending in (("program", "h"), ("html", "html"))}
    return bonecam.blades(
        files / "blade.tspline",
        files / "hub.ply",
        COUNT,
        job=job(),
        **outputs,
        sheet=files / "sheet.html",
        report=files / "wheel.json",
        keep=files / "kept",
    )


def contacts(path: ToolPath) -> np.ndarray:
    return path.contacts[path.kinds == MoveKind.CUT]


def test_channels_are_cut_from_the_blank_to_the_hub_and_then_the_blades(made):
    levels = made.levels.levels
    assert [(path.level, path.rest) for path in made.paths] == [
        *((index, 0) for index in range(len(levels) - 2, 0, -1)),
        (0, 1),
        (0, 0),
    ]
    assert all(level.deepest <= level.limit + 1e-3 for level in levels[1:])


def test_every_pitch_has_the_same_path(made):
    turn = np.diag([-1.0, -1.0, 1.0])  # half a turn, for two blades
    for path in made.paths:
        rows = len(path.tips) // COUNT
        np.testing.assert_allclose(path.tips[:rows] @ turn, path.tips[rows:], atol=1e-9)
        np.testing.assert_allclose(path.axes[:rows] @ turn, path.axes[rows:], atol=1e-9)


def test_both_sides_of_every_blade_are_cut(made):
    cut = contacts(made.paths[-1])
    for azimuth in (0.0, np.pi):
        across = cut @ [-np.sin(azimuth), np.cos(azimuth), 0.0]
        here = cut[:, 0] * np.cos(azimuth) > 0
        assert min((side * across[here] > HALF / 2).sum() for side in (1, -1)) > 10


def test_the_text_removes_the_blank_as_it_may(made):
    removal = made.removal
    assert removal is not None
    assert removal.left is not None
    assert (removal.rapid_contact, removal.link_contact) == (None, None)
    assert removal.left.deepest_gouge.value <= made.job.path.gouge_tolerance
    assert all(level.removed > 1.0 for level in removal.levels)
    blank, solid = made.blank.mesh.volume, made.workpiece.solid.volume
    post = np.pi * 5.0**2 * 30.0
    assert solid < removal.volume - post < solid + 0.3 * (blank - solid)


def test_force_and_bending_are_judged_from_the_text(made):
    mechanics = made.report["mechanics"]
    assert [(row["index"], row["rest"]) for row in mechanics["levels"]] == [
        (path.level, path.rest) for path in made.paths
    ]
    assert all(0.1 < row["force_mean_n"] < row["peak_max_n"] for row in mechanics["levels"])
    assert 0.0 < mechanics["error_kept_um"]["median"] <= mechanics["error_kept_um"]["p99"]
    assert "BENDING KEEPS" in re.sub(r"\n\d+ ; ", " ", made.program.text)
    assert "error kept" in made.summary


def test_a_cutter_that_bends_too_far_is_refused(made):
    machine, dialect = read_machine(made.job.nc.machine), job_dialect(made.job.nc)
    strict = made.job.with_values(mechanics={"largest_error": 0.001})
    cut = made.blank, made.wheel, made.levels.levels
    with pytest.raises(BendingError, match="bending keeps errors of"):
        prove_removal_of_wheel(made.program.text, machine, dialect, strict, *cut)


def test_a_text_that_cuts_a_neighbour_is_refused(made):
    machine, dialect = read_machine(made.job.nc.machine), job_dialect(made.job.nc)
    wider = RepeatedDistance(MeshDistance(made.workpiece.solid), 3)
    with pytest.raises(VerifyError, match="enters the part"):
        verify(made.program.text, made.paths, machine, dialect, wider, job=made.job)


def test_a_text_without_its_roughing_is_refused(made):
    machine, dialect = read_machine(made.job.nc.machine), job_dialect(made.job.nc)
    unroughed = write_program(made.paths[-2:], machine, dialect, made.job).text
    with pytest.raises(VerifyError, match=r"deep|enters material|remove"):
        prove_removal_of_wheel(
            unroughed, machine, dialect, made.job, made.blank, made.wheel, made.levels.levels, mechanics=False
        )


def test_the_files_of_a_run_are_written(made, files):
    kept = {file.name for file in (files / "kept").iterdir()}
    assert {
        "blank.csv",
        "blank.ply",
        "solid.ply",
        "left.ply",
        "error.png",
        "surface.iga",
        "toolpath.png",
        "program.h",
    } <= kept
    assert "turned to the blades" in (files / "sheet.html").read_text(encoding="utf-8")
    assert (files / "wheel.h").read_text() == made.program.text
    view = unpack((files / "kept" / "view.gz").read_bytes(), "view.gz")
    facts, arrays = view.facts, view.arrays
    assert len(facts["levels"]) == len(made.levels.levels)
    assert {f"before_{path.level}" for path in made.paths} <= set(arrays)
    assert (arrays["after_0"] <= arrays["before_0"] + 1e-6).all()
    sheet = (files / "sheet.html").read_text(encoding="utf-8")
    assert "Bending," in sheet or "ending keeps" in sheet
    assert f"{COUNT} blades" in made.summary
    assert sum(made.report["uncut_mm2"].values()) < made.report["surface"]["area_mm2"]


@pytest.mark.parametrize(
    ("half", "count", "radius", "error", "words"),
    [
        (HALF, 30, 1.5, JobError, r"finishing.*radius|roughing.*radius"),
        (3.0, 12, 1.5, SurfaceError, "overlap"),
        (HALF, 1, 1.5, SurfaceError, "give from 2"),
    ],
)
def test_a_wheel_that_cannot_be_cut_is_refused_before_it_is_planned(half, count, radius, error, words):
    with pytest.raises(error, match=words):
        bonecam.blades(blade(half), hub(), count, job=job().with_values(roughing={"radius": radius}))


def test_a_wheel_that_does_not_repeat_is_refused():
    pin = cylinder(1.0, -1.0, 6.0, 0.05)
    pose = np.eye(4)
    pose[:3, 3] = [0.0, 11.0, 3.0]
    with pytest.raises(SurfaceError, match="does not repeat"):
        bonecam.blades(blade(), hub(), 2, [pin.move(pose)], job())


def test_sections_from_the_tip_are_refused():
    with pytest.raises(SurfaceError, match="from its tip to the hub"):
        bonecam.blades(skin([row[::-1] for row in sections()[::-1]], 0.01), hub(), 2, job=job())


def test_the_command_tells_a_wrong_wheel_in_one_line(files, made, capsys):
    given = ["blades", str(files / "blade.tspline"), "--hub", str(files / "hub.ply"), "--count", "40"]
    assert main([*given, "-o", str(files / "none.h"), "-q"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "overlap" in told
    assert not (files / "none.h").exists()


def test_the_demo_s_wheel_is_the_impeller_that_ships(tmp_path, monkeypatch):
    given: list[dict] = []
    stand_in = wraps(bonecam.blades)(lambda **named: given.append(named) or SimpleNamespace(summary="made"))
    monkeypatch.setattr(blading, "blades", stand_in)
    monkeypatch.chdir(tmp_path)
    page = str(tmp_path / "wheel.html")
    assert (
        main(["demo", "--impeller", "--html", page, "--controller", "siemens-840d", "--set", "nc.coolant=false"]) == 0
    )
    (named,) = given
    assert (named["blade"], named["hub"]) == (
        bonecam_meshes.path("impeller_blade"),
        bonecam_meshes.path("impeller_hub"),
    )
    assert (named["count"], named.get("obstacles", ())) == (11, ())
    assert named["job"] == bonecam.read_job(bonecam_meshes.job("impeller")).with_values(
        nc={"controller": "siemens-840d", "coolant": False}
    )
    assert (named["program"], named["html"], named["mechanics"]) == ("impeller.mpf", page, True)


def test_the_demo_s_wheel_has_no_file_for_its_surface(tmp_path, capsys):
    assert main(["demo", "--impeller", "--surface", str(tmp_path / "a.tsm")]) == 2
    assert "give --keep, not --surface" in capsys.readouterr().err


def test_the_job_of_the_shipped_wheel_passes_what_is_asked_before_planning():
    wheel_job = bonecam.read_job(bonecam_meshes.job("impeller"))
    surface, _ = read_blade(bonecam_meshes.path("impeller_blade"), "mm", wheel_job.surface.tolerance_for())
    wheel = wheel_of(surface, read_hub(bonecam_meshes.path("impeller_hub"), surface, "mm"), 11)
    require_room(wheel, wheel_job)
    with pytest.raises(ValueError, match="take impeller"):
        bonecam_meshes.job("phalanx")


def test_feeds_by_the_force_are_refused():
    with pytest.raises(JobError, match="one feed a cutter"):
        bonecam.blades(blade(), hub(), 2, job=job().with_values(path={"feed": "force"}))
