"""From contacts to a tool path: an axis for every contact, proven free, and the moves that join the
passes."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.errors import OrientationError
from bonecam.job import NcJob, PathJob
from bonecam.orientation.admissible import Free, allowed, nearest_free, smoothed
from bonecam.orientation.lead import lead_axes, turned_up
from bonecam.orientation.limits import AxisLimits, angles_between
from bonecam.orientation.links import Feeds, Linker, Moves, Pose
from bonecam.orientation.moves import Checker
from bonecam.orientation.pole import AT_POLE, nearest_to_pole, round_pole, round_pole_where_free
from bonecam.orientation.scene import Scene
from bonecam.toolpath.path import ContactPath, Kind, ToolPath

MAX_TURN = np.radians(15.0)
NEAR_RADII = 2.5


def orient(path: ContactPath, scene: Scene, limits: AxisLimits, job: PathJob, nc: NcJob) -> ToolPath:
    """Tool axes for the contacts of one level, and safe moves before, between and behind its passes.

    Contacts without an allowed, collision-free axis, and passes without a way to them, are left out and
    listed in `uncut` (`limits`, `collision`). Raises OrientationError where nothing can be reached.
    """
    checker = Checker(scene, path.cutter)
    axes, reasons, steady = choose_axes(path, checker, limits, job)
    kept = np.array([not reason for reason in reasons], dtype=bool)
    index = np.flatnonzero(kept)
    if not len(index):
        raise OrientationError(
            f"level {path.level}: no contact has a free tool axis: use a longer overhang, a longer post or a slimmer holder",
            level=path.level,
        )
    joined = _joined(path, index, axes, checker, steady)
    runs = np.split(np.arange(len(index)), np.flatnonzero(~joined[:-1]) + 1)
    feeds = Feeds(nc.link_feed, nc.plunge_feed, nc.rapid_feed)
    linker = Linker(checker, limits, job, feeds)
    builder = _Builder(path, axes, index, linker, runs)
    return builder.build([*zip(path.contacts[~kept], [r for r in reasons if r])])


def choose_axes(
    path: ContactPath, checker: Checker, limits: AxisLimits, job: PathJob
) -> tuple[Float[ndarray, "n 3"], list[str], Bool[ndarray, " n"]]:
    """A free axis for every contact; for each an empty string or why there is none; and whether it was found
    steady as it is.

    A contact is steady where its pose and its halves of the moves to its neighbours on the pass are proven
    free.
    """
    cutter, max_tilt = path.cutter, np.radians(job.max_tilt_deg)
    axes = turned_up(
        lead_axes(path.normals, path.feeds, np.radians(job.lead_deg)), path.centres, cutter, limits
    )
    axes = round_pole(axes, path.centres, path.pass_index)
    good = allowed(axes, path.normals, limits, max_tilt)
    wished, centres = axes.copy(), path.centres
    together = np.r_[path.pass_index[1:] == path.pass_index[:-1], False]
    steady = checker.steady(centres - cutter.radius * axes, axes, together)
    open_ = np.flatnonzero(good & ~steady)
    good[open_] = checker.free(centres[open_], axes[open_])
    axes, reasons = _freed(path, axes, good, checker, limits, max_tilt)
    kept = (axes == wished).all(axis=1) & np.array([not reason for reason in reasons])
    same = np.r_[True, kept, True]
    return axes, reasons, steady & same[:-2] & kept & same[2:]


def _freed(
    path: ContactPath,
    axes: ndarray,
    good: Bool[ndarray, " n"],
    checker: Checker,
    limits: AxisLimits,
    max_tilt: float,
) -> tuple[Float[ndarray, "n 3"], list[str]]:
    """The axes, those that are not good replaced by the nearest free ones and smoothed; for each an empty
    string or why there is none.

    FCL is asked only where no axis is proven free by distance: it takes a hundred times as long.
    """
    axes, reasons, centres = axes.copy(), np.where(good, "", "collision").astype(object), path.centres
    if good.all():
        return axes, reasons.tolist()
    for proof in (checker.free, checker.clear):
        which = np.flatnonzero(reasons == "collision")
        free = _of_contacts(proof, centres)
        axes[which], reasons[which] = nearest_free(
            which, axes[which], path.normals[which], limits, max_tilt, free
        )
    reached = np.flatnonzero(reasons == "")
    free, normals, passes = (
        _of_contacts(checker.free, centres[reached]),
        path.normals[reached],
        path.pass_index[reached],
    )
    found = smoothed(axes[reached], normals, passes, ~good[reached], limits, max_tilt, free)

    def may(i: Int[ndarray, " k"], tried: Float[ndarray, "k 3"]) -> Bool[ndarray, " k"]:
        return allowed(tried, normals[i], limits, max_tilt) & free(i, tried)

    axes[reached] = round_pole_where_free(found, centres[reached], passes, may)
    return axes, reasons.tolist()


def _of_contacts(proof: Callable[[ndarray, ndarray], ndarray], centres: Float[ndarray, "n 3"]) -> Free:
    """The proof of poses as one of contacts, by index."""
    return lambda i, tried: proof(centres[i], tried)


def _joined(
    path: ContactPath, index: ndarray, axes: ndarray, checker: Checker, steady: ndarray
) -> Bool[ndarray, " n"]:
    """Whether the tool cuts from each kept contact straight to the next: same pass, neighbours, small turn
    off the pole, proven free."""
    passes, kept_axes = path.pass_index[index], axes[index]
    joined = np.r_[(passes[1:] == passes[:-1]) & (np.diff(index) == 1), False]
    joined[:-1] &= (angles_between(kept_axes[1:], kept_axes[:-1]) <= MAX_TURN) & (
        nearest_to_pole(kept_axes) > AT_POLE
    )
    tips = path.centres[index] - path.cutter.radius * kept_axes
    return checker.free_moves(tips, kept_axes, joined, steady[index])


class _Builder:
    """Lays the runs behind one another with the links between them."""

    def __init__(
        self, path: ContactPath, axes: ndarray, index: ndarray, linker: Linker, runs: list[ndarray]
    ) -> None:
        self._path, self._axes, self._linker = path, axes, linker
        self._runs = [index[run] for run in runs]

    def build(self, uncut: list[tuple[ndarray, str]]) -> ToolPath:
        """The whole tool path. Runs that cannot be reached join the uncut contacts."""
        centre, axis = self._linker.safe
        way = [Moves.along(Kind.RAPID, centre[None], axis[None], self._linker.feeds.rapid)]
        rows: list[ndarray] = [np.full(1, -1)]
        passes: list[ndarray] = [np.full(1, -1)]
        here, count, before = None, 0, -1
        hop_free, hops = self._hops()
        leavable = self._leavable(hop_free)
        self._linker.foresee(self._expected(hop_free, leavable))
        for k, run in enumerate(self._runs):
            link: Moves | None = None
            if leavable[k]:
                hop = here is not None and before == k - 1 and hop_free[k - 1]
                link = hops[k - 1] if hop else self._linker.far(here, self._pose(run[0]))
            if link is None:
                uncut += [(self._path.contacts[i], "collision") for i in run]
                continue
            way += [link, self._cut(run)]
            rows += [np.full(len(link.kinds), -1), run]
            passes += [np.full(len(link.kinds), -1), np.full(len(run), count)]
            here, before, count = self._pose(run[-1]), k, count + 1
        if here is None:
            raise OrientationError(
                f"level {self._path.level}: no pass can be reached safely: give more clearance",
                level=self._path.level,
            )
        home = self._linker.far(here, None)
        assert home is not None
        way.append(home)
        rows.append(np.full(len(home.kinds), -1))
        passes.append(np.full(len(home.kinds), -1))
        return self._path_of(way, np.concatenate(rows), np.concatenate(passes), uncut)

    def _leavable(self, hop_free: ndarray) -> list[bool]:
        """Whether the tool gets away from the end of each run: by a hop to one it gets away from, or out to
        the safe point."""
        answer = [False] * len(self._runs)
        self._linker.foresee(
            [
                (self._pose(run[-1]), None)
                for run, hop in zip(self._runs, [*hop_free, False], strict=True)
                if not hop
            ]
        )
        for k in range(len(self._runs) - 1, -1, -1):
            hop = k + 1 < len(self._runs) and bool(hop_free[k]) and answer[k + 1]
            answer[k] = hop or self._linker.far(self._pose(self._runs[k][-1]), None) is not None
        return answer

    def _expected(self, hop_free: ndarray, leavable: list[bool]) -> list[tuple[Pose | None, Pose | None]]:
        """The long ways that are needed if every run that can be left is reached."""
        reached = np.flatnonzero(leavable).tolist()
        pairs = [(a, b) for a, b in pairwise(reached) if b > a + 1 or not hop_free[a]]
        first: list[tuple[Pose | None, Pose | None]] = [
            (None, self._pose(self._runs[k][0])) for k in reached[:1]
        ]
        return first + [(self._pose(self._runs[a][-1]), self._pose(self._runs[b][0])) for a, b in pairs]

    def _pose(self, contact: int | np.integer) -> Pose:
        return self._path.centres[contact], self._axes[contact]

    def _hops(self) -> tuple[ndarray, list[Moves]]:
        last = np.array([run[-1] for run in self._runs[:-1]], dtype=np.int64)
        first = np.array([run[0] for run in self._runs[1:]], dtype=np.int64)
        p = self._path
        return self._linker.hops(
            (p.centres[last], p.normals[last], self._axes[last]),
            (p.centres[first], p.normals[first], self._axes[first]),
            NEAR_RADII * p.cutter.radius,
        )

    def _cut(self, run: ndarray) -> Moves:
        moves = Moves.along(Kind.CUT, self._path.centres[run], self._axes[run], self._path.cutter.feed)
        moves.feeds[0] = min(self._linker.feeds.plunge, self._path.cutter.feed)
        return moves

    def _path_of(
        self, way: list[Moves], rows: ndarray, passes: ndarray, uncut: list[tuple[ndarray, str]]
    ) -> ToolPath:
        p = self._path
        axes, centres = np.vstack([m.axes for m in way]), np.vstack([m.centres for m in way])
        cut = (rows >= 0)[:, None]
        return ToolPath(
            p.level,
            p.cutter,
            np.concatenate([m.kinds for m in way]),
            passes,
            np.where(cut, p.parameters[rows], np.nan),
            np.where(cut, p.contacts[rows], np.nan),
            centres - p.cutter.radius * axes,
            axes,
            np.concatenate([m.feeds for m in way]),
            np.vstack([p.uncut, *(point[None] for point, _ in uncut)]),
            p.reasons + tuple(reason for _, reason in uncut),
        )
