"""T-splines over general T-meshes, made of random numbers, and files of them."""

from pathlib import Path

import numpy as np
from bonecam_plugins.tsplines import TMesh
from numpy import ndarray

from bonecam.surface import TSpline


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
