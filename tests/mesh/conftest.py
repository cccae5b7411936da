"""Small solids with known volumes, and what every reader of part files promises of a bad file."""

import pytest
from mesh_bodies import ellipsoid


@pytest.fixture(scope="session")
def bone():
    """A convex part of 1,536 faces."""
    return ellipsoid(5, 4, 14)
