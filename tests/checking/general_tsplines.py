"""T-splines over general T-meshes, made of random numbers or of rows, and files of them.

Rows on a general T-mesh become closed lines that no edge joins, poles rows of equal control points.
"""

from pathlib import Path

import numpy as np
from bonecam_plugins.tsplines import TMesh
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface import OpenRowTMesh, TSpline
from bonecam.surface.refinement import aligned


def grid(s_lines: ndarray, t_lines: ndarray, period: tuple[float, float] = (0.0, 0.0)) -> TMesh:
    """The full grid: a vertex at every crossing. The end knots of a clamped direction come twice, of a closed
    one once and no end."""
    a, b = len(s_lines), len(t_lines)
    p, q = a - (not period[0]), b - (not period[1])
    along_s, along_t, inside = (np.ones(shape, dtype=bool) for shape in ((p, b), (a, q), (p, q)))
    return TMesh(s_lines, t_lines, np.indices((a, b)).reshape(2, -1).T, along_s, along_t, inside, period)


def tensor(seed: int, s_count: int = 4, t_count: int = 3, closed: bool = False) -> TSpline[TMesh]:
    """A patch near the unit square's graph, or a tube closed in s."""
    rng = np.random.default_rng(seed)
    inner = lambda n: np.cumsum(rng.uniform(0.3, 1.0, n))  # noqa: E731
    t = inner(t_count)
    t = np.concatenate([[0.0, 0.0], t, [t[-1] + 0.5] * 2])
    if closed:
        s = inner(s_count + 3)
        mesh = grid(s, t, (float(s[-1] - s[0] + 0.6), 0.0))
    else:
        s = inner(s_count)
        mesh = grid(np.concatenate([[0.0, 0.0], s, [s[-1] + 0.5] * 2]), t)
    x, y = mesh.s_lines[mesh.vertices[:, 0]], mesh.t_lines[mesh.vertices[:, 1]]
    angle = 2 * np.pi * x / mesh.period[0] if closed else x
    points = np.column_stack([3 * np.cos(angle), 3 * np.sin(angle), y] if closed else [x, y, np.zeros(mesh.size)])
    return TSpline(mesh, points + 0.15 * rng.standard_normal((mesh.size, 3)), rng.uniform(0.7, 1.4, mesh.size))


def inner_samples(surface: TSpline, seed: int, count: int) -> tuple[ndarray, ndarray]:
    """Makes parameters inside random elements."""
    rng = np.random.default_rng(seed)
    box = surface.elements().boxes[rng.integers(0, len(surface.elements().boxes), count)]
    u = rng.random((2, count))
    return box[:, 0] + (box[:, 1] - box[:, 0]) * u[0], box[:, 2] + (box[:, 3] - box[:, 2]) * u[1]


def random_tspline(seed: int, closed: bool = False, rounds: int = 3) -> TSpline[TMesh]:
    """Makes a T-spline with T-junctions, its control points moved after each cut."""
    rng = np.random.default_rng(seed)
    surface = tensor(seed, int(rng.integers(1, 4)), int(rng.integers(1, 4)), closed)
    for k in range(rounds):
        surface = surface.refine(*inner_samples(surface, seed + k, 1), ("s", "t", "st")[int(rng.integers(3))])
        surface = surface.with_control_points(
            surface.control_points + 0.02 * rng.standard_normal(surface.control_points.shape)
        )
    return surface


def with_damage(source: Path, folder: Path, old: str, new: str) -> Path:
    """Makes a copy of a text file with the first `old` replaced."""
    text = source.read_text()
    assert old in text
    (folder / source.name).write_text(text.replace(old, new, 1))
    return folder / source.name


