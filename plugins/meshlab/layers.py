"""What a filter sees: MeshLab's layers as bonecam's values, and the values that travel between filters beside
them.

A layer of MeshLab holds triangles only. The T-spline, stock, level or tool path that a filter computed is
kept in a record beside the layer; a new layer inherits the record of the layer it came from. A record speaks
of a layer's geometry: where another filter has changed that since, asking for it is an error instead of an
answer about a mesh that is gone.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import FilterError
from bonecam.job import Job
from bonecam.mesh.meshlab import meshlab, quality_colours
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.mesh.units import to_mm

Value = TypeVar("Value")


@dataclass
class _Record:
    """What is kept of one layer, and the layer's geometry when it was."""

    fingerprint: bytes
    values: dict[str, Any] = field(default_factory=dict)


class Layers:
    """The layers of one pymeshlab MeshSet. Filters read the current one, add new ones and keep values beside
    them.

    `folder` is where the relative names of files to write lead.
    """

    def __init__(self, meshset: Any, folder: Path) -> None:
        self.meshset = meshset
        self.folder = folder
        self._records: dict[int, _Record] = {}

    @property
    def count(self) -> int:
        """Number of layers."""
        return int(self.meshset.mesh_number())

    @property
    def name(self) -> str:
        """What errors call the current layer."""
        return f"layer {self.meshset.current_mesh_id()} {self.meshset.current_mesh().label()!r}"

    def mesh(self) -> TriangleMesh:
        """The current layer in its own coordinates, its matrix applied. FilterError where there is none, or
        no triangles."""
        if not self.count:
            raise FilterError("there is no layer: load a mesh first")
        layer = self.meshset.current_mesh()
        if not layer.face_number():
            raise FilterError(f"{self.name} has no triangles: make a layer with a surface the current one")
        return TriangleMesh(layer.transformed_vertex_matrix(), layer.face_matrix().astype(np.int32))

    def bone(self) -> TriangleMesh:
        """The current layer where its size is a bone's in mm; UnitsError names the unit that it seems to be
        in."""
        return to_mm(self.mesh(), "mm", self.name, 'apply apply_units_in_mm with units="{}"')

    def keep(self, **values: Any) -> None:
        """Keep values beside the current layer; what was kept of an earlier shape of it is dropped."""
        self._records[self.meshset.current_mesh_id()] = _Record(self._fingerprint(), {**self._valid(), **values})

    def kept(self, name: str, kind: type[Value], made_by: str) -> Value:
        """The value `name` beside the current layer. FilterError says which filter makes it, or that the
        layer has changed."""
        record = self._records.get(self.meshset.current_mesh_id())
        if record is None or not isinstance(record.values.get(name), kind):
            raise FilterError(f"{self.name} has no {name}: apply {made_by} first", value=name)
        if record.fingerprint != self._fingerprint():
            raise FilterError(f"{self.name} was changed after its {name} was made: apply {made_by} again", value=name)
        value: Value = record.values[name]
        return value

    def job(self) -> Job:
        """The job as the filters before have filled it in beside the current layer, or the default one."""
        job: Job = self._valid().get("job", Job())
        return job

    def add(
        self,
        mesh: TriangleMesh,
        name: str,
        quality: Float[ndarray, " n"] | None = None,
        keep: Mapping[str, Any] | None = None,
        largest: float = 0.0,
    ) -> int:
        """A new current layer with the kept values of the layer before and `keep`.

        `quality` is a number a vertex, shown as colour: from 0 to `largest`, or without that over its own
        range.
        """
        extra = {} if quality is None else {"v_scalar_array": np.asarray(quality, dtype=np.float64)}
        key = self._new(meshlab().Mesh(mesh.vertices, mesh.faces, **extra), name, keep or {})
        if quality is not None:
            self.native("compute_color_from_scalar_per_vertex", **(quality_colours(largest) if largest > 0 else {}))
        return key

    def add_polyline(
        self, points: Float[ndarray, "n 3"], edges: ndarray, name: str, quality: Float[ndarray, " n"]
    ) -> int:
        """A new current layer of points (n, 3) joined by edges (m, 2), with a number a point."""
        layer = meshlab().Mesh(
            points,
            edge_matrix=edges.astype(np.int32).reshape(-1, 2),
            v_scalar_array=np.asarray(quality, dtype=np.float64),
        )
        key = self._new(layer, name, {})
        self.native("compute_color_from_scalar_per_vertex")
        return key

    def select(self, key: int) -> None:
        """Make a layer the current one."""
        self.meshset.set_current_mesh(key)

    def transform(self, matrix: Float[ndarray, "4 4"]) -> None:
        """Move the current layer itself; faces of one that is mirrored go round the other way."""
        self.native("set_matrix", transformmatrix=np.asarray(matrix, dtype=np.float64), compose=True, freeze=True)
        if np.linalg.det(matrix) < 0:
            self.native("meshing_invert_face_orientation")

    def native(self, name: str, **values: Any) -> Any:
        """Apply one of MeshLab's own filters as part of the running one."""
        return self.meshset.apply_native(name, **values)

    def target(self, name: str) -> Path:
        """Where a file to be written goes: relative names lead into `folder`. FilterError where one leads out
        of it again."""
        place = self.folder / name
        if not Path(name).is_absolute() and self.folder.resolve() not in place.resolve().parents:
            raise FilterError(
                f"file {name!r} is no file in the folder of outputs: give a name in it, or an absolute path", file=name
            )
        return place

    def keys(self) -> frozenset[int]:
        """The ids of all layers."""
        return frozenset(layer.id() for layer in self.meshset)

    def restore(self, keys: frozenset[int], current: int | None) -> None:
        """Delete the layers that are not of `keys` and make `current` current again."""
        for key in sorted(self.keys() - keys):
            self.meshset.set_current_mesh(key)
            self.native("delete_current_mesh")
            self._records.pop(key, None)
        if current is not None:
            self.meshset.set_current_mesh(current)

    def _new(self, layer: Any, name: str, keep: Mapping[str, Any]) -> int:
        inherited = self._valid() if self.count else {}
        self.meshset.add_mesh(layer, name)
        self.keep(**{**inherited, **keep})
        return int(self.meshset.current_mesh_id())

    def _valid(self) -> dict[str, Any]:
        """What is kept of the current layer as it is now."""
        record = self._records.get(self.meshset.current_mesh_id())
        return record.values if record is not None and record.fingerprint == self._fingerprint() else {}

    def _fingerprint(self) -> bytes:
        layer = self.meshset.current_mesh()
        state = hashlib.blake2b(np.ascontiguousarray(layer.transformed_vertex_matrix()).tobytes())
        state.update(np.ascontiguousarray(layer.face_matrix()).tobytes())
        return state.digest()
