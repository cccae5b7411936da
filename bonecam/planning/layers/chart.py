"""The lines that a tool comes down on the part along, by two coordinates a and b.

`FlatChart`: parallel lines; a (mm) is measured across the part, b (mm) along it: z where the lines are level.
`RoundChart`: lines that leave the Z
axis at right angles; a is the angle about it (radians), b (mm) is z. The height of a point on its line is its
distance from the plane, or from the axis, mm.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

Z = np.array([0.0, 0.0, 1.0])


@runtime_checkable
class Chart(Protocol):
    """A grid of lines, at all pairs of the coordinates `a` and `b`."""

    @property
    def a(self) -> Float[ndarray, " p"]:
        """Coordinates across, evenly spaced."""

    @property
    def b(self) -> Float[ndarray, " q"]:
        """Coordinates along, evenly spaced, mm."""

    @property
    def closed(self) -> bool:
        """Whether the last a is followed by the first."""

    def bases(self, a: Float[ndarray, " n"], b: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The points of height 0."""

    def axes(self, a: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The unit directions of the lines, away from the part."""

    def coordinates(
        self, points: Float[ndarray, "n 3"]
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
        """a, b and the height of points."""

    def reach(self, heights: Float[ndarray, " n"], radius: float) -> Float[ndarray, " n"]:
        """How far from their own line, as a difference of a, balls at these heights meet others."""


@dataclass(frozen=True, eq=False)
class FlatChart:
    """Lines parallel to the unit `axis`; the unit vectors `across`, of a, and `along`, of b, are at right angles to it
    and to one another."""

    axis: Float[ndarray, "3"]
    across: Float[ndarray, "3"]
    a: Float[ndarray, " p"]
    b: Float[ndarray, " q"]
    along: Float[ndarray, "3"] = field(default_factory=Z.copy)
    closed: bool = False

    def bases(self, a: Float[ndarray, " n"], b: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The points of height 0 on the lines (a, b)."""
        return a[:, None] * self.across + b[:, None] * self.along

    def axes(self, a: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The unit directions of the lines, away from the part."""
        return np.tile(self.axis, (len(a), 1))

    def coordinates(
        self, points: Float[ndarray, "n 3"]
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
        """a, b and the height of points."""
        return points @ self.across, points @ self.along, points @ self.axis

    def reach(self, heights: Float[ndarray, " n"], radius: float) -> Float[ndarray, " n"]:
        """How far from their own line balls at these heights meet others, mm."""
        return np.full(len(heights), radius)

    @cached_property
    def turned_over(self) -> "FlatChart":
        """This chart as seen from the other side: its lines stay, its tool axis is reversed."""
        return replace(self, axis=-self.axis)


@dataclass(frozen=True, eq=False)
class RoundChart:
    """Lines that leave the Z axis at right angles, at the angles `a` and the heights `b`."""

    a: Float[ndarray, " p"]
    b: Float[ndarray, " q"]
    closed: bool = True

    def bases(self, a: Float[ndarray, " n"], b: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The points of height 0, on the axis."""
        return b[:, None] * Z

    def axes(self, a: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
        """The unit directions of the lines, away from the axis."""
        return np.column_stack([np.cos(a), np.sin(a), np.zeros(len(a))])

    def coordinates(
        self, points: Float[ndarray, "n 3"]
    ) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"], Float[ndarray, " n"]]:
        """a, b and the height of points."""
        return np.arctan2(points[:, 1], points[:, 0]), points[:, 2], np.hypot(points[:, 0], points[:, 1])

    def reach(self, heights: Float[ndarray, " n"], radius: float) -> Float[ndarray, " n"]:
        """How far from their own line, in radians, balls at these heights meet others."""
        return np.where(heights > radius, np.arcsin(radius / np.maximum(heights, radius)), np.pi)


def windows(
    chart: Chart, a: Float[ndarray, " n"], b: Float[ndarray, " n"], heights: Float[ndarray, " n"], radius: float
) -> Int[ndarray, "n 4"]:
    """First and last line of the grid that each ball may meet, across and along."""
    across, along = chart.a[1] - chart.a[0], chart.b[1] - chart.b[0]
    wide = chart.reach(heights, radius)
    first = np.ceil((a - wide - chart.a[0]) / across).astype(np.int64)
    last = np.floor((a + wide - chart.a[0]) / across).astype(np.int64)
    if chart.closed:
        last = np.minimum(last, first + len(chart.a) - 1)
    else:
        first, last = first.clip(0), last.clip(max=len(chart.a) - 1)
    begin = np.ceil((b - radius - chart.b[0]) / along).astype(np.int64).clip(0)
    end = np.floor((b + radius - chart.b[0]) / along).astype(np.int64).clip(max=len(chart.b) - 1)
    return np.column_stack([first, last, begin, end])
