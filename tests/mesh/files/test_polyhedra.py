"""SAT, SAB and DXF polyhedra as triangles."""

import sys
from typing import Any

import numpy as np
import pytest
from mesh_bodies import check_refused, is_closed

from bonecam.errors import FileError
from bonecam.mesh.files.mesh_files import read_mesh, read_mesh_file

ezdxf = pytest.importorskip("ezdxf", reason="ezdxf is not installed: pip install 'bonecam[cad]'")
from ezdxf.acis import api  # noqa: E402
from ezdxf.render import MeshBuilder, forms  # noqa: E402
from ezdxf.xclip import XClip  # noqa: E402


def block() -> MeshBuilder:
    """6 x 7 x 20 mm, with a concave L section: 6 x 7 less 3 x 4."""
    outline = [(0, 0), (6, 0), (6, 3), (3, 3), (3, 7), (0, 7)]
    return forms.extrude([(x, y, 0.0) for x, y in outline], [(0, 0, 0), (0, 0, 20)], close=True, caps=True)


VOLUME = (6 * 7 - 3 * 4) * 20.0


def sat_text(mesh: Any) -> str:
    return "\n".join(api.export_sat([api.body_from_mesh(mesh)])) + "\n"


def test_a_sat_polyhedron_with_concave_faces_is_one_closed_outward_mesh(tmp_path):
    (tmp_path / "block.sat").write_text(sat_text(block()))
    mesh = read_mesh(tmp_path / "block.sat")
    assert len(mesh.vertices) == 12
    assert is_closed(mesh)
    assert mesh.volume == pytest.approx(VOLUME)


def test_a_binary_sab_gives_the_same(tmp_path):
    (tmp_path / "block.sab").write_bytes(api.export_sab([api.body_from_mesh(block())]))
    assert read_mesh(tmp_path / "block.sab").volume == pytest.approx(VOLUME)


def test_the_unit_of_the_sat_header_is_applied(tmp_path):
    lines = sat_text(block()).splitlines()
    lines[2] = lines[2].replace("1 ", "1000 ", 1)
    (tmp_path / "metres.sat").write_text("\n".join(lines))
    assert read_mesh(tmp_path / "metres.sat").volume == pytest.approx(VOLUME * 1e9)


@pytest.mark.parametrize("version", ["R12", "R2000", "R2013"])
def test_every_kind_of_dxf_surface_is_read(version, tmp_path):
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
    assert is_closed(mesh)


def acis_block(layout: Any) -> None:
    api.export_dxf(layout.add_3dsolid(), [api.body_from_mesh(block())])


KINDS = {
    "3DFACE": lambda layout: block().render_3dfaces(layout),
    "MESH": lambda layout: block().render_mesh(layout),
    "POLYLINE": lambda layout: block().render_polyface(layout),
    "3DSOLID": acis_block,
}


@pytest.mark.parametrize("kind", KINDS)
def test_inserted_blocks_stand_in_their_places_and_face_outward(kind, tmp_path):
    drawing = ezdxf.new("R2013", units=4)
    KINDS[kind](drawing.blocks.new("part"))
    outer = drawing.blocks.new("outer", base_point=(0, 0, 5))
    outer.add_blockref("part", (0, 0, 0), {"xscale": -1, "yscale": -1, "zscale": -1})
    outer.add_blockref("part", (20, 0, 0))
    grid = {"row_count": 2, "row_spacing": 30, "column_count": 3, "column_spacing": -50}
    drawing.modelspace().add_blockref("outer", (100, 0, 0), {"xscale": -2, **grid})
    drawing.saveas(tmp_path / "a.dxf")
    mesh = read_mesh(tmp_path / "a.dxf")
    assert mesh.volume == pytest.approx(2 * 3 * 2 * 2 * VOLUME)
    assert is_closed(mesh)
    np.testing.assert_allclose(mesh.bounds, [[100 - 2 * 26 - 100, -7, -25], [100 + 2 * 6, 30 + 7, 15]])


def xref(drawing: Any) -> None:
    drawing.add_xref_def("other.dxf", "other")
    drawing.modelspace().add_blockref("other", (0, 0, 0))


def clipped(drawing: Any) -> None:
    block().render_mesh(drawing.blocks.new("part"))
    XClip(drawing.modelspace().add_blockref("part", (0, 0))).set_block_clipping_path([(0, 0), (1, 1)])


def bomb(drawing: Any, depth: int = 40) -> None:
    block().render_mesh(drawing.blocks.new("part 0"))
    for k in range(depth):
        level = drawing.blocks.new(f"part {k + 1}")
        for _ in range(2):
            level.add_blockref(f"part {k}", (0, 0))
    drawing.modelspace().add_blockref(f"part {depth}", (0, 0))


def itself(drawing: Any) -> None:
    drawing.blocks.new("part").add_blockref("part", (0, 0))
    drawing.modelspace().add_blockref("part", (0, 0))


def smooth_mesh(drawing: Any) -> None:
    block().render_mesh(drawing.modelspace(), {"subdivision_levels": 2})


def smooth_polymesh(drawing: Any) -> None:
    drawing.modelspace().add_polymesh((4, 4)).append_vertices([(0, 0, 0)] * 9, {"flags": 65})


def miscounted(drawing: Any) -> None:
    block().render_polyface(drawing.modelspace())
    drawing.modelspace().query("POLYLINE").first.dxf.n_count += 1


