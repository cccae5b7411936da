"""Meshes of a machine's links: told where they are wrong, and held against tool, table, stock and one another."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import BodiesError, MachineError
from bonecam.job import Job
from bonecam.machine.machine import MACHINES, Machine, read_machine
from bonecam.mesh.files.mesh_files import write_mesh
from bonecam.mesh.solids import cylinder
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.planning.collision import block_mesh, body_texts, check_bodies
from bonecam.setup.capsule import Capsule
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ToolPath
from bonecam.verify import clearances
from bonecam.verify.clearances import SHARE, TOUCHING, body_clearance
from bonecam.verify.findings import Clearance
from bonecam.verify.removal import check_removal, simulate_removal
from bonecam.verify.sweeping import Accuracy
from bonecam.workholding.clamping import Clamping
from bonecam.workholding.post import Column, Post

HEIDENHAIN = read_dialect("heidenhain")
CUTTERS = [Cutter.from_job(1, "finishing", Job().tool("finishing"), read_machine("mikron-ucp600").nose)]
BOUNDS = np.array([[-4.0, -4.0, 100.0], [4.0, 4.0, 130.0]])
BLOCKS = {
    "cradle": ("B", [[-150, 150, -60], [150, 200, 60]]),
    "towers": ("bed", [[-60, 240, -300], [60, 300, 100]]),
    "head": ("XYZ", [[-100, 60, 120], [100, 300, 400]]),
}
"""Blocks of the machine's frame, mm, and their links."""


@pytest.fixture
def machine_with(tmp_path: Path) -> Callable[..., Machine]:
    """Makes a Mikron with bodies: link and corners of a block by name."""

    def build(bodies: dict, scale: float = 1.0, units: str = "mm") -> Machine:
        text = (MACHINES / "mikron-ucp600.toml").read_text()
        for name, (link, corners) in bodies.items():
            block = block_mesh(np.array(corners, dtype=float))
            write_mesh(TriangleMesh(block.vertices * scale, block.faces), tmp_path / f"{name}.stl")
            text += f'[[bodies]]\nname = "{name}"\nlink = "{link}"\nstl = "{name}.stl"\nunits = "{units}"\n'
        (tmp_path / "own.toml").write_text(text.replace('beside = "closed"', 'beside = "open"'))
        return read_machine(tmp_path / "own.toml")

    return build


@pytest.fixture
def leaning(path_of: Callable[..., ToolPath]) -> ToolPath:
    """Cuts round a part whose axes lean more and more, once round it."""
    polar, azimuth = np.radians(np.linspace(0, 80, 60)), np.radians(np.linspace(0, 330, 60))
    axes = np.column_stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
    return path_of(np.array([0.0, 0.0, 120.0]) + 3 * axes, axes, tool=CUTTERS[0])


def motions_of(path: ToolPath, machine: Machine):
    return read_program(write_program([path], machine, HEIDENHAIN, Job()).text, machine, HEIDENHAIN)


@pytest.mark.parametrize("names", [["cradle"], ["towers"], ["head"], ["cradle", "head"], [*BLOCKS]])
def test_the_least_clearance_is_that_of_all_poses(names: list[str], machine_with, leaning: ToolPath) -> None:
    machine = machine_with({name: BLOCKS[name] for name in names})
    motions = motions_of(leaning, machine)
    told = body_clearance(motions, machine, CUTTERS, Clamping((Column(140.0, 0.0, -np.inf),), closed=False), BOUNDS)
    assert told is not None
    assert told.least is not None
    way = clearances._way_of(motions, np.arange(len(motions.tips)), motions.controls[1])
    fixed = [
        clearances.Solid("box round the stock", block_mesh(BOUNDS)),
        clearances.Solid("table", cylinder(140.0, -2000.0, 0.0, 0.2)),
    ]
    pairs = clearances._pairs(way, CUTTERS[0], clearances.link_solids(machine), fixed)
    least = min(pair.distance(words) for pair in pairs for words in way.words)
    assert told.least.value <= least + 1e-9 + max(TOUCHING, SHARE * least)
    assert told.least.value >= least - TOUCHING


def test_a_wall_beside_the_tool_is_as_far_as_it_is(machine_with, path_of: Callable[..., ToolPath]) -> None:
    """The tool goes upright to x = 40: its nose of 80 mm has its rim at 80 there, the wall stands at 100."""
    tips = np.column_stack([np.linspace(0.0, 40.0, 9), np.zeros(9), np.full(9, 100.0)])
    path = path_of(tips, np.tile([0.0, 0.0, 1.0], (9, 1)), tool=CUTTERS[0])
    machine = machine_with({"wall": ("B", [[100, -50, 0], [120, 50, 300]])})
    motions = motions_of(path, machine)
    told = body_clearance(motions, machine, CUTTERS, Clamping(), BOUNDS)
    assert told is not None
    assert told.least is not None
    assert (told.part, told.other, told.touched) == ("spindle", "wall", 0)
    assert told.least.value == pytest.approx(20.0, abs=TOUCHING)
    assert told.least.place == pytest.approx((40.0, 0.0, 100.0), abs=TOUCHING)


