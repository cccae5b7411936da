"""Typed filter parameters, MeshLab's way: a length is a number of mm or a percentage of the bounding box's
diagonal.

Parameters of a stage are derived from its job record (`parameters_of`), so that default, unit, range, label
and tooltip stay stated once, in `bonecam.job`. Text in scripts is read and written here too, one form a kind.

MeshLab's filters have two names: the one its dialogs and scripts show, and pymeshlab's.
`meshlab_names.tsv` pairs them.

The pairs were read off scripts that pymeshlab 2025.7 saved after running each filter, and for the filters
that need a raster, a texture or a GPU off the texts of its plugins.

The Filter record and the Registry of what is installed.

A filter is a function `act(layers, values, progress) -> dict` with everything a person needs to know of it. A
third party adds filters by an entry point of the group `bonecam_plugins.meshlab` that names an iterable of Filter
records:

    [project.entry-points."bonecam_plugins.meshlab"]
    my_family = "my_package.my_module:FILTERS"

The filters as text for a person: `bonecam filters` and `bonecam filters NAME`.
"""

import logging
import math
import re
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from bonecam_plugins.meshlab.layers import Layers

from bonecam.errors import FilterError, did_you_mean
from bonecam.job.parameter import record
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.progress import Progress

Section = TypeVar("Section")


class Kind(Enum):
    """What values a parameter takes; the value is the name of the kind in MeshLab's scripts."""

    FLOAT = "RichFloat"
    INT = "RichInt"
    BOOL = "RichBool"
    ENUM = "RichEnum"
    STRING = "RichString"
    LENGTH = "RichPercentage"
    OPEN_FILE = "RichOpenFile"
    SAVE_FILE = "RichSaveFile"


TYPE_NAMES = {
    Kind.FLOAT: "a number",
    Kind.INT: "a whole number",
    Kind.BOOL: "true or false",
    Kind.ENUM: "a choice",
    Kind.STRING: "a text",
    Kind.LENGTH: "a number of mm, a PureValue or a PercentageValue",
    Kind.OPEN_FILE: "a file name",
    Kind.SAVE_FILE: "a file name",
}


@dataclass(frozen=True)
class Percentage:
    """A length as a percentage of the bounding box's diagonal (or of the parameter's own range where it says
    so)."""

    value: float


