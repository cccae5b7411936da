"""Moves between passes: a short hop just above the surface where it is proven free, else out, round the stock
and in again.

Out and in run along the tool's own axis; the last of the way in is at the plunge feed. Everything is verified
with the whole tool against level, material in process, post and table.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.job import PathJob
from bonecam.orientation.limits import AxisLimits, angles_between, polar, with_polar
from bonecam.orientation.moves import Checker, interpolated
from bonecam.orientation.pole import AT_POLE, nearest_to_pole, round_pole
from bonecam.orientation.scene import Scene
from bonecam.orientation.travel import Route, travel
from bonecam.toolpath.gouge import moves_gouge_free
from bonecam.toolpath.path import Kind

HOP_LIFT, HOP_STEPS = 0.2, 6
HOP_TURN = np.radians(30.0)
STANDOFF = 1.0
"""Rapid moves end, and begin, where the ball is this far from the material in process, mm."""
LEVEL_OUT = np.radians([90.0, 70.0, 45.0])
BEND = 1.5
REACH = np.array(
    [
        0.0,
        0.1,
        0.25,
        0.5,
        1.0,
        1.5,
        2.0,
        3.0,
        4.0,
        5.0,
        6.0,
        8.0,
        10.0,
        13.0,
        16.0,
        20.0,
        26.0,
        34.0,
        45.0,
        60.0,
        80.0,
    ]
)
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

Pose = tuple[Float[ndarray, "3"], Float[ndarray, "3"]]
"""Ball centre and axis."""


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
    def along(
        cls, kind: Kind, centres: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], feed: float
    ) -> "Moves":
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

    def __init__(self, checker: Checker, limits: AxisLimits, job: PathJob, feeds: Feeds) -> None:
        self._checker, self._limits, self.feeds = checker, limits, feeds
        self._scene: Scene = checker.scene
        self._radius = checker.cutter.radius
        self._clearance, self._tolerance = job.clearance, job.gouge_tolerance
        self._route = Route(self._scene.stock, job.clearance + self._radius)
        self._outs: dict[bytes, Moves | None] = {}
        self._rounds: dict[bytes, Moves | None] = {}

    @property
    def safe(self) -> tuple[Float[ndarray, "3"], Float[ndarray, "3"]]:
        """Ball centre and axis of the point above the stock where a level begins and ends."""
        centre, _ = self._route.frames(np.zeros(1), np.array([self._route.top]), np.array([self._clearance]))
        return centre[0], np.array([0.0, 0.0, 1.0])

    def hops(
        self, ends: tuple[ndarray, ndarray, ndarray], starts: tuple[ndarray, ndarray, ndarray], near: float
    ) -> tuple[Bool[ndarray, " k"], list[Moves]]:
        """Short links from ends to starts (each: centres, normals, axes (k, 3)), and which of them are proven
        free."""
        (a, na, va), (b, nb, vb) = ends, starts
        turned = angles_between(va, vb) > HOP_TURN  # refused, and opposite axes have no turn between them
        between, turning = interpolated(
            a + HOP_LIFT * na, b + HOP_LIFT * nb, va, np.where(turned[:, None], va, vb), HOP_STEPS
        )
        turning = round_pole(turning, between, np.repeat(np.arange(len(a)), HOP_STEPS + 1))
        between, turning = (
            between.reshape(len(a), HOP_STEPS + 1, 3),
            turning.reshape(len(a), HOP_STEPS + 1, 3),
        )
        hops = [
            Moves.along(Kind.LINK, *way, min(self.feeds.link, self._checker.cutter.feed))
            for way in zip(between, turning, strict=True)
        ]
        c, v = (
            np.concatenate([x[:, None], y, z[:, None]], axis=1)
            for x, y, z in ((a, between, b), (va, turning, vb))
        )
        good = (np.linalg.norm(b - a, axis=1) <= near) & ~turned
        good &= np.array([nearest_to_pole(way).min() > AT_POLE for way in v], dtype=bool)
        which = np.flatnonzero(good)
        if len(which):
            places, axes = c[which].reshape(-1, 3), v[which].reshape(-1, 3)
            joined = np.tile(np.r_[np.ones(HOP_STEPS + 2, dtype=bool), False], len(which))
            free = self._checker.free_moves(places - self._radius * axes, axes, joined, cutting=True)
            free[joined] &= self._ball_free(places[:-1][joined[:-1]], places[1:][joined[:-1]])
            good[which] = (free | ~joined).reshape(len(which), -1).all(axis=1)
        return good, hops

    def foresee(self, pairs: Sequence[tuple[Pose | None, Pose | None]]) -> None:
        """Find what `far` needs for all these pairs at once, which is much quicker than one after the
        other."""
        self._find_outs([pose for pair in pairs for pose in pair if pose is not None])
        outs = [(self._out(first), self._out(last)) for first, last in pairs]
        self._find_rounds(
            [(_end(out), _end(enter)) for out, enter in outs if out is not None and enter is not None]
        )

    def far(self, first: Pose | None, last: Pose | None) -> Moves | None:
        """The way from one (centre, axis) to another, the end itself left out; None stands for the safe
        point. None: there is no way."""
        out, enter = self._out(first), self._out(last)
        if out is None or enter is None:
            return None
        between = self._round(_end(out), _end(enter))
        if between is None and first is not None and last is not None:
            home, back = self.far(first, None), self.far(None, last)
            return None if home is None or back is None else home.then(back)
        if between is None:
            return None
        way = out.then(between) if first is not None else between
        return way if last is None else way.then(self._reversed(enter))

    def _reversed(self, out: Moves) -> Moves:
        """The way in: the way out backwards without its first pose, links at the plunge feed."""
        kinds = out.kinds[:0:-1]
        feeds = np.where(kinds == Kind.LINK, self.feeds.plunge, self.feeds.rapid)
        return Moves(kinds, out.centres[-2::-1], out.axes[-2::-1], feeds)

    def _out(self, pose: Pose | None) -> Moves | None:
        """From a contact straight to the standoff (link), on to the clearance surface (rapid); verified.
        None: blocked."""
        if pose is None:
            centre, axis = self.safe
            return Moves.along(Kind.RAPID, centre[None], axis[None], self.feeds.rapid)
        self._find_outs([pose])
        return self._outs[_key(pose)]

    def _find_outs(self, poses: Sequence[Pose]) -> None:
        """Try the directions out of each pose one after the other, the same one of all poses at once."""
        fresh = {key: pose for pose in poses if (key := _key(pose)) not in self._outs}
        ways = {key: _ways_out(axis) for key, (_, axis) in fresh.items()}
        for k in range(1 + 2 * len(LEVEL_OUT)):
            left = [key for key in fresh if self._outs.get(key) is None and k < len(ways[key])]
            if left:
                self._outs.update(
                    zip(left, self._proven_out([fresh[key] for key in left], [ways[key][k] for key in left]))
                )

    def _proven_out(
        self, poses: Sequence[Pose], chosen: Sequence[tuple[float, ndarray]]
    ) -> list[Moves | None]:
        """The way out of each pose: so far along its axis, then in a direction; None where it is not proven
        free."""
        bends, corners = (
            np.array([bend for bend, _ in chosen]),
            np.array([c + bend * a for (c, a), (bend, _) in zip(poses, chosen, strict=True)]),
        )
        lengths = np.maximum(
            bends + self._route.exits(corners, np.array([direction for _, direction in chosen])), REACH[4]
        )
        reaches = [np.r_[REACH[length - 0.05 > REACH], length] for length in lengths]
        ways = [
            (
                c + np.outer(np.minimum(r, bend), a) + np.outer(np.maximum(r - bend, 0), d),
                np.repeat(a[None], len(r), axis=0),
            )
            for (c, a), (bend, d), r in zip(poses, chosen, reaches, strict=True)
        ]
        places = np.vstack([way[0] for way in ways])
        air = (
            self._scene.room(
                places, np.full(len(places), self._radius + STANDOFF), "material", self._scene.post
            )
            - self._radius
        )
        starts = np.cumsum([len(reach) for reach in reaches])[:-1]
        blocked = [np.flatnonzero(part < STANDOFF) for part in np.split(air, starts)]
        turns = [
            min(int(b[-1]) + 1 if len(b) else 1, len(reach) - 1)
            for b, reach in zip(blocked, reaches, strict=True)
        ]
        good = self._verified(
            [(c[: k + 1], a[: k + 1]) for (c, a), k in zip(ways, turns, strict=True)], cutting=True
        )
        open_ = [i for i in np.flatnonzero(good) if turns[i] + 1 < len(reaches[i])]
        good[open_] = self._verified(
            [(ways[i][0][turns[i] :], ways[i][1][turns[i] :]) for i in open_], cutting=False
        )
        bent = [np.flatnonzero((r == bend) & (r > 0)) for r, bend in zip(reaches, bends, strict=True)]
        return [
            self._way_out(*way, k, b) if free else None
            for way, k, b, free in zip(ways, turns, bent, good, strict=True)
        ]

    def _way_out(self, places: ndarray, axes: ndarray, turn: int, bent: ndarray) -> Moves:
        """Link to the pose `turn`, and rapid from there to the last, each straight but for where it is
        `bent`."""
        stops = np.unique(np.r_[bent, turn, len(places) - 1])
        link = stops <= turn
        feeds = np.where(link, self.feeds.link, self.feeds.rapid)
        return Moves(np.where(link, int(Kind.LINK), int(Kind.RAPID)), places[stops], axes[stops], feeds)

    def _round(self, first: Pose, last: Pose) -> Moves | None:
        """Round the stock by the first route that is proven free."""
        self._find_rounds([(first, last)])
        return self._rounds[_key(first) + _key(last)]

    def _find_rounds(self, pairs: Sequence[tuple[Pose, Pose]]) -> None:
        """Try the routes between each two poses one after the other, the same one of all pairs at once."""
        fresh = {key: pair for pair in pairs if (key := _key(pair[0]) + _key(pair[1])) not in self._rounds}
        for choice in TRIES:
            left = [key for key in fresh if self._rounds.get(key) is None]
            routes = [travel(self._route, *fresh[key], self._limits, **choice) for key in left]  # type: ignore[arg-type]
            allowed = np.array([self._limits.allow(axes).all() for _, axes in routes], dtype=bool)
            allowed[allowed] = self._verified([routes[i] for i in np.flatnonzero(allowed)], cutting=False)
            for key, (centres, axes), free in zip(left, routes, allowed, strict=True):
                self._rounds[key] = (
                    Moves.along(Kind.RAPID, centres[1:], axes[1:], self.feeds.rapid) if free else None
                )

    def _verified(self, ways: Sequence[tuple[ndarray, ndarray]], *, cutting: bool) -> Bool[ndarray, " k"]:
        """Whether straight moves through the poses (centres, axes) of each way are proven free; finely
        subdivided."""
        if not ways:
            return np.zeros(0, dtype=bool)
        starts, ends = np.vstack([c[:-1] for c, _ in ways]), np.vstack([c[1:] for c, _ in ways])
        first, last = np.vstack([a[:-1] for _, a in ways]), np.vstack([a[1:] for _, a in ways])
        places, turns = interpolated(
            starts - self._radius * first, ends - self._radius * last, first, last, VERIFY_STEPS
        )
        joined = np.tile(np.r_[np.ones(VERIFY_STEPS, dtype=bool), False], len(first))
        free = (
            (self._checker.free_moves(places, turns, joined, cutting=cutting) | ~joined)
            .reshape(len(first), -1)
            .all(axis=1)
        )
        if cutting:
            free[free] = self._ball_free(starts[free], ends[free])
        blocked = np.bincount(
            np.repeat(np.arange(len(ways)), [len(c) - 1 for c, _ in ways]), ~free, len(ways)
        )
        return np.asarray(blocked == 0)

    def _ball_free(self, starts: Float[ndarray, "m 3"], ends: Float[ndarray, "m 3"]) -> Bool[ndarray, " m"]:
        """Whether the ball keeps the gouge tolerance on straight moves of its centre: the proofs shrink it by
        more than that leaves."""
        return moves_gouge_free(starts, ends, self._radius, self._tolerance, self._scene.level_distance)


def _ways_out(axis: ndarray) -> list[tuple[float, ndarray]]:
    """Ways out to try: how far along the axis, and the direction then: along the axis on, or the same way but
    level or rising, so that a drooping holder does not sink to the table; at once or behind a BEND, where the
    ball leaves a hollow first.
    """
    angle = float(polar(axis[None])[0])
    level = [with_polar(axis[None], np.array([limit]))[0] for limit in LEVEL_OUT if angle > limit]
    return [(0.0, axis)] + [(bend, direction) for bend in (0.0, BEND) for direction in level]


def _key(pose: Pose) -> bytes:
    return np.concatenate(pose).tobytes()


def _end(way: Moves) -> Pose:
    return way.centres[-1], way.axes[-1]