def test_a_program_that_meets_a_body_is_refused_and_no_fault_of_the_part(
    machine_with, path_of: Callable[..., ToolPath]
) -> None:
    tips = np.column_stack([np.linspace(0.0, 40.0, 9), np.zeros(9), np.full(9, 100.0)])
    path = path_of(tips, np.tile([0.0, 0.0, 1.0], (9, 1)), tool=CUTTERS[0])
    machine = machine_with({"wall": ("C", [[70, -50, 0], [120, 50, 300]])})
    stock = Capsule(np.array([0.0, 0.0, 60.0]), np.array([0.0, 0.0, 80.0]), 3.0)
    text = write_program([path], machine, HEIDENHAIN, Job()).text
    removal = simulate_removal(text, machine, HEIDENHAIN, stock, Post(1.0, 57.0), CUTTERS, accuracy=Accuracy(0.4))
    assert removal.report["clearance_mm"]["bodies"] < TOUCHING
    with pytest.raises(BodiesError, match=r"line \d+: the holder comes within 0\.5 mm of the wall at"):
        check_removal(removal)
    check_removal(replace(removal, bodies=Clearance("bodies", None, 0)))


@pytest.mark.parametrize(
    ("bodies", "scale", "units", "told"),
    [
        ({"table": ("C", [[-100, -100, -40], [100, 100, 5]])}, 1.0, "mm", "'table' overlaps the part over"),
        ({"head": ("XYZ", [[-100, -100, -40], [100, 100, 5]])}, 1.0, "mm", "'head' overlaps the tool in front"),
        ({"table": ("C", [[-100, -100, -40], [100, 100, 0]])}, 0.001, "mm", "is 0.286 mm from corner to corner"),
        ({"table": ("C", [[-100, -100, -40], [100, 100, 0]])}, 1.0, "m", "correct units, or the file"),
    ],
)
def test_a_body_out_of_place_is_told_in_a_line(bodies: dict, scale: float, units: str, told: str, machine_with) -> None:
    with pytest.raises(MachineError, match=told) as caught:
        check_bodies(machine_with(bodies, scale, units))
    assert "\n" not in str(caught.value)


def test_bodies_in_another_unit_stand_where_they_are(machine_with) -> None:
    for scale, units in ((0.1, "cm"), (0.001, "m"), (1 / 25.4, "inch")):
        cradle, head = body_texts(machine_with({name: BLOCKS[name] for name in ("cradle", "head")}, scale, units))
        assert cradle == "cradle: moves with B, X -150 to 150, Y 150 to 200, Z -60 to 60 mm, all axes at zero"
        assert "Z 120 to 400 mm from the spindle nose" in head


def test_a_body_that_is_written_again_is_read_again(machine_with) -> None:
    machine = machine_with({"cradle": BLOCKS["cradle"]})
    (before,) = body_texts(machine)
    (body,) = machine.link_bodies
    write_mesh(block_mesh(np.array([[-150, 150, -60], [150, 300, 60]], dtype=float)), body.file)
    os.utime(body.file, ns=(0, body.file.stat().st_mtime_ns + 1))
    (after,) = body_texts(machine)
    assert "Y 150 to 200" in before
    assert "Y 150 to 300" in after


def test_a_body_that_is_open_or_not_there_is_told_in_a_line(machine_with, tmp_path: Path) -> None:
    machine = machine_with({"cradle": BLOCKS["cradle"]})
    block = block_mesh(np.array(BLOCKS["cradle"][1], dtype=float))
    write_mesh(TriangleMesh(block.vertices, block.faces[1:]), tmp_path / "open.stl")
    (body,) = machine.link_bodies
    for file, told in (("open.stl", "has 3 open edges: export it as a closed solid"), ("none.stl", "none.stl")):
        changed = replace(machine, link_bodies=(replace(body, file=tmp_path / file),))
        with pytest.raises(MachineError, match=told):
            check_bodies(changed)


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ('link = "B"', 'link = "A"', r"bodies\.1\.link: A: use one of C, B, XYZ, bed"),
        ('name = "head"', 'name = "cradle"', r"bodies\.2\.name: 'cradle' is there twice"),
        ('stl = "head.stl"', 'stl = "head.step"', r"bodies\.2\.stl: 'head\.step': give a file that ends in \.stl"),
        ('units = "mm"', 'units = "feet"', "units"),
    ],
)
def test_wrong_keys_of_bodies_are_told_with_their_place(
    right: str, wrong: str, told: str, machine_with, tmp_path: Path
) -> None:
    machine_with({name: BLOCKS[name] for name in ("cradle", "head")})
    text = (tmp_path / "own.toml").read_text()
    assert right in text
    (tmp_path / "own.toml").write_text(text.replace(right, wrong))
    with pytest.raises(MachineError, match=told):
        read_machine(tmp_path / "own.toml")
