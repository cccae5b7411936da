"""Where the spindle nose goes between the ends of a block."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.machine.kinematics import inverse_linear
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.verify.control import check_limits, nose_moves

SIEMENS = read_dialect("siemens-840d")


HALF = 0.5**0.5
CHAINS = {
    "table-table": (["C", "A", "XYZ"], {"C": ([0, 0, 1], [1, 2, 0]), "A": ([1, 0, 0], [0, 5, -70])}),
    "head-table": (["C", "XYZ", "B"], {"C": ([0, 0, 1], [1, 2, 0]), "B": ([0, 1, 0], [0, 0, 40])}),
    "head-head": (["XYZ", "C", "A"], {"C": ([0, 0, 1], [0, 0, 90]), "A": ([1, 0, 0], [3, 0, 60])}),
    "nutating": (["C", "B", "XYZ"], {"C": ([0, 0, 1], [1, 2, 0]), "B": ([0, HALF, HALF], [0, 5, -7])}),
}
"""Chains of machines: direction and pivot of each rotary axis."""


def machine_text(chain, rotary, point):
    text = f'title = "test"\nchain = {chain}\npart_zero = [1.0, -2.0, 3.0]\nprogrammed_point = "{point}"\n'
    text += "".join(f"[{letter}]\ntravel = 4000.0\nspeed = 10000.0\n" for letter in "XYZ")
    for letter, (direction, pivot) in rotary.items():
        text += f"[{letter}]\nspeed_deg_s = 60.0\nsign = 1\ndirection = {direction}\npivot = {pivot}\n"
        text += "endless = true\n" if letter == "C" else "limits_deg = [-179.0, 179.0]\n"
    return text


@pytest.fixture(scope="module", params=[(name, point) for name in CHAINS for point in ("tip", "centre")])
def moves(request, capsule_path, tmp_path_factory):
    """The nose of a helix in long blocks, and that sampled at a thousand places of each block."""
    name, point = request.param
    path = tmp_path_factory.mktemp("machine") / "test.toml"
    path.write_text(machine_text(*CHAINS[name], point))
    machine = read_machine(path)
    job = Job().with_values(path={"chord_tolerance": 0.5, "gouge_tolerance": 0.5})
    text = write_program([capsule_path(count=60, turns=3.0)], machine, SIEMENS, job).text
    motions = read_program(text, machine, SIEMENS)
    rows = np.flatnonzero(motions.known_start)
    control = motions.controls[1]
    dense = np.empty((len(rows), 1001, 3))
    for at, u in enumerate(np.linspace(0, 1, 1001)):
        tips, _ = control.between(motions.words[rows - 1], motions.words[rows], u)
        angles = (1 - u) * motions.words[rows - 1, 3:] + u * motions.words[rows, 3:]
        dense[:, at] = inverse_linear(machine, tips, angles, control.tool_length)[:, :3]
    dense[:, :, 2] += control.tool_length
    return nose_moves(motions, machine), rows, dense


def test_no_block_leaves_the_line_between_its_ends_by_more_than_its_bow(moves):
    noses, rows, dense = moves
    line = np.linspace(0, 1, 1001)[:, None]
    starts, ends = noses.starts[rows][:, None], noses.ends[rows][:, None]
    off = np.abs(dense - ((1 - line) * starts + line * ends)).max(axis=(1, 2))
    assert (off <= noses.bows[rows] + 1e-9).all()
    assert off.max() > 0.02  # the blocks are bowed enough to tell


@pytest.mark.parametrize("column", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_highest_place_of_each_block_is_found(moves, column, sign):
    noses, rows, dense = moves
    highest = (sign * dense[:, :, column]).max(axis=1)
    found = noses.highest(column, sign, rows)
    assert np.abs(found - highest).max() < 0.002
    value = float(np.median(highest))
    assert set(rows[highest > value + 0.002]) <= set(noses.reaching(column, sign, value).tolist())


def test_a_limit_that_is_passed_between_the_ends_of_a_block_only_is_kept(capsule_path):
    """The tip stays at X 100 of the part while C turns from -20 to 20: X goes from 94 over 100 to 94."""
    mikron, heidenhain = read_machine("mikron-ucp600"), read_dialect("heidenhain")
    lines = write_program([capsule_path(count=24)], mikron, heidenhain, Job()).text.splitlines()
    start = next(k for k, line in enumerate(lines) if " L B" in line)
    blocks = [
        "L B+0.000 C-20.000 R0 FMAX",
        "FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS",
        "L X+100.000 Y+0.000 Z+60.000 R0 FMAX",
        "L X+100.000 Y+0.000 Z+60.000 B+0.000 C+20.000 R0 F100",
        "FUNCTION RESET TCPM",
        "M30",
        "END PGM BONE MM",
    ]
    number = int(lines[start].split(" ")[0])
    text = "\n".join([*lines[:start], *(f"{number + k} {block}" for k, block in enumerate(blocks))]) + "\n"
    motions = read_program(text, mikron, heidenhain)
    with pytest.raises(VerifyError, match=r"X goes to 100\.000 mm, its limit is 99\.9 mm") as caught:
        check_limits(motions, with_limits(mikron, 0, 99.9))
    assert caught.value.evidence["line"] == start + 4
    check_limits(motions, with_limits(mikron, 0, 100.001))
    assert nose_moves(motions, mikron).ends[:, 0].max() < 94.0


def with_limits(machine, column, high):
    linear = list(machine.linear)
    linear[column] = replace(linear[column], limits=(-1e4, float(high)))
    return replace(machine, linear=tuple(linear))
