"""How stiff and strong a material is, and what force cuts it: the tables [stiffness] and [force] of its file.

The force coefficients are those of a mechanistic model (Altintas 2012, Manufacturing Automation, 2.8): an edge of the
length b that takes a chip of the thickness h loads the work along its way (t), along the normal of its surface (r) and
along itself (a) by (ktc h + kte) b, (krc h + kre) b and (kac h + kae) b. Authors differ by a factor of two for one
alloy: `band` holds the smallest and the largest multiple of the forces that they give.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.text.record import Record

NAMES = ("ktc", "krc", "kac", "kte", "kre", "kae")
SCALED = (631.0, 99.0, 273.0, 13.0, 10.0, 2.8)
"""Coefficients of aluminium 6082-T6 (its file has the source), which stand in, by the share of the yield strengths, for
those of a material that has none: N/mm^2, N/mm."""
SCALED_YIELD = 250.0
"""Yield strength of that alloy, N/mm^2."""
SCALED_BAND = (0.5, 2.0)
"""Band of what was scaled: a guess of the size of the difference between authors for one alloy."""


class StiffnessTable(Record):
    """The schema of [stiffness]: modulus (N/mm^2), density (kg/m^3), yield strength (N/mm^2)."""

    elasticity: float
    density: float
    yield_strength: float
    source: str


class ForceTable(Record):
    """The schema of [force]: ktc, krc, kac (N/mm^2), kte, kre, kae (N/mm), their band between authors."""

    ktc: float
    krc: float
    kac: float
    kte: float
    kre: float
    kae: float
    band: list[float]
    source: str
    range: str


@dataclass(frozen=True)
class CuttingForce:
    """Force coefficients (ktc, krc, kac in N/mm^2, kte, kre, kae in N/mm), the smallest and the largest multiple of the
    force that others give, and where they are from; `scaled`: from the yield strength alone."""

    coefficients: tuple[float, ...]
    band: tuple[float, float]
    source: str
    scaled: bool

    @property
    def array(self) -> Float[ndarray, "6"]:
        """The coefficients as an array."""
        return np.array(self.coefficients)


def check_stiffness(table: StiffnessTable | None) -> None:
    """ValueError where a number of [stiffness] is not positive."""
    for name in ("elasticity", "density", "yield_strength") if table else ():
        value = getattr(table, name)
        if value <= 0:
            raise ValueError(f"[stiffness] {name} = {value:g}: give a positive number")


def check_force(table: ForceTable | None) -> None:
    """ValueError where coefficients of [force] are negative, ktc is not positive, or the band does not hold 1."""
    if table is None:
        return
    for name in NAMES:
        value = getattr(table, name)
        if value < 0 or (name == "ktc" and value == 0):
            raise ValueError(f"[force] {name} = {value:g}: give a positive number")
    if len(table.band) != 2 or not 0 < table.band[0] <= 1 <= table.band[1]:
        raise ValueError(f"[force] band = {table.band}: give two multiples with 1 between, like [0.6, 1.9]")


def cutting_force(force: ForceTable | None, yield_strength: float) -> CuttingForce:
    """The force that it takes to cut a material with a yield strength (N/mm^2): its coefficients, or those of aluminium
    by the share of the yield strengths."""
    if force is not None:
        values = tuple(float(getattr(force, name)) for name in NAMES)
        return CuttingForce(values, (force.band[0], force.band[1]), force.source, scaled=False)
    share = yield_strength / SCALED_YIELD
    source = f"no coefficients are known: those of aluminium 6082 times {share:.2f}, the share of the yield strengths"
    return CuttingForce(tuple(share * value for value in SCALED), SCALED_BAND, source, scaled=True)
