"""Parts that come as a surface or from a CAD system, as far as the T-spline in the program's frame."""

from pathlib import Path

import numpy as np
import pytest
from bonecam_plugins.meshlab import MeshSet
from small_parts import pebble

import bonecam
from bonecam.errors import FileError, JobError, MeshError, SurfaceError
from bonecam.job import Job
from bonecam.setup import place
from bonecam.surface import TSpline, save_surface
from bonecam.surface.files.surface_input import read_part
from bonecam.surface.part_surface import fit_surface

JOB = Job()


def rows_of(surface: TSpline, turn: np.ndarray, path: Path) -> Path:
    """Sections of a body as a rows file, turned."""
    angle = np.arange(20) / 20
    blocks = [
        surface.evaluate(angle[: 1 if t in (0, 1) else None], np.full(1 if t in (0, 1) else 20, t)) @ turn.T
        for t in np.linspace(0, 1, 10)
    ]
    path.write_text("\n\n".join("\n".join(" ".join(map(repr, point)) for point in block.tolist()) for block in blocks))
    return path


@pytest.mark.parametrize(
    "turn",
    [np.eye(3), np.diag([1.0, -1.0, -1.0]), np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])],
    ids=["as is", "upside down", "lying"],
)
def test_rows_are_skinned_and_stand_where_their_mesh_stands(turn, tmp_path):
    body = pebble()
    part, given = read_part(rows_of(body, turn, tmp_path / "rows.xyz"), JOB)
    setup = place(part, JOB)
    fitted = fit_surface(setup.part, JOB, given=given)
    assert fitted.surface.volume == pytest.approx(body.volume, rel=0.02)
    assert fitted.surface.project(setup.part.mesh.vertices).distances.max() < 0.02
    lower, upper = fitted.surface.evaluate(np.zeros(2), np.array([0.0, 1.0]))
    assert lower[2] < upper[2]
    assert abs(setup.stock.signed_distance(fitted.surface.control_points)).min() > 0


def test_a_saved_surface_is_a_part_again(tmp_path):
    body = pebble()
    save_surface(body, tmp_path / "body.tspline")
    part, given = read_part(tmp_path / "body.tspline", JOB)
    surface = fit_surface(place(part, JOB).part, JOB, given=given).surface
    assert surface.tmesh.size == body.tmesh.size
    assert surface.volume == pytest.approx(body.volume, rel=1e-12)


@pytest.mark.parametrize("name", ["body.step", "body.igs"])
def test_a_cad_part_is_fitted_like_a_mesh(name, tmp_path):
    pytest.importorskip("OCP", reason="OpenCASCADE's wheel is not installed: pip install 'bonecam[cad]'")
    body = pebble()
    save_surface(body, tmp_path / name)
    part, given = read_part(tmp_path / name, JOB)
    assert given is None
    assert part.repairs == ()
    assert part.mesh.volume == pytest.approx(body.volume, rel=5e-3)


def test_rows_that_make_no_part_are_refused(tmp_path):
    file = rows_of(pebble(), np.eye(3), tmp_path / "rows.xyz")
    blocks = file.read_text().split("\n\n")
    (tmp_path / "open.xyz").write_text("\n\n".join(blocks[1:-1]))
    with pytest.raises(SurfaceError, match=r"open\.xyz: encloses no part"):
        read_part(tmp_path / "open.xyz", JOB)
    (tmp_path / "crossing.xyz").write_text("\n\n".join([*blocks[:3], blocks[6], *blocks[3:]]))
    with pytest.raises(MeshError, match=r"crossing\.xyz: its surface cuts"):
        read_part(tmp_path / "crossing.xyz", JOB)
    with pytest.raises(FileError, match=r"none\.csv: cannot be read"):
        read_part(tmp_path / "none.csv", JOB)


@pytest.mark.parametrize(("field", "value"), [("mirror", "x"), ("scale", 1.25)])
def test_a_surface_is_not_mirrored_or_scaled_in_silence(tmp_path, field, value):
    file = rows_of(pebble(), np.eye(3), tmp_path / "rows.xyz")
    job = JOB.with_values(mesh={field: value})
    for machine in (read_part, bonecam.finish):
        with pytest.raises(JobError, match=rf"\[mesh\] {field} = .*{value}.*: only meshes are: leave it out"):
            machine(file, job=job)


@pytest.mark.parametrize("name", ["body.step", "body.iges", "body.tspline"])
def test_the_save_filter_writes_what_the_ending_says(name, tmp_path):
    if name != "body.tspline":
        pytest.importorskip("OCP", reason="OpenCASCADE's wheel is not installed: pip install 'bonecam[cad]'")
    body, meshes = pebble(), MeshSet(folder=tmp_path)
    meshes.layers.add(body.tessellate(0.1), "surface", keep={"surface": body})
    assert meshes.apply_filter("save_tspline_surface", file=name) == {"file": str(tmp_path / name)}
    save_surface(body, tmp_path / f"same_{name}")
    assert (tmp_path / name).read_bytes() == (tmp_path / f"same_{name}").read_bytes()
