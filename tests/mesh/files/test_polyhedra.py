"""SAT, SAB and DXF polyhedra as triangles."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bonecam.errors import FileError
from bonecam.mesh.files.mesh_files import read_mesh

ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed: pip install 'bonecam[cad]'")
from ezdxf.acis import api  # noqa: E402
from ezdxf.render import MeshBuilder, forms  # noqa: E402


def block() -> MeshBuilder:
    """6 x 7 x 20 mm, with a concave L section: 6 x 7 less 3 x 4."""
    outline = [(0, 0), (6, 0), (6, 3), (3, 3), (3, 7), (0, 7)]
    return forms.extrude([(x, y, 0.0) for x, y in outline], [(0, 0, 0), (0, 0, 20)], close=True, caps=True)


VOLUME = (6 * 7 - 3 * 4) * 20.0


def sat_text(mesh: Any) -> str:
    return "\n".join(api.export_sat([api.body_from_mesh(mesh)])) + "\n"


def is_closed(faces: np.ndarray) -> bool:
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())


def test_a_sat_polyhedron_with_concave_faces_is_one_closed_outward_mesh(tmp_path: Path) -> None:
    (tmp_path / "block.sat").write_text(sat_text(block()))
    mesh = read_mesh(tmp_path / "block.sat")
    assert len(mesh.vertices) == 12
    assert is_closed(mesh.faces)
    assert mesh.volume == pytest.approx(VOLUME)


def test_a_binary_sab_gives_the_same(tmp_path: Path) -> None:
    (tmp_path / "block.sab").write_bytes(api.export_sab([api.body_from_mesh(block())]))
    assert read_mesh(tmp_path / "block.sab").volume == pytest.approx(VOLUME)


def test_the_unit_of_the_sat_header_is_applied(tmp_path: Path) -> None:
    lines = sat_text(block()).splitlines()
    lines[2] = lines[2].replace("1 ", "1000 ", 1)
    (tmp_path / "metres.sat").write_text("\n".join(lines))
    assert read_mesh(tmp_path / "metres.sat").volume == pytest.approx(VOLUME * 1e9)


@pytest.mark.parametrize("version", ["R12", "R2000", "R2013"])
def test_every_kind_of_dxf_surface_is_read(version: str, tmp_path: Path) -> None:
    drawing = ezdxf.new(version)
    drawing.units = 0
    space = drawing.modelspace()
    count = 2
    block().render_polyface(space)
    block().translate(10, 0, 0).render_3dfaces(space)
    if version != "R12":
        block().translate(20, 0, 0).render_mesh(space)
        solid = space.add_3dsolid()
        api.export_dxf(solid, [api.body_from_mesh(block().translate(30, 0, 0))])
        count = 4
    inner = drawing.blocks.new("part")
    block().render_polyface(inner)
    space.add_blockref("part", (50, 0, 0))
    space.add_line((0, 0), (1, 1))
    drawing.saveas(tmp_path / "parts.dxf")
    mesh = read_mesh(tmp_path / "parts.dxf")
    assert mesh.volume == pytest.approx(VOLUME * (count + 1))
    assert is_closed(mesh.faces)


def test_the_unit_of_a_dxf_is_applied(tmp_path: Path) -> None:
    drawing = ezdxf.new("R2000", units=1)
    block().render_polyface(drawing.modelspace())
    drawing.saveas(tmp_path / "inch.dxf")
    assert read_mesh(tmp_path / "inch.dxf").volume == pytest.approx(VOLUME * 25.4**3)


def curved(text: str) -> str:
    return text.replace("plane-surface", "cone-surface", 1)


BAD = {
    "text.sat": ("a letter", "is no readable SAT file"),
    "cut.sat": (sat_text(forms.cube())[:900], "is no readable SAT file"),
    "curved.sat": (curved(sat_text(forms.cube())), "has 1 curved faces of 6"),
    "text.dxf": ("a letter", "is no readable DXF file"),
    "empty.dxf": ("", "is empty"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line_that_names_it(
    check_refused: Callable[[Path, bytes | str, str], None], name: str, tmp_path: Path
) -> None:
    check_refused(tmp_path / name, *BAD[name])


def test_a_drawing_of_lines_is_refused(tmp_path: Path) -> None:
    drawing = ezdxf.new()
    drawing.modelspace().add_line((0, 0), (1, 1))
    drawing.saveas(tmp_path / "lines.dxf")
    with pytest.raises(FileError, match="holds no faces"):
        read_mesh(tmp_path / "lines.dxf")


def test_a_face_with_a_hole_is_refused(tmp_path: Path) -> None:
    lines = sat_text(forms.cube()).splitlines()
    body = lines[3:]
    loops = [i for i, line in enumerate(body) if line.startswith("loop ")]
    words = body[loops[0]].split()
    words[4] = f"${loops[1]}"
    body[loops[0]] = " ".join(words)
    (tmp_path / "hole.sat").write_text("\n".join([*lines[:3], *body]))
    with pytest.raises(FileError, match="1 faces with holes"):
        read_mesh(tmp_path / "hole.sat")


def test_without_ezdxf_one_line_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "block.sat").write_text(sat_text(block()))
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(FileError, match=r"needs ezdxf: pip install 'bonecam\[cad\]'$"):
        read_mesh(tmp_path / "block.sat")


@pytest.mark.parametrize("link", ["next_coedge", "next_face", "next_lump"])
def test_a_list_that_never_ends_is_refused(link: str, tmp_path: Path) -> None:
    body = api.body_from_mesh(block())
    face = body.lump.shell.face
    entity = {"next_coedge": face.loop.coedge.next_coedge, "next_face": face, "next_lump": body.lump}[link]
    setattr(entity, link, entity)
    (tmp_path / "a.sat").write_text("\n".join(api.export_sat([body])))
    with pytest.raises(FileError, match=rf"is no readable SAT file \({link} of \w+ leads round for ever\)"):
        read_mesh(tmp_path / "a.sat")
