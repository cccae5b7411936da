import re
from dataclasses import replace

import numpy as np
import pytest
from synthetic_paths import BOTTOM, CAPSULE_RADIUS, TOP, capsule_path

from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.dialect import read_dialect
from bonecam.nc.machine import read_machine
from bonecam.nc.posting.write import write_program
from bonecam.nc.reading.read import read_program
from bonecam.verify.proof import verify_program
from bonecam.verify.readback import Tolerances, compare

PAIRS = {
    name: (read_machine(machine), read_dialect(name))
    for name, machine in (("heidenhain", "mikron-ucp600"), ("linuxcnc", "linuxcnc-xyzbc"))
}
PATHS = (
    capsule_path(level=4, radius=2.0, offset=1.5, number=1, count=300),
    capsule_path(level=0, radius=1.0, number=2, count=600),
)


def capsule_mesh(chord: float = 0.002) -> TriangleMesh:
    """The part of the synthetic paths, inscribed."""
    around = int(np.ceil(np.pi / np.arccos(1 - chord / CAPSULE_RADIUS)))
    slope = np.linspace(-np.pi / 2, np.pi / 2, around // 2 + 1)
    z = np.where(slope < 0, BOTTOM, TOP) + CAPSULE_RADIUS * np.sin(slope)
    r = CAPSULE_RADIUS * np.cos(slope)
    middle = len(slope) // 2
    z, r = np.insert(z, middle, BOTTOM), np.insert(r, middle, CAPSULE_RADIUS)
    angle = 2 * np.pi * np.arange(around) / around
    points = np.column_stack(
        [np.outer(r, np.cos(angle)).ravel(), np.outer(r, np.sin(angle)).ravel(), np.repeat(z, around)]
    )
    index = np.arange(len(points)).reshape(-1, around)
    a, b, c, d = index[:-1], np.roll(index[:-1], -1, 1), np.roll(index[1:], -1, 1), index[1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return TriangleMesh(points, faces.astype(np.int32))


@pytest.fixture(scope="module")
def mesh():
    return MeshDistance(capsule_mesh())


@pytest.fixture(params=PAIRS)
def pair(request):
    return PAIRS[request.param]


def text_of(pair, paths=PATHS) -> str:
    return write_program(paths, *pair, Job()).text


def test_what_was_written_is_proved(pair, mesh):
    proof = verify_program(text_of(pair), PATHS, *pair, mesh)
    assert proof.rows == sum(len(path.tips) for path in PATHS)
    assert proof.moves >= proof.rows
    assert proof.readback_tip_error_mm <= 0.001
    assert proof.readback_axis_error_deg <= 0.0008
    assert proof.gouge.depth <= 0.01


def check(text, pair, paths=PATHS):
    return compare(read_program(text, *pair), paths, pair[1], Tolerances())


def changed(text: str, number: int, pattern: str, change) -> tuple[str, int]:
    """The text with one number of the cutting block at place `number` changed; and its line."""
    lines = text.splitlines()
    places = [i for i, line in enumerate(lines) if re.search(r" X.* F\d", line)]
    place = places[number]
    lines[place] = re.sub(pattern, change, lines[place])
    assert lines != text.splitlines()
    return "\n".join(lines) + "\n", place + 1


def shifted(by: float):
    def change(found):
        value = float(found[2]) + by
        signed = "+" in found[2] or "-" in found[2]
        decimals = len(found[2].split(".")[1])
        return f"{found[1]}{value:{'+' if signed else ''}.{decimals}f}"

    return change


@pytest.mark.parametrize("letter", "XYZ")
def test_a_tip_off_by_five_micrometres_is_found_at_its_line(pair, letter):
    text, line = changed(text_of(pair), 200, rf"( {letter})([-+]?[\d.]+)", shifted(0.005))
    with pytest.raises(VerifyError, match=rf"line {line}: ") as caught:
        check(text, pair)
    assert caught.value.evidence["line"] == line


@pytest.mark.parametrize("letter", "BC")
def test_an_axis_off_by_a_hundredth_degree_is_found_at_its_line(pair, letter):
    text, line = changed(text_of(pair), 200, rf"( {letter})([-+]?[\d.]+)", shifted(0.01))
    with pytest.raises(VerifyError, match=rf"line {line}: "):
        check(text, pair)


def test_a_wrong_feed_is_found_at_its_line(pair):
    text, line = changed(
        text_of(pair),
        200,
        r"( F)(\d+(?:\.\d+)?)",
        lambda found: f" F{float(found[2]) * 1.1:.{4 if '.' in found[2] else 0}f}",
    )
    with pytest.raises(VerifyError, match=rf"line {line}: feed is"):
        check(text, pair)


def without(text: str, start: int, count: int) -> str:
    """The text without some cutting blocks, block numbers mended."""
    lines = text.splitlines()
    places = [i for i, line in enumerate(lines) if re.search(r" X.* F\d", line)][start : start + count]
    lines = [line for i, line in enumerate(lines) if i not in places]
    if lines[0].startswith("0 "):
        numbers = iter(range(len(lines)))
        lines = [
            line if line.startswith(" ") else f"{next(numbers)} {line.split(' ', 1)[1]}" for line in lines
        ]
    return "\n".join(lines) + "\n"


def test_a_missing_block_is_found(pair):
    with pytest.raises(VerifyError, match="tip off by"):
        check(without(text_of(pair), 200, 1), pair)


def test_a_missing_end_is_found(pair):
    text = text_of(pair, PATHS[:1])
    with pytest.raises(VerifyError, match=r"ends \d+ points early"):
        check(text, pair, PATHS)


def test_a_move_too_many_is_found(pair):
    text = text_of(pair, PATHS)
    with pytest.raises(VerifyError, match="more than the paths have"):
        check(text, pair, PATHS[:1])


def test_a_tool_exchanged_is_found(pair):
    exchanged = tuple(
        replace(path, cutter=replace(path.cutter, number=3 - path.cutter.number)) for path in PATHS
    )
    with pytest.raises(VerifyError, match="tool 1 cuts what tool 2"):
        check(text_of(pair), pair, exchanged)


def test_a_path_through_the_part_is_refused_with_line_and_place(pair, mesh):
    deep = (PATHS[0], capsule_path(level=0, number=2, offset=-0.05, count=600))
    with pytest.raises(
        VerifyError, match=r"line \d+: the ball enters the part by 0.05\d+ mm at \("
    ) as caught:
        verify_program(text_of(pair, deep), deep, *pair, mesh)
    assert caught.value.evidence["error"] == pytest.approx(0.05, abs=0.005)


def test_every_split_move_lies_on_the_way_meant(pair):
    rough = (capsule_path(count=60, turns=4.0),)
    checked = check(text_of(pair, rough), pair, rough)
    assert (checked.source < -1).sum() > 30
    assert checked.tip_error.max() < 0.002
