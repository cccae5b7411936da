"""The anatomical axes that a file's header states are told, whatever the kind of file."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bonecam.job import MeshJob
from bonecam.mesh.files.mesh_files import axes_text, stated_axes
from bonecam.mesh.part import prepare_part
from bonecam.mesh.triangle_mesh import TriangleMesh

PLY = b"ply\nformat ascii 1.0\ncomment %s\nelement vertex 0\nend_header\n"


@pytest.mark.parametrize(
    ("data", "letters"),
    [
        (PLY % b"3D Slicer output. SPACE=LPS", "LPS"),
        (PLY % b"space: right-anterior-superior", "RAS"),
        (PLY % b"coordinate_system = LAS", "LAS"),
        (b"# 3D Slicer output. SPACE=RAS\nv 0 0 0\n", "RAS"),
        (b"solid bone SPACE=LPS\nfacet normal 0 0 1\n", "LPS"),
        (b"3D Slicer output. SPACE=LPS".ljust(80) + bytes(54), "LPS"),
        (PLY % b"SPACE=PIR", "PIR"),
        (PLY % b"colour space: sRGB", ""),
        (PLY % b"SPACE=LRS", ""),
        (PLY % b"exported by a scanner", ""),
        (b"ply\n" + bytes(200) + b"\nSPACE=LPS", ""),
        (b"", ""),
    ],
)
def test_the_axes_of_a_comment_are_read(data: bytes, letters: str) -> None:
    assert stated_axes(data) == letters


def test_left_handed_axes_are_told_to_make_a_mirror_image() -> None:
    assert axes_text("LPS") == ("its header states the axes LPS: x to the left, y to the back, z to the head")
    for letters in ("LPS", "RAS", "PIR", "ASR"):
        assert "mirror" not in axes_text(letters)
    for letters in ("LAS", "RPS", "RAI"):
        assert axes_text(letters).endswith("left-handed: check that it is no mirror image")


def test_the_part_tells_what_its_file_states(tmp_path: Path, ellipsoid: Callable[..., TriangleMesh]) -> None:
    bone = ellipsoid(5, 4, 14, rings=8, columns=12)
    lines = [f"v {x} {y} {z}" for x, y, z in bone.vertices]
    lines += ["f " + " ".join(map(str, trio)) for trio in bone.faces + 1]
    file = tmp_path / "bone.obj"
    file.write_text("\n".join(["# SPACE=LPS", *lines]))
    part = prepare_part(file, MeshJob(mirror="x", scale=1.25, pit_radius=0.0))
    assert part.notes == ("mirrored in X of its file", "scaled by 1.25", axes_text("LPS"))
    assert np.allclose(part.given.vertices, bone.vertices * [-1.25, 1.25, 1.25])
