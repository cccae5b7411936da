"""Where the iso-parametric lines of a zig-zag lie: the next line at the smallest step found on this one.

With the feed along one parameter, the distance to a neighbouring line across the feed grows by sqrt(EG - F^2)
/ sqrt(E) per unit of t (feed along s), which is Eqs. 13-14 of Gan et al. (2014) solved for the distance;
divided by the exact side step of the section across the feed and integrated, it counts passes. No place of a
line is more than one pass from the next line.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import dots
from bonecam.errors import ToolPathError
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.scallop import side_step

FEED_SAMPLES, ACROSS_SAMPLES = 96, 600
FULLNESS = 0.97
"""Part of the exact side step that is used: covers the integration on the sample grid."""
TURN = np.pi
"""A cell of the grid turns by no more: at a crease the curvature of one point is not that of its whole
cell."""
MOST_LINES = 20000
CELLS = 16
"""Cells of the grid that are looked at for the next line at first."""
POLE = 1e-5
"""Parameter distance from a pole at which its limits are taken."""


def line_positions(surface: TSpline, direction: str, radius: float, scallop: float) -> Float[ndarray, " k"]:
    """Increasing t of the rings (`around`) or s of the pole-to-pole lines (`along`).

    The first and last ring lie within half a side step of their pole, so that the pole itself is cut.
    """
    across, counts = _pass_counts(surface, direction, radius, scallop)
    if direction == "around":
        return _evened(lambda full: _rings(across, counts, full))
    return _evened(lambda full: _meridians(across, counts, full))


def _pass_counts(surface: TSpline, direction: str, radius: float, scallop: float) -> tuple[ndarray, ndarray]:
    """The across parameter (a,), and passes counted from its start (f, a) at f places along the feed."""
    low, high = surface.domain[1]
    edge = POLE * (high - low)
    t_count = ACROSS_SAMPLES if direction == "around" else FEED_SAMPLES
    s_count = FEED_SAMPLES if direction == "around" else ACROSS_SAMPLES
    s, t = np.linspace(0, 1, s_count), np.linspace(low + edge, high - edge, t_count)
    grid_s, grid_t = (v.ravel() for v in np.meshgrid(s, t, indexing="ij"))
    height, curvature = across_feed(surface, direction, grid_s, grid_t)
    cell = np.maximum(height, np.finfo(float).eps) * (
        (high - low) / t_count if direction == "around" else 1 / s_count
    )
    reach = np.where(1 + curvature * radius > 0.05, np.minimum(curvature, TURN / cell), 0.0)
    rate = (height / side_step(radius, scallop, reach)).reshape(s_count, t_count)
    if direction == "along":
        rate, across = rate.T, s
    else:
        across = np.linspace(low, high, t_count)
    passes = np.cumsum((rate[:, 1:] + rate[:, :-1]) / 2 * np.diff(across), axis=1)
    return across, np.column_stack([np.zeros(len(passes)), passes])


def across_feed(
    surface: TSpline, direction: str, s: Float[ndarray, " n"], t: Float[ndarray, " n"]
) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
    """Distance across the feed per unit of the other parameter (mm), and the normal curvature there (1/mm, >
    0: convex)."""
    _, Ss, St, Sss, Sst, Stt = surface.evaluate(s, t, 2)
    if direction == "along":
        Ss, St, Sss, Stt = St, Ss, Stt, Sss
    E, F = (dots(Ss, b) for b in (Ss, St))
    normal = np.cross(Ss, St) if direction == "around" else np.cross(St, Ss)
    area = np.linalg.norm(normal, axis=1)
    inverse = np.divide(1.0, area, out=np.full(len(area), np.nan), where=area > 0)
    e, f, g = (dots(a, normal) * inverse for a in (Sss, Sst, Stt))
    with np.errstate(divide="ignore", invalid="ignore"):
        height = area / np.sqrt(E)
        shear = -F / E
        curvature = -(e * shear**2 + 2 * f * shear + g) / height**2
    degenerate = ~np.isfinite(curvature)
    return np.where(degenerate, 0.0, height), np.where(degenerate, 0.0, curvature)


def _rings(across: ndarray, counts: ndarray, full: float) -> ndarray:
    """Rings half a step, then whole steps, from pole to pole."""
    lines: list[float] = []
    cell, here, step = 1, counts[:, 0], full / 2
    while (counts[:, -1] - here).max() > full / 2 or not lines:
        cell, place, here = _next(across, counts, cell, here, step)
        lines.append(place)
        _require_progress(lines)
        step = full
    return np.array(lines)


def _meridians(across: ndarray, counts: ndarray, full: float) -> ndarray:
    """Lines from s = 0 by whole steps until the seam is one step away or less."""
    cell, lines, here = 1, [0.0], counts[:, 0]
    while (counts[:, -1] - here).max() > full:
        cell, place, here = _next(across, counts, cell, here, full)
        lines.append(place)
        _require_progress(lines)
    return np.array(lines)


def _require_progress(lines: list[float]) -> None:
    if len(lines) > MOST_LINES or (len(lines) > 1 and not lines[-1] > lines[-2]):
        raise ToolPathError(
            f"passes crowd without end at parameter {lines[-1]:.6f}: smooth the level there",
            parameter=lines[-1],
        )


def _next(
    across: ndarray, counts: ndarray, start: int, here: ndarray, step: float
) -> tuple[int, float, ndarray]:
    """The cell, from `start` on, and the parameter where the fullest place has moved on by `step`, and the
    counts there."""
    last, window = len(across) - 1, CELLS
    while start + window < last and (counts[:, start + window] - here).max() < step:
        window *= 2
    # the one cell before may be where the last line lies
    moved = (counts[:, start - 1 : start + window + 1] - here[:, None]).max(axis=0)
    cell = int(np.clip(np.searchsorted(moved, step), 1, len(moved) - 1))
    ratio = np.clip((step - moved[cell - 1]) / (moved[cell] - moved[cell - 1]), 0.0, 1.0)
    cell += start - 1
    return (
        cell,
        float(across[cell - 1] + ratio * (across[cell] - across[cell - 1])),
        counts[:, cell - 1] + ratio * (counts[:, cell] - counts[:, cell - 1]),
    )


def _evened(lines_at: Callable[[float], ndarray]) -> ndarray:
    """The lines of the smallest step that needs no more of them than a full step does."""
    low, high = 0.5 * FULLNESS, FULLNESS
    best = lines_at(high)
    for _ in range(6):
        middle = (low + high) / 2
        lines = lines_at(middle)
        if len(lines) <= len(best):
            best, high = lines, middle
        else:
            low = middle
    return best
