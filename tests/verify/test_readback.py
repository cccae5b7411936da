"""Programs with one fault each: reading the text back finds every one, with its block."""

import re
from functools import cache

import numpy as np
import pytest
from controls import PAIRS
from small_parts import PATH_CAPSULE, capsule_path

from bonecam.errors import BonecamError, VerifyError
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.mesh import MeshDistance
from bonecam.nc import read_dialect, read_program, write_program
from bonecam.setup import Capsule
from bonecam.verify import Tolerances, verify
from bonecam.verify.readback import compare_moves

PATHS = (
    capsule_path(level=4, radius=2.0, offset=1.5, number=1, count=300),
    capsule_path(level=0, radius=1.0, number=2, count=600),
)


@pytest.fixture(scope="module")
def mesh():
    bottom, top, radius = PATH_CAPSULE
    return MeshDistance(Capsule(np.array([0.0, 0.0, bottom]), np.array([0.0, 0.0, top]), radius).mesh(0.002))


@pytest.fixture(params=["heidenhain", "linuxcnc"])
def pair(request):
    return PAIRS[request.param]


@cache
def posted(name, *paths) -> str:
    return write_program(paths, *PAIRS[name], Job()).text


def text_of(pair, paths) -> str:
    return posted(pair[1].name, *paths)


def test_what_was_written_is_proved(pair, mesh):
    proof = verify(text_of(pair, PATHS), PATHS, *pair, mesh)
    assert proof.rows == sum(len(path.tips) for path in PATHS)
    assert proof.moves >= proof.rows
    assert proof.readback_tip_error_mm <= 0.001
    assert proof.readback_axis_error_deg <= 0.0008
    assert proof.gouge.depth <= 0.01


def check(text, pair, paths):
    return compare_moves(read_program(text, *pair), paths, pair[1], Tolerances())


BLOCK = r"(L|G1) X.* C\S+( F\d[\d.]*)?$"
"""A feed move with all five words."""


def changed(text: str, number: int, pattern: str, change, block: str = BLOCK) -> tuple[str, int]:
    """The text with one number of the block at place `number` of those of a form changed; and its line."""
    lines = text.splitlines()
    places = [i for i, line in enumerate(lines) if re.search(block, line)]
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


@pytest.mark.parametrize(
    ("letter", "by", "place"), [*((w, 0.005, 200) for w in "XYZ"), *((w, 0.01, 200) for w in "BC"), ("X", 1.0, 700)]
)
def test_a_word_off_by_little_is_found_at_its_line(pair, letter, by, place):
    text, line = changed(text_of(pair, PATHS), place, rf"( {letter})([-+]?[\d.]+)", shifted(by))
    with pytest.raises(VerifyError, match=rf"line {line}: ") as caught:
        check(text, pair, PATHS)
    assert caught.value.evidence["line"] == line


def test_a_wrong_feed_is_found_at_its_line(pair):
    text, line = changed(
        text_of(pair, PATHS),
        9,
        r"( F)(\d+(?:\.\d+)?)",
        lambda found: f" F{float(found[2]) * 1.1:.{4 if '.' in found[2] else 0}f}",
        block=r" X.* F\d",
    )
    with pytest.raises(VerifyError, match=rf"line {line}: feed is"):
        check(text, pair, PATHS)


def without(text: str, start: int, count: int) -> str:
    """The text without some cutting blocks, block numbers mended."""
    lines = text.splitlines()
    places = [i for i, line in enumerate(lines) if re.search(BLOCK, line)][start : start + count]
    lines = [line for i, line in enumerate(lines) if i not in places]
    if lines[0].startswith("0 "):
        numbers = iter(range(len(lines)))
        lines = [line if line.startswith(" ") else f"{next(numbers)} {line.split(' ', 1)[1]}" for line in lines]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("fault", "paths", "why"),
    [
        (lambda text: without(text, 200, 1), PATHS, "tip off by"),
        (lambda text: text, PATHS[:1], "more than the paths have"),
        (lambda text: text, (*PATHS, *PATHS), r"ends \d+ points early"),
    ],
)
def test_blocks_too_many_or_too_few_are_found(pair, fault, paths, why):
    with pytest.raises(VerifyError, match=why):
        check(fault(text_of(pair, PATHS)), pair, paths)


def test_a_path_through_the_part_is_refused_with_line_and_place(pair, mesh):
    deep = (PATHS[0], capsule_path(level=0, number=2, offset=-0.05, count=600))
    with pytest.raises(VerifyError, match=r"line \d+: the ball enters the part by 0.05\d+ mm at \(") as caught:
        verify(text_of(pair, deep), deep, *pair, mesh)
    assert caught.value.evidence["error"] == pytest.approx(0.05, abs=0.005)


def test_every_split_move_lies_on_the_way_meant(pair):
    rough = (capsule_path(count=60, turns=4.0),)
    checked = check(text_of(pair, rough), pair, rough)
    assert (checked.source < -1).sum() > 30
    assert checked.tip_error.max() < 0.002


MACHINE, DIALECT = read_machine("mikron-ucp600"), read_dialect("heidenhain")


PLANTED = (
    capsule_path(level=2, radius=2.0, offset=1.5, number=1, count=60, turns=2),
    capsule_path(level=1, radius=1.0, offset=0.5, number=2, count=60, turns=2),
    capsule_path(level=0, radius=1.0, number=2, count=60, turns=2),
)


@pytest.fixture(scope="module")
def blocks():
    """The blocks of the program without their numbers."""
    text = write_program(PLANTED, MACHINE, DIALECT, Job()).text
    return [re.sub(r"^\d+ ", "", line) for line in text.rstrip("\n").split("\n")]


def numbered(blocks):
    lines = []
    number = 0
    for block in blocks:
        continued = bool(lines) and lines[-1].endswith("~")
        lines.append(block if continued else f"{number} {block}")
        number += not continued
    return "\n".join(lines) + "\n"


def line_of_the_fault(blocks, paths):
    with pytest.raises(BonecamError) as caught:
        compare_moves(read_program(numbered(blocks), MACHINE, DIALECT), paths, DIALECT, Tolerances())
    return caught.value.evidence["line"]


def cuts_of(blocks):
    return [k for k, block in enumerate(blocks) if re.search(r"^L X.* C\S+( F\d+)?$", block)]


def test_a_feed_made_a_rapid_is_found(blocks):
    cuts = cuts_of(blocks)
    at = cuts[len(cuts) // 2]
    wrong = list(blocks)
    wrong[at] = re.sub(r"( F\d+)?$", " FMAX", wrong[at], count=1)
    assert line_of_the_fault(wrong, PLANTED) == at + 1


def test_two_levels_swapped_are_found(blocks):
    one, two = blocks.index("; LEVEL 1"), blocks.index("; LEVEL 0")
    end = max(k for k, block in enumerate(blocks) if block == "L M140 MB MAX") + 1
    wrong = blocks[:one] + blocks[two:end] + blocks[one:two] + blocks[end:]
    assert one < line_of_the_fault(wrong, PLANTED) <= cuts_of(wrong[one:])[0] + one + 1


def test_a_tool_call_exchanged_is_found(blocks):
    swap = {"TOOL CALL 1 ": "TOOL CALL 2 ", "TOOL CALL 2 ": "TOOL CALL 1 "}
    wrong = [re.sub(r"^TOOL CALL [12] ", lambda f: swap[f[0]], block) for block in blocks]
    first = next(k for k, block in enumerate(wrong) if block.startswith("TOOL CALL"))
    assert first < line_of_the_fault(wrong, PLANTED) <= cuts_of(wrong)[0] + 1
