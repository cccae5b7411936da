"""The sections [mesh] and [surface] of a job: the part, and the T-spline that is fitted to it."""

import math
from dataclasses import dataclass

from bonecam.job.parameter import JobSection, check, millimetres, parameter

LEAST_TOLERANCE = 0.001
"""The narrowest tolerance that may be stated, mm."""
FINEST_FIT, COARSEST_FIT = 0.02, 0.08
"""Tolerances (mm) that are found are no narrower and no wider."""


@dataclass(frozen=True)
class MeshJob(JobSection):
    """How the mesh is read, repaired and cut into rows."""

    units: str = parameter(
        "stated",
        "Units",
        "Unit of the mesh file's coordinates; stated: the one that the file or its format states, mm where none does.",
        choices=("stated", "mm", "m", "inch", "cm", "um"),
    )
    mirror: str = parameter(
        "none",
        "Mirror",
        "Mirror the part in the file's x, y or z, as for the bone of the other side.",
        choices=("none", "x", "y", "z"),
    )
    scale: float = parameter(
        1.0, "Scale", "Factor on the part's size, as 1.25 for a blank that shrinks when it is sintered.", 0.1, 10.0
    )
    script: str = parameter(
        "",
        "Script",
        "Filter script (.mlx) of MeshLab that the mesh goes through first; it ends with the part's mesh alone.",
        file=".mlx",
    )
    label: int = parameter(0, "Label", "Label of the part in a label map (NIfTI, NRRD); 0: its only one.", 0, 2**31 - 1)
    upright: bool = parameter(
        True, "Upright", "Turn the part's longest principal axis to +Z and centre the part on the Z axis."
    )
    facets: str = parameter(
        "found",
        "Facets",
        "found: facets that are coarser than half the tolerance of the surface, noise and steps of voxels are taken "
        "as samples of a smooth surface, which is fitted near their vertices; fine facets, and those of parts with "
        "true edges, are kept. smooth: it is fitted in any case. exact: facets are kept.",
        choices=("found", "smooth", "exact"),
    )
    smooth_within: float = millimetres(
        2.0,
        "Smooth within",
        "A smooth surface is drawn to vertices that it would leave farther; one farther from the facets all the same "
        "is refused.",
        0.001,
        50.0,
    )
    rows: int = parameter(48, "Rows", "Number of harmonic rows between the poles.", 6, 200)

    @property
    def changes(self) -> tuple[str, ...]:
        """What is told of a part that is filtered, mirrored or scaled; nothing of one that is taken as it is."""
        mirrored = f"mirrored in {self.mirror.upper()} of its file" if self.mirror != "none" else ""
        scaled = f"scaled by {self.scale:g}" if self.scale != 1 else ""
        scripted = f"changed by the filters of {self.script}" if self.script else ""
        return tuple(filter(None, (scripted, mirrored, scaled)))


@dataclass(frozen=True)
class SurfaceJob(JobSection):
    """The fit of the T-spline to the mesh."""

    tolerance: float = millimetres(
        0.0,
        "Tolerance",
        "Target of the largest two-sided deviation between surface and mesh; 0: twice the sagitta of the facets, from "
        "0.02 to 0.08 mm.",
        0.0,
        5.0,
    )
    max_control_points: int = parameter(1500, "Control points", "Largest number of control points.", 40, 20000)
    largest_deviation: float = millimetres(
        0.5, "Largest deviation", "A surface that deviates more from the mesh is refused.", 0.001, 50.0
    )

    def __post_init__(self) -> None:
        check(self)
        if 0 < self.tolerance < LEAST_TOLERANCE:
            bound = f"give {LEAST_TOLERANCE:g} mm or more, or 0 for twice the sagitta of the facets"
            raise self.fault("tolerance", bound)

    def tolerance_for(self, sagitta: float = math.inf) -> float:
        """The tolerance (mm) that is stated, or else twice the `sagitta` (mm) of the facets, rounded up to a um, within
        FINEST_FIT and COARSEST_FIT; the latter for what has no facets."""
        if self.tolerance:
            return self.tolerance
        twice = math.ceil(min(2000 * sagitta, 1000 * COARSEST_FIT)) / 1000
        return max(twice, FINEST_FIT)

    def tolerance_why(self, sagitta: float, tolerance: float) -> str:
        """Where the `tolerance` (mm) of a fit to facets of a `sagitta` (mm) comes from."""
        if self.tolerance:
            return "as the job states"
        if math.isinf(sagitta):
            return "the widest, since no facets came"
        if tolerance > self.tolerance_for(sagitta):
            return "the widest, since a narrower fit failed"
        bound = {FINEST_FIT: ", but no narrower", COARSEST_FIT: ", but no wider"}.get(tolerance, "")
        return f"twice the sagitta of the facets, {sagitta:.4f} mm{bound}"
