"""A MeshSet that is pymeshlab's plus bonecam's filters: by `apply_filter`, as methods, and in filter scripts.

    meshes = MeshSet()
    meshes.load_new_mesh("bone.stl")
    meshes.meshing_isotropic_explicit_remeshing()          # MeshLab's
    meshes.compute_tspline_surface(tolerance=0.1)          # ours; lengths as mm, PureValue or PercentageValue
    meshes.apply_filter("generate_morph_levels", roughing_depth=pymeshlab.PercentageValue(1.5))

pymeshlab's methods and `apply_filter` call our `apply_filter`, which knows both sorts. What ours compute
beyond triangles is kept beside the layers (`layers`). A filter of ours that fails or is cancelled leaves the
layers as they were.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

from bonecam_plugins.meshlab.filter import Filter, Registry, installed, parameter_list
from bonecam_plugins.meshlab.guards import ENDING, layers_of, meshlab_filters, try_filter, try_reading
from bonecam_plugins.meshlab.layers import Layers
from bonecam_plugins.meshlab.meshlab_values import FilterCall, ScriptParameter, read_calls, refusals_told, write_script
from bonecam_plugins.meshlab.scripts import ScriptFiles, ScriptStep, apply_steps, read_script

from bonecam.errors import BonecamError, FileError, FilterError, did_you_mean
from bonecam.mesh.meshlab import meshlab
from bonecam.progress import Progress, silent
from bonecam.runtime.staging import temporary_folder


class MeshSetError(FilterError, meshlab().PyMeshLabException):  # type: ignore[misc]
    """A filter of a MeshSet is unknown, has a wrong parameter, or failed: also a PyMeshLabException."""


class MeshSetFileError(FileError, meshlab().PyMeshLabException):  # type: ignore[misc]
    """A file that a MeshSet cannot read: also a PyMeshLabException."""


class MeshSet(meshlab().MeshSet):  # type: ignore[misc]
    """pymeshlab.MeshSet plus the filters of `registry`. `folder`: where relative names of files that filters
    write lead. A script may write and read elsewhere with `allow_outside`, and over files with `force`; so may what a
    mesh file names as material or texture lie."""

    def __init__(
        self,
        verbose: bool = False,
        progress: Progress = silent,
        registry: Registry | None = None,
        folder: str | Path = ".",
        *,
        allow_outside: bool = False,
        force: bool = False,
    ) -> None:
        super().__init__(verbose)
        self.registry = installed() if registry is None else registry
        self.progress = progress
        self.layers = Layers(self, Path(folder))
        self.allow_outside = allow_outside
        self.force = force
        self._history: list[int | FilterCall] = []
        self._native_calls = 0
        self._loaded: tuple[ScriptStep, ...] = ()
        self._loaded_from = ""

    def __getattr__(self, name: str) -> Any:
        registry = self.__dict__.get("registry")
        if registry is None or name not in registry.names:
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")

        def apply(**values: Any) -> dict[str, Any]:
            return self.apply_filter(name, **values)

        apply.__name__, apply.__doc__ = name, registry[name].documentation
        return apply

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.registry.names})

    def load_new_mesh(self, file_name: str, **options: Any) -> None:
        """Add the layers of a file, the last of them current; `options` are those of MeshLab's reader.

        MeshLab reads it in a process of its own (`mesh.files.meshlab_files`). MeshSetFileError names the file
        and what is wrong with it.
        """
        with _as_ours(), layers_of(Path(file_name), options, allow_outside=self.allow_outside) as layers:
            for file, label in layers:
                super().load_new_mesh(str(file))
                self.current_mesh().set_label(self._free_label(label))

    def load_project(self, file_name: str | Sequence[str]) -> None:
        """Add the layers and rasters of a project of MeshLab's, which is read in a process of its own first.
        MeshSetFileError names the file and what is wrong with it."""
        with _as_ours():
            try_reading("load_project", file_name, {"file_name": file_name})
        super().load_project(file_name)

    def load_new_raster(self, file_name: str, **options: Any) -> None:
        """Add a picture as a raster, as `load_project`."""
        with _as_ours():
            try_reading("load_new_raster", file_name, {"file_name": file_name, **options})
        super().load_new_raster(file_name, **options)

    def _free_label(self, label: str) -> str:
        """The label, with a number in it where another layer has it, as MeshLab numbers them."""
        name = Path(label)
        taken = {layer.label() for layer in self}
        numbered = (f"{name.stem}({k}){name.suffix}" for k in count(1))
        return label if label not in taken else next(free for free in numbered if free not in taken)

    def apply_filter(self, filter_name: str, **values: Any) -> dict[str, Any]:
        """Apply a filter of MeshLab's or ours by its Python name; the results by name.

        MeshSetError names an unknown filter or parameter; of MeshLab's own filters it carries MeshLab's words.
        """
        with _as_ours():
            if filter_name in self.registry.names:
                return self._apply_ours(self.registry[filter_name], values)
            if filter_name not in meshlab_filters():
                remedy = f"{did_you_mean(filter_name, self.filter_list())}: `bonecam filters` lists them"
                raise FilterError(f"there is no filter {filter_name!r}{remedy}", filter=filter_name)
            result = self.apply_native(filter_name, **values)
        self._history.append(self._native_calls - 1)
        return result

    def apply_native(self, filter_name: str, **values: Any) -> dict[str, Any]:
        """Apply a filter of MeshLab's without a line in the script; FilterError carries MeshLab's words."""
        if filter_name in ENDING:
            with _as_ours():
                try_filter(filter_name, values, self.filter_parameter_values(filter_name, **values))
        with refusals_told(filter_name, values):
            result: dict[str, Any] = super().apply_filter(filter_name, **values)
        self._native_calls += 1
        return result

    def _apply_ours(self, item: Filter, given: Mapping[str, Any]) -> dict[str, Any]:
        mesh = self.layers.mesh() if item.needs_layer else None
        with _faults_told(item):
            values = item.values(given, mesh)
        keys = self.layers.keys()
        current = self.current_mesh_id() if keys else None
        try:
            with _faults_told(item):
                result = item.act(self.layers, values, self.progress)
        except BaseException:
            self.layers.restore(keys, current)
            raise
        written = []
        for name, value in given.items():
            known = item.parameter(name)
            written.append(ScriptParameter(known.name, known.kind.value, {"value": known.written(value)}))
        self._history.append(FilterCall(item.display_name, tuple(written)))
        return result

    def filter_list(self) -> list[str]:
        """Python names of all filters, MeshLab's and ours."""
        return sorted({*meshlab_filters(), *self.registry.names})

    def filter_parameter_values(self, filter_name: str, **values: Any) -> dict[str, Any]:
        """What `apply_filter` would use on the current layer: the given values and the defaults."""
        with _as_ours():
            if filter_name not in self.registry.names:
                with refusals_told(filter_name, values):
                    return dict(super().filter_parameter_values(filter_name, **values))
            mesh = self.layers.mesh() if self.layers.count else None
            return self.registry[filter_name].values(values, mesh)

    def print_filter_list(self) -> None:
        """Print the Python names of all filters, as pymeshlab does."""
        sys.stdout.write("".join(f"\t{name}\n" for name in self.filter_list()))

    def print_filter_parameter_list(self, filter_name: str) -> None:
        """Print the parameters of a filter with their defaults, as pymeshlab does."""
        if filter_name in self.registry.names:
            sys.stdout.write(parameter_list(self.registry[filter_name]))
        else:
            meshlab().print_filter_parameter_list(filter_name)

    def save_filter_script(self, filter_script_name: str) -> None:
        """Write what was applied so far as a script; MeshLab writes its own filters, we ours between them."""
        with temporary_folder() as folder:
            native = str(folder / "native.mlx")
            super().save_filter_script(native)
            calls = read_calls(native)
        write_script([calls[item] if isinstance(item, int) else item for item in self._history], filter_script_name)

    def load_filter_script(self, filter_script_name: str) -> None:
        """Read a script of MeshLab's filters and ours in place of what was applied so far; an error names its line."""
        with _as_ours():
            steps = read_script(filter_script_name, self.registry)
        self.clear_filter_script()
        self._loaded = tuple(steps)
        self._loaded_from = filter_script_name

    def apply_filter_script(self) -> None:
        """Apply the script that was loaded; an error names its line.

        It writes into the folder of this MeshSet and over no file that is there, and reads files beside the
        script, but for `allow_outside` and `force`.
        """
        with _as_ours():
            apply_steps(self, self.placed(self._loaded, self._loaded_from), self._loaded_from, self.progress)

    def placed(self, steps: Sequence[ScriptStep], script: str) -> list[ScriptStep]:
        """The steps with the names of their files in the folders that a script may use."""
        folder = self.layers.folder
        files = ScriptFiles(folder, folder, (Path(script).absolute().parent,), self.allow_outside, self.force)
        return files.placed(steps, script, self.registry)

    def clear_filter_script(self) -> None:
        """Forget what was applied so far."""
        super().clear_filter_script()
        self._history.clear()
        self._native_calls = 0
        self._loaded = ()


@contextmanager
def _as_ours() -> Iterator[None]:
    """What is wrong with a filter is told as MeshSetError, with a file as MeshSetFileError."""
    try:
        yield
    except FilterError as error:
        raise MeshSetError(str(error), **error.evidence) from error
    except (FileError, meshlab().PyMeshLabException) as error:
        raise MeshSetFileError(str(error), **getattr(error, "evidence", {})) from error


@contextmanager
def _faults_told(item: Filter) -> Iterator[None]:
    """What is wrong in the code of a filter, which may be a stranger's, is told as FilterError, with that as cause."""
    try:
        yield
    except (BonecamError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        ends = isinstance(error, SystemExit)
        words = " ".join(str(error).split())
        what = f"it would end the program (sys.exit({words}))" if ends else f"{type(error).__name__}: {words}"
        raise FilterError(f"{item.name}: {what}: mend or uninstall its plugin", filter=item.name) from error
