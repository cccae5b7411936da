"""Solids as FCL measures their distances, and whether the bodies of a machine leave room for tool and part."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import MachineError
from bonecam.machine.bodies import BED
from bonecam.machine.kinematics import link_poses
from bonecam.machine.machine import Machine
from bonecam.mesh.healing.surface_moves import winding_numbers
from bonecam.mesh.solids.revolution import revolve
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.collision.fcl_model import FclObject, distance_of, fcl_object
from bonecam.planning.collision.tool_mesh import SIDES, block_mesh
from bonecam.workholding.link_bodies import body_meshes

PIN = 2.0
"""Radius (mm) of the thinnest tool and part that bodies of a machine must leave room for."""
PIN_FROM, PIN_TO = 1.0, 50.0
"""Their ends, mm: in front of the spindle nose, and over the program's zero."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed mesh, mm, that is called by its `name`."""

    name: str
    mesh: TriangleMesh

    @cached_property
    def fcl(self) -> FclObject:
        """The mesh as a collision object."""
        return fcl_object(self.mesh)

    @cached_property
    def corners(self) -> Float[ndarray, "8 3"]:
        """The corners of its bounding box, mm."""
        return block_mesh(self.mesh.bounds).vertices

    def distance(self, turned: Float[ndarray, "3 3"], at: Float[ndarray, "3"], other: "Solid") -> float:
        """The distance (mm) of this solid, turned and moved there, from another; 0 where one meets or holds the
        other."""
        distance = distance_of(self.fcl, turned, at, other.fcl)
        own, its = self.mesh.vertices[:1] @ turned.T + at, (other.mesh.vertices[:1] - at) @ turned
        return 0.0 if other._holds(own) or self._holds(its) else distance

    def _holds(self, point: Float[ndarray, "1 3"]) -> bool:
        """Whether a point lies inside; pieces of the mesh may overlap."""
        low, high = self.mesh.bounds
        within = bool(((point >= low) & (point <= high)).all())
        return within and bool(abs(winding_numbers(self.mesh, point)[0]) > 0.5)


def link_solids(machine: Machine) -> dict[str, list[Solid]]:
    """The bodies of a machine by their links; MachineError as in `body_meshes`."""
    solids: dict[str, list[Solid]] = {}
    for body, mesh in body_meshes(machine).items():
        solids.setdefault(body.link, []).append(Solid(body.name, mesh))
    return solids


def body_texts(machine: Machine) -> list[str]:
    """What moves with what, and where, all axes at zero, a line a body; MachineError as in `check_bodies`."""
    check_bodies(machine)
    texts = []
    for link, solids in link_solids(machine).items():
        for solid in solids:
            low, high = solid.mesh.bounds.round(1).tolist()
            room = ", ".join(f"{letter} {a:g} to {b:g}" for letter, a, b in zip("XYZ", low, high, strict=True))
            from_where = " from the spindle nose" if link in carried_links(machine) else ""
            carrier = "stands still" if link == BED else f"moves with {link}"
            texts.append(f"{solid.name}: {carrier}, {room} mm{from_where}, all axes at zero")
    return texts


def carried_links(machine: Machine) -> list[str]:
    """The links on the tool's side, from the linear axes to what the spindle is in."""
    return ["XYZ", *(axis.letter for axis in machine.tool_axes if axis.letter)]


def check_bodies(machine: Machine) -> None:
    """MachineError as in `body_meshes`, and where with all axes at zero a body is in the place of the tool in front of
    the spindle nose, or of the part over the program's zero."""
    heights, radius = np.array([PIN_FROM, PIN_TO]), np.full(2, PIN)
    part = Solid("the part over the program's zero", revolve(radius, heights, (PIN_FROM, PIN_TO), SIDES))
    tool = Solid("the tool in front of the spindle nose", revolve(radius, -heights[::-1], (-PIN_TO, -PIN_FROM), SIDES))
    for link, solids in link_solids(machine).items():
        turned, at = link_poses(machine, link, np.zeros((1, 5)))
        for solid in solids:
            if link in carried_links(machine):
                met, distance = tool, solid.distance(np.eye(3), np.zeros(3), tool)
            else:
                met, distance = part, solid.distance(turned[0], at[0], part)
            if distance == 0:
                remedy = f"correct its place in the STL (all axes at zero, mm), its units, or link = {link!r}"
                raise MachineError(
                    f"{machine.name}: the body {solid.name!r} overlaps {met.name}: {remedy}", body=solid.name
                )
