"""The preferred tool axis: the contact normal leaning forward along the feed by the lead angle.

A lead of 10 degrees keeps the ball's tip, which does not cut, off the surface (Gan et al. 2014, section 5.2).
Where the machine's limits or the table forbid that axis, its polar angle is brought within bounds.

Steering the tool axis round the singularity of the rotary axes.

Near +Z the two rotary axes of tables and heads say the same, and a small turn of the tool is a large one of
the machine. An axis that would come within SINGULAR_CONE of +Z runs round it on that cone instead, its
azimuth turning evenly; so do axes between which a move would come within MIN_PASS_ANGLE of +Z.

Free tool axes: within the machine's limits, near enough to the contact normal, and free of
collision.

Where the preferred axis is not admissible, the nearest admissible direction of a fixed set takes its place.
The set is an icosphere, the same for every contact, so that neighbours choose alike; the axes are then
smoothed along the passes, and each step of that is proven free again.
"""

import math
from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, dots, frozen, unit
from bonecam.job import field_error
from bonecam.machine.limits import MachineLimits, polar_angles, with_polar_angles
from bonecam.tool.cutter import Cutter
from bonecam.workholding.clamping import Clamping

OUTWARD = 0.3
"""How far an axis that points straight down is leant away from the Z axis before its azimuth is taken (a
share of its length)."""

ROOM = 0.5
"""Axes that would sink to the table are bounded so far above it, mm: the moves between them bulge."""
LEAVING = 5.0
"""Length (mm) along a drooping axis that there is room for above the table: the tool has to leave the contact."""


def check_lead(cutter: Cutter, lead_deg: float) -> None:
    """JobError where shank, holder or spindle would enter a flat part while the axis leans by the lead angle
    (degrees).

    A rim of radius r that stands c above the ball's centre along the axis is R + c cos(lead) - r sin(lead) above
    the part, R being the ball's radius.
    """
    lead = math.radians(abs(lead_deg))
    for section in cutter.profile[1:]:
        for height, radius in ((section.start, section.radius), (section.end, section.end_radius)):
            if cutter.radius + (height - cutter.radius) * math.cos(lead) <= radius * math.sin(lead):
                name = section.name
                enters = f"at the lead of {lead_deg:g} degrees the {name} would cut into a flat part"
                if name == "spindle":
                    remedy = "give a longer overhang or holder, or less path.lead_deg"
                    raise field_error(cutter.name, "overhang", cutter.overhang, f"{enters}: {remedy}")
                remedy = f"give a slimmer {name}, less path.lead_deg, or a longer overhang or flute_length"
                raise field_error(cutter.name, f"{name}_diameter", 2 * section.radius, f"{enters}: {remedy}")


def lead_axes(normals: Float[ndarray, "n 3"], feeds: Float[ndarray, "n 3"], lead: float) -> Float[ndarray, "n 3"]:
    """cos(lead) n + sin(lead) f, unit; `lead` in radians, positive leans forward."""
    return unit(np.cos(lead) * normals + np.sin(lead) * feeds)


def bound_polar_angles(
    axes: Float[ndarray, "n 3"],
    centres: Float[ndarray, "n 3"],
    cutter: Cutter,
    clamping: Clamping,
    limits: MachineLimits,
) -> Float[ndarray, "n 3"]:
    """The axes with polar angles brought within the limits and above the table's plane.

    An axis that points almost straight down takes its azimuth from where its ball stands about the Z axis:
    outward.
    """
    distance = np.linalg.norm(centres[:, :2], axis=1, keepdims=True)
    outward = centres[:, :2] / np.maximum(distance, np.finfo(float).tiny)
    horizontal = np.linalg.norm(axes[:, :2], axis=1, keepdims=True)
    down = axes[:, 2:] < 0
    leaning = np.where(down, axes[:, :2] + OUTWARD * (1 - horizontal) * outward, axes[:, :2])
    aimed = np.column_stack([leaning, axes[:, 2]])

    angle = polar_angles(axes)
    largest = np.minimum(limits.largest, table_limits(centres, cutter, clamping.clearance))
    bounded = np.clip(angle, limits.smallest, np.maximum(largest, limits.smallest))
    kept = np.where((bounded == angle)[:, None], axes, with_polar_angles(aimed, bounded))
    return limits.nearest(kept) if limits.narrow else kept


def has_room(
    axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], cutter: Cutter, clamping: Clamping
) -> Bool[ndarray, " n"]:
    """Whether a tool that leaves its contact along its axis keeps above the table."""
    if not clamping.closed:
        return np.ones(len(axes), dtype=bool)
    return polar_angles(axes) <= table_limits(centres, cutter, clamping.clearance)


