"""The in-process material of a strategy in layers: a height field on the lines that the tool comes down along."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.kernels.height_field import cut_heights, lower
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.layers.chart import Chart, FlatChart, windows
from bonecam.planning.layers.drop import drop
from bonecam.setup.stock import Stock

CELL = 0.15
"""Distance of the lines, mm."""
DEVIATION = 0.2
"""How far the material may reach out of its mesh, mm: a cell, and the slope of a wall in it."""
LEAST_AREA = 1e-9
"""Faces of less area (mm^2) are none."""


@dataclass(frozen=True, eq=False)
class HeightField:
    """Material between the heights `bottoms` and `tops` (p, q), mm, on the lines of a chart; none where equal."""

    chart: Chart
    tops: Float[ndarray, "p q"]
    bottoms: Float[ndarray, "p q"]

    @cached_property
    def _lines(self) -> tuple[Float[ndarray, "p q 3"], Float[ndarray, "p 3"]]:
        """Bases of all lines and their directions."""
        a, b = np.meshgrid(self.chart.a, self.chart.b, indexing="ij")
        bases = self.chart.bases(a.ravel(), b.ravel()).reshape(*a.shape, 3)
        return bases, self.chart.axes(self.chart.a)

    @property
    def solid(self) -> Bool[ndarray, "p q"]:
        """Which lines meet material."""
        return self.tops > self.bottoms

    def cut(
        self, a: Float[ndarray, " n"], b: Float[ndarray, " n"], heights: Float[ndarray, " n"], radius: float
    ) -> Float[ndarray, " n"]:
        """The largest height (mm) that each ball with its centre at `heights` would remove on its own."""
        centres = self.chart.bases(a, b) + heights[:, None] * self.chart.axes(a)
        depths = np.zeros(len(a))
        near = windows(self.chart, a, b, heights, radius)
        bases, axes = self._lines
        cut_heights(
            heights=self.tops,
            bottoms=self.bottoms,
            bases=bases,
            axes=axes,
            centres=centres,
            windows=near,
            radius=radius,
            cut=depths,
        )
        return depths

    def lowered(
        self, a: Float[ndarray, " n"], b: Float[ndarray, " n"], heights: Float[ndarray, " n"], radius: float
    ) -> "HeightField":
        """The material without what balls with their centres at `heights` remove."""
        centres = self.chart.bases(a, b) + heights[:, None] * self.chart.axes(a)
        tops = self.tops.copy()
        bases, axes = self._lines
        near = windows(self.chart, a, b, heights, radius)
        lower(tops, bases, axes, centres, windows=near, radius=radius)
        return replace(self, tops=np.maximum(tops, self.bottoms))

    def turned_over(self) -> "HeightField":
        """The material as it is seen from the other side; only parallel lines have one."""
        assert isinstance(self.chart, FlatChart)
        return HeightField(self.chart.turned_over, -self.bottoms, -self.tops)

    def mesh(self) -> TriangleMesh:
        """Closed faces round the cells whose corners all meet material."""
        bases, axes = self._lines
        upper = bases + self.tops[..., None] * axes[:, None]
        under = bases + self.bottoms[..., None] * axes[:, None]
        p, q = self.tops.shape
        number = np.arange(p * q).reshape(p, q)
        solid = self.solid
        ring = number
        if self.chart.closed:
            solid, ring = np.vstack([solid, solid[:1]]), np.vstack([number, number[:1]])
        cells = solid[:-1, :-1] & solid[1:, :-1] & solid[:-1, 1:] & solid[1:, 1:]
        faces = _faces(cells, ring, p * q, self.chart.closed)

        # The mesh of the vertices that faces use, its faces outward. Vertices at one place, as all lines have one on
        # the axis, are one; faces without area are left out.
        vertices = np.vstack([upper.reshape(-1, 3), under.reshape(-1, 3)])
        points, number = np.unique(vertices + 0.0, axis=0, return_inverse=True)  # -0.0 + 0.0 is 0.0
        faces = number.reshape(-1)[faces]
        a, b, c = (points[faces[:, k]] for k in range(3))
        faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > LEAST_AREA]
        used, index = np.unique(faces, return_inverse=True)
        mesh = TriangleMesh(points[used], index.reshape(faces.shape).astype(np.int32))
        return mesh if mesh.volume > 0 else TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])


def stock_field(chart: Chart, stock: Stock, top: float) -> HeightField:
    """The stock on the lines of a chart; `top` (mm) is higher than all of it."""
    a, b = (each.ravel() for each in np.meshgrid(chart.a, chart.b, indexing="ij"))
    bases = chart.bases(a, b)
    axes = chart.axes(a)
    shape = len(chart.a), len(chart.b)
    if chart.closed:
        tops = drop(bases, axes, stock.signed_distance, top, 0.0).reshape(shape)
        return HeightField(chart, tops, np.zeros(shape))
    tops = drop(bases, axes, stock.signed_distance, top, -top)
    bottoms = -drop(bases, -axes, stock.signed_distance, top, -top)
    middle = (tops + bottoms) / 2
    missed = tops <= bottoms
    return HeightField(
        chart, np.where(missed, middle, tops).reshape(shape), np.where(missed, middle, bottoms).reshape(shape)
    )


def _faces(cells: Bool[ndarray, "p q"], number: ndarray, under: int, closed: bool) -> ndarray:
    """Two triangles above and two below each solid cell, and two on each of its sides without a neighbour."""
    i, j = np.nonzero(cells)
    corners = number[i, j], number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]
    quads = [np.column_stack(corners), np.column_stack([c + under for c in corners[::-1]])]
    wide = np.pad(cells, 1)
    if closed:
        wide[[0, -1], 1:-1] = cells[[-1, 0]]
    beside = {(0, 1): wide[i + 1, j], (1, 2): wide[i + 2, j + 1], (2, 3): wide[i + 1, j + 2], (3, 0): wide[i, j + 1]}
    for (one, other), solid in beside.items():
        first, last = corners[one][~solid], corners[other][~solid]
        quads.append(np.column_stack([last, first, first + under, last + under]))
    quad = np.vstack(quads)
    return np.vstack([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])
