"""The filters as text for a person: `bonecam filters` and `bonecam filters NAME`."""

import math
import re
import textwrap
from collections.abc import Iterable

from bonecam.filters.filter import Filter, Registry, installed
from bonecam.filters.parameter import FilterParameter, Kind

WIDTH = 100
"""Columns of the text."""


def catalogue(name: str | None = None, registry: Registry | None = None) -> str:
    """Every filter by category, or the filter `name` with its parameters. FilterError where there is none of
    that name."""
    known = installed() if registry is None else registry
    return overview(known) if name is None else page(known[name])


def overview(filters: Iterable[Filter]) -> str:
    """One paragraph a filter, under its category."""
    items = list(filters)
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
