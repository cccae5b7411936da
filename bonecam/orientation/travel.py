"""Travel round the stock: the ball's centre runs on a capsule about the stock, the axis leans the same way
from its normal.

A convex stock is missed by the whole tool while the axis stays close enough to the capsule's outward normal:
the plane between them separates the two. Each route is verified all the same.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.orientation.limits import AxisLimits, angles_between, polar, unit, with_polar
from bonecam.setup.stock import Capsule

ROW_STEP, ROW_TURN = 3.0, np.radians(5.0)
ROUNDS, PARTS = 8, 64


class Route:
    """The surface at distance `clearance` from the stock capsule, addressed by azimuth and arc length from
    its lower pole."""

    def __init__(self, stock: Capsule, clearance: float) -> None:
        self._low, self._radius = np.asarray(stock.start), stock.radius + clearance
        span = np.asarray(stock.end) - self._low
        self._span = float(np.linalg.norm(span))
        axis = span / self._span if self._span > 0 else np.array([0.0, 0.0, 1.0])
        side = np.eye(3)[0] if abs(axis[0]) < 0.9 else np.eye(3)[1]
        x = side - (side @ axis) * axis
        x /= np.linalg.norm(x)
        self._frame = np.column_stack([x, np.cross(axis, x), axis])
        self._quarter = self._radius * np.pi / 2
        self._stock, self._clearance = stock, clearance

    @property
    def top(self) -> float:
        """Arc length of the upper pole."""
        return 2 * self._quarter + self._span

    def exits(self, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """How far each ball goes along its axis until it leaves the surface's inside, mm (0 where it is
        outside)."""
        low, high = (
            np.zeros(len(centres)),
            2 * (self._span + 2 * self._radius) + np.linalg.norm(centres - self._low, axis=1),
        )
        rows = np.arange(len(centres))
        for _ in range(ROUNDS):
            reach = np.linspace(low, high, PARTS + 1, axis=1)[:, 1:]
            places = centres[:, None] + reach[:, :, None] * axes[:, None]
            outside = (
                self._stock.signed_distance(places.reshape(-1, 3)).reshape(reach.shape) >= self._clearance
            )
            first = np.where(outside.any(axis=1), outside.argmax(axis=1), PARTS - 1)
            low, high = np.where(first > 0, reach[rows, first - 1], low), reach[rows, first]
        return np.where(self._stock.signed_distance(centres) >= self._clearance, 0.0, high)

    def address(self, point: Float[ndarray, "3"]) -> tuple[float, float, float]:
        """Azimuth, arc length and height above the surface of a point outside."""
        local = self._frame.T @ (point - self._low)
        level, up = float(np.hypot(local[0], local[1])), float(local[2])
        azimuth = float(np.arctan2(local[1], local[0])) if level > 1e-9 * self._radius else np.nan
        above = up - np.clip(up, 0.0, self._span)
        height = float(np.hypot(level, above)) - self._radius
        return (
            azimuth,
            self._quarter
            + float(np.clip(up, 0.0, self._span))
            + self._radius * float(np.arctan2(above, level)),
            height,
        )

    def frames(
        self, azimuth: Float[ndarray, " n"], arc: Float[ndarray, " n"], height: Float[ndarray, " n"]
    ) -> tuple[ndarray, ndarray]:
        """Points (n, 3) and frames (n, 3, 3) whose columns are the outward normal, up the meridian, round the
        capsule."""
        past = arc - self._quarter
        angle = (past - np.clip(past, 0.0, self._span)) / self._radius
        out = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(azimuth))])
        up = np.array([0.0, 0.0, 1.0])
        normal = np.cos(angle)[:, None] * out + np.sin(angle)[:, None] * up
        rise = np.cos(angle)[:, None] * up - np.sin(angle)[:, None] * out
        local = np.clip(past, 0.0, self._span)[:, None] * up + (self._radius + height)[:, None] * normal
        columns = np.stack([normal, rise, np.cross(normal, rise)], axis=2)
        return self._low + local @ self._frame.T, self._frame @ columns


def travel(
    route: Route,
    first: tuple[ndarray, ndarray],
    last: tuple[ndarray, ndarray],
    limits: AxisLimits,
    *,
    rise: float = 0.0,
    way_round: bool = False,
    over_top: bool = False,
) -> tuple[Float[ndarray, "n 3"], Float[ndarray, "n 3"]]:
    """Ball centres and axes from one (centre, axis) to another, ends included; `rise` bulges out, `way_round`
    turns the long way.

    `over_top` goes by the upper pole, the axis upright there.
    """
    a, b = route.address(first[0]), route.address(last[0])
    start = 0.0 if np.isnan(a[0]) and np.isnan(b[0]) else (b[0] if np.isnan(a[0]) else a[0])
    end = start if np.isnan(b[0]) else b[0]
    turn = float(np.mod(end - start + np.pi, 2 * np.pi) - np.pi)
    if way_round:
        turn -= np.copysign(2 * np.pi, turn)
    if over_top:
        peak = (
            route.frames(np.array([start]), np.array([route.top]), np.array([rise]))[0][0],
            np.array([0.0, 0.0, 1.0]),
        )
        up = travel(route, first, peak, limits, rise=rise)
        down = travel(route, peak, last, limits, rise=rise)
        return np.vstack([up[0], down[0][1:]]), np.vstack([up[1], down[1][1:]])
    ends = route.frames(np.array([start, start + turn]), np.array([a[1], b[1]]), np.array([a[2], b[2]]))[1]
    relative = np.stack([ends[0].T @ first[1], ends[1].T @ last[1]])
    count = 65
    f = np.linspace(0, 1, count)
    azimuth, arc = start + f * turn, (1 - f) * a[1] + f * b[1]
    height = (1 - f) * a[2] + f * b[2] + rise * np.sin(np.pi * f)
    centres, frames = route.frames(azimuth, arc, height)
    axes = np.einsum(
        "nij,nj->ni", frames, unit((1 - f)[:, None] * relative[0] + f[:, None] * relative[1] + 1e-12)
    )
    axes = unit(with_polar(axes, np.clip(polar(axes), limits.smallest, limits.largest)))
    centres[[0, -1]], axes[[0, -1]] = [first[0], last[0]], [first[1], last[1]]
    return _thinned(centres, axes)


def _thinned(centres: ndarray, axes: ndarray) -> tuple[ndarray, ndarray]:
    """Drop poses while the steps since the last kept one amount to less than ROW_STEP or ROW_TURN."""
    step = (
        np.linalg.norm(np.diff(centres, axis=0), axis=1) / ROW_STEP
        + angles_between(axes[1:], axes[:-1]) / ROW_TURN
    )
    whole = np.floor(np.cumsum(step))
    kept = np.r_[0, 1 + np.flatnonzero(np.diff(whole) > 0), len(centres) - 1]
    kept = kept[np.r_[True, np.diff(kept) > 0]]
    return centres[kept], axes[kept]
