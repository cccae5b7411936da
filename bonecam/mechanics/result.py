"""What the mechanics of a program tell: figures, and the section `mechanics` of the report.

What would help a program whose part bends too much, and by how much: the error kept, and the stress at the peaks,
on a thicker neck, with a pin at the free end, with a clamp higher up, and with a cutter that does not give way. A
stiffer part follows single edges where a softer one gives way under their mean.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import BendingError, place_name
from bonecam.mechanics.beam import Beam, Sections, tailstock_support
from bonecam.mechanics.loads import SLOW, UM, KeptErrors, Loads, PathLoads, Standing, Workpiece, cut_shares
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.workholding.post import REACH, pin_above, with_pin

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
    work: Workpiece, standing: Standing, kept: KeptErrors, areas: Float[ndarray, " n"], tooth_hz: float, stress: float
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
    texts = [f"{remedy.what} would keep {UM * remedy.p99:.1f} um at {remedy.stress:.0f} MPa" for remedy in enough]
    return " or ".join(texts) + ("" if strong else ", shallower levels (levels.roughing_depth) load it less")


@dataclass(frozen=True, eq=False)
class ErrorKept:
    """The error that bending leaves on the finished surface: the share of its area that stays below each value, mm.

    `places` are vertices of `mesh`, `errors` (n,) at each (mm, NaN where no move has cut, positive where material
    stays), `areas` (n,) mm^2. `place` is that at `p99`.
    """

    mesh: TriangleMesh
    errors: Float[ndarray, " n"]
    areas: Float[ndarray, " n"]

    @cached_property
    def _shares(self) -> Float[ndarray, "3"]:
        known = np.isfinite(self.errors)
        return cut_shares(np.abs(self.errors[known]), self.areas[known], (0.5, 0.95, 0.99))

    @property
    def sizes(self) -> Float[ndarray, " n"]:
        """How large the error is at each place, mm; 0 where no move has cut."""
        return np.nan_to_num(np.abs(self.errors))

    @property
    def median(self) -> float:
        """Half of the surface keeps no more, mm."""
        return float(self._shares[0])

    @property
    def p95(self) -> float:
        """95 % of the surface keep no more, mm."""
        return float(self._shares[1])

    @property
    def p99(self) -> float:
        """99 % of the surface keep no more, mm."""
        return float(self._shares[2])

    @property
    def place(self) -> tuple[float, float, float]:
        """Where the error is that 99 % stay below."""
        away = np.where(np.isfinite(self.errors), np.abs(np.abs(self.errors) - self.p99), np.inf)
        x, y, z = (float(value) for value in self.mesh.vertices[np.argmin(away)])
        return x, y, z

    @property
    def report(self) -> dict[str, Any]:
        """`error_kept_um` of the report."""
        figures = {"median": self.median, "p95": self.p95, "p99": self.p99}
        return {
            **{name: round(UM * value, 2) for name, value in figures.items()},
            "place": [round(value, 3) for value in self.place],
        }


@dataclass(frozen=True, eq=False)
class Mechanics:
    """What the loads of a program are: of each of its `paths`, and the `error` kept, None where no part was given;
    where it bends more than the job allows, the `remedies`."""

    workpiece: Workpiece
    paths: tuple[PathLoads, ...]
    error: ErrorKept | None
    remedies: tuple[Remedy, ...] = ()

    @property
    def largest_stress(self) -> float:
        """Half of the yield strength, N/mm^2."""
        return self.workpiece.stiffness.yield_strength / 2

    @property
    def yields(self) -> bool:
        """Whether the stress at the peaks is more than that."""
        return bool(self.stress[1] > self.largest_stress)

    @property
    def faults(self) -> tuple[str, ...]:
        """What bends more than the job allows, in words."""
        faults = []
        limits = self.workpiece.limits
        if self.yields:
            bound = f"half of the yield strength ({self.largest_stress:g} MPa)"
            faults.append(f"stress at the peaks is {self.stress[1]:.0f} MPa, more than {bound}")
        if self.error is not None and self.error.p99 > limits.largest_error:
            bound = f"mechanics.largest_error ({UM * limits.largest_error:g} um)"
            faults.append(f"bending keeps errors of {UM * self.error.p99:.1f} um, more than {bound}")
        return tuple(faults)

    def check(self, *, assumed: bool = False) -> None:
        """BendingError where the part bends more than the job allows, with the remedy that helps most; none where the
        job says not to refuse. Where what stands before is `assumed`, an error kept is told only: it is as large as
        that; stress is refused."""
        limits = self.workpiece.limits
        if limits.refuse and (self.yields or (self.faults and not assumed)):
            where = f" at {place_name(self.error.place)}" if self.error else ""
            place = {"place": self.error.place} if self.error else {}
            hint = (
                ""
                if self.workpiece.stub or not self.workpiece.post
                else "; holding.diameter = 0 finds a neck that is stiff enough"
            )
            own = "or mechanics.refuse = false, which the header then tells"
            helps = best_text(self.remedies, limits.largest_error, self.largest_stress)
            raise BendingError(
                f"{' and '.join(self.faults)}{where}: {helps}{hint}; {own}", line=0, remedy=f"{helps}{hint}", **place
            )

    @cached_property
    def stress(self) -> Float[ndarray, "3"]:
        """Largest bending stress at the peaks that 95 %, 99 % and all of the cutting time stay below, N/mm^2."""
        stress = np.concatenate([path.stress for path in self.paths] or [np.zeros(0)])
        minutes = np.concatenate([path.minutes for path in self.paths] or [np.zeros(0)])
        return cut_shares(stress, minutes, (0.95, 0.99, 1.0))

    @property
    def feeds_borne(self) -> float | None:
        """How many times its feeds the program may be driven at, in a shell, with error and stress below the largest:
        the force of the edges, (1 - e) f + e of the times f, where e is what they press whatever the feed. 0: however
        slowly, more; None where no shell holds, or nothing is cut."""
        bent = [path for path in self.paths if len(path.moves)]
        if self.workpiece.seat is None or not bent:
            return None
        peaks, shares = (np.concatenate([getattr(path, name) for path in bent]) for name in ("peak", "edge_share"))
        edge = float(np.average(shares, weights=peaks))
        error = self.error.p99 if self.error is not None else 0.0
        loaded = max(error / self.workpiece.limits.largest_error, float(self.stress[1]) / self.largest_stress)
        if not loaded > 0 or edge >= 1:
            return None
        return max((1 / loaded - edge) / (1 - edge), 0.0)

    @property
    def slowest(self) -> PathLoads | None:
        """The path behind which the lowest frequency is least beside that of its edges."""
        return max(self.paths, key=lambda path: path.tooth_hz / path.first_hz, default=None)

    def move_forces(self, moves: int) -> Float[ndarray, " m"]:
        """The largest mean force on each of so many moves of the text, N; 0 in air."""
        forces = np.zeros(moves)
        for path in self.paths:
            np.maximum.at(forces, path.moves, path.mean)
        return forces

    def __str__(self) -> str:
        """What bending does, in the words of the program's header."""
        error = f"bending keeps {UM * self.error.p95:.1f} um in 95 of 100 places, " if self.error else ""
        beyond = ", beyond what holds" if self.faults else ""
        _, p99, most = self.stress
        yields = f"yields at {self.workpiece.stiffness.yield_strength:g}"
        if self.feeds_borne is not None:
            yields += f"; {shell_text(self.report['shell'])}"
        return f"{error}stress at peaks {p99:.0f} N/mm2 for 99 % of the cutting, {most:.0f} at most, {yields}{beyond}"

    @property
    def report(self) -> dict[str, Any]:
        """The section `mechanics` of the report."""
        work, slowest = self.workpiece, self.slowest
        p95, p99, most = (round(float(value), 1) for value in self.stress)
        return {
            "material": work.material,
            "levels": [_path_figures(path) for path in self.paths],
            "error_kept_um": self.error.report if self.error else None,
            "neck_stress_mpa": p95,
            "neck_stress_p99_mpa": p99,
            "neck_stress_max_mpa": most,
            "yield_mpa": work.stiffness.yield_strength,
            "first_hz": round(slowest.first_hz, 1) if slowest else None,
            "tooth_hz": round(slowest.tooth_hz, 1) if slowest else None,
            "band": list(work.force.band),
            "coefficients": work.force.source,
            "scaled": work.force.scaled,
            "shell": None
            if work.seat is None or self.feeds_borne is None
            else {"modulus_mpa": work.seat.youngs, "feeds_borne": round(self.feeds_borne, 2)},
            "faults": list(self.faults),
            "remedies": [
                {"what": one.what, "p99_um": round(UM * one.p99, 2), "stress_mpa": round(one.stress, 1)}
                for one in self.remedies
            ],
        }


