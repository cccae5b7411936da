"""A mesh under repair, with what was done to it."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from bonecam.arrays import lengths
from bonecam.errors import counted
from bonecam.mesh.distance import exact_closest
from bonecam.mesh.healing.surface_moves import surface_moves
from bonecam.mesh.meshlab import from_meshset, to_meshset
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces

REPORTED = 5e-4
"""Least movement of the surface that a sentence has, mm: what its three decimals show."""


@dataclass(frozen=True)
class Repair:
    """One change of a mesh in a sentence, and how far it moved the surface, mm: `outward` what it added on the
    surface, `inward` what it took off; `hole` is the width of the widest hole that it closed, mm. Pieces that it left
    out, debris and inner shells, are no part of the surface. `guessed` mm2 of surface are not as they were given: those
    that close holes, pieces outside the part that were dropped, and what lies off the surface that was there."""

    change: str
    outward: float = 0.0
    inward: float = 0.0
    left_out: TriangleMesh | None = None
    hole: float = 0.0
    guessed: float = 0.0

    @classmethod
    def between(
        cls, change: str, before: TriangleMesh, after: TriangleMesh, solid: TriangleMesh | None = None
    ) -> "Repair":
        """The change that led from one mesh to another, measured as `surface_moves` does."""
        moves = surface_moves(before, after, solid)
        return cls(change, moves.outward, moves.inward)

    def __str__(self) -> str:
        if max(self.outward, self.inward) < REPORTED:
            return self.change
        return f"{self.change}; moved the surface {self.outward:.3f} mm outward, {self.inward:.3f} mm inward at most"

    @property
    def report(self) -> dict[str, str | float]:
        """The change as the report has it."""
        moved = {"outward_mm": round(self.outward, 6), "inward_mm": round(self.inward, 6)}
        return {"change": self.change, **moved, "guessed_mm2": round(self.guessed, 6)}


@dataclass(frozen=True, eq=False)
class RepairState:
    """A mesh, and the changes that led to it."""

    mesh: TriangleMesh
    done: tuple[Repair, ...] = ()

    def then(self, mesh: TriangleMesh, *changes: str) -> "RepairState":
        """The next state: the changed mesh, and sentences of changes that keep the surface where it is."""
        return RepairState(mesh, self.done + tuple(map(Repair, changes)))

    def closed(self, mesh: TriangleMesh, change: str, width: float, area: float) -> "RepairState":
        """The next state after holes were closed, the widest of this width (mm), all of this area (mm2)."""
        return RepairState(mesh, (*self.done, Repair(change, hole=width, guessed=area)))

    def keep(
        self, kept: Bool[ndarray, " m"], change: str, *, outside: Bool[ndarray, " m"] | bool = False
    ) -> "RepairState":
        """The next state with the `kept` faces only; the others, all or some of them `outside` the part, are left
        out."""
        area = float(lengths(self.mesh.face_vectors[~kept & outside]).sum() / 2)
        dropped = Repair(change, left_out=keep_faces(self.mesh, ~kept), guessed=area)
        return RepairState(keep_faces(self.mesh, kept), (*self.done, dropped))

    def moved(
        self, mesh: TriangleMesh, change: str, solid: TriangleMesh | None = None, off: float = np.inf
    ) -> "RepairState":
        """The next state after a change that moves the surface: it is measured as `surface_moves` does. What lies
        farther `off` (mm) than a change of this kind does everywhere is guessed."""
        repair = Repair.between(change, self.mesh, mesh, solid)
        middles = mesh.vertices[mesh.faces].mean(axis=1)
        away = lengths(exact_closest(self.mesh, middles)[0] - middles) > off if np.isfinite(off) else False
        guessed = float((lengths(mesh.face_vectors) / 2 * away).sum())
        return RepairState(mesh, (*self.done, replace(repair, guessed=guessed)))

    @property
    def changes(self) -> str:
        """All that was done, in one line."""
        return "; ".join(map(str, self.done))


def apply_filter(state: RepairState, name: str, elements: str = "", sentence: str = "", noun: str = "") -> RepairState:
    """`state` after one MeshLab filter.

    The sentence is added where the number of `elements` (faces or vertices) changed.
    """
    meshset = to_meshset(state.mesh)
    getattr(meshset, name)()
    mesh = from_meshset(meshset)
    changed = abs(len(getattr(mesh, elements)) - len(getattr(state.mesh, elements))) if elements else 0
    return state.then(mesh, *((sentence.format(counted(changed, noun)),) if changed else ()))


def apply_filters(state: RepairState, filters: tuple[tuple[str, str, str, str], ...]) -> RepairState:
    """`state` after MeshLab filters: name, elements that are counted, sentence and noun of each."""
    for name, elements, sentence, noun in filters:
        state = apply_filter(state, name, elements, sentence, noun)
    return state
