"""What would help a program whose part bends too much, and by how much: the error kept, under the same forces, on a
thicker neck, with a clamp higher up, and with a shorter cutter."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.mechanics.beam import Beam
from bonecam.mechanics.error_kept import KeptErrors, cut_shares
from bonecam.mechanics.sections import Sections
from bonecam.mechanics.workpiece import Standing, Workpiece

THICKER = 1.5
"""How many times as thick a neck is tried."""
SHORTER = 2 / 3
"""To what share of its length a cutter is shortened: its compliance goes with the third power."""
NECK = 6.0
"""A clamp is tried so far below the part, mm: what a neck needs that a ball goes round."""


@dataclass(frozen=True)
class Remedy:
    """What would help, and the error (mm) that 99 % of the surface would stay below."""

    what: str
    p99: float


def remedies(
    work: Workpiece, standing: Standing, kept: KeptErrors, areas: Float[ndarray, " n"]
) -> tuple[Remedy, ...]:
    """What would help, that which helps most first; the forces stay as they are."""
    here = np.flatnonzero(np.isfinite(kept.errors))
    beam = work.beam(standing)
    foot = work.stub.top if work.stub else work.clamped

    def share(other: Beam, tool_share: float = 1.0) -> float:
        errors = np.abs(kept.errors_with(other, here, tool_share))
        return float(cut_shares(errors, areas[here], (0.99,))[0])

    diameter = 2 * work.post.radius
    thick = replace(beam, sections=thickened(beam.sections, foot, work.post.top, THICKER))
    found = [
        Remedy(f"a neck of {THICKER * diameter:g} mm (holding.diameter)", share(thick)),
        Remedy(f"cutters a third shorter (overhang of {_cutters(kept, here)})", share(beam, SHORTER**3)),
    ]
    if work.post.top - foot > NECK:
        held = beam.sections.between(work.post.top - NECK, float(beam.sections.high[-1]))
        found.append(
            Remedy(f"a chuck or collet {NECK:g} mm below the part", share(replace(beam, sections=held)))
        )
    return tuple(sorted(found, key=lambda remedy: remedy.p99))


def thickened(sections: Sections, low: float, high: float, times: float) -> Sections:
    """The sections, those between two heights so many times as thick."""
    factor = np.where((sections.low >= low) & (sections.high <= high), times, 1.0)
    second = sections.second * factor[:, None, None] ** 4
    return replace(sections, area=sections.area * factor**2, second=second)


def _cutters(kept: KeptErrors, here: Int[ndarray, " k"]) -> str:
    """What is told of the cutters that leave the surface."""
    stiffest, softest = kept.tool[here].min(), kept.tool[here].max()
    values = sorted({round(1000 * float(value), 1) for value in (stiffest, softest)})
    return f"the one that gives way by {values[-1]:g} um/N"


def best_text(found: Sequence[Remedy]) -> str:
    """The remedy that helps most, in words."""
    if not found:
        return "give a thicker neck, a chuck or collet nearer to the part, or shallower levels"
    return f"{found[0].what} would keep {1000 * found[0].p99:.1f} um"
