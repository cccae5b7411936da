"""Label maps of segmented scans, NIfTI and NRRD, by SimpleITK (extra `ct`): whole numbers on a grid of voxels.

Coordinates are those of ITK: mm, +X to the patient's left, +Y to the back, +Z to the head (LPS). NIfTI's own are RAS,
half a turn about Z from it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.errors import file_error

LABEL_MAPS = (".nii", ".nii.gz", ".nrrd")
"""Endings of label maps."""
MOST_LABELS = 1000
"""A map with more labels is the scan itself."""
SHOWN = 12
"""So many labels a message lists."""


@dataclass(frozen=True, eq=False)
class LabelMap:
    """Labels at the middles of voxels, by the voxel's three numbers; `pitch` (mm) and the transform (4, 4) from numbers
    times pitch to space, a turn or a mirror image with a shift."""

    file: Path
    labels: Int64[ndarray, "a b c"]
    pitch: Float[ndarray, "3"]
    transform: Float[ndarray, "4 4"]

    @cached_property
    def counts(self) -> dict[int, int]:
        """The number of voxels of each label but 0, the largest first."""
        values, counts = np.unique(self.labels[self.labels != 0], return_counts=True)
        order = np.argsort(-counts, kind="stable")
        return dict(zip(values[order].tolist(), counts[order].tolist()))

    def chosen(self, label: int) -> int:
        """The label, or the only one for 0. FileError where it is not in the map, or there are several."""
        listed = ", ".join(f"{value} ({count} voxels)" for value, count in list(self.counts.items())[:SHOWN])
        more = len(self.counts) - SHOWN
        listed += f" and {more} more" if more > 0 else ""
        if not self.counts:
            raise file_error(self.file, "holds no label but 0", "segment the bone first")
        if label and label not in self.counts:
            what = f"label {label} is not in the map, which has {listed}"
            raise file_error(self.file, what, "set mesh.label to one of them")
        if not label and len(self.counts) > 1:
            raise file_error(self.file, f"holds the labels {listed}", "set mesh.label to that of the part")
        return label or next(iter(self.counts))


def read_label_map(file: Path) -> LabelMap:
    """The label map of a file. FileError where SimpleITK is not installed, or the file is no label map in space."""
    try:
        import SimpleITK
    except ImportError as error:
        remedy = "pip install 'bonecam[ct]'"
        raise file_error(file, "reading a label map needs SimpleITK", remedy) from error
    SimpleITK.ProcessObject.SetGlobalWarningDisplay(False)
    try:
        image = SimpleITK.ReadImage(str(file))
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1].strip()[:200]
        raise file_error(file, f"cannot be read ({reason})", "write it anew from its source") from error
    if image.GetDimension() != 3 or image.GetNumberOfComponentsPerPixel() != 1:
        raise file_error(file, "is no map of one number a voxel in space", "export one label map (3D)")
    return _label_map(file, image, SimpleITK.GetArrayViewFromImage)


def _label_map(file: Path, image: Any, values_of: Callable[[Any], Any]) -> LabelMap:
    values = np.asarray(values_of(image)).transpose(2, 1, 0)
    labels = values.astype(np.int64)
    if values.dtype.kind == "f" and not (labels == values).all():
        raise file_error(
            file, "holds values that are no whole numbers", "give the segmentation, not the scan"
        )
    transform = np.eye(4)
    transform[:3, :3] = np.array(image.GetDirection()).reshape(3, 3)
    transform[:3, 3] = image.GetOrigin()
    label_map = LabelMap(file, labels, np.array(image.GetSpacing()), transform)
    if len(label_map.counts) > MOST_LABELS:
        what = f"holds {len(label_map.counts)} different values"
        raise file_error(file, what, "give the segmentation, not the scan")
    return label_map
