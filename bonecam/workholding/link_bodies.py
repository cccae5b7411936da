"""The meshes of a machine's links: of its table, cradle, head, housing, as their STL files have them."""

from functools import lru_cache

from bonecam.errors import FileError, MachineError, MeshError
from bonecam.machine.bodies import LinkBody
from bonecam.machine.machine import Machine
from bonecam.mesh import read_mesh
from bonecam.mesh.healing.topology import edges_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.mesh.units import MM_OF

MOST_FACES = 200_000
"""A mesh of more triangles is refused: its tree takes a second, and each distance more than a millisecond."""
SMALLEST, LARGEST = 10.0, 1e4
"""Bodies of machines are as long from corner to corner, mm."""


@lru_cache(maxsize=24)
def _body_mesh(body: LinkBody, _written: int) -> TriangleMesh:
    """The mesh of a body as its file was `_written` (ns)."""
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
    _, counts = edges_of(mesh)
    if (counts % 2).any():
        raise _error(body, f"{who} has {int((counts % 2).sum())} open edges: export it as a closed solid")
    return TriangleMesh(mesh.vertices * MM_OF[body.units], mesh.faces)


def body_meshes(machine: Machine) -> dict[LinkBody, TriangleMesh]:
    """The closed meshes of all bodies of a machine, mm; MachineError where a file cannot be read, is not closed, has
    too many triangles, or a size that no body of a machine has."""
    meshes = {}
    for body in machine.link_bodies:
        written = body.file.stat().st_mtime_ns if body.file.exists() else 0
        meshes[body] = _body_mesh(body, written)
    return meshes


def _error(body: LinkBody, what: str) -> MachineError:
    return MachineError(what, file=str(body.file), body=body.name)
