"""MeshLab's filters have two names: the one its dialogs and scripts show, and pymeshlab's.
`meshlab_names.tsv` pairs them.

The pairs were read off scripts that pymeshlab 2025.7 saved after running each filter, and for the filters
that need a raster, a texture or a GPU off the texts of its plugins.
"""

from functools import cache
from importlib.resources import files


@cache
def _pairs() -> tuple[tuple[str, str], ...]:
    text = files("bonecam.filters").joinpath("meshlab_names.tsv").read_text(encoding="utf-8")
    rows = [line.split("\t") for line in text.splitlines()]
    return tuple((python, shown) for python, shown in rows)


@cache
def _python_of_shown() -> dict[str, str]:
    return {shown: python for python, shown in _pairs()}


def all_names() -> frozenset[str]:
    """Every name of either sort."""
    return frozenset(name for pair in _pairs() for name in pair)


def python_name(name: str) -> str:
    """pymeshlab's name of a shown name; any other name is given back as it is."""
    return _python_of_shown().get(name, name)
