"""Damaged STL, PLY, OBJ and OFF files: each gives a mesh or one typed line."""

import random
import struct

import numpy as np
import pytest
from mutations import mutate, outcome

from bonecam.mesh import read_mesh

DEFAULT = 60
"""Damaged files of each kind in the default run."""
MANY = 1000
"""And with -m fuzz."""


def prism(sides: int) -> tuple[np.ndarray, list[list[int]]]:
    """A prism with polygons for its ends: vertices and faces."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([8 * np.cos(turn), 5 * np.sin(turn)])
    vertices = np.concatenate([np.insert(ring, 2, z, axis=1) for z in (0.0, 30.0)])
    sidewalls = [[k, (k + 1) % sides, sides + (k + 1) % sides, sides + k] for k in range(sides)]
    return vertices, [[*range(sides)][::-1], [*range(sides, 2 * sides)], *sidewalls]


VERTICES, POLYGONS = prism(12)
TRIANGLES = [[face[0], face[k], face[k + 1]] for face in POLYGONS for k in range(1, len(face) - 1)]
LINES = ["{:.6g} {:.6g} {:.6g}".format(*vertex) for vertex in VERTICES]


def ply(form: str) -> bytes:
    head = [f"ply\nformat {form} 1.0\ncomment a prism\nelement vertex {len(VERTICES)}"]
    head += [f"property float {axis}" for axis in "xyz"] + ["property uchar red"]
    head += [f"element face {len(POLYGONS)}", "property list uchar int vertex_indices", "end_header\n"]
    order = ">" if "big" in form else "<"
    if form == "ascii":
        rows = [f"{line} 7" for line in LINES] + [" ".join(map(str, [len(f), *f])) for f in POLYGONS]
        return "\n".join([*head[:-1], "end_header", *rows, ""]).encode()
    body = b"".join(struct.pack(f"{order}3fB", *vertex, 7) for vertex in VERTICES)
    body += b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in POLYGONS)
    return "\n".join(head).encode() + body


def obj(corner: str) -> bytes:
    faces = ["f " + " ".join(corner.format(k + 1) for k in face) for face in POLYGONS]
    extra = [f"vt 0.{k} 0.5" for k in range(24)] + [f"vn 0 {k} 1" for k in range(24)]
    head = ["# a prism", "mtllib prism.mtl", "o prism", "usemtl bone"]
    return "\n".join([*head, *(f"v {line}" for line in LINES), *extra, "g all", "s off", *faces, ""]).encode()


def off() -> bytes:
    faces = [" ".join(map(str, [len(face), *face])) for face in POLYGONS]
    return "\n".join(["OFF", f"{len(VERTICES)} {len(faces)} 0", *LINES, *faces, ""]).encode()


def ascii_stl() -> bytes:
    lines = ["solid prism"]
    for face in TRIANGLES:
        lines += [" facet normal 0 0 0", "  outer loop", *(f"   vertex {LINES[k]}" for k in face)]
        lines += ["  endloop", " endfacet"]
    return "\n".join([*lines, "endsolid prism", ""]).encode()


def binary_stl() -> bytes:
    rows = [bytes(12) + VERTICES[face].astype("<f4").tobytes() + bytes(2) for face in TRIANGLES]
    return b"a prism".ljust(80) + struct.pack("<I", len(rows)) + b"".join(rows)


SOUND = {
    "ascii.stl": ascii_stl(),
    "binary.stl": binary_stl(),
    "ascii.ply": ply("ascii"),
    "little.ply": ply("binary_little_endian"),
    "big.ply": ply("binary_big_endian"),
    "plain.obj": obj("{0}"),
    "normals.obj": obj("{0}//{0}"),
    "textured.obj": obj("{0}/{0}/{0}"),
    "counted_back.obj": obj("-{0}"),
    "polygons.off": off(),
}


@pytest.mark.parametrize("name", SOUND)
def test_the_sound_files_are_one_solid(name, tmp_path):
    (tmp_path / name).write_bytes(SOUND[name])
    mesh = read_mesh(tmp_path / name)
    assert len(mesh.faces) == len(TRIANGLES)
    assert abs(mesh.volume) == pytest.approx(6 * np.sin(np.pi / 6) * 8 * 5 * 30, rel=1e-4)


@pytest.mark.parametrize(
    "count", [pytest.param(DEFAULT, id="few"), pytest.param(MANY, id="many", marks=pytest.mark.fuzz)]
)
@pytest.mark.parametrize("name", SOUND)
def test_a_damaged_mesh_gives_a_mesh_or_one_line(name, count, tmp_path):
    rng = random.Random(name)
    file = tmp_path / name
    refused = 0
    for _ in range(count):
        file.write_bytes(mutate(rng, SOUND[name]))
        refused += bool(outcome(read_mesh, file))
    assert 0 < refused < count