REFUSED = {
    "miscounted": (miscounted, "has a POLYLINE of 14 faces that tells of 15"),
    "xref": (xref, r"shows the block 'other', which is in another file: bind it \(XREF\)"),
    "missing": (lambda drawing: drawing.modelspace().add_blockref("far", (0, 0)), "shows the block 'far'"),
    "clipped": (clipped, r"shows the block 'part' clipped \(XCLIP\)"),
    "bomb": (bomb, "inserts more than 1,000,000 faces by its blocks: export the part alone"),
    "itself": (itself, "has the block 'part' within itself"),
    "smooth mesh": (smooth_mesh, "holds a MESH that cannot be read: export the part as STEP"),
    "smooth polymesh": (smooth_polymesh, "holds a POLYLINE that cannot be read"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_dxf_does_not_show_whole_is_refused(name, tmp_path):
    build, message = REFUSED[name]
    drawing = ezdxf.new("R2013")
    block().render_mesh(drawing.modelspace())
    build(drawing)
    drawing.saveas(tmp_path / "a.dxf")
    with pytest.raises(FileError, match=rf"a\.dxf: {message}"):
        read_mesh(tmp_path / "a.dxf")


def test_faces_that_the_model_space_does_not_show_are_told(tmp_path):
    drawing = ezdxf.new("R2013", units=4)
    for layout in (drawing.modelspace(), drawing.layout("Layout1"), drawing.blocks.new("unused")):
        block().render_mesh(layout)
    drawing.saveas(tmp_path / "a.dxf")
    given = read_mesh_file(tmp_path / "a.dxf")
    assert given.mesh.volume == pytest.approx(VOLUME)
    assert given.notes == ("left out of its file: 2 blocks or layouts with faces that are not shown",)


def test_an_entity_of_a_damaged_name_is_told(tmp_path):
    drawing = ezdxf.new("R2013", units=4)
    block().render_3dfaces(drawing.modelspace())
    drawing.saveas(tmp_path / "a.dxf")
    text = (tmp_path / "a.dxf").read_text()
    at = text.index("\n3DFACE", text.index("\nENTITIES"))
    (tmp_path / "a.dxf").write_text(f"{text[:at]}\n3D %7E{text[at + 7 :]}")
    assert read_mesh_file(tmp_path / "a.dxf").notes == ("left out of its file: 1 3D %7E",)


def test_a_polygon_mesh_that_closes_has_its_last_faces(tmp_path):
    drawing = ezdxf.new("R2013", units=4)
    mesh = drawing.modelspace().add_polymesh((6, 5))
    mesh.close(True, True)
    around = np.linspace(0, 2 * np.pi, 7)
    across = np.linspace(0, 2 * np.pi, 6)
    for (i, j), _ in np.ndenumerate(np.empty((6, 5))):
        out = 10 + 3 * np.cos(across[j])
        mesh.set_mesh_vertex((i, j), (out * np.cos(around[i]), out * np.sin(around[i]), 3 * np.sin(across[j])))
    drawing.saveas(tmp_path / "ring.dxf")
    ring = read_mesh(tmp_path / "ring.dxf")
    assert len(ring.faces) == 2 * 6 * 5
    assert is_closed(ring)


def test_the_unit_of_a_dxf_is_applied(tmp_path):
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
    "scaled.sat": (f"{sat_text(forms.cube())}transform 1 0 0 2 no_rotate #", "scales a body by 2: apply the scale"),
    "text.dxf": ("a letter", "is no readable DXF file"),
    "empty.dxf": ("", "is empty"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line_that_names_it(name, tmp_path):
    check_refused(tmp_path / name, *BAD[name])


def test_a_drawing_of_lines_is_refused(tmp_path):
    drawing = ezdxf.new()
    drawing.modelspace().add_line((0, 0), (1, 1))
    drawing.saveas(tmp_path / "lines.dxf")
    with pytest.raises(FileError, match="holds no faces"):
        read_mesh(tmp_path / "lines.dxf")


def test_a_face_with_a_hole_is_refused(tmp_path):
    lines = sat_text(forms.cube()).splitlines()
    body = lines[3:]
    loops = [i for i, line in enumerate(body) if line.startswith("loop ")]
    words = body[loops[0]].split()
    words[4] = f"${loops[1]}"
    body[loops[0]] = " ".join(words)
    (tmp_path / "hole.sat").write_text("\n".join([*lines[:3], *body]))
    with pytest.raises(FileError, match="1 faces with holes"):
        read_mesh(tmp_path / "hole.sat")


def test_without_ezdxf_one_line_names_the_extra(tmp_path, monkeypatch):
    (tmp_path / "block.sat").write_text(sat_text(block()))
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(FileError, match=r"needs ezdxf: pip install 'bonecam\[cad\]'$"):
        read_mesh(tmp_path / "block.sat")


@pytest.mark.parametrize("link", ["next_coedge", "next_face", "next_lump"])
def test_a_list_that_never_ends_is_refused(link, tmp_path):
    body = api.body_from_mesh(block())
    face = body.lump.shell.face
    entity = {"next_coedge": face.loop.coedge.next_coedge, "next_face": face, "next_lump": body.lump}[link]
    setattr(entity, link, entity)
    (tmp_path / "a.sat").write_text("\n".join(api.export_sat([body])))
    with pytest.raises(FileError, match=rf"is no readable SAT file \({link} of \w+ leads round for ever\)"):
        read_mesh(tmp_path / "a.sat")
