"""What is kept for a person to look at where a level fails its check."""

import resource
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from small_job import SMALL_CAPSULE
from small_parts import UPRIGHT_CAPSULE, grooved_pebble, level_of, pebble

from bonecam.cli import main
from bonecam.errors import FileError, LevelError
from bonecam.levels import StockLevel, job_levels, levels_in, morph_open
from bonecam.levels.measure import line_depths
from bonecam.mesh import read_mesh, write_mesh
from bonecam.mesh.meshlab import meshlab
from bonecam.report import kept
from bonecam.report.kept import keep_failed_level, keep_levels
from bonecam.report.page.contents import NO_LEVEL, PARTED, Contents, pack
from bonecam.runtime.own_files import OWN_FILES
from bonecam.setup import Cylinder, Schedule
from bonecam.surface import skin
from bonecam.tool import MoveKind

pytestmark = pytest.mark.whole


PATCH = Cylinder(2.0, 0.0, 3.0).mesh(0.1)


def seen(folder: Path) -> set[str]:
    """Names of the files in a kept folder but for the list of what is bonecam's."""
    return {item.name for item in folder.iterdir()} - {OWN_FILES}


def failing(*_: object, **__: object) -> None:
    raise LevelError(
        "level 7 falls 0.0500 mm behind at (1.00, 2.00, 3.00): give more",
        level=7,
        place=np.array([1.0, 2, 3]),
        patch=PATCH,
    )


def test_the_patch_of_a_failed_level_is_written_and_named(tmp_path):
    with (
        pytest.raises(LevelError, match=r"give more \(.*failed_level_07\.ply shows it\)$") as caught,
        keep_failed_level(tmp_path / "keep"),
    ):
        failing()
    assert caught.value.evidence["level"] == 7
    assert seen(tmp_path / "keep") == {"failed_level_07.ply"}
    assert np.allclose(read_mesh(caught.value.evidence["file"]).bounds, PATCH.bounds, atol=1e-6)


def test_nothing_is_written_where_nothing_is_kept_or_there_is_no_patch(tmp_path):
    with pytest.raises(LevelError, match=r"give more$"), keep_failed_level(None):
        failing()
    with pytest.raises(LevelError, match=r"^no patch$"), keep_failed_level(tmp_path / "keep"):
        raise LevelError("no patch", level=3)
    assert not list(tmp_path.iterdir())


