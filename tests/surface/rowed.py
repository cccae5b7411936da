"""Random and bone-like row-structured T-splines for the surface tests."""

import numpy as np

from bonecam.surface.tmesh.rows import RowTMesh
from bonecam.surface.tspline import TSpline


def bone_like(
    rows: int = 12,
    around: int = 9,
    seed: int = 0,
    length: float = 28.0,
    radius: float = 5.0,
    spread: float = 0.2,
    poles: bool = True,
) -> TSpline:
    """A closed tube along z with its own random knots in every row, flat round the poles, weights in 1 +-
    spread."""
    rng = np.random.default_rng(seed)
    t = np.concatenate([[0.0] * 4, np.linspace(0, 1, rows - 2)[1:-1], [1.0] * 4])
    height = np.array([t[j + 1 : j + 4].mean() for j in range(rows)])
    height[1], height[-2] = height[0], height[-1]
    knots, points = [], []
    for j in range(rows):
        if poles and j in (0, rows - 1):
            knots.append(np.zeros(1))
            points.append(np.array([[0.0, 0.0, length * height[j]]]))
            continue
        row = (np.arange(around) + 0.6 * rng.random(around)) / around
        angle = 2 * np.pi * row
        r = radius * np.sin(np.pi * (0.1 + 0.8 * j / (rows - 1))) * (1 + 0.12 * np.cos(3 * angle))
        knots.append(row)
        points.append(
            np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(around, length * height[j])])
        )
    control = np.vstack(points)
    return TSpline(RowTMesh.from_rows(t, knots), control, rng.uniform(1 - spread, 1 + spread, len(control)))


def samples(n: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.random(n), rng.random(n)
