"""What FCL would find of its tool, told by distances where those decide: fifty times as fast.

A section of the tool is a cylinder of radius r from `bottom` to `top`; of a cone, the cylinder that holds it is
proven free, and the one inside it collides. With d the distance from the axis point at height u to the nearest
obstacle:

    collision   the ball of radius min(r, u - bottom, top - u) about the point lies in the cylinder, and the
                obstacle comes nearer than that
    free        the sphere of radius d is empty; it holds the disc at every height within sqrt(d^2 - r^2) of u

In contrast to `sphere_tracing.py`, a sphere may begin up to 4 radii above the height that is proven so far:
of a wide disc close above a level no sphere about its own middle holds the rim.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.planning.collision.scene import Scene, Surroundings
from bonecam.planning.collision.sphere_tracing import COLLIDING, FREE, UNDECIDED
from bonecam.planning.collision.tool_mesh import CIRCUMSCRIBED, sweep_margin
from bonecam.tool.cutter import Cutter, ToolSection

LOOK_AHEAD = (4.0, 2.0, 1.0, 0.5, 0.25, 0.0)
"""How far above the proven height spheres are tried, in radii of the section; a far one proves most."""
ROUNDS = 12
"""Times that the proven height is raised at most; then the section is undecided."""
MIN_RISE = 0.02
"""A round that raises the proven height by less (mm) proves nothing more."""
SURE_SHARE = 0.99
"""Part of a radius or a sphere that counts, against rounding and for polygons inside a circle."""


@dataclass(frozen=True)
class ThickSection:
    """A section from `bottom` to `top` (mm from the tip) between an `inner` and an `outer` cylinder (radii, mm)
    about the tool axis, and what it must stay out of."""

    bottom: float
    top: float
    inner: float
    outer: float
    around: Surroundings


def classify_thick_tool(
    scene: Scene,
    cutter: Cutter,
    margin: float,
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    *,
    air: float | None = None,
) -> Int[ndarray, "n k"]:
    """FREE, UNDECIDED or COLLIDING for each section of the cutter's profile in each pose above the table; UNDECIDED too
    where one above it collides.

    The tool above the cutter is thicker by `sweep_margin`s of `margin` (mm), the cutter is thinner by
    the scene's `tangent_slack`; `air` as in `classify_poses`.
    """
    centres = cutter.centres_of(tips, axes)
    ball, *above = cutter.profile
    around = _with_prisms(scene.around(ball.name, cutter.envelope_radius, air))
    thin = cutter.radius - scene.tangent_slack
    sections = [
        ThickSection(ball.start, ball.end, thin, thin, around),
        *(_thick(scene, cutter, section, margin, air) for section in above),
    ]
    states = np.full((len(tips), len(sections)), UNDECIDED)
    for k in reversed(range(len(sections))):
        open_ = np.flatnonzero((states != COLLIDING).all(axis=1))
        states[open_, k] = _classify_section(tips[open_], axes[open_], sections[k])
    ball_free = _ball_free(around, cutter, centres)
    states[:, 0] = np.where(ball_free, states[:, 0], np.maximum(states[:, 0], UNDECIDED))
    return states


def _thick(
    scene: Scene, cutter: Cutter, section: ToolSection, margin: float, air: float | None
) -> ThickSection:
    """A section above the cutter, thicker by its margin."""
    by = sweep_margin(cutter, section, margin)
    inner = min(section.radius, section.end_radius) + by
    outer = section.widest + by * float(np.hypot(1.0, section.taper))
    around = _with_prisms(scene.around(section.name, cutter.envelope_radius, air))
    return ThickSection(section.start - by, section.end + by, inner, outer, around)


def _with_prisms(around: Surroundings) -> Surroundings:
    """Surroundings whose columns hold the prisms that stand for them."""
    columns = [replace(column, radius=column.radius * CIRCUMSCRIBED) for column in around.columns]
    return replace(around, columns=tuple(columns))


def _ball_free(around: Surroundings, cutter: Cutter, centres: Float[ndarray, "n 3"]) -> Bool[ndarray, " n"]:
    """Whether the ball, thinner by the scene's `tangent_slack`, is free at each centre."""
    thin = cutter.envelope_radius - around.scene.tangent_slack
    distance = around.distance_bound(centres, np.full(len(centres), cutter.envelope_radius))
    clamping = around.scene.clamping
    above = centres[:, 2] > cutter.envelope_radius + clamping.clearance
    return (distance > thin) & (above | (not clamping.closed))


def _classify_section(
    tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], section: ThickSection
) -> Int[ndarray, " n"]:
    """The state of one section of each tool."""
    state = np.full(len(tips), UNDECIDED)
    proven = np.full(len(tips), section.bottom)
    going = np.arange(len(tips))
    for _ in range(ROUNDS):
        if not len(going):
            break
        raised, hit = _raise(tips[going], axes[going], proven[going], section)
        state[going[hit]] = COLLIDING
        state[going[~hit & (raised >= section.top)]] = FREE
        rising = ~hit & (raised < section.top) & (raised > proven[going] + MIN_RISE)
        proven[going] = raised
        going = going[rising]
    return state


def _raise(
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    proven: Float[ndarray, " n"],
    section: ThickSection,
) -> tuple[Float[ndarray, " n"], Bool[ndarray, " n"]]:
    """The proven height (mm) of each tool raised by the first sphere of LOOK_AHEAD that begins below it, and
    whether one before that told a collision."""
    raised = proven.copy()
    hit = np.zeros(len(proven), dtype=bool)
    for ahead in LOOK_AHEAD:
        open_ = np.flatnonzero(~hit & (raised <= proven + MIN_RISE))
        if not len(open_):
            break
        low = proven[open_]
        u = np.minimum(low + ahead * section.outer, section.top)
        half, hit[open_] = _sphere(tips[open_] + u[:, None] * axes[open_], u, low, section)
        raised[open_] = np.where(u - half <= low, np.maximum(raised[open_], u + half), raised[open_])
    return raised, hit


def _sphere(
    points: Float[ndarray, "n 3"], u: Float[ndarray, " n"], low: Float[ndarray, " n"], section: ThickSection
) -> tuple[Float[ndarray, " n"], Bool[ndarray, " n"]]:
    """How far above and below height `u` (mm) discs of the section lie in the empty sphere about the axis
    point there (-1 where none does), and whether an obstacle enters the section near it; distances are asked
    as far as a sphere that holds all discs above `low` reaches."""
    outer = section.outer * CIRCUMSCRIBED
    wanted = np.hypot(outer, np.maximum(u - low, section.top - u)) / SURE_SHARE
    distance = section.around.distance_bound(points, wanted)
    room = np.minimum(section.inner, np.minimum(u - section.bottom, section.top - u))
    collides = distance + section.around.deviation < SURE_SHARE * room
    spare = (SURE_SHARE * distance) ** 2 - outer**2
    return np.where((distance > 0) & (spare > 0), np.sqrt(np.maximum(spare, 0.0)), -1.0), collides
