"""The recipe of the impeller: a turboexpander's wheel of 108 mm with self-blending blades (the workpiece of Xu et al.
2013, section 7.2, whose shape is not published), made by formula, so that it ships under bonecam's licence.

Between hub and shroud, quarters of ellipses in the meridional plane, lies a camber surface that is radial at the rim
and wraps by WRAP up to the exducer. A section is a closed curve on a surface of revolution between the two: two sides
half a thickness off the camber, blended by half ellipses. The wheel stands on its back, its axis is +Z, the rim is at
z = 0 and above.

    file                       contents                                                          counts
    meshes/impeller_blade.txt  one blade: SECTIONS closed rows of points from hub to tip         9 rows of 72 points
    meshes/impeller_hub.ply    the hub, solid, with its back                                     2,628 faces
    meshes/impeller_blades.ply the other BLADES - 1 blades, from inside the hub to the tip       11,300 faces
    meshes/impeller_shroud.ply the casing round the blades, CLEARANCE off their tips             4,964 faces

All in millimetres; binary PLY, float32, closed and outward. Make them again with `python -m bonecam_meshes.impeller
[FOLDER]`.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from bonecam_meshes.phalanx import write
from jaxtyping import Float
from numpy import ndarray

from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.plugins import added
from bonecam.surface import skin

BLADES = 11
"""Blades of the wheel."""
RIM = 54.0
"""Radius of the wheel, mm: 108 mm across (Xu et al. 2013, Fig. 8)."""
HEIGHT = 36.0
"""Of the exducer over the rim at the hub, mm."""
HUB, SHROUD = (14.0, 0.0), (32.0, 7.0)
"""Radius at the exducer and height at the rim, mm."""
CLEARANCE = 0.4
"""Between the blades' tips and the casing, mm."""
WRAP = np.radians(45.0)
"""Turn of the camber from rim to exducer, radians."""
ROOT, TIP = 0.9, 0.6
"""Half thickness of the blade at hub and tip, mm."""
BLEND = 1.6
"""Half ellipses at the edges are so many times as long as half the blade is thick."""
SECTIONS = 9
"""Rows from hub to tip."""
BURIED = 0.06
"""The solid blades begin this share of the channel inside the hub."""
ENDS = (0.02, 0.98)
"""Where the camber begins and ends, shares of the way from rim to exducer."""
CHORD = 0.1
"""Chord tolerance of the obstacles, mm."""


def meridian(span: float, share: Float[ndarray, " n"]) -> Float[ndarray, "n 2"]:
    """(radius, height) on the flow surface at a share of the channel's width, from rim (0) to exducer (1)."""
    inner = HUB[0] + span * (SHROUD[0] - HUB[0])
    lower = HUB[1] + span * (SHROUD[1] - HUB[1])
    angle = share * np.pi / 2
    return np.column_stack([RIM - (RIM - inner) * np.sin(angle), HEIGHT - (HEIGHT - lower) * np.cos(angle)])


def camber(span: float, share: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Points of the camber surface."""
    radius, height = meridian(span, share).T
    turn = -WRAP * share**2
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])


def section(span: float) -> Float[ndarray, "n 3"]:
    """One closed section, without its first point again; counter-clockwise seen from the tip."""
    half = ROOT + span * (TIP - ROOT)
    way = np.linspace(*ENDS, 400)
    line = camber(span, way)
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
    blend = BLEND * half
    side = np.linspace(blend, length[-1] - blend, 27)
    turn = np.linspace(np.pi / 2, 3 * np.pi / 2, 11)[1:-1]
    ends = np.column_stack([blend * np.cos(turn), half * np.sin(turn)])
    along = np.r_[side[::-1], blend + ends[:, 0], side, length[-1] - blend - ends[:, 0]]
    off = np.r_[np.full(27, -half), -ends[:, 1], np.full(27, half), ends[:, 1]]
    place = np.asarray(np.interp(along, length, way))
    return camber(span, place) + off[:, None] * _normals(span, place)


def _normals(span: float, share: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Unit normals of the camber surface, by central differences of 1e-5."""
    step = 1e-5
    along = camber(span, share + step) - camber(span, share - step)
    across = camber(span + step, share) - camber(span - step, share)
    normal = np.cross(along, across)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def sections(first: float = 0.0) -> list[Float[ndarray, "n 3"]]:
    """The sections of a blade from a share of the channel's width on."""
    return [section(float(span)) for span in np.linspace(first, 1.0, SECTIONS)]


def make() -> Any:
    """Hub, casing and all blades as closed solids, by the plugin for wheels (`bonecam.wheels.impeller`)."""
    blade = skin(sections(-BURIED), 0.005)
    share = np.linspace(0.0, 1.0, 400)
    gap = CLEARANCE / (SHROUD[1] - HUB[1])
    hub, shroud = (meridian(span, share) for span in (0.0, 1.0 + gap))
    return added("names", "wheels").impeller(blade, hub, shroud, BLADES, chord_tolerance=CHORD)


def joined(meshes: tuple[TriangleMesh, ...]) -> TriangleMesh:
    """Separate solids as one mesh."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts)]
    return TriangleMesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces).astype(np.int32))


def write_rows(rows: list[Float[ndarray, "n 3"]], path: Path) -> None:
    """Rows as a text file of blocks, each closed by its first point, to 0.1 um."""
    blocks = ["\n".join(" ".join(f"{x:.4f}" for x in p) for p in np.vstack([row, row[:1]])) for row in rows]
    head = "# bonecam impeller blade, millimetres, made by bonecam_meshes.impeller\n"
    path.write_text(head + "\n\n".join(blocks) + "\n", encoding="utf-8")


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    made = make()
    write_rows(sections(), folder / "impeller_blade.txt")
    write(made.hub, folder / "impeller_hub.ply", "impeller")
    write(made.shroud, folder / "impeller_shroud.ply", "impeller")
    write(joined(made.blades[1:]), folder / "impeller_blades.ply", "impeller")
