"""How deep a cut is at most, between two levels.

No point of level k is farther from level k - 1 than the depth, and none of level k - 1 from level k. A piece
of the one is compared with the other along the bilinear map of parameters that leads the piece's corners to
their footpoints (`kernels.hulls.mapped_distance`). Any map gives a true bound, this one a tight one: where
the footpoint of a point at the distance d is off by e, the bound is e^2 / 2d too large.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.kernels.hulls.depth import depth_bound
from bonecam.kernels.hulls.footpoints import DepthTarget
from bonecam.levels.measure.certificates.certificate import ACCURACY, ROUNDING, SMALLEST
from bonecam.levels.measure.certificates.nets import bezier_nets
from bonecam.levels.problem.tolerances import DEPTH_TOLERANCE
from bonecam.surface.tspline import TSpline

MARGIN = 1e-4
"""A depth bound is good enough up to so many mm over the limit of the cut."""

SEEDS = 5
"""Points each way on an element that searches for footpoints start from."""

LONGEST_STEPS = (0.02, 0.05)
"""Longest step of a search for a footpoint in s and in t, shares of the domain."""


@dataclass(frozen=True, eq=False)
class DepthBound:
    """No point of a level is farther from another than `distance`, mm; `place` is where the bound is largest;
    `too_deep` are parameters (s, t) of pieces that may be deeper than allowed; `pieces` is how many were
    bounded."""

    distance: float
    place: Float[ndarray, "3"]
    too_deep: Float[ndarray, "k 2"]
    pieces: int


def bound_depth(level: TSpline, other: TSpline, limit: float) -> DepthBound:
    """How far points of a level are at most from another one over the same T-mesh; good enough where it is
    within `limit` mm."""
    boxes = level.elements().boxes
    corners = np.ascontiguousarray(boxes[:, [[0, 2], [1, 2], [0, 3], [1, 3]]])
    distance, deepest, too_deep, pieces = depth_bound(
        bezier_nets(level),
        corners,
        on=depth_target(other),
        goal=limit + MARGIN,
        alarm=limit + DEPTH_TOLERANCE,
        accuracy=ACCURACY,
        smallest=SMALLEST,
    )
    place = level.positions(*_parameters(boxes, deepest[None]).T)[0]
    return DepthBound(distance + ROUNDING, place, _parameters(boxes, too_deep), pieces)


def depth_target(surface: TSpline) -> DepthTarget:
    """The surface that depths are measured to, with points on it that searches for footpoints start from."""
    elements = surface.elements()
    domain = surface.domain
    nets = bezier_nets(surface)

    share = (np.arange(SEEDS) + 0.5) / SEEDS
    low = elements.boxes[:, ::2, None]
    size = np.diff(elements.boxes.reshape(-1, 2, 2), axis=2)
    s = low[:, 0] + size[:, 0] * np.tile(share, SEEDS)
    t = low[:, 1] + size[:, 1] * np.repeat(share, SEEDS)
    points = surface.positions(s.ravel(), t.ravel()).reshape(*s.shape, 3)

    return DepthTarget(
        patches=surface.patches,
        boxes=elements.boxes,
        strips=elements.strips,
        domain=domain,
        period=np.array(elements.period),
        poles=np.array(surface.poles),
        limit=np.array(LONGEST_STEPS) * np.diff(domain)[:, 0],
        seeds=np.dstack([s, t, points]),
        hulls=np.hstack([nets.min(1), nets.max(1)]),
    )


def _parameters(boxes: Float[ndarray, "e 4"], pieces: Float[ndarray, "k 3"]) -> Float[ndarray, "k 2"]:
    """(s, t) of the middles of pieces, each given by its element and the parameters (u, v) on it."""
    box = boxes[pieces[:, 0].astype(int)]
    return np.column_stack([box[:, i] + pieces[:, 1 + i // 2] * (box[:, i + 1] - box[:, i]) for i in (0, 2)])
