"""What holds the post, as obstacles: the table, what stands on it, riser, chuck and stub, and the bracket of a
tailstock; a clearance is kept from them.

The meshes of a machine's links: of its table, cradle, head, housing, as their STL files have them.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

from bonecam.errors import FileError, MachineError, MeshError
from bonecam.job import HoldingJob
from bonecam.machine.bodies import LinkBody, Table
from bonecam.machine.machine import Machine
from bonecam.mesh.files.mesh_files import read_whole
from bonecam.mesh.solids import edges_of
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.mesh.units import MM_OF
from bonecam.workholding.post import Column, Post, tailstock_bodies

DEFAULT = HoldingJob()
LEAST_NECK = 3.0
"""A neck between stub and part is no shorter, mm: a turning tool is to get between them."""
STUB_CLEARANCE = 0.5
"""Ball, neck and shank keep so far from the stub, mm: it is of the material that they cut, where holder and spindle
would break."""


@dataclass(frozen=True)
class Clamping:
    """Upright columns about the Z axis, the `stub` of the bar that they hold, if there is one, and whether nothing may
    go below the table's plane z = 0 (`closed`); the columns of the bracket of a tailstock, which stand `beside` the
    part and over it.

    The whole tool keeps the `clearance` (mm) from the columns; holder and spindle keep it from stub and post too.
    """

    columns: tuple[Column, ...] = ()
    closed: bool = True
    clearance: float = DEFAULT.clearance
    stub: Column | None = None
    beside: tuple[Column, ...] = ()

    @property
    def top(self) -> float:
        """The highest that anything stands below the neck, mm."""
        return max((column.top for column in self.solids), default=0.0)

    @property
    def solids(self) -> tuple[Column, ...]:
        """The columns and the stub, below the part."""
        return (*self.columns, *((self.stub,) if self.stub else ()))

    @property
    def below(self) -> "Clamping":
        """What stands below the part alone."""
        return replace(self, beside=())

    @property
    def above(self) -> "Clamping":
        """What holds the free end alone."""
        return Clamping(closed=False, clearance=self.clearance, beside=self.beside)

    @property
    def kept_off(self) -> tuple[Column, ...]:
        """All that the tool never touches: columns, stub and bracket."""
        return *self.solids, *self.beside

    def carried(self, post: Post) -> tuple[Column, ...]:
        """The post and the stub, of the material that is cut, above what holds them, and what holds the free end."""
        if self.stub is None:
            return post.solids
        return replace(post.column, bottom=self.stub.bottom), self.stub, *post.solids[1:]

    def with_pin(self, post: Post) -> "Clamping":
        """The clamping with what holds the free end of a post's part, which nothing touches either."""
        return replace(self, beside=(*self.beside, *(replace(one, name="tailstock") for one in post.solids[1:])))

    def kept_columns(self, section: str, air: float = 0.0) -> tuple[Column, ...]:
        """The columns, with what a section of the tool (cutter, neck, shank, holder, spindle) keeps round them; `air`
        (mm) is the least it keeps between passes."""
        kept = []
        for column in self.kept_off:
            room = self.room(column, section)
            kept.append(column.grown(max(room, air) if column is self.stub else room))
        return tuple(kept)

    def room(self, column: Column, section: str) -> float:
        """What a section of the tool keeps from one of the solids while it cuts, mm."""
        cutting = column is self.stub and section not in ("holder", "spindle")
        return STUB_CLEARANCE if cutting else self.clearance


def clamping_of(holding: HoldingJob, table: Table) -> Clamping:
    """The clamping of a job on a machine's table.

    Cones that stand on the table are taken as the cylinders that hold them; an open table as the disc that holds
    it, endless downwards.
    """
    held = holding_columns(holding)
    stub = held.pop("stub", None)
    columns = list(held.values())
    height = 0.0
    for piece in table.standing:
        size = max(piece.diameter, piece.top_diameter) / 2, height + piece.length, height
        columns.append(Column(*size, name="what stands on the table"))
        height += piece.length
    if table.open_beside:
        plate = math.hypot(table.half_width, table.half_depth)
        columns.append(Column(min(table.radius, plate), 0.0, -math.inf, name="table"))
    beside = tuple(replace(one, name="tailstock") for one in tailstock_bodies(holding))
    return Clamping(tuple(columns), not table.open_beside, holding.clearance, stub, beside)


def holding_columns(holding: HoldingJob) -> dict[str, Column]:
    """What a job puts on the table below the neck, by name, from the lowest up: riser, chuck, stub."""
    columns = {}
    if holding.riser_height:
        columns["riser"] = Column(holding.riser_diameter / 2, holding.riser_height, name="riser")
    if holding.chuck_height:
        size = holding.chuck_diameter / 2, holding.chuck_height, holding.riser_height
        columns["chuck"] = Column(*size, name="chuck")
    if holding.stub_length:
        foot = max(holding.chuck_height, holding.riser_height)
        columns["stub"] = Column(holding.stub_diameter / 2, holding.support_height, foot, name="stub")
    return columns


MOST_FACES = 200_000
"""A mesh of more triangles is refused: its tree takes a second, and each distance more than a millisecond."""
SMALLEST, LARGEST = 10.0, 1e4
"""Bodies of machines are as long from corner to corner, mm."""


@lru_cache(maxsize=24)
def _body_mesh(body: LinkBody, _written: int) -> TriangleMesh:
    """The mesh of a body as its file was `_written` (ns), in the unit that the file states, else that of the body."""
    who = f"{body.file}: the body {body.name!r}"
    try:
        given = read_whole(body.file)
    except (FileError, MeshError) as error:
        raise MachineError(f"the body {body.name!r} of the machine: {error}", file=str(body.file)) from error
    mesh, unit = given.mesh, given.unit or body.units
    if len(mesh.faces) > MOST_FACES:
        remedy = f"give at most {MOST_FACES}, without threads and roundings"
        raise _error(body, f"{who} has {len(mesh.faces)} triangles: {remedy}")
    size = mesh.diagonal * MM_OF[unit]
    if not SMALLEST <= size <= LARGEST:
        what = f"is {size:.3g} mm from corner to corner if its unit is {unit}"
        raise _error(body, f"{who} {what}: correct units, or the file")
    _, counts = edges_of(mesh)
    if (counts % 2).any():
        raise _error(body, f"{who} has {int((counts % 2).sum())} open edges: export it as a closed solid")
    return TriangleMesh(mesh.vertices * MM_OF[unit], mesh.faces)


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
