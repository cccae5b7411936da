"""Paths of another system, or of another machine's program, become a proved program here."""

from pathlib import Path

import numpy as np
import pytest
from bonecam_plugins.reposting import posting
from small_parts import revolved

import bonecam
from bonecam.cli import main
from bonecam.errors import FileError, JobError, MachineError, ProgramError, VerifyError
from bonecam.files import whole_folder
from bonecam.job import Job, write_job
from bonecam.job.nc_section import LINK_FEED
from bonecam.machine import read_machine
from bonecam.mesh import write_mesh
from bonecam.nc import read_dialect, read_program
from bonecam.setup import Capsule
from bonecam.surface import save_surface
from bonecam.tool import MoveKind

AXIS = np.array([0.0, 0.5, 0.75**0.5])
TIPS = np.array([[0.0, 0.0, 60.0], [0.0, 0.0, 31.0], [4.0, 1.0, 31.0], [8.0, 2.0, 31.5], [8.0, 2.0, 60.0]])
JOB = Job().with_values(nc={"machine": "linuxcnc-xyzac", "controller": "linuxcnc"})


@pytest.fixture
def part(tmp_path):
    """A capsule that the paths pass over."""
    file = tmp_path / "part.ply"
    write_mesh(Capsule(np.array([0.0, 0, 12]), np.array([0.0, 0, 24]), 3.0).mesh(0.05), file)
    return file


def apt(tmp_path: Path, tips: np.ndarray = TIPS, axis: np.ndarray = AXIS, cutter: str = "2.0,1.0") -> Path:
    """Cutter location data of one tool, its first and last move rapid."""
    lines = ["PARTNO/THEIRS", "UNITS/MM", "LOADTL/7", f"CUTTER/{cutter}", "FEDRAT/MMPM,300.0"]
    for row, tip in enumerate(tips):
        lines += ["RAPID"] * (row in (0, len(tips) - 1))
        lines.append("GOTO/" + ",".join(f"{value:.9f}" for value in (*tip, *axis)))
    file = tmp_path / "theirs.apt"
    file.write_text("\n".join([*lines, "FINI", ""]))
    return file


def test_foreign_cutter_locations_are_posted_and_read_back(part, tmp_path):
    made = bonecam.post(apt(tmp_path), part, JOB, program=tmp_path / "ours.ngc")
    text = (tmp_path / "ours.ngc").read_text()
    motions = read_program(text, read_machine("linuxcnc-xyzac"), read_dialect("linuxcnc"))
    assert set(motions.tools) == {2}
    for tip in TIPS:
        assert np.abs(motions.tips - tip).max(axis=1).min() < 1e-4
    assert np.abs(motions.axes[-1] - AXIS).max() < 1e-6
    assert "gouge" in made.summary


def test_a_program_goes_from_one_machine_and_control_to_another(part, tmp_path):
    bonecam.post(apt(tmp_path), part, JOB, program=tmp_path / "first.ngc")
    wanted = JOB.with_values(nc={"machine": "dmu-45", "controller": "siemens-840d"})
    origin = "linuxcnc-xyzac", "linuxcnc"
    bonecam.post(tmp_path / "first.ngc", part, wanted, program=tmp_path / "second.mpf", origin=origin)
    text = (tmp_path / "second.mpf").read_text()
    motions = read_program(text, read_machine("dmu-45"), read_dialect("siemens-840d"))
    for tip in TIPS[1:4]:
        assert np.abs(motions.tips - tip).max(axis=1).min() < 2e-3


@pytest.mark.parametrize("marked", [True, False])
def test_cuts_faster_than_a_slower_spindle_allows_stay_cuts_and_are_slowed(marked, part, tmp_path):
    paths = apt(tmp_path)
    text = paths.read_text().replace("300.0", "1847.0")
    paths.write_text(text.replace("FEDRAT", "PPRINT/CUT\nFEDRAT") if marked else text)
    slow = JOB.with_values(nc={"machine": "hermle-c600u", "controller": "heidenhain"})
    made = bonecam.post(paths, part, slow)
    (path,) = made.proved.paths
    cuts = path.kinds == MoveKind.CUT
    assert path.cutter.feed < 1847
    assert np.count_nonzero(path.kinds == MoveKind.LINK) == 0
    assert cuts.any()
    assert path.feed_rates[cuts].max() <= path.cutter.feed
    assert made.slowed == 3
    assert "feed      3 cuts slowed" in made.summary


def test_moves_as_fast_as_links_are_links_where_no_mark_tells(part, tmp_path):
    paths = apt(tmp_path)
    lines = paths.read_text().replace("300.0", f"{LINK_FEED}").splitlines()
    lines.insert(len(lines) - 5, "FEDRAT/MMPM,300.0")
    paths.write_text("\n".join(lines))
    made = bonecam.post(paths, part, JOB)
    assert set(made.proved.paths[0].kinds) == {MoveKind.RAPID, MoveKind.LINK, MoveKind.CUT}
    assert made.slowed == 0


