"""The surface of one label of a map: marching cubes between the voxels inside and outside, in mm and the map's space,
smoothed within half a voxel."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bonecam.errors import file_error
from bonecam.mesh.facets.voxel_steps import Unstepped, without_steps
from bonecam.mesh.files.formats.label_map import LabelMap, read_label_map
from bonecam.mesh.triangle_mesh import TriangleMesh

MOST_VOXELS = 30_000_000
"""Most voxels of the box round a label: marching cubes takes 60 bytes for each."""


@dataclass(frozen=True, eq=False)
class LabelSurface:
    """The surface of a label, as voxels have it (`steps`), and smoothed where that was asked for."""

    map: LabelMap
    label: int
    cut: bool
    steps: TriangleMesh
    smoothed: Unstepped | None

    @property
    def mesh(self) -> TriangleMesh:
        """The surface, smoothed if it was."""
        return self.smoothed.mesh.move(self.map.transform) if self.smoothed else self.steps.move(self.map.transform)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be known of it."""
        size = " x ".join(f"{pitch:.3g}" for pitch in self.map.pitch)
        how = (
            f"smoothed within {self.smoothed.largest:.3f} mm of them" if self.smoothed else "their steps kept as asked"
        )
        description = f"label {self.label}, one of {len(self.map.counts)}, voxels of {size} mm, {how}"
        cut = "the label reaches the edge of its map: the scan ends there, and the part with it"
        return (description, cut) if self.cut else (description,)


def label_surface(file: Path, label: int, *, smooth: bool) -> LabelSurface:
    """The surface of a label of a file, or of its only label for 0. FileError names what is wrong."""
    label_map = read_label_map(file)
    label = label_map.chosen(label)
    inside = label_map.labels == label
    spans = [np.flatnonzero(inside.any(axis=tuple({0, 1, 2} - {axis}))) for axis in range(3)]
    low, high = (np.array([span[end] for span in spans]) for end in (0, -1))
    if np.prod(high - low + 3) > MOST_VOXELS:
        what = f"label {label} spans {' x '.join(map(str, high - low + 1))} voxels, {MOST_VOXELS:,} are allowed"
        raise file_error(file, what, "resample the map")
    box = tuple(slice(a, b + 1) for a, b in zip(low, high))
    steps = _marched(np.pad(inside[box], 1), label_map.pitch, low - 1)
    cut = bool((low == 0).any() or (high == np.array(inside.shape) - 1).any())
    mirrored = np.linalg.det(label_map.transform[:3, :3]) < 0
    if mirrored:  # faces go round the other way in space
        steps = TriangleMesh(steps.vertices, steps.faces[:, ::-1].copy())
    return LabelSurface(label_map, label, cut, steps, without_steps(steps, label_map.pitch) if smooth else None)


def _marched(inside: np.ndarray, pitch: np.ndarray, first: np.ndarray) -> TriangleMesh:
    """The surface between voxels inside and outside, at numbers times pitch; `first` are the numbers of the first."""
    import igl

    numbers = np.indices(inside.shape[::-1]).reshape(3, -1)[::-1].T  # x is the fastest
    nodes = np.ascontiguousarray((numbers + first) * pitch)
    values = inside.transpose(2, 1, 0).ravel().astype(np.float64)
    vertices, faces = igl.marching_cubes(values, nodes, *inside.shape, 0.5)[:2]
    mesh = TriangleMesh(vertices, faces.astype(np.int32))
    return mesh if mesh.volume > 0 else TriangleMesh(vertices, faces[:, ::-1].astype(np.int32))
