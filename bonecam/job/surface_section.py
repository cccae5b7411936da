"""The section [surface] of a job."""

from dataclasses import dataclass

from bonecam.job.parameter import JobSection, parameter


@dataclass(frozen=True)
class SurfaceJob(JobSection):
    """The fit of the T-spline to the mesh."""

    tolerance: float = parameter(
        0.08,
        "Tolerance",
        "Target of the largest two-sided deviation between surface and mesh.",
        unit="mm",
        low=0.001,
        high=5.0,
    )
    max_control_points: int = parameter(
        450, "Control points", "Largest number of control points.", low=40, high=20000
    )
    largest_deviation: float = parameter(
        0.5,
        "Largest deviation",
        "A surface that deviates more from the mesh is refused.",
        unit="mm",
        low=0.001,
        high=50.0,
    )
