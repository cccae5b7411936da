"""A registry of three small filters, and meshes to apply them to."""

from pathlib import Path

import bonecam_meshes
import pytest
from filter_examples import OFFSET, RECALL, TURN

from bonecam.filters.filter import Registry
from bonecam.filters.meshset import MeshSet


@pytest.fixture
def registry() -> Registry:
    return Registry([OFFSET, RECALL, TURN])


@pytest.fixture
def phalanx() -> Path:
    return Path(bonecam_meshes.path("phalanx"))


@pytest.fixture
def meshes(registry: Registry, phalanx: Path) -> MeshSet:
    found = MeshSet(registry=registry)
    found.load_new_mesh(str(phalanx))
    return found
