"""T-splines structured in rows, made of random numbers, and files of rows."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy import ndarray

from bonecam.surface import OpenRowTMesh, RowTMesh, TSpline, fit, skin


def bone_like(
    rows: int = 12,
    around: int = 9,
    seed: int = 0,
    length: float = 28.0,
    radius: float = 5.0,
    spread: float = 0.2,
    poles: bool = True,
) -> TSpline:
    """Makes a closed tube along z with its own random knots in every row, flat round the poles, weights in
    1 +- spread."""
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
        points.append(np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(around, length * height[j])]))
    control = np.vstack(points)
    return TSpline(RowTMesh.from_rows(t, knots), control, rng.uniform(1 - spread, 1 + spread, len(control)))


def samples(n: int, seed: int = 1) -> tuple[ndarray, ndarray]:
    """Makes random parameters in the unit square."""
    rng = np.random.default_rng(seed)
    return rng.random(n), rng.random(n)


SECTION_POLES = np.array([[0.0, 0.0, -9.0], [0.0, 0.0, 9.0]])
"""The lower and the upper end of the ellipsoid of `sections`."""


def sections(count: int = 9, points: int = 24) -> list[ndarray]:
    """Makes sections of an ellipsoid of half axes 4, 3, 9 from below, counter-clockwise seen from above, each
    with its own number of points."""
    found = []
    for j, height in enumerate(np.cos(np.linspace(np.pi, 0, count + 2))[1:-1]):
        angle = 2 * np.pi * np.arange(points + j % 3) / (points + j % 3)
        r = np.sqrt(1 - height**2)
        found.append(np.column_stack([4 * r * np.cos(angle), 3 * r * np.sin(angle), np.full(len(angle), 9 * height)]))
    return found


def write_rows(blocks: Sequence[ndarray], path: Path) -> Path:
    """Writes rows of points to a text file, an empty line between rows."""
    path.write_text(
        "\n\n".join("\n".join(",".join(map(repr, point)) for point in block.tolist()) for block in blocks) + "\n"
    )
    return path


def open_rows(seed: int) -> TSpline[OpenRowTMesh]:
    """Six open rows with random knots, one of them twice, and random weights."""
    rng = np.random.default_rng(seed)
    inner = [np.sort(np.append(rng.uniform(0.1, 0.9, j % 3), [0.5] * (j // 2))) for j in range(6)]
    t = np.concatenate([np.zeros(4), [0.3, 0.6], np.ones(4)])
    rows = OpenRowTMesh.from_rows(t, [np.concatenate([np.zeros(4), k, np.ones(4)]) for k in inner])
    return TSpline(rows, rng.standard_normal((rows.size, 3)), rng.uniform(0.8, 1.2, rows.size))


def rows_apart_by_rounding() -> TSpline:
    """Rows with knots that differ by rounding only."""
    surface = bone_like(9, 6, 3)
    rows = [row.copy() for row in surface.tmesh.s_knots]
    rows[3][2], rows[4][2] = rows[5][2] + 1e-16, rows[5][2] - 1e-16
    rows[3][-1], rows[4][0] = 1 - 2e-16, 0.0
    return TSpline(type(surface.tmesh).from_rows(surface.tmesh.t_knots, rows), surface.control_points, surface.weights)


def own_surfaces() -> dict[str, TSpline]:
    """What bonecam makes: fitted (levels keep its T-mesh), skinned closed, with and without poles, and
    open."""
    fitted = fit(bone_like(8, 8).tessellate(0.3), 0.3).surface
    angle = 2 * np.pi * np.arange(40) / 40
    rings = [
        np.column_stack([(2 + z % 3) * np.cos(angle), 3 * np.sin(angle) + z, np.full(40, float(z))])
        for z in range(1, 8)
    ]
    poles = np.array([[0.0, 0, 0], [0, 8, 8]])
    skinned = skin(rings, 0.01, poles=poles), skin(rings, 0.01), skin(rings, 0.01, closed=False)
    return dict(zip(("fitted", "poles", "tube", "sheet"), (fitted, *skinned)))


def assert_unchanged_by_refinement(name: str, surface: TSpline, count: Callable[[TSpline], int]) -> None:
    """Asserts that a surface over the unit square stays what it is, while what `count` counts grows each time."""
    s, t = np.random.default_rng(1).random((2, 1000))
    expected, size = surface.evaluate(s, t), np.ptp(surface.control_points, axis=0).max()
    for seed, order in enumerate((("st", "s"), ("t", "st"))):
        finer = surface
        for k, directions in enumerate(order):
            coarse, finer = finer, finer.refine(*np.random.default_rng(10 * seed + k).random((2, 1)), directions)
            assert count(finer) > count(coarse), name
        np.testing.assert_allclose(finer.evaluate(s, t), expected, atol=1e-13 * size, err_msg=name)
