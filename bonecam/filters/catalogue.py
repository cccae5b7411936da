"""The filters as text for a person: `bonecam filters` and `bonecam filters NAME` (Markdown)."""

import math
import re
from collections.abc import Iterable

from bonecam.filters.filter import Filter, Registry, installed
from bonecam.filters.parameter import FilterParameter, Kind


def catalogue(name: str | None = None, registry: Registry | None = None) -> str:
    """Every filter by category, or the filter `name` with its parameters. FilterError where there is none of
    that name."""
    known = installed() if registry is None else registry
    return overview(known) if name is None else page(known[name])


def overview(filters: Iterable[Filter]) -> str:
    """One line a filter, under its category."""
    items = list(filters)
    lines = []
    for category in sorted({item.category for item in items}):
        lines += [f"## {category}", ""]
        lines += [
            f"- `{item.name}` ({item.display_name}): {first_sentence(item.documentation)}"
            for item in items
            if item.category == category
        ]
        lines.append("")
    return "\n".join(lines).rstrip()


def page(item: Filter) -> str:
    """One filter: documentation, what it changes, parameters."""
    change = (
        "Changes the current layer." if item.changes_layer else "The current layer's mesh is not changed."
    )
    needs = f" Apply {', then '.join(f'`{name}`' for name in item.after)} first." if item.after else ""
    lines = [
        f"# {item.name}",
        "",
        f"{item.display_name} · {item.category}",
        "",
        item.documentation.strip(),
        "",
        change + needs,
        "",
    ]
    if item.parameters:
        lines += ["| parameter | kind | default | unit | range | meaning |", "|---|---|---|---|---|---|"]
        lines += [row(parameter) for parameter in item.parameters]
    else:
        lines.append("No parameters.")
    if item.references:
        lines += ["", "References", "", *[f"- {reference}" for reference in item.references]]
    return "\n".join(lines).rstrip()


def row(item: FilterParameter) -> str:
    """One line of the table of parameters."""
    default = "from the mesh" if item.computed is not None else f"`{item.written(item.default)}`"
    unit = f"{item.unit or '-'} or %" if item.kind is Kind.LENGTH else item.unit or "-"
    return (
        f"| `{item.name}` | {item.kind.name.lower()} | {default} | {unit} | {limits(item)} | "
        f"**{item.label}.** {item.tooltip} |"
    )


def limits(item: FilterParameter) -> str:
    """The range or the choices of a parameter, `-` where it has none."""
    if item.choices:
        return ", ".join(f"`{choice}`" for choice in item.choices)
    low, high = (f"{value:g}" if math.isfinite(value) else "" for value in (item.low, item.high))
    return f"{low} .. {high}" if low or high else "-"


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
