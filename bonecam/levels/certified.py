"""A morph with the certificate of every cut."""

from dataclasses import replace

from bonecam.levels.certificate import certifiable, certify
from bonecam.levels.morph import Morph
from bonecam.levels.stock import Stock
from bonecam.progress import Progress, silent


def certified(made: Morph, stock: Stock, progress: Progress = silent) -> Morph:
    """The morph, its levels 1 to K (`stock`) with their certificates; as it is where weights are not one, for which there are none."""
    surfaces = [level.surface for level in made.levels if level.surface is not None]
    if not all(certifiable(surface) for surface in surfaces):
        return made
    first, *others = made.levels
    found = certify(surfaces, stock, [level.limit for level in others], progress=progress)
    return replace(made, levels=(first, *(replace(level, certificate=one) for level, one in zip(others, found))))
