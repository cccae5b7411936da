"""Damaged SAT, DXF, STEP and IGES files: each gives a mesh, its B-spline faces, or one typed line."""

import random
from pathlib import Path

import pytest
from mutations import mutate, outcome
from small_parts import pebble

from bonecam.mesh import read_mesh
from bonecam.surface.files.cad import read_bsplines, write_iges, write_step

pytestmark = pytest.mark.whole

pytest.importorskip("ezdxf")

DEFAULT = 100
"""Damaged files of each kind in the default run."""
CHILDREN = 6
"""Damaged STEP and IGES files in the default run: each takes a process of its own."""
MANY = 1000
"""And with -m fuzz."""


def write_sat(file: Path) -> None:
    from ezdxf.acis import api
    from ezdxf.render import forms

    file.write_text("\n".join(api.export_sat([api.body_from_mesh(forms.cylinder(6))])))


def write_dxf(file: Path) -> None:
    import ezdxf
    from ezdxf.render import forms

    drawing = ezdxf.new()
    forms.cylinder(8).render_mesh(drawing.modelspace())
    forms.cube().render_3dfaces(drawing.modelspace())
    drawing.saveas(file)


def write_cad(file: Path) -> None:
    """A box as STEP or IGES, by its ending: OpenCASCADE reads it in a tenth of a second."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.IGESControl import IGESControl_Writer
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    box = BRepPrimAPI_MakeBox(10.0, 20.0, 30.0).Shape()
    if file.suffix == ".step":
        step = STEPControl_Writer()
        step.Transfer(box, STEPControl_StepModelType.STEPControl_AsIs)
        step.Write(str(file))
    else:
        iges = IGESControl_Writer()
        iges.AddShape(box)
        iges.Write(str(file))


WRITERS = {"a.sat": write_sat, "a.dxf": write_dxf, "a.step": write_cad, "a.igs": write_cad}
SURFACES = {"a.step": write_step, "a.igs": write_iges}
COUNTS = [*((name, DEFAULT) for name in ("a.sat", "a.dxf")), *((name, CHILDREN) for name in ("a.step", "a.igs"))]


@pytest.mark.parametrize(
    ("name", "count"),
    [
        *(pytest.param(name, count, id=f"{name}-few") for name, count in COUNTS),
        *(pytest.param(name, MANY, id=f"{name}-many", marks=pytest.mark.fuzz) for name in WRITERS),
    ],
)
def test_a_damaged_cad_file_gives_a_mesh_or_one_line(name, count, tmp_path):
    rng = random.Random(name)
    file = tmp_path / name
    WRITERS[name](file)
    sound = file.read_bytes()
    assert len(read_mesh(file).faces) >= 12

    refused = 0
    for _ in range(count):
        file.write_bytes(mutate(rng, sound))
        refused += bool(outcome(read_mesh, file))
    assert 0 < refused < count


@pytest.mark.parametrize(
    ("name", "count"),
    [
        *(pytest.param(name, CHILDREN // 3, id=f"{name}-few") for name in SURFACES),
        *(pytest.param(name, MANY, id=f"{name}-many", marks=pytest.mark.fuzz) for name in SURFACES),
    ],
)
def test_a_damaged_file_of_a_surface_gives_its_faces_or_one_line(name, count, tmp_path):
    rng = random.Random(f"surface {name}")
    file = tmp_path / name
    SURFACES[name](pebble(), file)
    sound = file.read_bytes()
    assert read_bsplines(file)

    file.write_bytes(sound[: len(sound) // 2])
    assert outcome(read_bsplines, file)
    for _ in range(count):
        file.write_bytes(mutate(rng, sound))
        outcome(read_bsplines, file)