def table_limits(centres: Float[ndarray, "n 3"], cutter: Cutter, clearance: float) -> Float[ndarray, " n"]:
    """Largest polar angle (radians) at which the rims of the tool keep the clearance (mm) above the table z = 0, and
    ROOM more for the moves, at the contact and LEAVING from it; 0 where none does.

    With a ball centre at height z, a rim of radius r at height c above it stands at z + c cos(a) - r sin(a) =
    z + h cos(a + f), h = |(c, r)|, tan(f) = r / c.
    """
    largest = np.full(len(centres), np.pi)
    rims = [
        (height - cutter.radius + leaving, radius)
        for section in cutter.profile
        for height, radius in ((section.start, section.radius), (section.end, section.end_radius))
        for leaving in (0.0, LEAVING)
    ]
    for height, radius in rims:
        reach = np.hypot(height, radius)
        phase = np.arctan2(radius, height)
        cosine = np.clip((clearance + ROOM - centres[:, 2]) / reach, -1, 1)
        largest = np.minimum(largest, np.where(cosine > -1, np.arccos(cosine) - phase, np.pi))
    return np.maximum(largest, 0.0)


SINGULAR_CONE = np.radians(3.0)
"""Contacts get no axis with a smaller polar angle, radians."""
MIN_PASS_ANGLE = np.radians(1.0)
"""No move comes nearer to +Z, radians: an axis that passes at 1 degree turns the table by 10 degrees in 0.17
degrees of its own."""
SINGULAR_ANGLE = np.radians(0.1)
"""A cut that comes this near to +Z (radians), because collisions forbid all else, is broken there: the tool
retracts and comes back."""
MAX_ROUNDS = 8
"""Times that a stretch on the cone may grow until its moves keep MIN_PASS_ANGLE."""

Free = Callable[[Int[ndarray, " k"], Float[ndarray, "k 3"]], Bool[ndarray, " k"]]
"""Whether contacts (by index) may have the given axes, or the tool on them is free of collision with these."""


def avoid_singularity(
    axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], passes: Int[ndarray, " n"]
) -> Float[ndarray, "n 3"]:
    """The axes with every stretch of a pass that lies within SINGULAR_CONE of +Z moved onto the cone.

    The azimuth turns the short way round, evenly over the path of the ball centre, from the axis before the
    stretch to the one behind it. Where the pass begins or ends with the stretch it stays that of the other
    side; where both are missing, that of the first axis. Ends of moves that pass too near to +Z become
    stretches too, which keep their polar angle, and grow until no move comes within MIN_PASS_ANGLE.
    """
    near = polar_angles(axes) < SINGULAR_CONE * (1 - 1e-9)
    same_pass = passes[1:] == passes[:-1]
    steered = axes
    for _ in range(MAX_ROUNDS):
        steered = _round_cone(axes, near, centres, passes) if near.any() else axes
        crossing = np.flatnonzero(same_pass & (least_polar_angles(steered) < MIN_PASS_ANGLE))
        if not len(crossing):
            break
        ends = np.r_[crossing, crossing + 1]
        if near[ends].all():
            near = near | np.r_[False, near[:-1] & same_pass] | np.r_[near[1:] & same_pass, False]
        near[ends] = True
    return steered


def avoid_singularity_where(
    axes: Float[ndarray, "n 3"], centres: Float[ndarray, "n 3"], passes: Int[ndarray, " n"], admissible: Free
) -> Float[ndarray, "n 3"]:
    """As `avoid_singularity`, but a stretch keeps its axes where one of its new axes is not admissible."""
    steered = avoid_singularity(axes, centres, passes)
    moved = np.flatnonzero((steered != axes).any(axis=1))
    stretch = np.cumsum(np.diff(moved, prepend=-2) > 1)
    blocked = np.bincount(stretch, ~admissible(moved, steered[moved]), len(moved) + 1) > 0
    taken = moved[~blocked[stretch]]
    result = axes.copy()
    result[taken] = steered[taken]
    return result