@dataclass(frozen=True)
class FilterParameter:
    """One parameter of a filter. `computed` gives the default where it depends on the mesh; `default` is then
    shown as example.

    Raises ValueError where the record contradicts itself: a default of the wrong kind or out of range, an
    empty label or tooltip.
    """

    name: str
    kind: Kind
    default: Any
    label: str
    tooltip: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    percentage_of_range: bool = False
    computed: Callable[[TriangleMesh], Any] | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if not (self.name.isidentifier() and self.name == self.name.lower() and self.label and self.tooltip):
            raise ValueError(f"parameter {self.name!r} needs a lower-case name, a label and a tooltip")
        if self.percentage_of_range and not math.isfinite(self.high - self.low):
            raise ValueError(f"parameter {self.name!r}: a percentage of its range needs a range")
        if (self.kind is Kind.ENUM) != bool(self.choices):
            raise ValueError(f"parameter {self.name!r}: choices belong to {Kind.ENUM}, and to nothing else")
        try:
            self.checked(self.default)
        except FilterError as error:
            raise ValueError(f"the default of {error}") from error

    def checked(self, value: Any) -> Any:
        """`value` as the kind's own type; lengths stay Percentage until `resolved`. FilterError names
        parameter, value and range."""
        value = _plain(value)
        if self.kind is Kind.ENUM:
            if type(value) is int and 0 <= value < len(self.choices):  # MeshLab gives them by number or by name
                return self.choices[value]
            if value not in self.choices:
                what = f"{value!r}{did_you_mean(str(value), self.choices)}"
                raise self._refusal(what, f"choose one of {', '.join(self.choices)}")
            return str(value)
        if isinstance(value, Percentage):
            if self.kind is not Kind.LENGTH:
                raise self._refusal(f"{value.value:g} %", f"give {TYPE_NAMES[self.kind]}")
            if self.percentage_of_range and not 0 <= value.value <= 100:
                raise self._refusal(f"{value.value:g} %", "keep it within 0 .. 100 %")
            return value
        wanted = {Kind.BOOL: bool, Kind.INT: int, Kind.FLOAT: float, Kind.LENGTH: float}.get(self.kind, str)
        if wanted is float and type(value) is int:
            value = float(value)
        if wanted is str and isinstance(value, Path):
            value = str(value)
        if type(value) is not wanted or (isinstance(value, float) and not math.isfinite(value)):
            raise self._refusal(repr(value), f"give {TYPE_NAMES[self.kind]}")
        return self._in_range(value)

    def resolved(self, value: Any, mesh: TriangleMesh | None) -> Any:
        """`checked`, with a percentage turned into mm on `mesh`."""
        value = self.checked(value)
        if not isinstance(value, Percentage):
            return value
        if self.percentage_of_range:
            return self.low + value.value / 100 * (self.high - self.low)
        if mesh is None or not len(mesh.vertices):
            raise self._refusal(f"{value.value:g} %", "a percentage needs a current layer: load a mesh first")
        return self._in_range(value.value / 100 * mesh.diagonal)

    def default_on(self, mesh: TriangleMesh | None) -> Any:
        """The default on `mesh`, resolved."""
        value = self.computed(mesh) if self.computed is not None and mesh is not None else self.default
        return self.resolved(value, mesh)

    def read(self, text: str) -> Any:
        """The value of a script's text; numbers of a length are mm, `3%` a percentage. FilterError where it
        is malformed."""
        text = text.strip() if self.kind not in (Kind.STRING, Kind.OPEN_FILE, Kind.SAVE_FILE) else text
        try:
            if self.kind is Kind.BOOL:
                return {"true": True, "false": False, "1": True, "0": False}[text.lower()]
            if self.kind is Kind.INT or (
                self.kind is Kind.ENUM and text not in self.choices and text.lstrip("-").isdigit()
            ):
                return self.checked(int(text))
            if self.kind is Kind.LENGTH and text.endswith("%"):
                return self.checked(Percentage(float(text[:-1])))
            if self.kind in (Kind.FLOAT, Kind.LENGTH):
                return self.checked(float(text))
        except (ValueError, KeyError) as error:
            raise self._refusal(repr(text), f"give {TYPE_NAMES[self.kind]}") from error
        return self.checked(text)

    def written(self, value: Any) -> str:
        """The text of a value in a script: what `read` gives back."""
        value = self.checked(value)
        if isinstance(value, Percentage):
            return f"{value.value!r}%"
        return str(value).lower() if isinstance(value, bool) else str(value) if isinstance(value, str) else repr(value)

    def _in_range(self, value: Any) -> Any:
        if type(value) in (int, float) and not self.low <= value <= self.high:
            raise self._refusal(f"{value:g}", f"keep it within {self.low:g} .. {self.high:g} {self.unit}".rstrip())
        return value

    def _refusal(self, value: str, remedy: str) -> FilterError:
        return FilterError(f"parameter {self.name} = {value}: {remedy}", parameter=self.name)


def _plain(value: Any) -> Any:
    """numpy scalars as Python's, pymeshlab's PureValue as a number, its PercentageValue as Percentage."""
    kind = type(value).__name__
    if type(value).__module__.startswith("pymeshlab") and kind in ("PureValue", "PercentageValue"):
        return Percentage(float(value.value())) if kind == "PercentageValue" else float(value.value())
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 1) == 0 else value


def parameters_of(
    section: Any, prefix: str = "", only: Collection[str] = (), without: Collection[str] = ()
) -> tuple[FilterParameter, ...]:
    """The parameters of a section of a job, whose values are the defaults; their names begin with `prefix`.

    Lengths in mm take percentages of the bounding box's diagonal as well.
    """
    parameters = []
    for item in fields(section):
        if (only and item.name not in only) or item.name in without:
            continue
        value = getattr(section, item.name)
        known = record(item)
        kinds = {bool: Kind.BOOL, int: Kind.INT, float: Kind.FLOAT, str: Kind.ENUM if known.choices else Kind.STRING}
        kind = Kind.LENGTH if type(value) is float and known.unit == "mm" else kinds[type(value)]
        parameters.append(
            FilterParameter(
                prefix + item.name,
                kind,
                default=value,
                label=known.label,
                tooltip=known.tooltip,
                unit=known.unit,
                low=known.low,
                high=known.high,
                choices=known.choices,
            )
        )
    return tuple(parameters)


