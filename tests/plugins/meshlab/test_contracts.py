"""What every filter promises: one parametrised test a promise, over the registry of what is installed."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pymeshlab
import pytest
from bonecam_plugins.meshlab import Filter, FilterParameter, Kind, MeshSet, Percentage, installed
from bonecam_plugins.meshlab.filter import VERBS
from bonecam_plugins.meshlab.meshlab_values import FilterCall, ScriptParameter, write_script
from bonecam_plugins.meshlab.script_on_mesh import read_script

from bonecam.errors import FilterError

OURS = [item for item in installed() if item.act.__module__.startswith("bonecam_plugins")]
EVERY = pytest.mark.parametrize("item", OURS, ids=lambda item: item.name)

QUICK: dict[str, dict[str, Any]] = {
    "generate_stock": {"kind": "box", "allowance": 0.6},
    "generate_stock_capsule": {"allowance": 0.6},
    "compute_tspline_surface": {"tolerance": 0.2, "rows": 12},
    "generate_morph_levels": {"finishing_levels": 1, "finishing_depth": 0.5, "roughing_depth": 2.5},
    "generate_toolpath": {"roughing_scallop": 0.5, "finishing_scallop": 0.4, "chord_tolerance": 0.02},
}


class Chain:
    """An egg of 7 x 5.6 x 9.8 mm, and what the filters that others need first have made of it, each applied
    once."""

    def __init__(self, folder: Path) -> None:
        self.meshes = MeshSet(folder=folder)
        self.meshes.create_sphere(radius=3.5, subdiv=4)
        self.meshes.set_matrix(transformmatrix=np.diag([1.0, 0.8, 1.4, 1.0]))
        self._current = {(): self.meshes.current_mesh_id()}

    def prepare(self, names: Sequence[str]) -> None:
        """Make the layer current that the filters `names` lead to."""
        for count in range(1, len(names) + 1):
            done = tuple(names[:count])
            if done not in self._current:
                self.meshes.set_current_mesh(self._current[done[:-1]])
                self.meshes.apply_filter(done[-1], **QUICK[done[-1]])
                self._current[done] = self.meshes.current_mesh_id()
        self.meshes.set_current_mesh(self._current[tuple(names)])


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    return Chain(tmp_path_factory.mktemp("files"))


@pytest.fixture
def prepared(chain, item):
    chain.prepare(item.after)
    layers, current = chain.meshes.layers, chain.meshes.current_mesh_id()
    before = layers.keys()
    yield chain.meshes
    layers.restore(before, current)


def keeps_its_word(item: Filter, prepared: MeshSet, values: dict[str, Any]) -> None:
    """Results are plain values, and the input layer is as it was unless the filter says that it changes
    it."""
    source = prepared.current_mesh_id()
    vertices, faces = (prepared.current_mesh().vertex_matrix().copy(), prepared.current_mesh().face_matrix().copy())
    result = prepared.apply_filter(item.name, **values)
    assert isinstance(result, dict)
    assert all(isinstance(value, int | float | str | list | np.ndarray) for value in result.values())
    after = prepared.mesh(source)
    assert np.array_equal(after.face_matrix(), faces)
    assert item.changes_layer or np.array_equal(after.vertex_matrix(), vertices)


@EVERY
def test_leaves_its_input_layer_as_it_says(item, prepared):
    keeps_its_word(item, prepared, QUICK.get(item.name, {}))


@pytest.mark.slow
@pytest.mark.parametrize("item", [item for item in OURS if item.name in QUICK], ids=lambda item: item.name)
def test_runs_on_defaults(item, prepared):
    keeps_its_word(item, prepared, {})


@pytest.mark.parametrize("item", [item for item in OURS if item.after], ids=lambda item: item.name)
def test_says_what_must_come_before(item, tmp_path):
    meshes = MeshSet(folder=tmp_path)
    meshes.create_sphere(radius=5.0)
    with pytest.raises(FilterError, match=f"apply ({'|'.join(item.after)}) first"):
        meshes.apply_filter(item.name)
    assert meshes.mesh_number() == 1
    assert not list(tmp_path.iterdir())


@EVERY
def test_is_documented(item):
    assert item.name.split("_")[0] in VERBS
    assert item.documentation.strip().endswith(".")
    assert item.display_name[0].isupper()
    for parameter in item.parameters:
        assert parameter.label[0].isupper()
        assert parameter.tooltip.strip().endswith(".")
        assert parameter.kind is not Kind.LENGTH or parameter.unit == "mm"
        assert parameter.kind not in (Kind.FLOAT, Kind.INT) or np.isfinite([parameter.low, parameter.high]).all()
    assert set(item.after) <= set(installed().names)


@EVERY
def test_round_trips_through_a_script(item, tmp_path):
    parameters = tuple(ScriptParameter(p.name, p.kind.value, {"value": p.written(p.default)}) for p in item.parameters)
    write_script(
        [FilterCall(item.display_name, parameters), FilterCall(item.name, parameters)], tmp_path / "script.mlx"
    )
    for step in read_script(tmp_path / "script.mlx", installed()):
        assert step.name == item.name
        assert step.values == {p.name: p.checked(p.default) for p in item.parameters}


@EVERY
def test_refuses_values_out_of_range_or_kind_by_name(item):
    for parameter in item.parameters:
        for bad in wrong_values(parameter):
            with pytest.raises(FilterError, match=rf"{item.name}: parameter {parameter.name} = "):
                item.values({parameter.name: bad}, None)


def wrong_values(parameter: FilterParameter) -> list[object]:
    """Values that no parameter of this record may take."""
    bad: list[object] = [None, [1]]
    if parameter.kind not in (Kind.LENGTH,):
        bad += [pymeshlab.PercentageValue(3), Percentage(3.0)]
    if parameter.kind in (Kind.LENGTH, Kind.FLOAT, Kind.INT):
        step = 1 if parameter.kind is Kind.INT else 0.5
        bad += [bound + sign * step for bound, sign in ((parameter.low, -1), (parameter.high, 1)) if np.isfinite(bound)]
        bad += [float("nan"), "one", True]
    if parameter.kind in (Kind.BOOL, Kind.ENUM):
        bad += ["no such choice", 99]
    if parameter.kind in (Kind.STRING, Kind.OPEN_FILE, Kind.SAVE_FILE):
        bad += [3]
    return bad
