"""One label of a segmented scan becomes a mesh within half a voxel of its voxels; a label that is none is one line."""

import sys
from pathlib import Path

import mesh_bodies
import numpy as np
import pytest

from bonecam.errors import FileError, UnitsError
from bonecam.job import MeshJob
from bonecam.mesh import MeshDistance, TriangleMesh, prepare_part, read_mesh
from bonecam.mesh.smooth_surface import label_surface, step_pitch, without_steps

SimpleITK = pytest.importorskip("SimpleITK", reason="the extra `ct` is not installed")
PITCH = np.array([0.3, 0.3, 0.5])
MIDDLE = np.array([4.0, 5.0, 6.0])
HALF_AXES = np.array([2.0, 2.5, 4.0])


def numbers(pitch: np.ndarray = PITCH) -> np.ndarray:
    """The places (a, b, c, 3) of a map's voxels before they are turned into space."""
    shape = np.ceil(2 * MIDDLE / pitch).astype(int)
    return np.moveaxis(np.indices(shape), 0, -1) * pitch


def ellipsoid(places: np.ndarray) -> np.ndarray:
    return np.linalg.norm((places - MIDDLE) / HALF_AXES, axis=-1) < 1


def write(file: Path, labels: np.ndarray, pitch: np.ndarray = PITCH, turn: np.ndarray | None = None) -> Path:
    image = SimpleITK.GetImageFromArray(labels.transpose(2, 1, 0))
    image.SetSpacing(pitch.tolist())
    image.SetDirection((np.eye(3) if turn is None else turn).ravel().tolist())
    image.SetOrigin((10.0, -20.0, 30.0))
    SimpleITK.WriteImage(image, str(file), True)
    return file


@pytest.fixture
def hand(tmp_path):
    """A map with an ellipsoid as label 3 and a speck as label 9."""
    labels = np.where(ellipsoid(numbers()), 3, 0).astype(np.uint8)
    labels[1, 1, 1] = 9
    return write(tmp_path / "hand.nii.gz", labels)


TURNS = {
    "as it is": np.eye(3),
    "oblique": np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1.0]]),
    "mirrored": np.diag([1.0, 1.0, -1.0]),
}


@pytest.mark.parametrize("ending", [".nii", ".nii.gz", ".nrrd"])
@pytest.mark.parametrize("turn", TURNS)
def test_a_label_lies_where_its_map_says_within_half_a_voxel(turn, ending, tmp_path):
    labels = ellipsoid(numbers()).astype(np.uint8)
    found = label_surface(write(tmp_path / f"a{ending}", labels, turn=TURNS[turn]), 0, smooth=True)
    mesh, pose = found.mesh, TURNS[turn]
    back = (mesh.vertices - [10.0, -20.0, 30.0]) @ pose
    assert np.abs(np.linalg.norm((back - MIDDLE) / HALF_AXES, axis=1) - 1).max() < 0.12
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * HALF_AXES.prod(), rel=0.02)
    assert found.smoothed is not None
    steps = found.steps.move(found.map.transform)
    apart = max(MeshDistance(one).unsigned(other.vertices).max() for one, other in ((mesh, steps), (steps, mesh)))
    assert apart <= found.smoothed[1] <= PITCH.max() / 2 + 1e-6


def test_the_part_tells_label_voxels_and_the_largest_deviation(hand):
    part = prepare_part(hand, MeshJob(label=3))
    (told,) = [note for note in part.notes if "label" in note]
    assert told.startswith("label 3, one of 2, voxels of 0.3 x 0.3 x 0.5 mm, smoothed within 0.")
    assert part.smoothing is None
    kept = prepare_part(hand, MeshJob(label=3, facets="exact"))
    assert "their steps kept as asked" in kept.notes[0]
    turns = [np.abs(np.einsum("ij,ij->i", *_neighbours(one.given))).mean() for one in (part, kept)]
    assert turns[0] > turns[1] + 0.03  # normals of neighbours, side by side and in steps


def _neighbours(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray]:
    from bonecam.arrays import unit
    from bonecam.mesh.solids import neighbours_of

    normals = unit(mesh.face_vectors)
    return normals, normals[neighbours_of(mesh)[:, 0]]


