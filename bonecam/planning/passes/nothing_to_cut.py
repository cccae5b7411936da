"""The error of a level none of whose contacts can be machined."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import ToolPathError
from bonecam.levels.measure.level import MachinedLevel
from bonecam.mesh.facets.nearest_areas import nearest_areas

WHY_NOTHING = {
    "post": "are too near the post: take a thinner post (holding.diameter) or a smaller cutter",
    "gouge": "lie where the ball does not fit: take a smaller cutter",
    "covered": "lie under what the levels round it left uncut: give the tool more room there, by a longer "
    "overhang, a slimmer holder, a longer or thinner post",
}
"""What to do where a level cannot be cut at all, by the reason that most of its contacts have."""


def nothing_to_cut(level: MachinedLevel, reasons: ndarray, contacts: Float[ndarray, "n 3"]) -> ToolPathError:
    """The error of a level none of whose contacts can be machined, for these reasons."""
    names, counts = np.unique(reasons, return_counts=True)
    most = str(names[np.argmax(counts)])
    area = float(nearest_areas(level.mesh, contacts)[reasons == most].sum())
    what = f"{counts.max()} of its {len(reasons)} contacts ({area:.1f} mm2) {WHY_NOTHING[most]}"
    evidence = {"level": level.index, "reason": most, "area_mm2": area}
    return ToolPathError(f"level {level.index}: nothing can be cut: {what}", **evidence)
