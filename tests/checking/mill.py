"""Cutting profiles: ball, flat, bull (torus) and drum (barrel) as arcs of a half plane, revolved about the tool axis.

A place of the half plane is (r, h): its distance from the axis and its height above the tip, mm. On an arc of
radius a about (r0, h0) the outward normal at the angle phi from straight down is (sin phi, -cos phi), and the place
that has it is

    (r0 + a sin phi, h0 - a cos phi).

The profiles are convex, so that phi, which is the angle between the tool axis and the normal of the part, tells the
place that touches.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import dots, unit
from bonecam.errors import ToolPathError
from bonecam.machine.bodies import Frustum
from bonecam.tool.cutter import ToolSection

QUARTER = np.pi / 2


@dataclass(frozen=True)
class Arc:
    """An arc of a profile about (`centre`, `height`) from angle `first` to `last` (radians); a corner has the
    `radius` 0."""

    centre: float
    height: float
    radius: float
    first: float
    last: float


@dataclass(frozen=True)
class CuttingProfile:
    """The profile from the tip up: a flat bottom as far as the first arc begins, its `arcs`, and above them a
    cylinder. `name` is ball, flat, bull or drum; mm."""

    name: str
    arcs: tuple[Arc, ...]

    @property
    def bottom(self) -> float:
        """Radius of the flat bottom; 0 of a profile that ends in a point of the axis."""
        first = self.arcs[0]
        return first.centre + first.radius * float(np.sin(first.first))

    @property
    def radius(self) -> float:
        """The largest radius."""
        return max(arc.centre + arc.radius for arc in self.arcs if arc.first <= QUARTER <= arc.last)

    @property
    def top(self) -> tuple[float, float]:
        """Radius and height of the end of the last arc."""
        last = self.arcs[-1]
        r = last.centre + last.radius * float(np.sin(last.last))
        return r, last.height - last.radius * float(np.cos(last.last))

    @property
    def steepest(self) -> float:
        """The largest angle between tool axis and normal at which an arc touches, radians."""
        return self.arcs[-1].last


def ball(radius: float) -> CuttingProfile:
    """A ball-end cutter. ValueError where the radius is not positive."""
    _require(radius > 0, f"a ball of radius {radius:g} mm: give a positive one")
    return CuttingProfile("ball", (Arc(0.0, radius, radius, 0.0, QUARTER),))


def flat(radius: float) -> CuttingProfile:
    """A flat-end cutter. ValueError where the radius is not positive."""
    _require(radius > 0, f"a flat end of radius {radius:g} mm: give a positive one")
    return CuttingProfile("flat", (Arc(radius, 0.0, 0.0, 0.0, QUARTER),))


def bull(radius: float, corner: float) -> CuttingProfile:
    """A bull-nose cutter: a flat end whose `corner` is rounded (a torus). ValueError unless 0 < corner < radius."""
    _require(
        0 < corner < radius, f"a corner of {corner:g} mm on a radius of {radius:g} mm: give a smaller, positive one"
    )
    return CuttingProfile("bull", (Arc(radius - corner, corner, corner, 0.0, QUARTER),))


def drum(radius: float, side: float, nose: float, *, over: float = 0.0) -> CuttingProfile:
    """A drum (barrel) cutter: an arc of radius `side` that bulges to `radius`, and a ball `nose` that touches it.

    The arc goes on above its widest place by the angle `over` (radians). ValueError unless nose < radius < side.
    """
    _require(
        0 < nose < radius < side,
        f"a drum of radius {radius:g} mm, nose {nose:g} mm and side {side:g} mm: give 0 < nose < radius < side",
    )
    _require(0 <= over < QUARTER, f"over = {over:g} rad: give an angle from 0 to a quarter turn")
    joint = float(np.arcsin((side - radius) / (side - nose)))
    widest = nose + (side - nose) * float(np.cos(joint))
    arcs = (Arc(0.0, nose, nose, 0.0, joint), Arc(radius - side, widest, side, joint, QUARTER + over))
    return CuttingProfile("drum", arcs)


def _require(holds: bool, message: str) -> None:
    """ValueError with the message where something does not hold."""
    if not holds:
        raise ValueError(message)


UPRIGHT = 1e-9
"""Below this sine of phi the tool stands upright on the contact: a flat bottom touches all round its middle."""


@dataclass(frozen=True, eq=False)
class Placed:
    """Tools on contacts: their `tips`, the `centres` of the arcs that touch, the `arcs` by number, the `angles`
    (radians) between axis and normal, and the distance of each contact from its axis (`reach`), mm."""

    tips: Float[ndarray, "n 3"]
    centres: Float[ndarray, "n 3"]
    arcs: Int[ndarray, " n"]
    angles: Float[ndarray, " n"]
    reach: Float[ndarray, " n"]


@dataclass(frozen=True)
class Mill:
    """A cutter: its cutting `profile` up to `flute_length`, a thinner `neck` (diameter, length) above it if it has
    one, its shank up to the `overhang`, and the holder; mm from the tip.

    ValueError where the pieces do not follow one another.
    """

    profile: CuttingProfile
    flute_length: float
    shank_diameter: float
    overhang: float
    holder: tuple[Frustum, ...] = ()
    neck: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        top = self.profile.top[1]
        if not self.flute_length >= top:
            raise ValueError(
                f"flute_length = {self.flute_length:g}: the profile is {top:g} mm high, give at least that"
            )
        if self.neck is not None and not 0 < self.neck[0] <= 2 * self.profile.radius:
            raise ValueError(f"a neck of {self.neck[0]:g} mm: give a diameter up to the cutter's")
        above = self.flute_length + (self.neck[1] if self.neck else 0.0)
        if not self.overhang > above:
            raise ValueError(f"overhang = {self.overhang:g}: flutes and neck end at {above:g} mm, give more")

    @property
    def sections(self) -> tuple[ToolSection, ...]:
        """The cylinders and cones above the arcs of the profile, from the tip up."""
        width, top = self.profile.top
        pieces = [("cutter", self.flute_length - top, width, width)]
        if self.neck:
            pieces.append(("neck", self.neck[1], self.neck[0] / 2, self.neck[0] / 2))
        above = self.flute_length + (self.neck[1] if self.neck else 0.0)
        pieces.append(("shank", self.overhang - above, self.shank_diameter / 2, self.shank_diameter / 2))
        pieces += [("holder", piece.length, piece.diameter / 2, piece.top_diameter / 2) for piece in self.holder]
        sections = list[ToolSection]()
        start = top
        for name, length, radius, end_radius in pieces:
            if length > 0:
                sections.append(ToolSection(name, start, start + length, radius, end_radius))
                start += length
        return tuple(sections)

    def place(
        self, contacts: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"]
    ) -> Placed:
        """The tool on each contact with a unit normal of the part and a unit axis.

        A flat bottom that stands upright touches with its middle. ToolPathError where the axis leans further from
        the normal than the profile reaches.
        """
        angles = np.arccos(np.clip(dots(normals, axes), -1.0, 1.0))
        worst = int(np.argmax(angles)) if len(angles) else 0
        if len(angles) and angles[worst] > self.profile.steepest + UPRIGHT:
            raise ToolPathError(
                f"contact {worst}: the tool axis leans {np.degrees(angles[worst]):.1f} deg from the normal, a "
                f"{self.profile.name} cutter touches up to {np.degrees(self.profile.steepest):.1f}: tilt it less",
                index=worst,
            )
        arc = np.searchsorted([arc.last for arc in self.profile.arcs[:-1]], angles, side="right")
        centre, height, radius = (
            np.array([getattr(each, name) for each in self.profile.arcs])[arc]
            for name in ("centre", "height", "radius")
        )
        sine = np.sin(angles)
        upright = sine < UPRIGHT
        reach = np.where(upright, 0.0, centre + radius * sine)
        outward = unit(np.cos(angles)[:, None] * axes - normals + np.finfo(float).tiny)
        tips = contacts - reach[:, None] * outward - (height - radius * np.cos(angles))[:, None] * axes
        return Placed(tips, contacts + radius[:, None] * normals, arc, angles, reach)

    def effective_radii(
        self, normals: Float[ndarray, "n 3"], axes: Float[ndarray, "n 3"], feeds: Float[ndarray, "n 3"]
    ) -> Float[ndarray, " n"]:
        """Radius (mm) of the section that the tool sweeps across its unit feed direction, at the contact: that of a
        ball which leaves the same cusps. Infinite where a flat bottom stands upright."""
        placed = self.place(np.zeros_like(normals), normals, axes)
        arc_radius = np.array([arc.radius for arc in self.profile.arcs])[placed.arcs]
        meridian = unit(axes - np.cos(placed.angles)[:, None] * normals + np.finfo(float).tiny)
        sine = np.sin(placed.angles)
        upright = sine < UPRIGHT
        share = np.where(upright, 0.0, dots(feeds, meridian) ** 2)
        round_ = placed.reach / np.where(upright, 1.0, sine)
        radii = arc_radius * (1 - share) + round_ * share
        return np.where(upright & (self.profile.bottom > 0), np.inf, radii)

    def distances(
        self, points: Float[ndarray, "n 3"], tip: Float[ndarray, "3"], axis: Float[ndarray, "3"]
    ) -> Float[ndarray, " n"]:
        """Signed distance (mm) of points from the cutting part, negative inside: how deep it goes into the part there.
        Neck, shank and holder are `sections`."""
        away = points - tip
        h = away @ axis
        r = np.linalg.norm(away - h[:, None] * axis, axis=1)
        edges = [_to_arc(r, h, arc) for arc in self.profile.arcs]
        width, top = self.profile.top
        edges += [
            _to_segment(r, h, (0.0, 0.0), (self.profile.bottom, 0.0), (0.0, -1.0)),
            _to_segment(r, h, (width, top), (width, self.flute_length), (1.0, 0.0)),
            _to_segment(r, h, (width, self.flute_length), (0.0, self.flute_length), (0.0, 1.0)),
        ]
        nearest = np.argmin([np.abs(edge) for edge in edges], axis=0)
        return np.asarray(np.choose(nearest, edges))


def _to_arc(r: Float[ndarray, " n"], h: Float[ndarray, " n"], arc: Arc) -> Float[ndarray, " n"]:
    """Distance to an arc, negative on its inner side."""
    angle = np.clip(np.arctan2(r - arc.centre, arc.height - h), arc.first, arc.last)
    sine, cosine = np.sin(angle), np.cos(angle)
    across, up = r - arc.centre - arc.radius * sine, h - arc.height + arc.radius * cosine
    inside = across * sine - up * cosine < 0
    return np.where(inside, -1.0, 1.0) * np.hypot(across, up)


def _to_segment(
    r: Float[ndarray, " n"],
    h: Float[ndarray, " n"],
    start: tuple[float, float],
    end: tuple[float, float],
    outward: tuple[float, float],
) -> Float[ndarray, " n"]:
    """Distance to a straight edge, negative on its inner side."""
    along = np.subtract(end, start)
    square = max(float(along @ along), np.finfo(float).tiny)
    share = np.clip(((r - start[0]) * along[0] + (h - start[1]) * along[1]) / square, 0.0, 1.0)
    across, up = r - start[0] - share * along[0], h - start[1] - share * along[1]
    inside = across * outward[0] + up * outward[1] < 0
    return np.where(inside, -1.0, 1.0) * np.hypot(across, up)
