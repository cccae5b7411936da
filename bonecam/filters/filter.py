"""The Filter record and the Registry of what is installed.

A filter is a function `act(layers, values, progress) -> dict` with everything a person needs to know of it. A
third party adds filters by an entry point of the group `bonecam.filters` that names an iterable of Filter
records:

    [project.entry-points."bonecam.filters"]
    my_family = "my_package.my_module:FILTERS"
"""

import logging
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from bonecam.errors import FilterError, did_you_mean
from bonecam.filters import meshlab_names
from bonecam.filters.layers import Layers
from bonecam.filters.parameter import FilterParameter
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress

log = logging.getLogger(__name__)

GROUP = "bonecam.filters"
OURS = "bonecam_plugins."
"""What the entry points of bonecam's own filters begin with; they are loaded first."""
VERBS = ("generate", "meshing", "compute", "apply", "save")

Act = Callable[[Layers, Mapping[str, Any], Progress], dict[str, Any]]


@dataclass(frozen=True, eq=False)
class Filter:
    """A filter: what Python calls it, what MeshLab would show, and what it does.

    `act` takes the layers, the resolved value of every parameter by name, and the progress; it gives the
    results by name. It leaves the current layer's mesh as it is and adds what it makes as new layers, unless
    `changes_layer`. `after` names the filters whose kept values it needs, in their order; `references` the
    literature behind it. Raises ValueError where the name is of no verb family or the documentation is
    missing.
    """

    name: str
    display_name: str
    documentation: str
    category: str
    parameters: tuple[FilterParameter, ...]
    act: Act
    changes_layer: bool = False
    needs_layer: bool = True
    after: tuple[str, ...] = ()
    references: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not re.fullmatch(rf"({'|'.join(VERBS)})(_[a-z0-9]+)+", self.name):
            raise ValueError(
                f"filter {self.name!r}: begin its name with one of {', '.join(verb + '_' for verb in VERBS)}"
            )
        if not (self.display_name.strip() and self.documentation.strip() and self.category.strip()):
            raise ValueError(f"filter {self.name}: state its display name, documentation and category")
        names = [item.name for item in self.parameters]
        if len(set(names)) != len(names):
            raise ValueError(f"filter {self.name}: {next(n for n in names if names.count(n) > 1)!r} is there twice")

    def parameter(self, name: str) -> FilterParameter:
        """The parameter of that name (in any case, as scripts write it). FilterError names the known ones."""
        for item in self.parameters:
            if item.name == name.lower():
                return item
        known = ", ".join(item.name for item in self.parameters) or "none"
        raise FilterError(
            f"{self.name} knows no parameter {name!r}: use one of {known}", filter=self.name, parameter=name
        )

    def values(self, given: Mapping[str, Any], mesh: TriangleMesh | None) -> dict[str, Any]:
        """The resolved value of every parameter: what is given, else the default on `mesh`. FilterError names
        what is wrong."""
        values = {self.parameter(name).name: value for name, value in given.items()}
        try:
            return {
                item.name: item.resolved(values[item.name], mesh) if item.name in values else item.default_on(mesh)
                for item in self.parameters
            }
        except FilterError as error:
            raise FilterError(f"{self.name}: {error}", filter=self.name, **error.evidence) from error


class Registry:
    """Filters by name and by display name; FilterError where two, or one of MeshLab's, share one."""

    def __init__(self, filters: Iterable[Filter], taken: Collection[str] = ()) -> None:
        self._filters: dict[str, Filter] = {}
        self._display: dict[str, Filter] = {}
        reserved = set(taken)
        for item in filters:
            for name in (item.name, item.display_name):
                if name in reserved or name in self._filters or name in self._display:
                    raise FilterError(
                        f"two filters are called {name!r}: rename the one or uninstall its plugin", filter=name
                    )
            self._filters[item.name] = item
            self._display[item.display_name] = item

    def __iter__(self) -> Iterator[Filter]:
        return iter(self._filters[name] for name in sorted(self._filters))

    def __contains__(self, name: object) -> bool:
        return name in self._filters or name in self._display

    def __getitem__(self, name: str) -> Filter:
        """By name or display name; FilterError where there is none."""
        if name not in self:
            close = did_you_mean(name, self._filters)
            raise FilterError(f"there is no filter {name!r}{close}: `bonecam filters` lists them", filter=name)
        return self._filters.get(name) or self._display[name]

    @property
    def names(self) -> tuple[str, ...]:
        """Names in alphabetical order."""
        return tuple(sorted(self._filters))


def filters_of(plugin: EntryPoint) -> tuple[Filter, ...]:
    """The filters of one entry point; FilterError names the plugin that cannot be loaded."""
    place = f"plugin {plugin.name!r} ({plugin.value}{f' of {plugin.dist.name}' if plugin.dist else ''})"
    try:
        filters = tuple(plugin.load())
    except (Exception, SystemExit) as error:  # whatever a stranger's module raises while it is imported
        raise FilterError(
            f"{place} cannot be loaded: {type(error).__name__}: {error}: mend or uninstall it", plugin=plugin.name
        ) from error
    strange = [item for item in filters if not isinstance(item, Filter)]
    if strange:
        raise FilterError(f"{place} holds {strange[0]!r}, which is no Filter: mend or uninstall it", plugin=plugin.name)
    return filters


@cache
def installed() -> Registry:
    """Every filter of the entry points, ours and third parties'; loaded once.

    A plugin that cannot be loaded, or whose filters have names that are taken, is left out with a warning.
    """
    plugins = sorted(
        entry_points(group=GROUP), key=lambda plugin: (not plugin.value.startswith(OURS), plugin.name, plugin.value)
    )
    reserved = meshlab_names.all_names()
    filters: tuple[Filter, ...] = ()
    for plugin in plugins:
        try:
            more = (*filters, *filters_of(plugin))
            Registry(more, taken=reserved)
        except FilterError as error:
            log.warning("bonecam: %s", error)
            continue
        filters = more
    return Registry(filters, taken=reserved)
