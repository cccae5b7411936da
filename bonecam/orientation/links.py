"""Moves between passes: a short hop just above the surface where it is proven free, else out, round the stock and in again.

Out and in run along the tool's own axis; the last of the way in is at the plunge feed. Everything is verified with the whole
tool against level, material in process, post and table.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.orientation.limits import AxisLimits, angles_between, polar, with_polar
from bonecam.orientation.moves import Checker, interpolated
from bonecam.orientation.scene import Scene
from bonecam.orientation.travel import Route, travel
from bonecam.toolpath.path import Kind

HOP_LIFT, HOP_STEPS = 0.2, 6
HOP_TURN = np.radians(30.0)
STANDOFF = 1.0
"""Rapid moves end, and begin, where the ball is this far from the material in process, mm."""
LEVEL_OUT = np.radians([90.0, 70.0, 45.0])
REACH = np.array([0.0, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0, 26.0, 34.0, 45.0, 60.0, 80.0])
TRIES = (
    {"rise": 0.0},
    {"rise": 0.0, "way_round": True},
    {"rise": 5.0},
    {"rise": 0.0, "over_top": True},
    {"rise": 15.0, "over_top": True},
    {"rise": 15.0},
    {"rise": 15.0, "way_round": True},
)
VERIFY_STEPS = 4


@dataclass(frozen=True)
class Feeds:
    """mm/min: of links, of plunges, and the number given to rapid moves."""

    link: float
    plunge: float
    rapid: float


@dataclass(frozen=True, eq=False)
class Moves:
    """Tool positions arrived at one after the other: kind, ball centre, axis, feed."""

    kinds: Int[ndarray, " n"]
    centres: Float[ndarray, "n 3"]
    axes: Float[ndarray, "n 3"]
    feeds: Float[ndarray, " n"]

    @classmethod
    def along(cls, kind: Kind, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], feed: float) -> "Moves":
        """Moves of one kind at one feed."""
        return cls(np.full(len(centres), int(kind)), centres, axes, np.full(len(centres), feed))

    def then(self, other: "Moves") -> "Moves":
        """These moves and the others behind them."""
        return Moves(
            np.r_[self.kinds, other.kinds],
            np.vstack([self.centres, other.centres]),
            np.vstack([self.axes, other.axes]),
            np.r_[self.feeds, other.feeds],
        )


class Linker:
    """Finds the ways between poses (ball centre, axis) of one level."""

    def __init__(self, checker: Checker, limits: AxisLimits, clearance: float, feeds: Feeds) -> None:
        self._checker, self._limits, self.feeds = checker, limits, feeds
        self._scene: Scene = checker.scene
        self._radius = checker.cutter.radius
        self._clearance = clearance
        self._route = Route(self._scene.stock, clearance + self._radius)
        self._found: dict[bytes, Moves | None] = {}

    @property
    def safe(self) -> tuple[Float[ndarray, "3"], Float[ndarray, "3"]]:
        """Ball centre and axis of the point above the stock where a level begins and ends."""
        centre, _ = self._route.frames(np.zeros(1), np.array([self._route.top]), np.array([self._clearance]))
        return centre[0], np.array([0.0, 0.0, 1.0])

    def hops(
        self, ends: tuple[ndarray, ndarray, ndarray], starts: tuple[ndarray, ndarray, ndarray], near: float
    ) -> tuple[Bool[ndarray, " k"], list[Moves]]:
        """Short links from ends to starts (each: centres, normals, axes (k, 3)), and which of them are proven free."""
        (a, na, va), (b, nb, vb) = ends, starts
        possible = (np.linalg.norm(b - a, axis=1) <= near) & (angles_between(va, vb) <= HOP_TURN)
        between, turning = interpolated(a + HOP_LIFT * na, b + HOP_LIFT * nb, va, vb, HOP_STEPS)
        between, turning = between.reshape(len(a), HOP_STEPS + 1, 3), turning.reshape(len(a), HOP_STEPS + 1, 3)
        hops = [Moves.along(Kind.LINK, *way, min(self.feeds.link, self._checker.cutter.feed)) for way in zip(between, turning, strict=True)]
        good = possible.copy()
        which = np.flatnonzero(possible)
        if len(which):
            c = np.concatenate([a[which, None], between[which], b[which, None]], axis=1).reshape(-1, 3)
            v = np.concatenate([va[which, None], turning[which], vb[which, None]], axis=1).reshape(-1, 3)
            joined = np.tile(np.r_[np.ones(HOP_STEPS + 2, dtype=bool), False], len(which))
            free = self._checker.free_moves(c - self._radius * v, v, joined, cutting=True)
            good[which] = (free | ~joined).reshape(len(which), -1).all(axis=1)
        return good, hops

    def far(self, first: tuple[ndarray, ndarray] | None, last: tuple[ndarray, ndarray] | None) -> Moves | None:
        """The way from one (centre, axis) to another, the end itself left out; None stands for the safe point. None: there is no way."""
        out, enter = self._out(first), self._out(last)
        if out is None or enter is None:
            return None
        between = self._round((out.centres[-1], out.axes[-1]), (enter.centres[-1], enter.axes[-1]))
        if between is None and first is not None and last is not None:
            home, back = self.far(first, None), self.far(None, last)
            return None if home is None or back is None else home.then(back)
        if between is None:
            return None
        way = out.then(between) if first is not None else between
        return way if last is None else way.then(self._reversed(enter))

    def _reversed(self, out: Moves) -> Moves:
        """The way in: the way out backwards without its first pose, all but the last move rapid."""
        centres, axes = out.centres[::-1][1:], out.axes[::-1][1:]
        return Moves.along(Kind.RAPID, centres, axes, self.feeds.rapid)

    def _out(self, pose: tuple[ndarray, ndarray] | None) -> Moves | None:
        """From a contact straight to the standoff (link), on to the clearance surface (rapid); verified. None: blocked."""
        if pose is None:
            centre, axis = self.safe
            return Moves.along(Kind.RAPID, centre[None], axis[None], self.feeds.rapid)
        key = np.concatenate(pose).tobytes()
        if key not in self._found:
            ways = (self._straight_out(*pose, direction) for direction in self._directions(pose[1]))
            self._found[key] = next((way for way in ways if way is not None), None)
        return self._found[key]

    def _directions(self, axis: ndarray) -> list[ndarray]:
        """Ways out to try: along the axis, and the same way but level or rising, so that a drooping holder does not sink to the table."""
        angle = float(polar(axis[None])[0])
        return [axis] + [with_polar(axis[None], np.array([limit]))[0] for limit in LEVEL_OUT if angle > limit]

    def _straight_out(self, centre: ndarray, axis: ndarray, direction: ndarray) -> Moves | None:
        length = max(self._route.exit(centre, direction), REACH[4])
        reach = np.r_[REACH[length - 0.05 > REACH], length]
        places, axes = centre + reach[:, None] * direction, np.repeat(axis[None], len(reach), axis=0)
        air = self._scene.room(places, np.full(len(places), self._radius + STANDOFF), "material", self._scene.post) - self._radius
        blocked = np.flatnonzero(air < STANDOFF)
        first = min(int(blocked[-1]) + 1 if len(blocked) else 1, len(reach) - 1)
        if not self._verified(places[: first + 1], axes[: first + 1], cutting=True):
            return None
        if first + 1 < len(places) and not self._verified(places[first:], axes[first:], cutting=False):
            return None
        link = Moves.along(Kind.LINK, places[first : first + 1], axes[:1], self.feeds.link)
        return link if first + 1 == len(places) else link.then(Moves.along(Kind.RAPID, places[-1:], axes[:1], self.feeds.rapid))

    def _round(self, first: tuple[ndarray, ndarray], last: tuple[ndarray, ndarray]) -> Moves | None:
        """Round the stock by the first route that is proven free."""
        for choice in TRIES:
            centres, axes = travel(self._route, first, last, self._limits, **choice)  # type: ignore[arg-type]
            if self._limits.allow(axes).all() and self._verified(centres, axes, cutting=False):
                return Moves.along(Kind.RAPID, centres[1:], axes[1:], self.feeds.rapid)
        return None

    def _verified(self, centres: ndarray, axes: ndarray, *, cutting: bool) -> bool:
        """Whether straight moves through these poses are proven free; finely subdivided."""
        tips = centres - self._radius * axes
        places, turns = interpolated(tips[:-1], tips[1:], axes[:-1], axes[1:], VERIFY_STEPS)
        joined = np.tile(np.r_[np.ones(VERIFY_STEPS, dtype=bool), False], len(tips) - 1)
        return bool((self._checker.free_moves(places, turns, joined, cutting=cutting) | ~joined).all())
