"""Label maps of segmented scans, NIfTI and NRRD, by SimpleITK (extra `ct`): whole numbers on a grid of voxels.

Coordinates are those of ITK: mm, +X to the patient's left, +Y to the back, +Z to the head (LPS). NIfTI's own are RAS,
half a turn about Z from it. What ITK does not tell is read from the header: the units of an NRRD, how far axes of
voxels are from square, and how many voxels there are.
"""

import gzip
import re
import struct
import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from bonecam.errors import file_error
from bonecam.files import input_bytes

LABEL_MAPS = (".nii", ".nii.gz", ".nrrd")
"""Endings of label maps."""
MOST_LABELS = 1000
"""A map with more labels is the scan itself."""
UNITS = {"mm": 1.0, "um": 0.001, "\N{MICRO SIGN}m": 0.001, "micron": 0.001, "cm": 10.0, "m": 1000.0}
"""The mm of units that an NRRD may state."""
MOST_SKEW = 1e-3
"""Most angle of axes of voxels from perpendicular, radians: 0.05 mm in a bone of 50 mm."""
MOST_OFF = 1e-3
"""Largest difference between a NIfTI's two sizes of a voxel, share of it: the same."""
NUMBERS = (2, 4, 8, 16, 64, 256, 512, 768, 1024, 1280)
"""The types of a NIfTI's voxels that are one number each."""
NIFTI_1, NIFTI_2 = 348, 540
"""Bytes of the headers of NIfTI-1 and 2, which begin with these numbers."""
SHOWN = 12
"""So many labels a message lists."""


@dataclass(frozen=True, eq=False)
class LabelMap:
    """Labels at the middles of voxels, by the voxel's three numbers; `pitch` and the transform (4, 4) from numbers
    times pitch to space, a turn or a mirror image with a shift. Lengths are in mm, of a map without a `unit` in its
    own."""

    file: Path
    labels: Int64[ndarray, "a b c"]
    pitch: Float[ndarray, "3"]
    transform: Float[ndarray, "4 4"]
    unit: str

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


@dataclass(frozen=True, eq=False)
class _Header:
    """What a file's header says: the directions of the axes of voxels (3, 3), a row each, or none; the unit after
    scaling by `mm`, empty where none is stated; bytes of voxels in the file, or words of a text; how many a voxel has
    there, 0 where as many as in memory."""

    axes: Float[ndarray, "n 3"]
    unit: str
    mm: float
    size: int
    width: int


def _header(file: Path) -> _Header:
    """The header of a NIfTI-1 or NRRD file; FileError where the file cannot be read or states a unit that is none."""
    try:
        data = input_bytes(file)
        data = gzip.decompress(data) if file.suffix.lower() == ".gz" else data
        return _nrrd_header(file, data) if file.suffix.lower() == ".nrrd" else _nifti_header(file, data)
    except (OSError, EOFError, zlib.error) as error:
        raise file_error(file, f"cannot be read ({error})", "write it anew from its source") from error


