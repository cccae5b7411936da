"""A small wheel by formula: straight blades on a conical hub, and a coarse job for it."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

import bonecam
from bonecam.mesh.solids import revolve
from bonecam.surface import TSpline, skin

PROFILE = np.array([[0.0, -3.0], [14.0, -3.0], [14.0, 0.0], [6.0, 10.0], [0.0, 10.0]])
"""Of the hub, rows (radius, height), mm."""
HEIGHT, HALF = 2.4, 0.8
"""Of the blades over the hub, and half their thickness, mm."""
EDGES = (0.12, 0.94)
"""Where the blades begin and end, shares of the way up the hub's cone; it ends less than a ball beyond them."""


def sections(half: float = HALF) -> list[Float[ndarray, "n 3"]]:
    """Closed sections of a blade at azimuth 0, from the hub out."""
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    start, end = PROFILE[2:4]
    along = end - start
    away = np.array([along[1], -along[0]]) / np.linalg.norm(along)
    share = (EDGES[0] + EDGES[1]) / 2 - (EDGES[1] - EDGES[0]) / 2 * np.cos(angle)
    rows = []
    for height in np.linspace(0.0, HEIGHT, 4):
        middle = start + share[:, None] * along + height * away
        rows.append(np.column_stack([middle[:, 0], half * np.sin(angle), middle[:, 1]]))
    return rows


def blade(half: float = HALF) -> TSpline:
    """The blade as one surface."""
    return skin(sections(half), 0.01)


def hub() -> bonecam.TriangleMesh:
    """The hub as a closed mesh."""
    return revolve(*PROFILE[1:-1].T, (PROFILE[0, 1], PROFILE[-1, 1]), 120)


def job() -> bonecam.Job:
    """Coarse passes, a ball of R 1.5 for all cuts."""
    tool = {
        "radius": 1.5,
        "flute_length": 4.0,
        "neck_diameter": 2.4,
        "neck_length": 12.0,
        "shank_diameter": 5.0,
        "overhang": 30.0,
        "holder_diameter": 16.0,
        "scallop": 0.3,
        "feed": 1500.0,
        "spindle": 10000.0,
    }
    return bonecam.Job().with_values(
        holding={"diameter": 10.0, "length": 30.0},
        roughing=tool,
        finishing=tool,
        levels={"finishing_depth": 0.3, "depths": "0.3 1.1"},
        path={
            "orientation": "lead",
            "max_tilt_deg": 85.0,
            "gouge_tolerance": 0.05,
            "chord_tolerance": 0.02,
            "pattern": "along",
        },
        warnings={"refuse": False},
    )
