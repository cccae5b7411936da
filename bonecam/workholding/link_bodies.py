"""The meshes of a machine's links: of its table, cradle, head, housing, as their STL files have them."""

from functools import lru_cache

import numpy as np

from bonecam.errors import FileError, MachineError, MeshError
from bonecam.machine.bodies import LinkBody
from bonecam.machine.machine import Machine
from bonecam.mesh import read_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.mesh.units import MM_OF

MOST_FACES = 200_000
"""A mesh of more triangles is refused: its tree takes a second, and each distance more than a millisecond."""
SMALLEST, LARGEST = 10.0, 1e4
"""Bodies of machines are as long from corner to corner, mm."""


@lru_cache(maxsize=24)
def body_mesh(body: LinkBody) -> TriangleMesh:
    """The closed mesh of a body, mm; MachineError where its file cannot be read, is not closed, has too many triangles,
    or a size that no body of a machine has."""
    who = f"{body.file}: the body {body.name!r}"
    try:
        mesh = read_mesh(body.file)
    except (FileError, MeshError) as error:
        raise MachineError(f"the body {body.name!r} of the machine: {error}", file=str(body.file)) from error
    if len(mesh.faces) > MOST_FACES:
        remedy = f"give at most {MOST_FACES}, without threads and roundings"
        raise _error(body, f"{who} has {len(mesh.faces)} triangles: {remedy}")
    size = mesh.diagonal * MM_OF[body.units]
    if not SMALLEST <= size <= LARGEST:
        what = f"is {size:.3g} mm from corner to corner if its unit is {body.units}"
        raise _error(body, f"{who} {what}: correct units, or the file")
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    if (counts % 2).any():
        raise _error(body, f"{who} has {int((counts % 2).sum())} open edges: export it as a closed solid")
    return TriangleMesh(mesh.vertices * MM_OF[body.units], mesh.faces)


def body_meshes(machine: Machine) -> dict[LinkBody, TriangleMesh]:
    """The meshes of all bodies of a machine; MachineError as of `body_mesh`."""
    return {body: body_mesh(body) for body in machine.link_bodies}


def _error(body: LinkBody, what: str) -> MachineError:
    return MachineError(what, file=str(body.file), body=body.name)