def test_a_label_at_the_edge_of_its_map_is_told(tmp_path):
    labels = ellipsoid(numbers()).astype(np.uint8)[:, :, :14]
    found = label_surface(write(tmp_path / "cut.nrrd", labels), 0, smooth=True)
    assert "the label reaches the edge of its map" in found.notes[1]
    assert found.mesh.volume > 0


@pytest.mark.parametrize(
    ("label", "told"),
    [
        (7, r"hand\.nii\.gz: label 7 is not in the map, which has 3 \(\d+ voxels\), 9 \(1 voxels\): set mesh\.label"),
        (0, r"hand\.nii\.gz: holds the labels 3 \(\d+ voxels\), 9 \(1 voxels\): set mesh\.label to that of the part"),
    ],
)
def test_a_label_that_is_not_there_is_one_line(label, told, hand):
    with pytest.raises(FileError, match=told):
        prepare_part(hand, MeshJob(label=label))


@pytest.mark.parametrize(
    ("name", "values", "told"),
    [
        ("empty.nrrd", np.zeros((4, 4, 4), np.uint8), "no label but 0: segment the bone first"),
        ("scan.nrrd", np.arange(2000, dtype=np.int16).reshape(10, 10, 20), "1999 different values: give the segm"),
        ("parts.nii", np.full((4, 4, 4), 0.5, np.float32), "no whole numbers: give the segmentation"),
        ("flat.nrrd", np.zeros((4, 4), np.uint8), "is no map of one number a voxel"),
    ],
)
def test_what_is_no_label_map_is_one_line(name, values, told, tmp_path):
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(values), str(tmp_path / name))
    with pytest.raises(FileError, match=told) as caught:
        prepare_part(tmp_path / name, MeshJob())
    assert "\n" not in str(caught.value)


def test_a_damaged_map_a_unit_and_a_missing_library_are_one_line(hand, tmp_path, monkeypatch):
    with pytest.raises(UnitsError, match="states its unit itself"):
        prepare_part(hand, MeshJob(label=3, units="m"))
    (tmp_path / "bad.nrrd").write_text("NRRD0004\nbad")
    with pytest.raises(FileError, match=r"bad\.nrrd: cannot be read \(.*\): write it anew") as caught:
        prepare_part(tmp_path / "bad.nrrd", MeshJob())
    assert "\n" not in str(caught.value)
    monkeypatch.setitem(sys.modules, "SimpleITK", None)
    with pytest.raises(FileError, match=r"needs SimpleITK: pip install 'bonecam\[ct\]'"):
        prepare_part(hand, MeshJob(label=3))


@pytest.mark.parametrize("pitch", [(0.3, 0.3, 0.3), (0.3, 0.4, 0.6), (0.25, 0.25, 1.0)])
def test_the_pitch_of_steps_is_measured(pitch, tmp_path):
    size = np.array(pitch)
    file = write(tmp_path / "a.nrrd", ellipsoid(numbers(size)).astype(np.uint8), size)
    steps = label_surface(file, 0, smooth=False).steps
    assert step_pitch(steps) == pytest.approx(pitch, rel=1e-6)
    smooth, _ = without_steps(steps, size)
    assert step_pitch(smooth) is None
    assert (np.abs(smooth.vertices - steps.vertices) <= size / 2 + 1e-9).all()


def test_a_mesh_of_no_voxels_has_no_pitch():
    assert step_pitch(mesh_bodies.ellipsoid(5.0, 4.0, 3.0)) is None


def test_a_mesh_with_steps_is_smoothed_within_half_a_pitch_and_says_so(tmp_path):
    size = np.array([0.4, 0.4, 0.4])
    file = write(tmp_path / "a.nrrd", ellipsoid(numbers(size)).astype(np.uint8), size)
    steps = label_surface(file, 0, smooth=False).steps
    part = prepare_part(steps, MeshJob())
    assert part.smoothing is not None
    assert "steps of voxels (every 0.4 x 0.4 x 0.4 mm)" in part.repairs[0].change
    assert part.coarseness is not None
    assert part.coarseness.report["pitch_mm"] == [0.4, 0.4, 0.4]
    kept = prepare_part(steps, MeshJob(facets="exact"))
    assert any("facets kept as asked" in note and "every 0.4" in note for note in kept.notes)


def test_a_label_map_is_no_file_of_read_mesh(hand):
    with pytest.raises(FileError, match="unknown ending"):
        read_mesh(hand)
