"""A registry of three small filters, and meshes to apply them to."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import bonecam_meshes
import numpy as np
import pytest
from bonecam_plugins.meshlab import Filter, FilterParameter, Kind, Layers, MeshSet, Registry

from bonecam.errors import StockError
from bonecam.mesh import TriangleMesh
from bonecam.progress import Progress


def offset(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    mesh = layers.mesh()
    moved = TriangleMesh(mesh.vertices + np.array([0, 0, values["distance"]]), mesh.faces)
    layers.add(moved, "moved", quality=moved.vertices[:, 2], keep={"distance": values["distance"]})
    if values["fail"]:
        raise StockError("the stock is too small: take a larger one", distance=1.0)
    if values["file"]:
        layers.target(values["file"]).write_text("moved\n")
    return {"distance": values["distance"], "how": values["how"]}


def recall(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    return {"distance": layers.kept("distance", float, "generate_offset")}


def turn(layers: Layers, values: Mapping[str, Any], progress: Progress) -> dict[str, Any]:
    layers.transform(np.diag([-1.0, -1.0, 1.0, 1.0]))
    return {}


OFFSET = Filter(
    "generate_offset",
    "Generate Offset",
    "Moves a copy of the layer along z. A test's filter.",
    "Test",
    (
        FilterParameter("distance", Kind.LENGTH, 1.0, "Distance", "How far.", "mm", 0.0, 20.0),
        FilterParameter("how", Kind.ENUM, "up", "How", "Which way.", choices=("up", "down")),
        FilterParameter("count", Kind.INT, 2, "Count", "How often.", low=1, high=9),
        FilterParameter("share", Kind.LENGTH, 5.0, "Share", "Of the range.", "mm", 0.0, 10.0, percentage_of_range=True),
        FilterParameter("fail", Kind.BOOL, False, "Fail", "Raise an error after the layer was added."),
        FilterParameter("size", Kind.FLOAT, 0.0, "Size", "Of the mesh.", "mm", computed=lambda mesh: mesh.diagonal),
        FilterParameter("file", Kind.SAVE_FILE, "", "File", "Written where given."),
    ),
    offset,
)
RECALL = Filter("compute_recall", "Recall", "Gives what generate_offset kept.", "Test", (), recall)
TURN = Filter("apply_turn", "Apply Turn", "Turns the layer half round.", "Test", (), turn, changes_layer=True)


@pytest.fixture(scope="session")
def offset_filter():
    """Moves a copy of the layer along z; has a parameter of every kind."""
    return OFFSET


@pytest.fixture(scope="session")
def recall_filter():
    """Gives what the offset kept."""
    return RECALL


@pytest.fixture(scope="session")
def turn_filter():
    """Turns the layer half round."""
    return TURN


@pytest.fixture
def registry():
    return Registry([OFFSET, RECALL, TURN])


@pytest.fixture
def phalanx():
    return Path(bonecam_meshes.path("phalanx"))


@pytest.fixture
def meshes(registry, phalanx):
    found = MeshSet(registry=registry)
    found.load_new_mesh(str(phalanx))
    return found