def shell_text(shell: Mapping[str, float]) -> str:
    """What the report tells of a shell, in words."""
    bears = f"bears {shell['feeds_borne']:g} times these feeds" if shell["feeds_borne"] else "bears no feed"
    return f"the shell of {shell['modulus_mpa']:g} N/mm2 {bears}"


def mechanics_of(loads: Loads) -> Mechanics | None:
    """What the loads of a whole program tell; None where nothing was asked."""
    work, kept = loads.workpiece, loads.kept
    if work is None:
        return None
    if kept is None or loads.standing is None:
        return Mechanics(work, tuple(loads.paths), None)
    error = ErrorKept(kept.finished.mesh, kept.errors, kept.finished.areas)
    mechanics = Mechanics(work, tuple(loads.paths), error)
    tooth = max(path.tooth_hz for path in loads.paths)
    if mechanics.faults and np.isfinite(kept.errors).any():
        helps = remedies(
            work, loads.standing, kept=kept, areas=error.areas, tooth_hz=tooth, stress=float(mechanics.stress[1])
        )
        borne = mechanics.feeds_borne
        if borne:
            slower = f"feeds of {np.floor(100 * borne) / 100:g} times these (roughing.feed, finishing.feed)"
            less = min(work.limits.largest_error / max(error.p99, np.finfo(float).tiny), 1.0)
            bent = min(mechanics.largest_stress / max(float(mechanics.stress[1]), np.finfo(float).tiny), 1.0)
            helps = (Remedy(slower, min(less, bent) * error.p99, min(less, bent) * float(mechanics.stress[1])), *helps)
        mechanics = replace(mechanics, remedies=helps)
    return mechanics


def _path_figures(path: PathLoads) -> dict[str, Any]:
    """The figures of one path."""
    total = max(path.minutes.sum(), np.finfo(float).tiny)
    high = cut_shares(path.mean, path.minutes, (0.95,))[0]
    peaks = cut_shares(path.peak, path.minutes, (0.95, 1.0))
    bent = cut_shares(path.deflection, path.minutes, (0.5, 0.95))
    return {
        "index": path.index,
        "rest": path.rest,
        "force_mean_n": round(float((path.mean * path.minutes).sum() / total), 2),
        "force_p95_n": round(float(high), 2),
        "peak_p95_n": round(float(peaks[0]), 2),
        "peak_max_n": round(float(peaks[1]), 2),
        "deflection_median_um": round(UM * float(bent[0]), 2),
        "deflection_p95_um": round(UM * float(bent[1]), 2),
        "first_hz": round(path.first_hz, 1) if np.isfinite(path.first_hz) else None,
        "tooth_hz": round(path.tooth_hz, 1),
    }