def torus_text(n: int = 5, m: int = 6, units: str = "1 meters") -> str:
    """Makes a closed torus the way Fusion writes it: no 0m records, one 0g a vertex."""
    v = lambda i, j: (i % n) + n * (j % m)  # noqa: E731
    link = lambda i, j, k: 4 * v(i, j) + k  # noqa: E731  k: side of face (i, j): bottom, right, top, left
    lines = [
        "#TS0200",
        "",
        "degree 3",
        "cap-type G1CAPS",
        f"units {units}",
        "end-conditions SUBD_CREASES",
        "star-knot-rule NURCCS",
    ]
    lines += [f"f {link(i, j, 0)} 0" for j in range(m) for i in range(n)]
    horizontal, vertical = (lambda i, j: v(i, j)), (lambda i, j: n * m + v(i, j))
    lines += [f"e {link(i, j, 0)} 1" for j in range(m) for i in range(n)] + [
        f"e {link(i, j, 3)} 1" for j in range(m) for i in range(n)
    ]
    lines += [f"v {link(i, j, 0)} EAST" for j in range(m) for i in range(n)]
    for j in range(m):
        for i in range(n):
            f = v(i, j)
            corners = (v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1))
            opposite = (link(i, j - 1, 2), link(i + 1, j, 3), link(i, j + 1, 0), link(i - 1, j, 1))
            edges = (horizontal(i, j), vertical(i + 1, j), horizontal(i, j + 1), vertical(i, j))
            for k in range(4):
                lines.append(
                    f"l {4 * f + (k - 1) % 4} {4 * f + (k + 1) % 4} {opposite[k]} {corners[k]} {f} {edges[k]} 0"
                )
    a, b = 2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m
    for y in b:
        for x in a:
            r = 0.03 + 0.01 * np.cos(y)
            lines.append(f"0g {r * np.cos(x):.17g} {r * np.sin(x):.17g} {0.01 * np.sin(y):.17g} 1")
    return "\n".join([*lines, "tol 1e-05", "behavior-version 14.2.0", ""])


POLE_POINTS = 4
"""A closed row has four knots at least."""


def as_general(surface: TSpline) -> TSpline[TMesh]:
    """The row-structured surface over a general T-mesh, exactly equal to it. Raises SurfaceError where the
    t-knots are not clamped.
    """
    if isinstance(surface.tmesh, OpenRowTMesh):
        return _of_open_rows(surface)
    rows = surface.tmesh
    t = surface.tmesh.t_knots
    if not (t[:4] == t[0]).all() or not (t[-4:] == t[-1]).all():
        raise SurfaceError("the t-knots are not clamped: a general T-mesh repeats its end knots")
    closed = aligned([row if len(row) > 1 else np.arange(POLE_POINTS) / POLE_POINTS for row in rows.s_knots], 1.0)
    orders = [np.argsort(row) for row in closed]
    knots = [row[order] for row, order in zip(closed, orders)]
    lines = np.unique(np.concatenate(knots))
    place = [np.searchsorted(lines, row) for row in knots]
    vertices = np.column_stack([np.concatenate(place), np.repeat(np.arange(len(knots)), [len(row) for row in knots])])
    a, b = len(lines), len(knots)
    along_s = np.ones((a, b), dtype=bool)
    along_t = np.zeros((a, b - 1), dtype=bool)
    inside = np.ones((a, b - 1), dtype=bool)
    mesh = TMesh(lines, t[2:-2], vertices=vertices, along_s=along_s, along_t=along_t, inside=inside, period=(1.0, 0.0))
    index = np.concatenate(
        [start + order % count for order, start, count in zip(orders, rows.row_starts, np.diff(rows.row_starts))]
    )
    return TSpline(mesh, surface.control_points[index], surface.weights[index])


def _of_open_rows(surface: TSpline) -> TSpline[TMesh]:
    """Open rows: both ends of s are clamped, two lines each, and edges join the rows there."""
    rows = surface.tmesh
    knots = [row[2:-2] for row in aligned(rows.s_knots)]
    every = np.unique(np.concatenate(knots))
    lines = np.repeat(every, np.max([_times(row, every) for row in knots], axis=0))
    place = [np.searchsorted(lines, row) + np.arange(len(row)) - np.searchsorted(row, row) for row in knots]
    across = np.concatenate(place)
    vertices = np.column_stack([across, np.repeat(np.arange(len(place)), [len(p) for p in place])])
    a, b = len(lines), len(place)
    along_t = np.zeros((a, b - 1), dtype=bool)
    along_t[[0, 1, -2, -1]] = True
    along_s = np.ones((a - 1, b), dtype=bool)
    inside = np.ones((a - 1, b - 1), dtype=bool)
    return TSpline(
        TMesh(lines, rows.t_knots[2:-2], vertices=vertices, along_s=along_s, along_t=along_t, inside=inside),
        surface.control_points,
        surface.weights,
    )


def _times(row: ndarray, every: ndarray) -> ndarray:
    """How often a row has each knot."""
    return np.asarray(np.searchsorted(row, every, side="right") - np.searchsorted(row, every))
