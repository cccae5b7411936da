"""The smallest part that goes the whole way, and a job for it that takes a minute."""

import numpy as np

from bonecam.job import Job
from bonecam.setup import Capsule

SMALL_CAPSULE = Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 7.5]), 2.5)
"""5 x 10 mm."""
SMALL = Job().with_values(
    mechanics={"refuse": False},
    surface={"tolerance": 0.2},
    stock={"diameter": 7.0, "length": 11.0},
    holding={"diameter": 3.0, "length": 60.0, "chuck_diameter": 12.0, "chuck_height": 6.0},
    levels={"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
    roughing={"preset": "ball-4", "scallop": 0.3},
    finishing={"preset": "ball-2", "scallop": 0.1},
)