def least_polar_angles(axes: Float[ndarray, "n 3"]) -> Float[ndarray, " m"]:
    """The least polar angle on the great circle from each unit axis to the next, radians; m = n - 1."""
    a, b = axes[:-1], axes[1:]
    at_ends = np.minimum(polar_angles(a), polar_angles(b))
    cosine = dots(a, b)
    between = (b[:, 2] > cosine * a[:, 2]) & (a[:, 2] > cosine * b[:, 2])
    normal = np.cross(a, b)
    length = np.linalg.norm(normal, axis=1)
    sine = np.divide(np.abs(normal[:, 2]), length, out=np.ones(len(a)), where=length > 0)
    return np.where(between, np.minimum(np.arcsin(np.minimum(sine, 1.0)), at_ends), at_ends)


def _round_cone(
    axes: Float[ndarray, "n 3"], near: Bool[ndarray, " n"], centres: Float[ndarray, "n 3"], passes: Int[ndarray, " n"]
) -> Float[ndarray, "n 3"]:
    """The axes with the stretches that are `near` moved onto the cone, or out to it."""
    azimuth = np.arctan2(axes[:, 1], axes[:, 0])
    steered = axes.copy()
    changes = np.flatnonzero((near[1:] != near[:-1]) | (passes[1:] != passes[:-1])) + 1
    for first, last in pairwise([0, *changes.tolist(), len(near)]):
        if not near[first]:
            continue
        before = first - 1 if first > 0 and passes[first - 1] == passes[first] else first
        behind = last if last < len(axes) and passes[last] == passes[first] else last - 1
        has_before, has_behind = before < first, behind == last
        start = azimuth[behind] if has_behind and not has_before else azimuth[before]
        end = azimuth[behind] if has_behind else start

        # The share of the length of a polyline that lies before each of its points; all 0 where it has none
        points = centres[before : behind + 1]
        lengths = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
        share = (lengths / lengths[-1] if lengths[-1] > 0 else lengths)[first - before :][: last - first]
        turn = float(np.mod(end - start + np.pi, 2 * np.pi) - np.pi)
        angle = start + turn * share
        directions = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(last - first)])
        angles = np.maximum(polar_angles(axes[first:last]), SINGULAR_CONE)
        steered[first:last] = with_polar_angles(directions, angles)
    return steered


SUBDIVISIONS = 3
"""Times that the edges of the icosahedron are halved: its directions are then about 8 degrees apart."""
BATCH = 8
"""Directions that are tested for a contact at once."""
MAX_DIRECTIONS = 120
"""Directions that are tested for a contact at most: the nearest ones."""
CHUNK = 4000
"""Contacts whose directions are sorted at once: it bounds the memory."""
SMOOTHING_ROUNDS = 10
"""Times that axes are averaged with their neighbours at most."""
NEIGHBOURHOOD = 12
"""Contacts before and behind a replaced axis whose axes are smoothed too."""
MIN_TURN = np.radians(0.375)
"""Smoothing leaves an axis alone that it would turn by less, radians."""
FEWEST = 100
"""A machine with fewer candidate directions within its limits has others: a narrow band, or a curve."""
AROUND = 180
"""Directions on each ring of a narrow band."""
MOST_SAMPLES = 720
"""Directions about of those that a machine reaches."""
COSINE_ROUNDING = 1e-9
"""Cosines this little below a limit are on it."""
COLLISION, LIMITS = -1, -2
"""Why a contact has no direction, in the place of the direction's index."""


def icosahedron_vertices() -> Float[ndarray, "12 3"]:
    """Unit vectors to the vertices of an icosahedron."""
    golden = (1 + np.sqrt(5)) / 2
    corners = [(0, a, b * golden) for a in (-1, 1) for b in (-1, 1)]
    return unit(np.array([np.roll(corner, k) for k in range(3) for corner in corners], dtype=np.float64))


def candidate_directions() -> Float[ndarray, "647 3"]:
    """The vertices of an icosphere, about 8 degrees apart; six directions on the singular cone stand for
    those inside it."""
    points = icosahedron_vertices()
    edge = 1.2
    for _ in range(SUBDIVISIONS):
        i, j = np.triu_indices(len(points), 1)
        near = np.linalg.norm(points[i] - points[j], axis=1) < edge
        points = np.vstack([points, unit(points[i[near]] + points[j[near]])])
        edge /= 1.9

    azimuth = np.arange(6) * np.pi / 3
    horizontal = np.column_stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth])
    ring = with_polar_angles(horizontal, np.full(6, SINGULAR_CONE))
    return np.vstack([points[polar_angles(points) >= SINGULAR_CONE], ring])