def section_of(section: Section, values: Mapping[str, Any], prefix: str = "") -> Section:
    """A section of a job with the values of a filter's parameters, whose names are `prefix` and the field's
    name.

    The reverse of `parameters_of`.
    """
    known = {item.name for item in fields(section)}  # type: ignore[arg-type]
    changes = {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
    kept = {name: value for name, value in changes.items() if name in known}
    return replace(section, **kept)  # type: ignore[type-var]


@cache
def _python_names() -> dict[str, str]:
    """pymeshlab's names of the shown ones."""
    text = files("bonecam_plugins.meshlab").joinpath("meshlab_names.tsv").read_text(encoding="utf-8")
    rows = (line.split("\t") for line in text.splitlines())
    return {shown: python for python, shown in rows}


def all_names() -> frozenset[str]:
    """Every name of either sort."""
    return frozenset({*_python_names(), *_python_names().values()})


def python_name(name: str) -> str:
    """pymeshlab's name of a shown name; any other name is given back as it is."""
    return _python_names().get(name, name)


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
    reserved = all_names()
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


WIDTH = 100
"""Columns of the text."""


def catalogue(name: str | None = None, registry: Registry | None = None) -> str:
    """Every filter by category, or the filter `name` with its parameters. FilterError where there is none of
    that name."""
    items = installed() if registry is None else registry
    if name is not None:
        return page(items[name])
    lines = []
    for category in sorted({item.category for item in items}):
        lines.append(category)
        for item in items:
            if item.category == category:
                lines += [f"  {item.name} ({item.display_name})", *_wrapped(first_sentence(item.documentation), 6)]
        lines.append("")
    return "\n".join(lines).rstrip()


def page(item: Filter) -> str:
    """One filter: documentation, what it changes, parameters."""
    change = "Changes the current layer." if item.changes_layer else "The current layer's mesh is not changed."
    needs = f" Apply {', then '.join(item.after)} first." if item.after else ""
    lines = [f"{item.name}: {item.display_name}, {item.category}", ""]
    for paragraph in item.documentation.strip().split("\n\n"):
        lines += [*_wrapped(" ".join(paragraph.split()), 0), ""]
    lines += [*_wrapped(change + needs, 0), ""]
    lines += ["Parameters:"] if item.parameters else ["No parameters."]
    for parameter in item.parameters:
        lines += entry(parameter)
    if item.references:
        lines += ["", "References:", *(line for each in item.references for line in _wrapped(each, 2))]
    return "\n".join(lines).rstrip()


def entry(item: FilterParameter) -> list[str]:
    """The lines of one parameter: name, kind, default and unit, range; then what it means."""
    default = "from the mesh" if item.computed is not None else item.written(item.default)
    unit = f"{item.unit or ''} or %".strip() if item.kind is Kind.LENGTH else item.unit or ""
    facts = [f"{item.kind.name.lower()} = {default} {unit}".rstrip(), limits(item)]
    return [f"  {item.name}: {', '.join(filter(None, facts))}", *_wrapped(f"{item.label}. {item.tooltip}", 6)]


def _wrapped(text: str, indent: int) -> list[str]:
    """A text in lines of WIDTH columns."""
    blanks = " " * indent
    return textwrap.wrap(text, WIDTH, initial_indent=blanks, subsequent_indent=blanks)


def limits(item: FilterParameter) -> str:
    """The range or the choices of a parameter, nothing where it has none."""
    if item.choices:
        return f"one of {', '.join(item.choices)}"
    low, high = (f"{value:g}" if math.isfinite(value) else "" for value in (item.low, item.high))
    return f"{low} .. {high}" if low or high else ""


def parameter_list(item: Filter) -> str:
    """The parameters in the form that pymeshlab prints them."""
    lines = [f"{item.name} filter - list of parameter names:"]
    lines += [
        f"\t{p.name} : {p.kind.name.lower()} = {p.written(p.default)}{f' {p.unit}' if p.unit else ''}"
        for p in item.parameters
    ]
    return "\n".join([*lines, ""])


def first_sentence(text: str) -> str:
    """Up to the first full stop that ends a sentence; an ellipsis does not."""
    return re.split(r"(?<=[^.\s])\.(?:\s|$)", " ".join(text.split()))[0] + "."
