"""What would help a program whose part bends too much, and by how much: the error kept, and the stress at the peaks,
on a thicker neck, with a pin at the free end, with a clamp higher up, and with a cutter that does not give way. A
stiffer part follows single edges where a softer one gives way under their mean."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.mechanics.beam import Beam
from bonecam.mechanics.error_kept import UM, KeptErrors, cut_shares
from bonecam.mechanics.loads import SLOW
from bonecam.mechanics.sections import Sections
from bonecam.mechanics.tailstock import tailstock_support
from bonecam.mechanics.workpiece import Standing, Workpiece
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.workholding.tailstock import REACH, pin_above, with_pin

THICKER = 1.5
"""How many times as thick a neck is tried."""
POWER = 0.7
"""The error kept falls as this power of the share of the force that shallower finishing cuts take, by
`strip.lighter_cuts`: 0.73 was seen for 0.69 (titanium), 0.56 for 0.43 (PEEK)."""
NECK = 6.0
"""A clamp is tried so far below the part, mm: what a neck needs that a ball goes round."""


@dataclass(frozen=True)
class Remedy:
    """What would help, the error (mm) that 99 % of the surface would stay below, and the stress (N/mm^2) that the peaks
    would in 99 % of the time."""

    what: str
    p99: float
    stress: float


def remedies(
    work: Workpiece,
    standing: Standing,
    kept: KeptErrors,
    areas: Float[ndarray, " n"],
    tooth_hz: float,
    stress: float,
) -> tuple[Remedy, ...]:
    """What would help against the errors that are kept and the `stress` (N/mm^2), that which helps most against the
    errors first; what the edges ask, which pass at `tooth_hz`, stays as it is. A clamp higher up is told to leave the
    stress as it is: the neck's upper end is not nearer to the cut."""
    here = np.flatnonzero(np.isfinite(kept.errors))
    beam = work.beam(standing)

    def share(other: Beam, tool_share: float = 1.0) -> float:
        follows = other.first_frequency(work.stiffness.density) >= SLOW * tooth_hz
        errors = np.abs(kept.errors_with(other, here, follows=follows, tool_share=tool_share))
        return float(cut_shares(errors, areas[here], (0.99,))[0])

    softest = UM * float(kept.tool[here].max())
    rigid = f"at best a stiffer cutter than the one of {softest:.3g} um/N (overhang, neck_length)"
    options = [Remedy(rigid, share(beam, 0.0), stress)]
    lighter = [(what, times**POWER) for what, times in work.lighter]
    whole = share(beam)
    options += [Remedy(what, times * whole, stress) for what, times in lighter]
    if work.post is None:
        top = float(beam.sections.high[-1])
        if work.clamped + NECK < top:
            held = beam.sections.between(work.clamped + NECK, top)
            options.append(Remedy(f"a shell {NECK:g} mm higher", share(replace(beam, sections=held)), stress))
        return tuple(sorted(options, key=lambda remedy: remedy.p99))
    foot = work.stub.top if work.stub else work.clamped
    diameter = 2 * work.post.radius
    widest = min(standing.width, 2 * work.stub.radius if work.stub else np.inf)
    if THICKER * diameter < widest:
        thick = replace(beam, sections=thickened(beam.sections, foot, work.post.top, THICKER))
        neck = f"a neck of {THICKER * diameter:g} mm (holding.diameter)"
        options.append(Remedy(neck, share(thick), stress / THICKER**3))
    pinned = _pinned(work, beam, kept.finished.mesh)
    if pinned is not None:
        pin, propped = pinned

        # The share of a stress that stays on another beam, of forces across the middle of some points
        forces = np.eye(3)[:2]
        middle = np.tile(kept.finished.points.mean(axis=0), (2, 1))
        each = [one.moment_stress(forces, middle).max() for one in (propped, beam)]
        lower = stress * float(each[0] / each[1])
        options.append(Remedy(pin, share(propped), lower))
    if work.post.top - foot > NECK:
        held = beam.sections.between(work.post.top - NECK, float(beam.sections.high[-1]))
        clamp = f"a chuck or collet {NECK:g} mm below the part"
        clamped = Remedy(clamp, share(replace(beam, sections=held)), stress)
        options.append(clamped)
        if min(one.p99 for one in options) > work.limits.largest_error:
            both = ((f"{clamp} with {what}", times * clamped.p99) for what, times in lighter)
            options += [Remedy(what, p99, stress) for what, p99 in both]
    return tuple(sorted(options, key=lambda remedy: remedy.p99))


def _pinned(work: Workpiece, beam: Beam, part: TriangleMesh) -> tuple[str, Beam] | None:
    """A pin at the free end in words, and the beam of a `part` that it holds; None where the part has a tailstock, or
    stands in what knows none."""
    given = with_pin(work.holding) if work.holding and work.body is None else None
    if given is None:
        return None
    change, holding = given
    holding = replace(holding, tailstock_reach=holding.tailstock_reach or REACH)
    support = tailstock_support(holding, pin_above(part, holding), work.stiffness.elasticity)
    pin = f"a pin of {holding.tailstock_diameter:g} mm at the free end ({change})"
    return pin, replace(beam, support=support)


def thickened(sections: Sections, low: float, high: float, times: float) -> Sections:
    """The sections, those between two heights so many times as thick."""
    factor = np.where((sections.low >= low) & (sections.high <= high), times, 1.0)
    second = sections.second * factor[:, None, None] ** 4
    return replace(sections, area=sections.area * factor**2, second=second)


def best_text(found: Sequence[Remedy], largest_error: float, largest_stress: float) -> str:
    """The remedies with which errors and stress stay below the largest (mm, N/mm^2), or those that at least lower what
    is too large, in words."""
    if not found:
        return "give a thicker neck, a chuck or collet nearer to the part, or shallower levels"
    strong = [remedy for remedy in found if remedy.stress <= largest_stress]
    enough = [remedy for remedy in strong if remedy.p99 <= largest_error] or strong[:1] or found[:1]
    texts = [
        f"{remedy.what} would keep {UM * remedy.p99:.1f} um at {remedy.stress:.0f} MPa" for remedy in enough
    ]
    return " or ".join(texts) + ("" if strong else ", shallower levels (levels.roughing_depth) load it less")
