"""FCL's word on the axes that no certified cone holds: the exact tool of each pose against level, material, post and
clamping. What it does not find free is left out."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.planning.axes.tool_axes import ToolAxes, WantedAxes
from bonecam.planning.collision.checker import CollisionChecker
from bonecam.planning.collision.fcl_model import build_fcl_model
from bonecam.tool.path import ContactPath, FreeCones, PoseCheck


def judged_axes(
    path: ContactPath, chosen: ToolAxes, wanted: WantedAxes, checker: CollisionChecker
) -> tuple[ToolAxes, PoseCheck]:
    """The axes, without those outside of FCL's cones with which the tool at rest collides (`collision`), and how many
    were asked and refused."""
    asked = np.flatnonzero(chosen.found & ~_in_certified_cones(wanted.cones, chosen.axes))
    axes = chosen.axes[asked]
    tips = path.centres[asked] - path.cutter.radius * axes
    model = build_fcl_model(checker.scene, path.cutter)
    refused = asked[[bool(name) for name in model.colliding_sections(tips, axes)]]
    reasons = np.array(chosen.reasons, dtype=object)
    reasons[refused] = "collision"
    judged = replace(chosen, reasons=tuple(reasons.tolist()))
    return judged, PoseCheck(len(asked), len(refused))


def _in_certified_cones(cones: FreeCones | None, axes: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Whether each axis lies in a cone that FCL has certified."""
    held = np.zeros(len(axes), dtype=bool)
    if cones is not None and cones.check is not None:
        rows = np.flatnonzero(cones.cone_of >= 0)
        shapes = cones.shapes.take(cones.cone_of[rows])
        held[rows] = shapes.off(axes[rows]) <= shapes.mean_angles
    return held
