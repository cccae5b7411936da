"""The error that a finished surface keeps, foretold before there are paths.

At a place with the compliance C along its normal, cut by a cutter of compliance c, the error is s F (C + c) t: F is the
force along the normal on an edge in the middle of a finishing strip (`mechanics.strip`), and t how that varies with
tilt, feed and engagement, which has the exponential distribution: on parts that are much stiffer than their cutter half
of the surface keep 0.23 to 0.30 of the error that 95 % keep, 99 % keep 1.4 to 1.6 times that (exponential: 0.23 and
1.54). So the share of the area that keeps more than x is the mean of exp(-x / (s F (C + c))) over the area. What
pushes along the surface moves it little: with the coefficients of titanium, whose edges push along the normal, the
size of the force would foretell half of what is kept.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from bonecam.mechanics.beam import Beam
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.holding.finished_beam import normal_compliances

FORCE_SHARE = 0.225
"""s: on 26 bones of aluminium with scallops of 0.1 mm 95 % of the surface keep 0.72 to 1.4 times what this foretells,
in the mean as much, and 99 % 0.65 to 1.24 times; on one of titanium 1.1 times, on one of PEEK 99 % 1.35 times."""


def foretold_errors(
    beam: Beam, part: TriangleMesh, tool: float, force: float, shares: Sequence[float]
) -> list[float]:
    """The errors (mm) that these shares of the area of a `part` on its `beam` stay below; `tool` is the compliance of
    the cutter (mm/N), `force` that along the normal on an edge in the middle of a finishing strip, N."""
    compliances, areas = normal_compliances(beam, part)
    gives = FORCE_SHARE * force * (np.maximum(compliances, 0.0) + tool)
    weights = areas / areas.sum()

    def beyond(error: float, share: float) -> float:
        return float(weights @ np.exp(-error / gives)) - (1 - share)

    # where all gave way as the softest place does, the error would be that at which the mean is the share itself
    softest = float(gives.max())
    return [float(brentq(beyond, 0.0, -softest * np.log1p(-share), args=(share,))) for share in shares]
