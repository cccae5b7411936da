"""What the mechanics of a program tell: figures, and the section `mechanics` of the report."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import BendingError, place_name
from bonecam.mechanics.error_kept import UM, cut_shares
from bonecam.mechanics.loads import Loads, PathLoads
from bonecam.mechanics.remedies import Remedy, best_text, remedies
from bonecam.mechanics.workpiece import Workpiece
from bonecam.mesh.triangle_mesh import TriangleMesh


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
                f"{' and '.join(self.faults)}{where}: {helps}{hint}; {own}",
                line=0,
                remedy=f"{helps}{hint}",
                **place,
            )

    @cached_property
    def stress(self) -> Float[ndarray, "3"]:
        """Largest bending stress at the peaks that 95 %, 99 % and all of the cutting time stay below, N/mm^2."""
        stress = np.concatenate([path.stress for path in self.paths] or [np.zeros(0)])
        minutes = np.concatenate([path.minutes for path in self.paths] or [np.zeros(0)])
        return cut_shares(stress, minutes, (0.95, 0.99, 1.0))

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
        return (
            f"{error}stress {self.stress[1]:.0f} of {self.workpiece.stiffness.yield_strength:g} N/mm2{beyond}"
        )

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
            "faults": list(self.faults),
            "remedies": [
                {
                    "what": one.what,
                    "p99_um": round(UM * one.p99, 2),
                    "stress_mpa": round(one.stress, 1),
                }
                for one in self.remedies
            ],
        }


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
            work,
            loads.standing,
            kept=kept,
            areas=error.areas,
            tooth_hz=tooth,
            stress=float(mechanics.stress[1]),
        )
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
