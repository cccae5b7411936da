"""The colours of levels and cuts, and the ticks of their colour bars."""

from typing import Any

COLOUR_MAP = "viridis"
"""The colour map of levels, cuts and depths."""

Norm = Any
"""A matplotlib.colors.Normalize: it takes a range of values to 0 .. 1."""


def value_range(low: int, high: int | float) -> Norm:
    """The values that the colour map covers."""
    from matplotlib.colors import Normalize

    return Normalize(low, high)


def logarithmic_range(low: float, high: float) -> Norm:
    """The values that the colour map covers, equal factors in equal steps."""
    from matplotlib.colors import LogNorm

    return LogNorm(low, high, clip=True)


def colours_of(norm: Norm, values: Any) -> Any:
    """The colours (RGBA) of values."""
    from matplotlib import colormaps

    return colormaps[COLOUR_MAP](norm(values))


def colour_scale(norm: Norm) -> Any:
    """What a colour bar shows."""
    from matplotlib.cm import ScalarMappable

    return ScalarMappable(norm=norm, cmap=COLOUR_MAP)


def whole_ticks() -> Any:
    """Ticks at whole numbers."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(integer=True)
