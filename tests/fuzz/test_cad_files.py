"""Damaged SAT and DXF files: each gives a mesh or one typed line."""

import random
from collections.abc import Callable
from pathlib import Path

import pytest

from bonecam.mesh.files.mesh_files import read_mesh

pytest.importorskip("ezdxf")

DEFAULT = 100
"""Damaged files of each kind in the default run."""
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


WRITERS = {"a.sat": write_sat, "a.dxf": write_dxf}


@pytest.mark.parametrize(
    "count", [pytest.param(DEFAULT, id="few"), pytest.param(MANY, id="many", marks=pytest.mark.fuzz)]
)
@pytest.mark.parametrize("name", WRITERS)
def test_a_damaged_polyhedron_gives_a_mesh_or_one_line(
    name: str, count: int, mutate: Callable, outcome: Callable, tmp_path: Path
) -> None:
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