@lru_cache(maxsize=8)
def directions_within(limits: MachineLimits) -> Float[ndarray, "d 3"]:
    """The candidate directions of a machine, read-only: all of the icosphere, or where few of these are within its
    limits, directions that are."""
    directions = candidate_directions()
    if limits.allow(directions).sum() < FEWEST:
        if limits.reached is not None:
            directions = limits.reached.samples
            stride = max(len(directions) // MOST_SAMPLES, 1)
            directions = directions[::stride]
        elif limits.largest > SINGULAR_CONE:
            # Directions on rings of polar angles within a narrow band, radians
            smallest = max(limits.smallest, SINGULAR_CONE)
            azimuth = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)
            around = np.column_stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth])
            angles = [smallest]
            if smallest != limits.largest:
                angles += [(smallest + limits.largest) / 2, limits.largest]
            directions = np.vstack([with_polar_angles(around, np.full(AROUND, angle)) for angle in angles])
    return frozen(directions)


def within_limits(
    axes: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], limits: MachineLimits, max_tilt: float
) -> Bool[ndarray, " n"]:
    """Within the machine's limits, and no further than `max_tilt` (radians) from the contact normal."""
    return limits.allow(axes) & (dots(axes, normals) >= np.cos(max_tilt) - COSINE_ROUNDING)


def nearest_free_axes(
    contacts: Int[ndarray, " k"],
    preferred: Float[ndarray, "k 3"],
    normals: Float[ndarray, "k 3"],
    limits: MachineLimits,
    max_tilt: float,
    free: Free,
) -> tuple[Float[ndarray, "k 3"], list[str]]:
    """The free candidate direction nearest to each preferred axis, and an empty string for each; where there
    is none the preferred axis, and why: `limits` or `collision`."""
    directions = directions_within(limits)
    directions = directions[limits.allow(directions)]
    index = np.full(len(contacts), LIMITS)
    for begin in range(0, len(contacts), CHUNK):
        chunk = slice(begin, begin + CHUNK)
        too_far = normals[chunk] @ directions.T < np.cos(max_tilt)
        behind_all = 9.0
        order = np.argsort(np.where(too_far, behind_all, -preferred[chunk] @ directions.T), axis=1, kind="stable")
        order = order[:, :MAX_DIRECTIONS]
        usable = ~np.take_along_axis(too_far, order, axis=1)
        index[chunk][usable.any(axis=1)] = COLLISION
        left = np.flatnonzero(usable.any(axis=1))
        for start in range(0, order.shape[1], BATCH):
            batch = order[left, start : start + BATCH]
            good = usable[left, start : start + BATCH]
            row, column = np.nonzero(good)
            if len(row):
                good[row, column] = free(contacts[begin + left[row]], directions[batch[row, column]])
            has_free = good.any(axis=1)
            index[begin + left[has_free]] = batch[has_free, good[has_free].argmax(axis=1)]
            left = left[~has_free]
            if not len(left):
                break
    axes = preferred.copy()
    axes[index >= 0] = directions[index[index >= 0]]
    reasons = np.select([index == LIMITS, index == COLLISION], ["limits", "collision"], "")
    return axes, reasons.tolist()


def smooth_axes(
    axes: Float[ndarray, "n 3"],
    normals: Float[ndarray, "n 3"],
    passes: Int[ndarray, " n"],
    replaced: Bool[ndarray, " n"],
    limits: MachineLimits,
    max_tilt: float,
    free: Free,
) -> Float[ndarray, "n 3"]:
    """The axes averaged along the passes near those that were `replaced`; an average that is not within the
    limits and free leaves the axis as it was."""
    axes = axes.copy()
    if not replaced.any():
        return axes
    same_pass = np.r_[passes[1:] == passes[:-1], False]
    window = np.ones(2 * NEIGHBOURHOOD + 1)
    close = np.convolve(replaced.astype(float), window, mode="same")[: len(axes)] > 0.5
    for _ in range(SMOOTHING_ROUNDS):
        # (1 2 1) / 4 of each axis and its neighbours on the pass, unit; the axis stands for a missing neighbour
        joined = same_pass[:-1, None]
        mean = 2 * axes
        mean[:-1] += np.where(joined, axes[1:], axes[:-1])
        mean[-1] += axes[-1]
        mean[1:] += np.where(joined, axes[:-1], axes[1:])
        mean[0] += axes[0]
        mean = unit(mean)

        if limits.narrow:
            mean = limits.nearest(mean)
        turned = angles_between(mean, axes) > MIN_TURN
        which = np.flatnonzero(close & turned & within_limits(mean, normals, limits, max_tilt))
        if not len(which):
            break
        which = which[free(which, mean[which])]
        axes[which] = mean[which]
    return axes
