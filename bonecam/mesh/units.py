"""Units: from the file's coordinates to mm, refused where the size is no bone's. And the bone of the other side, or
larger than it is to become."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import UnitsError
from bonecam.mesh.triangle_mesh import TriangleMesh

MM_OF = {"mm": 1.0, "m": 1000.0, "inch": 25.4, "cm": 10.0, "um": 0.001}
STATED = "stated"
"""The unit that a file or its format states, mm where it states none."""
SMALLEST = 5.0
"""Least plausible diagonal of a part's bounding box, mm: that of an ear ossicle."""
LARGEST = 1000.0
"""Largest plausible diagonal of a part's bounding box, mm: twice a femur."""
AXES = ("x", "y", "z")
FLAG = "give --units {}"
"""How the command line takes a unit."""
IN_JOB = ", or mesh.units in a job"
"""How a job takes it."""


def unit_in(units: str, stated: str = "") -> str:
    """The unit of coordinates: `units`, or for STATED the one that their file states, mm where it states none."""
    return (stated or "mm") if units == STATED else units


def mm_of(units: str) -> float:
    """The mm of a unit of MM_OF, or of STATED for files that state none."""
    return MM_OF[unit_in(units)]


def to_mm(mesh: TriangleMesh, units: str, file: str = "the mesh", flag: str = FLAG, stated: str = "") -> TriangleMesh:
    """`mesh` scaled to mm from `units`, one of MM_OF or STATED; `stated` is the unit that its file states, if any.

    UnitsError where another unit than the stated one is given though that one makes a part's size, or where no size
    of a part results: it names the size and the unit that would fit, put into `flag`."""
    if units not in (STATED, *MM_OF):
        raise ValueError(f"units {units!r}: use one of {', '.join((STATED, *MM_OF))}")
    unit = unit_in(units, stated)
    size = mesh.diagonal * MM_OF[unit]
    if stated and unit != stated and SMALLEST <= mesh.diagonal * MM_OF[stated] <= LARGEST:
        raise UnitsError(
            f"{file}: states its unit itself and was read in {stated}: leave out --units {units} (mesh.units)",
            units=units,
        )
    if not SMALLEST <= size <= LARGEST:
        raise UnitsError(
            f"{file}: {size:.3g} mm from corner to corner if its unit is {unit}: {_remedy(mesh.diagonal, flag)}",
            size_mm=size,
        )
    return TriangleMesh(mesh.vertices * MM_OF[unit], mesh.faces)


def _remedy(diagonal: float, flag: str) -> str:
    """Which units make the diagonal plausible, as a question, and their flags."""
    fitting = [(unit, diagonal * scale) for unit, scale in MM_OF.items() if SMALLEST <= diagonal * scale <= LARGEST]
    if not fitting:
        return f"no known unit makes it a part of {SMALLEST:g} to {LARGEST:g} mm; scale the mesh first"
    first, *others = (f"{flag.format(unit)} ({size:.3g} mm)" for unit, size in fitting)
    message = " or ".join([first, *(other.removeprefix("give ") for other in others)])
    asked = ", ".join(f"in {unit}" for unit, _ in fitting)
    return f"is it {asked}, or wrongly scaled? {message}{IN_JOB if flag == FLAG else ''}"


def mirror_and_scale(mesh: TriangleMesh, mirror: str = "none", scale: float = 1.0) -> TriangleMesh:
    """The mesh mirrored in one of AXES, about the plane where it is 0, and scaled about the origin.

    Faces of a mirrored mesh go round the other way, so that they face outward as before. A mesh that stays as it is
    comes back itself.
    """
    if mirror == "none" and scale == 1:
        return mesh
    faces = mesh.faces if mirror == "none" else mesh.faces[:, ::-1]
    return TriangleMesh(mesh.vertices * (signs_of(mirror) * scale), faces)


def signs_of(mirror: str) -> Float[ndarray, "3"]:
    """The factors on x, y and z of a mirror image."""
    return np.where([axis == mirror for axis in AXES], -1.0, 1.0)