def test_foreign_paths_that_gouge_are_refused_and_not_written(part, tmp_path):
    deep = TIPS - [0.0, 0.0, 6.0]
    with pytest.raises(VerifyError, match="the ball enters the part"):
        bonecam.post(apt(tmp_path, deep), part, JOB, program=tmp_path / "ours.ngc")
    assert not (tmp_path / "ours.ngc").exists()


@pytest.mark.parametrize(
    ("changed", "why"),
    [({"cutter": "2.0,0.5"}, "no ball: give paths of ball-end"), ({"cutter": "6.0,3.0"}, "a ball of radius 3 mm")],
)
def test_a_cutter_that_the_job_does_not_have_is_named(changed, why, part, tmp_path):
    with pytest.raises(ProgramError, match=why):
        bonecam.post(apt(tmp_path, **changed), part, JOB)  # type: ignore[arg-type]


def test_an_axis_that_the_machine_does_not_have_is_named(part, tmp_path):
    wanted = JOB.with_values(nc={"machine": "mill-4axis"})
    told = (
        r"^mill-4axis: 5 of 5 moves lean the tool by 30\.0 deg as its axes cannot, in level 0; on it the tool leans "
        r".* by 90 deg, all round: plan the part for this machine \(bonecam convert PART --machine mill-4axis\)"
    )
    with pytest.raises(MachineError, match=told):
        bonecam.post(apt(tmp_path), part, wanted)


@pytest.fixture
def kept(tmp_path):
    """What a run keeps of its part: the surface, and a mesh of it that lies far outside, as a coarse one may."""
    folder = tmp_path / "kept"
    surface = revolved(lambda share, azimuth: 3.0 + 0 * azimuth, low=9.0, high=27.0)
    with whole_folder(folder, "never") as work:
        save_surface(surface, work / "surface.tspline")
        write_mesh(Capsule(np.array([0.0, 0, 12]), np.array([0.0, 0, 24]), 8.0).mesh(0.05), work / "level_00.ply")
    return folder


@pytest.mark.parametrize("name", ["", "level_00.ply", "surface.tspline"])
def test_the_surface_of_a_kept_folder_stands_for_its_mesh(name, kept, tmp_path):
    assert "gouge" in bonecam.post(apt(tmp_path), kept / name, JOB).summary


def test_a_kept_mesh_that_was_changed_is_a_mesh_of_its_own(kept, tmp_path):
    with (kept / "level_00.ply").open("ab") as file:
        file.write(b"\n")
    with pytest.raises(VerifyError, match="the ball enters the part"):
        bonecam.post(apt(tmp_path), kept / "level_00.ply", JOB)


def test_a_gouge_of_the_kept_surface_is_refused(kept, tmp_path):
    with pytest.raises(VerifyError, match="the ball enters the part"):
        bonecam.post(apt(tmp_path, TIPS - [0.0, 0.0, 6.0]), kept, JOB)


def test_no_part_and_no_kept_folder_are_one_line(tmp_path):
    with pytest.raises(JobError, match="no part is named"):
        bonecam.post(apt(tmp_path), job=JOB)
    with pytest.raises(FileError, match="is no folder: give the one"):
        bonecam.post(apt(tmp_path), job=JOB, keep=tmp_path / "gone")
    with pytest.raises(FileError, match=r"has no surface.tspline"):
        bonecam.post(apt(tmp_path), tmp_path, JOB)


def test_a_probing_program_is_refused(part, tmp_path):
    with pytest.raises(JobError, match=r"\[nc\] probe = True: paths that are posted again know no bar: leave it out"):
        bonecam.post(apt(tmp_path), part, JOB.with_values(nc={"probe": True}))


def test_the_job_of_the_kept_folder_is_taken_and_told(tmp_path, monkeypatch, capsys):
    keep = tmp_path / "look"
    keep.mkdir()
    (keep / "job.toml").write_text(write_job(Job().with_values(nc={"controller": "siemens-840d"})))
    (keep / "surface.tspline").write_text("")
    taken = []

    def stop(paths, *, job, keep, **_):
        taken.append((job.nc.controller, str(keep)))
        raise FileError("stopped")

    monkeypatch.setattr(posting, "post", stop)
    assert main(["post", str(keep / "program.mpf"), "-o", str(tmp_path / "new.mpf")]) == 2
    assert capsys.readouterr().out == f"job       {keep / 'job.toml'}\n"
    assert taken == [("siemens-840d", str(keep))]
