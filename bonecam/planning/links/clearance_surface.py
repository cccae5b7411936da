"""The clearance surface: the capsule at a fixed distance round the stock, on which the ball centre runs from
pass to pass."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.setup.capsule import Capsule

SEARCH_ROUNDS = 8
"""Times that the interval of an exit is divided."""
SEARCH_PARTS = 64
"""Parts that the interval of an exit is divided into each time."""


@dataclass(frozen=True, eq=False)
class ClearanceSurface:
    """The surface at distance `clearance` (mm) from the stock, with coordinates on it: the azimuth about the
    stock's axis (radians), and the arc length along the meridian from the lower pole (mm)."""

    stock: Capsule
    clearance: float

    @property
    def radius(self) -> float:
        """Radius of the capsule, mm."""
        return self.stock.radius + self.clearance

    @property
    def top(self) -> float:
        """Arc length of the upper pole, mm."""
        return 2 * self._quarter + self._span

    @property
    def _quarter(self) -> float:
        """Arc length of the quarter circle of a cap, mm."""
        return self.radius * np.pi / 2

    @property
    def _low(self) -> Float[ndarray, "3"]:
        """Centre of the lower cap."""
        return np.asarray(self.stock.start)

    @cached_property
    def _span(self) -> float:
        """Distance between the centres of the caps, mm."""
        return float(np.linalg.norm(np.asarray(self.stock.end) - self._low))

    @cached_property
    def _frame(self) -> Float[ndarray, "3 3"]:
        """Columns: two directions across the axis (azimuth 0 and a quarter turn), and the axis."""
        span = np.asarray(self.stock.end) - self._low
        axis = span / self._span if self._span > 0 else np.array([0.0, 0.0, 1.0])
        side = np.eye(3)[0] if abs(axis[0]) < 0.9 else np.eye(3)[1]
        x = side - (side @ axis) * axis
        x /= np.linalg.norm(x)
        return np.column_stack([x, np.cross(axis, x), axis])

    def exit_lengths(self, centres: Float[ndarray, "n 3"], directions: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """How far each ball goes in its direction until it leaves the inside of the surface, mm; 0 where it
        is outside."""
        low = np.zeros(len(centres))
        across = 2 * (self._span + 2 * self.radius)
        high = across + np.linalg.norm(centres - self._low, axis=1)
        rows = np.arange(len(centres))
        for _ in range(SEARCH_ROUNDS):
            reach = np.linspace(low, high, SEARCH_PARTS + 1, axis=1)[:, 1:]
            points = centres[:, None] + reach[:, :, None] * directions[:, None]
            distance = self.stock.signed_distance(points.reshape(-1, 3)).reshape(reach.shape)
            outside = distance >= self.clearance
            first = np.where(outside.any(axis=1), outside.argmax(axis=1), SEARCH_PARTS - 1)
            low = np.where(first > 0, reach[rows, first - 1], low)
            high = reach[rows, first]
        return np.where(self.stock.signed_distance(centres) >= self.clearance, 0.0, high)

    def coordinates(self, point: Float[ndarray, "3"]) -> tuple[float, float, float]:
        """Azimuth (NaN on the axis), arc length and height above the surface of a point outside the stock's
        axis."""
        local = self._frame.T @ (point - self._low)
        across = float(np.hypot(local[0], local[1]))
        up = float(local[2])
        azimuth = float(np.arctan2(local[1], local[0])) if across > 1e-9 * self.radius else np.nan
        along = float(np.clip(up, 0.0, self._span))
        above = up - np.clip(up, 0.0, self._span)
        height = float(np.hypot(across, above)) - self.radius
        arc = self._quarter + along + self.radius * float(np.arctan2(above, across))
        return azimuth, arc, height

    def frames(
        self, azimuth: Float[ndarray, " n"], arc: Float[ndarray, " n"], height: Float[ndarray, " n"]
    ) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3 3"]]:
        """Points of given coordinates, and frames whose columns are the outward normal, up the meridian, and
        round the capsule."""
        past = arc - self._quarter
        angle = (past - np.clip(past, 0.0, self._span)) / self.radius
        out = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(azimuth))])
        up = np.array([0.0, 0.0, 1.0])
        normal = np.cos(angle)[:, None] * out + np.sin(angle)[:, None] * up
        rise = np.cos(angle)[:, None] * up - np.sin(angle)[:, None] * out
        along = np.clip(past, 0.0, self._span)[:, None] * up
        local = along + (self.radius + height)[:, None] * normal
        columns = np.stack([normal, rise, np.cross(normal, rise)], axis=2)
        return self._low + local @ self._frame.T, self._frame @ columns
