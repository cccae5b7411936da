"""Paths that several tests of posting write.

The paths of a program with two tools.
"""

import pytest
from small_parts import capsule_path

from bonecam.tool.path import ToolPath


@pytest.fixture(scope="session")
def three_paths() -> list[ToolPath]:
    """Two roughing levels and one of another tool."""
    return [
        capsule_path(level=5, radius=2.0, offset=1.5, count=60),
        capsule_path(level=4, radius=2.0, offset=1.0, count=60),
        capsule_path(level=0, radius=1.0, number=2, count=60),
    ]


@pytest.fixture(scope="session")
def paths() -> tuple[ToolPath, ToolPath]:
    """A level cut for roughing, and the last one for finishing."""
    return (
        capsule_path(level=5, radius=2.0, offset=1.5, number=1, count=150),
        capsule_path(level=0, radius=1.0, number=2, count=150),
    )