def _nrrd_header(file: Path, data: bytes) -> _Header:
    text, voxels = [*re.split(rb"\r?\n\r?\n", data, maxsplit=1), b""][:2]
    lines = text.decode(errors="replace").lower()
    fields = dict(re.findall(r"^([^:#\n]+):(?!=) *(.*?)\s*$", lines, re.MULTILINE))
    if {"data file", "datafile"} & fields.keys():
        raise file_error(file, "keeps its voxels in another file", "save it as one NRRD")
    if "left-handed" in fields.get("space", ""):
        raise file_error(file, "states left-handed axes, whose mirror image would be read", "save it in LPS or RAS")
    units = set(re.findall(r'"([^"]+)"', fields.get("space units", "") + fields.get("units", "")))
    if len(units) > 1 or units - set(UNITS):
        what = f"states the units {', '.join(sorted(units))}"
        raise file_error(file, what, f"write it in one of {', '.join(UNITS)}")
    rows = [row.split(",") for row in re.findall(r"\(([^)]*)\)", fields.get("space directions", ""))]
    spacings = fields.get("spacings", "")
    if fields and not rows and (not spacings or "nan" in spacings):
        what = "does not state how far apart its voxels are along every axis"
        raise file_error(file, what, "state it (space directions or spacings)")
    try:
        axes = np.array(rows, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        axes = np.empty((0, 3))  # no axes in space; ITK says what is wrong
    scale = UNITS[units.pop()] if units else 0.0
    encoding = fields.get("encoding", "")
    content = gzip.decompress(voxels) if encoding in ("gz", "gzip") else voxels
    words = content.split() if encoding not in ("raw", "gz", "gzip") else []
    size = len(b"".join(words)) // 2 if encoding == "hex" else len(words or content)
    return _Header(axes, "mm" if scale else "", scale or 1.0, size, int(encoding in ("txt", "text", "ascii")))


def _nifti_header(file: Path, data: bytes) -> _Header:
    order = "<" if data[:4] == struct.pack("<i", NIFTI_1) else ">"
    if data[:4] in (struct.pack("<i", NIFTI_2), struct.pack(">i", NIFTI_2)):
        raise file_error(file, "is NIfTI-2, which is not read", "save it as NIfTI-1 or NRRD")
    if len(data) < NIFTI_1 or struct.unpack_from(f"{order}i", data)[0] != NIFTI_1:
        raise file_error(file, "is no NIfTI", "write it anew from its source")
    if not np.isfinite(struct.unpack_from(f"{order}9f", data, 76) + struct.unpack_from(f"{order}18f", data, 256)).all():
        raise file_error(file, "has sizes or axes of voxels that are not numbers", "write it anew from its source")
    pitch = struct.unpack_from(f"{order}3f", data, 80)
    axes = np.array(struct.unpack_from(f"{order}12f", data, 280)).reshape(3, 4)[:, :3].T
    used = struct.unpack_from(f"{order}h", data, 254)[0] > 0
    lengths = np.linalg.norm(axes, axis=1) if used else np.abs(pitch)
    if not (np.allclose(pitch, lengths, rtol=MOST_OFF) or _skew(axes) > MOST_SKEW) or min(pitch) <= 0:
        shown = (" x ".join(f"{size:.4g}" for size in sizes) for sizes in (pitch, lengths))
        what = "has voxels of {} by pixdim and {} by its transform".format(*shown)
        raise file_error(file, what, "write it anew with one transform")
    start = int(struct.unpack_from(f"{order}f", data, 108)[0])
    kind, bits = struct.unpack_from(f"{order}2h", data, 70)
    if kind not in NUMBERS or not 0 < struct.unpack_from(f"{order}h", data, 40)[0] < 8:
        raise file_error(
            file, f"has voxels of the type {kind}, or no size", "save it with whole numbers of 8 or 16 bits"
        )
    return _Header(axes if used else np.empty((0, 3)), "mm", 1.0, len(data) - start, bits // 8)


def _skew(axes: Float[ndarray, "n 3"]) -> float:
    """How far, in radians, the angle between two of the axes (a row each) is from a right one at most."""
    lengths = np.linalg.norm(axes, axis=1, keepdims=True)
    directions = axes / np.where(lengths > 0, lengths, 1.0)
    cosines = directions @ directions.T - np.eye(len(axes))
    return float(np.arcsin(np.abs(cosines).max(initial=0.0).clip(0.0, 1.0)))


def read_label_map(file: Path) -> LabelMap:
    """The label map of a file, scaled to mm where it states another unit. FileError where SimpleITK is not installed,
    the file is no label map in space, its axes are not perpendicular, or its header tells of more or fewer voxels."""
    try:
        import SimpleITK
    except ImportError as error:
        remedy = "pip install 'bonecam[ct]'"
        raise file_error(file, "reading a label map needs SimpleITK", remedy) from error
    SimpleITK.ProcessObject.SetGlobalWarningDisplay(False)
    header = _header(file)
    angle = _skew(header.axes)
    if angle > MOST_SKEW:
        what = f"its axes of voxels are {np.degrees(angle):.2f} deg from perpendicular (a tilted gantry)"
        raise file_error(file, what, "resample the map to perpendicular axes", angle_deg=float(np.degrees(angle)))
    try:
        image = SimpleITK.ReadImage(str(file))
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1].strip()[:200]
        raise file_error(file, f"cannot be read ({reason})", "write it anew from its source") from error
    if image.GetDimension() != 3 or image.GetNumberOfComponentsPerPixel() != 1:
        raise file_error(file, "is no map of one number a voxel in space", "export one label map (3D)")
    values = np.asarray(SimpleITK.GetArrayViewFromImage(image)).transpose(2, 1, 0)
    size = values.size * (header.width or values.itemsize)
    if header.size != size:
        what = f"holds {header.size} bytes of voxels, its header tells of {size}"
        raise file_error(file, what, "write it anew from its source")
    with np.errstate(invalid="ignore"):  # of values that are no numbers, which are no whole ones either
        labels = values.astype(np.int64)
    if values.dtype.kind == "f" and not (labels == values).all():
        raise file_error(file, "holds values that are no whole numbers", "give the segmentation, not the scan")
    transform = np.eye(4)
    transform[:3, :3] = np.array(image.GetDirection()).reshape(3, 3)
    transform[:3, 3] = header.mm * np.array(image.GetOrigin())
    label_map = LabelMap(file, labels, header.mm * np.array(image.GetSpacing()), transform, header.unit)
    if len(label_map.counts) > MOST_LABELS:
        what = f"holds {len(label_map.counts)} different values"
        raise file_error(file, what, "give the segmentation, not the scan")
    return label_map
