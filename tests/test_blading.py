"""A wheel from its turned blank: every channel and blade is cut, nothing collides, wrong wheels are refused."""

from pathlib import Path

import numpy as np
import pytest
from small_wheel import HALF, blade, hub, job, sections

import bonecam
from bonecam.cli import main
from bonecam.errors import JobError, SurfaceError, VerifyError
from bonecam.machine.machine import read_machine
from bonecam.mesh import MeshDistance, write_mesh
from bonecam.mesh.solids.revolution import cylinder
from bonecam.nc.job_dialect import job_dialect
from bonecam.nc.posting.write import write_program
from bonecam.report.page.packing import unpack
from bonecam.surface import skin
from bonecam.surface.files.tspline_text import write_tsm
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.verify.proof import verify
from bonecam.verify.removal.proofs.of_wheel import prove_removal_of_wheel
from bonecam.verify.repeated import RepeatedDistance

COUNT = 2


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("wheel")


@pytest.fixture(scope="module")
def made(files: Path) -> bonecam.Bladed:
    write_tsm(blade(), files / "blade.tsm")
    write_mesh(hub(), files / "hub.ply")
    outputs = {name: files / f"wheel.{ending}" for name, ending in (("program", "h"), ("html", "html"))}
    return bonecam.blades(
        files / "blade.tsm",
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


def test_channels_are_cut_from_the_blank_to_the_hub_and_then_the_blades(made: bonecam.Bladed) -> None:
    levels = made.levels.levels
    assert [(path.level, path.rest) for path in made.paths] == [
        *((index, 0) for index in range(len(levels) - 2, 0, -1)),
        (0, 1),
        (0, 0),
    ]
    assert all(level.deepest <= level.limit + 1e-3 for level in levels[1:])


def test_every_pitch_has_the_same_path(made: bonecam.Bladed) -> None:
    turn = np.diag([-1.0, -1.0, 1.0])  # half a turn, for two blades
    for path in made.paths:
        rows = len(path.tips) // COUNT
        np.testing.assert_allclose(path.tips[:rows] @ turn, path.tips[rows:], atol=1e-9)
        np.testing.assert_allclose(path.axes[:rows] @ turn, path.axes[rows:], atol=1e-9)


def test_both_sides_of_every_blade_are_cut(made: bonecam.Bladed) -> None:
    cut = contacts(made.paths[-1])
    for azimuth in (0.0, np.pi):
        across = cut @ [-np.sin(azimuth), np.cos(azimuth), 0.0]
        here = cut[:, 0] * np.cos(azimuth) > 0
        assert min((side * across[here] > HALF / 2).sum() for side in (1, -1)) > 10


def test_the_text_removes_the_blank_as_it_may(made: bonecam.Bladed) -> None:
    removal = made.removal
    assert removal is not None
    assert removal.left is not None
    assert (removal.rapid_contact, removal.link_contact) == (None, None)
    assert removal.left.deepest_gouge.value <= made.job.path.gouge_tolerance
    assert all(level.removed > 1.0 for level in removal.levels)
    blank, solid = made.blank.mesh.volume, made.workpiece.solid.volume
    post = np.pi * 5.0**2 * 30.0
    assert solid < removal.volume - post < solid + 0.3 * (blank - solid)


def test_a_text_that_cuts_a_neighbour_is_refused(made: bonecam.Bladed) -> None:
    machine, dialect = read_machine(made.job.nc.machine), job_dialect(made.job.nc)
    wider = RepeatedDistance(MeshDistance(made.workpiece.solid), 3)
    with pytest.raises(VerifyError, match="enters the part"):
        verify(made.program.text, made.paths, machine, dialect, wider, job=made.job)


def test_a_text_without_its_roughing_is_refused(made: bonecam.Bladed) -> None:
    machine, dialect = read_machine(made.job.nc.machine), job_dialect(made.job.nc)
    unroughed = write_program(made.paths[-2:], machine, dialect, made.job).text
    with pytest.raises(VerifyError, match=r"deep|enters material|remove"):
        prove_removal_of_wheel(
            unroughed, machine, dialect, made.job, made.blank, made.wheel, made.levels.levels
        )


def test_the_files_of_a_run_are_written(made: bonecam.Bladed, files: Path) -> None:
    kept = {file.name for file in (files / "kept").iterdir()}
    assert {"blank.csv", "blank.ply", "solid.ply", "surface.iga", "toolpath.png", "program.h"} <= kept
    assert "turned to the blades" in (files / "sheet.html").read_text(encoding="utf-8")
    assert (files / "wheel.h").read_text() == made.program.text
    facts = unpack((files / "kept" / "view.gz").read_bytes(), "view.gz").facts
    assert len(facts["levels"]) == len(made.levels.levels)
    assert f"{COUNT} blades" in made.summary


@pytest.mark.parametrize(
    ("half", "count", "radius", "error", "words"),
    [
        (HALF, 30, 1.5, JobError, r"finishing.*radius|roughing.*radius"),
        (3.0, 12, 1.5, SurfaceError, "overlap"),
        (HALF, 1, 1.5, SurfaceError, "give from 2"),
    ],
)
def test_a_wheel_that_cannot_be_cut_is_refused_before_it_is_planned(
    half: float, count: int, radius: float, error: type[Exception], words: str
) -> None:
    with pytest.raises(error, match=words):
        bonecam.blades(blade(half), hub(), count, job=job().with_values(roughing={"radius": radius}))


def test_a_wheel_that_does_not_repeat_is_refused() -> None:
    pin = cylinder(1.0, -1.0, 6.0, 0.05)
    pose = np.eye(4)
    pose[:3, 3] = [0.0, 11.0, 3.0]
    with pytest.raises(SurfaceError, match="does not repeat"):
        bonecam.blades(blade(), hub(), 2, [pin.move(pose)], job())


def test_sections_from_the_tip_are_refused() -> None:
    with pytest.raises(SurfaceError, match="from its tip to the hub"):
        bonecam.blades(skin([row[::-1] for row in sections()[::-1]], 0.01), hub(), 2, job=job())


def test_the_command_tells_a_wrong_wheel_in_one_line(
    files: Path, made: bonecam.Bladed, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["blades", str(files / "blade.tsm"), "--hub", str(files / "hub.ply"), "--count", "40"]
    assert main([*given, "-o", str(files / "none.h"), "-q"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "overlap" in told
    assert not (files / "none.h").exists()
