"""Capsules as a job asks for them: of given sizes, of a given diameter, or found round the part."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import cKDTree

from bonecam.errors import StockError
from bonecam.job import StockJob
from bonecam.mesh.triangle_mesh import probes
from bonecam.setup.capsule import Capsule, enclosing_capsules, shortest_capsule
from bonecam.setup.stock import LyingPart, Schedule, StockKind, pose_remedy

CUTS_CHORD = 0.001
"""Chord tolerance, in radii, of the capsules on which cuts are counted."""
CUTS_TRIED = 16
"""Cuts are counted on about so many capsules."""


def capsule_of_fewest_cuts(points: Float[ndarray, "n 3"], job: StockJob, schedule: Schedule) -> Capsule:
    """Of the capsules at most `job.spare_volume` larger than the smallest the one with the fewest cuts, and
    of these the one whose farthest place is nearest to the part.

    A level gains a little less than its depth: only what leaves half a roughing depth to spare counts as that
    many cuts.
    """
    capsules = enclosing_capsules(points, job.allowance)
    tree = cKDTree(points)
    smallest = min(capsules, key=lambda capsule: capsule.volume)
    near = [capsule for capsule in capsules if capsule.volume <= (1 + job.spare_volume) * smallest.volume]

    def cuts(capsule: Capsule) -> tuple[int, float]:
        farthest = float(np.max(tree.query(probes(capsule.mesh(CUTS_CHORD * capsule.radius)))[0]))
        return schedule.lower_bound(farthest + schedule.beyond / 2), farthest

    return min((smallest, *near[:: 1 + len(near) // CUTS_TRIED]), key=cuts)


def capsule_of_size(diameter: float, length: float, middle: float) -> Capsule:
    """A capsule of this size on the Z axis about z = `middle`. StockError names the setting where there is
    none."""
    if diameter <= 0:
        raise StockError(
            f"stock.diameter = {diameter:g}: a capsule {length:g} mm long needs one: give the diameter, "
            "or no stock.length",
            distance=0.0,
        )
    if length < diameter:
        what = (
            f"stock.length = {length:g}: a capsule of diameter {diameter:g} mm is no shorter than that over both caps"
        )
        raise StockError(f"{what}: give at least {diameter:g}, or a smaller stock.diameter", distance=diameter - length)
    half = (length - diameter) / 2
    return Capsule(np.array([0, 0, middle - half]), np.array([0, 0, middle + half]), diameter / 2)


def _make(job: StockJob, part: LyingPart, schedule: Schedule) -> Capsule:
    """The capsule of a job: of the given sizes, or the best one of the given diameter, or the best one."""
    if not (job.diameter or job.length):
        return capsule_of_fewest_cuts(part.points, job, schedule)
    if not job.length:
        reach = np.linalg.norm(part.points[:, :2], axis=1)
        inner = job.diameter / 2 - job.allowance
        worst = int(np.argmax(reach))
        if reach[worst] >= inner:
            height = part.points[worst, 2] - part.points[:, 2].min()
            where = f"{reach[worst]:.2f} mm from the axis and {height:.2f} mm above its lower end"
            raise StockError(
                f"a capsule of diameter {job.diameter:g} mm does not hold the part {where}, and {job.allowance:g} mm "
                f"(stock.allowance) round it: give at least {2 * (reach[worst] + job.allowance):.2f}{pose_remedy(job)}",
                distance=float(reach[worst] - inner),
                place=part.points[worst],
            )
        return shortest_capsule(part.points, reach, inner, job.diameter / 2)
    return capsule_of_size(job.diameter, job.length, part.middle)


KIND = StockKind(
    ("diameter", "length"), _make, "a bar turned to a cylinder with half a ball at either end", centres=True
)
