"""What FCL would find of its tool, told by distances where those decide: fifty times as fast.

A section of the tool is a cylinder of radius r from `bottom` to `top`. With d the distance from the axis
point at height u to the nearest obstacle:

    collision   the ball of radius min(r, u - bottom, top - u) about the point lies in the cylinder, and the
                obstacle comes nearer than that
    free        the sphere of radius d is empty; it holds the disc at every height within sqrt(d^2 - r^2) of u

In contrast to `sphere_tracing.py`, a sphere may begin up to 4 radii above the height that is proven so far:
of a wide disc close above a level no sphere about its own middle holds the rim.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.orientation.collision.scene import Obstacle, Scene
from bonecam.orientation.collision.sphere_tracing import COLLIDING, FREE, TANGENT_SLACK, UNDECIDED
from bonecam.orientation.collision.tool_mesh import CIRCUMSCRIBED
from bonecam.setup.holding import Post
from bonecam.toolpath.cutter import Cutter

LOOK_AHEAD = (4.0, 2.0, 1.0, 0.5, 0.25, 0.0)
"""How far above the proven height spheres are tried, in radii of the section; a far one proves most."""
ROUNDS = 12
"""Times that the proven height is raised at most; then the section is undecided."""
MIN_RISE = 0.02
"""A round that raises the proven height by less (mm) proves nothing more."""
SURE_SHARE = 0.99
"""Part of a radius or a sphere that counts, against rounding and for polygons inside a circle."""


@dataclass(frozen=True)
class Section:
    """A cylinder about the tool axis from `bottom` to `top` (mm from the tip), what it must stay out of, and
    by how much (mm) the `obstacle` may reach out of the mesh that FCL has of it."""

    bottom: float
    top: float
    radius: float
    obstacle: Obstacle
    post: Post
    deviation: float


def classify_thick_tool(
    scene: Scene,
    cutter: Cutter,
    margin: float,
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    *,
    cutting: bool,
) -> Int[ndarray, " n"]:
    """FREE, UNDECIDED or COLLIDING for poses above the table.

    Shank and holder are thicker by `margin` (mm), the cutter is thinner by TANGENT_SLACK; `cutting`: it is held
    against the level, else against the material.
    """
    centres = tips + cutter.radius * axes
    state = np.where(_ball_free(scene, cutter, centres, cutting), FREE, UNDECIDED)
    for section in _sections(scene, cutter, margin, cutting):
        open_ = np.flatnonzero(state != COLLIDING)
        found = _classify_section(scene, tips[open_], axes[open_], section)
        state[open_] = np.maximum(state[open_], found)
    return state


def _sections(scene: Scene, cutter: Cutter, margin: float, cutting: bool) -> list[Section]:
    """Holder, shank, and the cutter above the centre of its ball."""
    (_, middle, edge, radius), *above = cutter.sections
    fillet = _prism(scene.post_with_fillet(cutter.radius))
    thick = [
        Section(start - margin, end + margin, wide + margin, "material", fillet, scene.material_deviation)
        for _, start, end, wide in above
    ]
    obstacle: Obstacle = "level" if cutting else "material"
    deviation = 0.0 if cutting else scene.material_deviation
    thin = radius - TANGENT_SLACK
    return [*thick[::-1], Section(middle, edge, thin, obstacle, _prism(scene.post), deviation)]


def _prism(post: Post) -> Post:
    """A post that holds the prism that stands for `post`."""
    return Post(post.radius * CIRCUMSCRIBED, post.top)


def _ball_free(
    scene: Scene, cutter: Cutter, centres: Float[ndarray, "n 3"], cutting: bool
) -> Bool[ndarray, " n"]:
    """Whether the ball, thinner by TANGENT_SLACK, is free at each centre."""
    thin = cutter.radius - TANGENT_SLACK
    obstacle: Obstacle = "level" if cutting else "material"
    wanted = np.full(len(centres), cutter.radius)
    distance = scene.distance_bound(centres, wanted, obstacle, _prism(scene.post))
    return np.asarray((distance > thin) & (centres[:, 2] > cutter.radius))


def _classify_section(
    scene: Scene, tips: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], section: Section
) -> Int[ndarray, " n"]:
    """The state of one section of each tool."""
    state = np.full(len(tips), UNDECIDED)
    proven = np.full(len(tips), section.bottom)
    going = np.arange(len(tips))
    for _ in range(ROUNDS):
        if not len(going):
            break
        raised, hit = _raise(scene, tips[going], axes[going], proven[going], section)
        state[going[hit]] = COLLIDING
        state[going[~hit & (raised >= section.top)]] = FREE
        rising = ~hit & (raised < section.top) & (raised > proven[going] + MIN_RISE)
        proven[going] = raised
        going = going[rising]
    return state


def _raise(
    scene: Scene,
    tips: Float[ndarray, "n 3"],
    axes: Float[ndarray, "n 3"],
    proven: Float[ndarray, " n"],
    section: Section,
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
        u = np.minimum(low + ahead * section.radius, section.top)
        half, hit[open_] = _sphere(scene, tips[open_] + u[:, None] * axes[open_], u, low, section)
        raised[open_] = np.where(u - half <= low, np.maximum(raised[open_], u + half), raised[open_])
    return raised, hit


def _sphere(
    scene: Scene,
    points: Float[ndarray, "n 3"],
    u: Float[ndarray, " n"],
    low: Float[ndarray, " n"],
    section: Section,
) -> tuple[Float[ndarray, " n"], Bool[ndarray, " n"]]:
    """How far above and below height `u` (mm) discs of the section lie in the empty sphere about the axis
    point there (-1 where none does), and whether an obstacle enters the section near it; distances are asked
    as far as a sphere that holds all discs above `low` reaches."""
    outer = section.radius * CIRCUMSCRIBED
    wanted = np.hypot(outer, np.maximum(u - low, section.top - u)) / SURE_SHARE
    distance = scene.distance_bound(points, wanted, section.obstacle, section.post)
    room = np.minimum(section.radius, np.minimum(u - section.bottom, section.top - u))
    collides = distance + section.deviation < SURE_SHARE * room
    spare = (SURE_SHARE * distance) ** 2 - outer**2
    return np.where((distance > 0) & (spare > 0), np.sqrt(np.maximum(spare, 0.0)), -1.0), collides
