"""The interpolation of a control: between two blocks, all programmed words change linearly and together.

With tool-centre control (TCPM, RTCP) the programmed point (tip or ball centre, part frame) runs straight
while the rotary angles run linearly. Without it the five joints run linearly and the tip follows through the
forward kinematics. X, Y, Z of the programmed point are along the axes of the machine as it stands with all rotary axes
at zero.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.machine.kinematics import forward, inverse_linear, tool_axes
from bonecam.machine.machine import Machine


@dataclass(frozen=True)
class Control:
    """A machine under the interpolation of a dialect, with tool-centre control or without it.

    `radius` of the ball and `tool_length`, from the tip to the spindle nose, in mm. The ball's centre lies its radius
    above the tip, or at the height `centre_at` (mm) where it is the ball that holds the end of a bull nose. The
    program's zero is `zero_height` (mm) above that of the part's frame.
    """

    machine: Machine
    tool_centre: bool
    radius: float
    tool_length: float
    centre_at: float | None = None
    zero_height: float = 0.0

    @property
    def centre_height(self) -> float:
        """Height of the ball's centre above the tip, mm."""
        return self.radius if self.centre_at is None else self.centre_at

    @property
    def programs_centre(self) -> bool:
        """Whether X, Y, Z program the centre of the ball instead of the tip."""
        return self.tool_centre and self.machine.programmed_point == "centre"

    @property
    def zero_shift(self) -> Float[ndarray, "3"]:
        """From the zero of the part's frame to that of the program, mm, along the axes of the machine."""
        return self.machine.in_machine(np.array([[0.0, 0.0, self.zero_height]]))[0]

    def joints(self, words: Float[ndarray, "n 5"]) -> Float[ndarray, "n 5"]:
        """The joints (mm, rad) where the control stands at `words`."""
        if not self.tool_centre:
            return words + np.r_[self.zero_shift, 0.0, 0.0]
        tips, _ = self.poses(words)
        return inverse_linear(self.machine, tips, words[:, 3:], self.tool_length)

    def words(self, tips: Float[ndarray, "n 3"], angles: Float[ndarray, "n 2"]) -> Float[ndarray, "n 5"]:
        """The values of X, Y, Z (mm) and the rotary words (rad) that bring the tip to `tips` at `angles`."""
        if not self.tool_centre:
            joints = inverse_linear(self.machine, tips, angles, self.tool_length)
            return joints - np.r_[self.zero_shift, 0.0, 0.0]
        points = tips
        if self.programs_centre:
            points = tips + self.centre_height * tool_axes(self.machine, angles)
        return np.column_stack([self.machine.in_machine(points) - self.zero_shift, angles])

    def poses(self, words: Float[ndarray, "n 5"]) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
        """Tips (mm) and unit tool axes in the part's frame where the control stands at `words`."""
        if not self.tool_centre:
            return forward(self.machine, self.joints(words), self.tool_length)
        axes = tool_axes(self.machine, words[:, 3:])
        points = self.machine.in_part(words[:, :3] + self.zero_shift)
        return (points - self.centre_height * axes if self.programs_centre else points), axes

    def between(
        self, start: Float[ndarray, "n 5"], end: Float[ndarray, "n 5"], fraction: float | Float[ndarray, "n"]
    ) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
        """Tips (mm) and unit tool axes at a fraction of each move."""
        part = np.broadcast_to(np.asarray(fraction, dtype=float), (len(start),))[:, None]
        return self.poses(start + part * (end - start))
