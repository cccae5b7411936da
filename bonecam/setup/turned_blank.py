"""A blank of revolution, turned before, and what a machinist is told of it."""

from dataclasses import dataclass

from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.solids.revolution import revolve_profile, segments_around
from bonecam.mesh.triangle_mesh import TriangleMesh

CHORD = 0.02
"""Chord tolerance round the axis, mm."""


@dataclass(frozen=True, eq=False)
class TurnedBlank:
    """The body of revolution about Z of a `profile`, rows (radius, height) in mm from its lower pole to its upper
    one."""

    profile: Float[ndarray, "n 2"]

    @property
    def diameter(self) -> float:
        """mm."""
        return 2 * float(self.profile[:, 0].max())

    @property
    def mesh(self) -> TriangleMesh:
        """The closed mesh of the blank."""
        return revolve_profile(self.profile, segments_around(self.diameter / 2, CHORD))

    @property
    def text(self) -> str:
        """What is to be mounted."""
        low, high = self.profile[:, 1].min(), self.profile[:, 1].max()
        return f"blank: turned to the blades' tips, diameter {self.diameter:.2f} mm, from Z {low:.2f} to Z {high:.2f}"
