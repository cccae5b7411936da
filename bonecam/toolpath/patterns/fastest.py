"""Which way passes run on a level: round the part or along it, whichever the machine does sooner.

A pass round the part turns the table once, whatever the axis does, where its normals turn once; a pass along it
hardly turns it. So a pass of length l takes max(l / feed, 2 pi / turning speed) round the part, and l / feed
along it.
"""

import numpy as np

from bonecam.surface.tspline import TSpline
from bonecam.toolpath.cutters.cutter import Cutter
from bonecam.toolpath.patterns.sampling import contact_frames
from bonecam.toolpath.patterns.spacing import line_positions

SAMPLES = 48
"""Moves into which a line is divided to measure it."""
FULL_TURN = {"round": 2 * np.pi, "along": 0.0}
"""What a pass turns the table by, radians."""


def fastest_pattern(surface: TSpline, cutter: Cutter, turn_speed: float) -> str:
    """`round` or `along`; `turn_speed` is that of the axis that changes the azimuth, rad/min."""
    return min(FULL_TURN, key=lambda pattern: pattern_minutes(surface, pattern, cutter, turn_speed))


def pattern_minutes(surface: TSpline, pattern: str, cutter: Cutter, turn_speed: float) -> float:
    """Minutes that the passes of a pattern take at least, links left out."""
    across = line_positions(surface, pattern, cutter.radius, cutter.scallop)
    low, high = surface.domain[0 if pattern == "round" else 1]
    along = np.tile(np.linspace(low, high, SAMPLES + 1), len(across))
    fixed = np.repeat(across, SAMPLES + 1)
    parameters = np.column_stack([along, fixed] if pattern == "round" else [fixed, along])
    points, normals, _ = contact_frames(surface, pattern, parameters)
    centres = (points + cutter.radius * normals).reshape(len(across), SAMPLES + 1, 3)
    lengths = np.linalg.norm(np.diff(centres, axis=1), axis=2).sum(axis=1)
    return float(np.maximum(lengths / cutter.feed, FULL_TURN[pattern] / turn_speed).sum())
