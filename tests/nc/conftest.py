"""Paths that several tests of posting write."""

from collections.abc import Callable

import pytest

from bonecam.tool.path import ToolPath


@pytest.fixture(scope="session")
def three_paths(capsule_path: Callable[..., ToolPath]) -> list[ToolPath]:
    """Two roughing levels and one of another tool."""
    return [
        capsule_path(level=5, radius=2.0, offset=1.5, count=60),
        capsule_path(level=4, radius=2.0, offset=1.0, count=60),
        capsule_path(level=0, radius=1.0, number=2, count=60),
    ]
