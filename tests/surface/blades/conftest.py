"""A straight blade between two cylinders: sections, and tables of them."""

import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray

ROOT, TIP, LENGTH, HALF = 20.0, 30.0, 24.0, 1.0


@pytest.fixture(scope="session")
def profiles() -> list[Float[ndarray, "n 3"]]:
    """Closed sections (along the axis, arc, radius), an ellipse LENGTH x 2 HALF at five radii; counter-clockwise seen
    from outside where the axis is +Z."""
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    x, arc = LENGTH / 2 * np.cos(angle), HALF * np.sin(angle)
    return [np.column_stack([x, -arc, np.full(48, r)]) for r in np.linspace(ROOT, TIP, 5)]
