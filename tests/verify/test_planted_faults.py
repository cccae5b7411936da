"""Programs with one fault each: reading the text back finds every one, with its block."""

import re

import pytest

from bonecam.errors import BonecamError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.verify.readback import Tolerances, compare_moves

MACHINE, DIALECT = read_machine("mikron-ucp600"), read_dialect("heidenhain")


@pytest.fixture(scope="module")
def paths(capsule_path):
    return (
        capsule_path(level=2, radius=2.0, offset=1.5, number=1, count=60, turns=2),
        capsule_path(level=1, radius=1.0, offset=0.5, number=2, count=60, turns=2),
        capsule_path(level=0, radius=1.0, number=2, count=60, turns=2),
    )


@pytest.fixture(scope="module")
def blocks(paths):
    """The blocks of the program without their numbers."""
    text = write_program(paths, MACHINE, DIALECT, Job()).text
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


def test_the_program_without_a_fault_is_accepted(blocks, paths):
    compare_moves(read_program(numbered(blocks), MACHINE, DIALECT), paths, DIALECT, Tolerances())


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
@pytest.mark.parametrize(("letter", "by"), [(w, s * d) for w, d in zip("XYZBC", (1, 1, 1, 5, 5)) for s in (1, -1)])
def test_a_changed_word_is_found(blocks, paths, letter, by, share):
    cuts = cuts_of(blocks)
    at = cuts[int(share * len(cuts))]
    wrong = list(blocks)
    wrong[at] = re.sub(rf" {letter}([+-][\d.]+)", lambda f: f" {letter}{float(f[1]) + by:+.3f}", wrong[at])
    assert wrong[at] != blocks[at]
    assert line_of_the_fault(wrong, paths) == at + 1


def test_a_feed_made_a_rapid_is_found(blocks, paths):
    cuts = cuts_of(blocks)
    at = cuts[len(cuts) // 2]
    wrong = list(blocks)
    wrong[at] = re.sub(r"( F\d+)?$", " FMAX", wrong[at], count=1)
    assert line_of_the_fault(wrong, paths) == at + 1


def test_two_levels_swapped_are_found(blocks, paths):
    one, two = blocks.index("; LEVEL 1"), blocks.index("; LEVEL 0")
    end = max(k for k, block in enumerate(blocks) if block == "L M140 MB MAX") + 1
    wrong = blocks[:one] + blocks[two:end] + blocks[one:two] + blocks[end:]
    assert one < line_of_the_fault(wrong, paths) <= cuts_of(wrong[one:])[0] + one + 1


def test_a_tool_call_exchanged_is_found(blocks, paths):
    swap = {"TOOL CALL 1 ": "TOOL CALL 2 ", "TOOL CALL 2 ": "TOOL CALL 1 "}
    wrong = [re.sub(r"^TOOL CALL [12] ", lambda f: swap[f[0]], block) for block in blocks]
    first = next(k for k, block in enumerate(wrong) if block.startswith("TOOL CALL"))
    assert first < line_of_the_fault(wrong, paths) <= cuts_of(wrong)[0] + 1
