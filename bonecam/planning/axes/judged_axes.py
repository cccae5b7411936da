"""FCL's word on the axes that no certified cone holds: the exact tool of each pose against level, material, post and
clamping. What it does not find free is left out."""

from dataclasses import replace

import numpy as np

from bonecam.planning.axes.tool_axes import ToolAxes, WantedAxes
from bonecam.planning.collision.checker import CollisionChecker
from bonecam.planning.collision.fcl_model import build_fcl_model
from bonecam.tool.path import ContactPath, PoseCheck


def judged_axes(
    path: ContactPath, chosen: ToolAxes, wanted: WantedAxes, checker: CollisionChecker
) -> tuple[ToolAxes, PoseCheck]:
    """The axes, without those outside of FCL's cones with which the tool at rest collides (`collision`), and how many
    were asked and refused."""
    cones, unsure = wanted.cones, chosen.found
    if cones is not None and cones.check is not None:
        unsure = unsure & ~cones.hold(chosen.axes)
    asked = np.flatnonzero(unsure)
    if not len(asked):
        return chosen, PoseCheck(0, 0)
    axes = chosen.axes[asked]
    tips = path.cutter.tips_of(path.centres[asked], axes)
    model = build_fcl_model(checker.scene, path.cutter)
    refused = asked[[bool(name) for name in model.colliding_sections(tips, axes)]]
    reasons = np.array(chosen.reasons, dtype=object)
    reasons[refused] = "collision"
    judged = replace(chosen, reasons=tuple(reasons.tolist()))
    return judged, PoseCheck(len(asked), len(refused))
