"""The comments that tell links from cuts in a program."""

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import dialect_names, read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.tool.path import MoveKind
from bonecam.verify.readback import Tolerances, compare_moves

PAIRS = dict.fromkeys(dialect_names(), "mikron-ucp600") | {"linuxcnc": "linuxcnc-xyzbc"}


@pytest.mark.parametrize("name", PAIRS)
def test_the_text_tells_which_moves_are_links(capsule_path, name):
    machine, dialect = read_machine(PAIRS[name]), read_dialect(name)
    path = capsule_path(level=0, radius=1.0, number=1, count=150)
    motions = read_program(write_program([path], machine, dialect, Job()).text, machine, dialect)
    source = compare_moves(motions, [path], dialect, Tolerances()).source
    # a move between two rows is of the kind of the later one
    kinds = path.kinds[np.where(source >= 0, source, -2 - source)]
    posted = (source != -1) & ~motions.rapid
    # rapids that the control may bend are written as feeds, and are links
    bent = set() if dialect.straight_rapids else {MoveKind.RAPID}
    assert set(kinds[posted]) == {MoveKind.LINK, MoveKind.CUT} | bent
    assert np.array_equal(motions.links[posted], kinds[posted] != MoveKind.CUT)
    assert not motions.links[motions.rapid].any()


def test_a_text_without_marks_has_no_links(capsule_path):
    machine, dialect = read_machine("linuxcnc-xyzbc"), read_dialect("linuxcnc")
    text = write_program([capsule_path(level=0, radius=1.0, number=1, count=50)], machine, dialect, Job()).text
    bare = text.replace("(LINK)\n", "").replace("(CUT)\n", "")
    with_marks, without = read_program(text, machine, dialect), read_program(bare, machine, dialect)
    assert not without.links.any()
    assert np.array_equal(without.words, with_marks.words)
