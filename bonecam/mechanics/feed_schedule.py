"""Feeds for an even peak of the force, from the force that each move of a program takes at its feed.

A peak is F = E + C f: what edges press whatever the feed, and what grows with it (Altintas 2012, 2.8). So the feed that
gives the peak T is that of the program times (T - E) / (F - E). T is one for each cutter: QUANTILE of its cutting time
is below it, so that what the peaks lose in time the rest wins.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mechanics.error_kept import cut_shares
from bonecam.mechanics.loads import PathLoads
from bonecam.tool.path import PARTING

QUANTILE = 0.75
LEAST, MOST = 0.5, 2.0
"""The feed of a move is changed by a factor between these."""


@dataclass(frozen=True, eq=False)
class FeedSchedule:
    """By what the feed of each move of a program is multiplied (`ratios`, 1 where nothing is cut), and the peak (N)
    that the moves of each cutter, by number, then have."""

    ratios: Float[ndarray, " m"]
    targets: Mapping[int, float]


def feed_schedule(paths: Sequence[PathLoads], tools: Sequence[int], moves: int) -> FeedSchedule:
    """The schedule of a program of so many `moves` from the loads of its `paths`, each cut by one of `tools`; parting
    keeps its feed."""
    ratios = np.full(moves, np.inf)
    targets = {}
    for tool in sorted(set(tools)):
        own = [path for path, by in zip(paths, tools, strict=True) if by == tool and path.index != PARTING]
        own = [path for path in own if len(path.moves)]
        if not own:
            continue
        target = targets[tool] = peaks(own, (QUANTILE,))[0]
        for path in own:
            edge = path.edge_share * path.peak
            grows = np.maximum(path.peak - edge, np.finfo(float).tiny)
            np.minimum.at(ratios, path.moves, (target - edge) / grows)
    return FeedSchedule(np.clip(np.where(np.isfinite(ratios), ratios, 1.0), LEAST, MOST), targets)


def peaks(paths: Sequence[PathLoads], shares: Sequence[float]) -> list[float]:
    """The peaks (N) that these shares of the cutting time of some paths stay below."""
    peak, minutes = (np.concatenate([getattr(path, name) for path in paths]) for name in ("peak", "minutes"))
    return [float(value) for value in cut_shares(peak, minutes, shares)]