def test_the_command_line_names_the_patch(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(job_levels, "make_levels", failing)
    monkeypatch.setattr(job_levels, "MOST_CHOICES", 1)
    part, out = tmp_path / "part.ply", tmp_path / "out"
    out.mkdir()
    write_mesh(SMALL_CAPSULE.mesh(0.05), part)
    files = [str(part), "-o", str(out / "bone.h"), "--keep", str(out / "keep")]
    job = ("surface.tolerance=0.2", "holding.diameter=3", "holding.length=60", "mechanics.refuse=false")
    assert main(["convert", *files, "-q", *(word for value in job for word in ("--set", value))]) == 2
    assert "failed_level_07.ply shows it" in capsys.readouterr().err
    assert [item.name for item in out.iterdir()] == ["keep"]


def test_levels_are_kept_with_their_pictures_before_there_is_a_path(tmp_path):
    made = levels_in(grooved_pebble(0.2), UPRIGHT_CAPSULE, Schedule((), 1.5), chord_tolerance=0.1)
    keep_levels(tmp_path / "levels", made.levels, UPRIGHT_CAPSULE)
    levels = {f"level_{level.index:02d}.ply" for level in made.levels}
    assert seen(tmp_path / "levels") == {*levels, "levels.png", "coloured.png", "depths.png"}


@pytest.mark.parametrize("closed", [False, True], ids=["sheet", "tube"])
def test_open_levels_are_kept_with_their_pictures_without_a_stock(tmp_path, closed):
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    across = (6 * np.cos(turn), 2 * np.sin(turn)) if closed else (np.linspace(0, 20, 16), np.sin(np.linspace(0, 2, 16)))
    rows = [np.column_stack([across[0], np.full(16, y), across[1]]) for y in range(20, 0, -4)]
    made = morph_open(skin(rows, 0.01, closed=closed), 1.0, Schedule((0.1,), 0.5), chord_tolerance=0.05)
    keep_levels(tmp_path / "blade", made.levels, line=0.4)
    levels = {f"level_{level.index:02d}.ply" for level in made.levels}
    assert seen(tmp_path / "blade") == {*levels, "levels.png", "coloured.png", "depths.png"}
    depths = line_depths(made.levels, None, 0.4)
    assert depths.shape[0] == made.cuts
    assert (depths.max(axis=1) <= [level.limit + 0.05 for level in made.levels[1:]]).all()
    assert depths[0].mean() > 0.05


def test_a_line_that_the_surface_has_not_is_refused_and_nothing_written(tmp_path):
    levels = [level_of(pebble(0.5 * k), k, 0.5) for k in range(3)]
    with pytest.raises(ValueError, match=r"line = 1\.5: give a parameter from 0 to 1"):
        keep_levels(tmp_path / "levels", levels, UPRIGHT_CAPSULE, line=1.5)
    assert not list(tmp_path.glob("levels/*"))


def test_kept_levels_are_coloured_on_one_scale(tmp_path):
    colours = {}
    for name, depths in (("shallow", [0.0, 0.1]), ("deep", [0.1, 0.5])):
        quality = np.linspace(*depths, len(PATCH.vertices))
        write_mesh(PATCH, tmp_path / f"{name}.ply", quality=quality, largest=0.5)
        meshset = meshlab().MeshSet()
        meshset.load_new_mesh(str(tmp_path / f"{name}.ply"))
        found = meshset.current_mesh()
        assert np.allclose(found.vertex_scalar_array(), quality, atol=1e-6)
        colours[name] = found.vertex_color_matrix()
    assert np.allclose(colours["shallow"][-1], colours["deep"][0], atol=0.02)
    assert np.abs(colours["shallow"][0] - colours["deep"][-1]).max() > 0.5


def test_levels_of_an_earlier_run_go_and_what_is_another_s_stays(tmp_path):
    folder, levels = tmp_path / "levels", [level_of(pebble(0.5 * k), k, 0.5) for k in range(4)]
    levels[-1] = StockLevel(3, levels[-1].mesh, 0.5, levels[-1].measures)
    keep_levels(folder, levels, UPRIGHT_CAPSULE)
    mine = {"level_notes.ply", "level_09.stl", "level_104.ply", "failed_level_03.ply"}
    for name in mine:
        (folder / name).write_text("mine")
    levels[2:] = [StockLevel(2, levels[2].mesh, 0.5, levels[2].measures)]
    keep_levels(folder, levels, UPRIGHT_CAPSULE)
    pictures = {"levels.png", "coloured.png", "depths.png"}
    assert seen(folder) == {*mine, *pictures, "level_00.ply", "level_01.ply", "level_02.ply"}
    assert (folder / "failed_level_03.ply").read_text() == "mine"


def test_a_level_that_a_person_has_changed_stays(tmp_path):
    levels = [level_of(pebble(0.5 * k), k, 0.5) for k in range(2)]
    keep_levels(tmp_path, [*levels, StockLevel(2, levels[1].mesh, 0.5, levels[1].measures)], UPRIGHT_CAPSULE)
    (tmp_path / "level_02.ply").write_text("mine")
    keep_levels(tmp_path, [levels[0], StockLevel(1, levels[1].mesh, 0.5, levels[1].measures)], UPRIGHT_CAPSULE)
    assert (tmp_path / "level_02.ply").read_text() == "mine"


def test_the_patch_of_an_earlier_run_goes(tmp_path):
    for number in (3, 7):
        with pytest.raises(LevelError, match=f"failed_level_0{number}"), keep_failed_level(tmp_path):
            raise LevelError("level fails", level=number, patch=PATCH)
    assert seen(tmp_path) == {"failed_level_07.ply"}


def test_a_patch_that_cannot_be_written_hides_no_error(tmp_path):
    (tmp_path / "keep").touch()
    with (
        pytest.raises(LevelError, match=r"give more \(.*keep: is a file: name a folder\)$"),
        keep_failed_level(tmp_path / "keep"),
    ):
        failing()


@pytest.mark.parametrize("room", [0, 500, 5000, 60000])
def test_a_disk_that_is_full_leaves_the_folder_as_it_was(room, tmp_path):
    levels = [level_of(pebble(0.5 * k), k, 0.5) for k in range(2)]
    levels[-1] = StockLevel(1, levels[-1].mesh, 0.5, levels[-1].measures)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        with pytest.raises(FileError, match="make room there") as caught:
            keep_levels(tmp_path / "keep", levels, UPRIGHT_CAPSULE)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert str(tmp_path / "keep") in str(caught.value)
    assert ".part" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_the_picture_of_engagement_shows_levels_and_no_parting(monkeypatch, tmp_path):
    moves = {name: np.zeros((4, 3)) for name in ("move_contact", "move_tip", "move_axis")}
    moves |= {"move_section": np.ones(4), "move_tool": np.ones(4, int), "move_kind": np.full(4, MoveKind.CUT)}
    moves["move_level"] = np.array([1, 0, NO_LEVEL, PARTED])
    view = pack(Contents({"tools": [{"number": 1, "radius": 2.0}]}, moves))
    made = SimpleNamespace(packed_view=view, levels=SimpleNamespace(levels=[]))
    drawn = []
    monkeypatch.setattr(kept, "draw_engagement", lambda *given, **named: drawn.extend(given[1][named["cuts"]]))
    kept._draw_engagement(made, tmp_path / "engagement.png")
    assert drawn == [1, 0]
