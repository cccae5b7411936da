"""APT statements written from tool paths are read back as they were; damaged ones are refused with their line."""

import contextlib

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bonecam.errors import ProgramError
from bonecam.job import Job
from bonecam.report import read_apt
from bonecam.report.tables import apt_text
from bonecam.tool import Cutter, MoveKind, ToolPath

JOB = Job()
CUTTERS = [Cutter.from_job(k, name, JOB.tool(name)) for k, name in ((1, "roughing"), (2, "finishing"))]


def path(level: int, cutter: Cutter, seed: int, count: int = 20) -> ToolPath:
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(count, 3))
    nan = np.full((count, 3), np.nan)
    return ToolPath(
        level,
        cutter,
        rng.integers(0, 3, count),
        np.zeros(count, dtype=np.int64),
        nan[:, :2],
        nan,
        rng.normal(scale=100, size=(count, 3)),
        axes / np.linalg.norm(axes, axis=1)[:, None],
        rng.choice([900.0, 333.125, 2500.0], count),
        np.zeros((0, 3)),
        (),
    )


PATHS = [path(7, CUTTERS[0], 1), path(6, CUTTERS[0], 2, 1), path(0, CUTTERS[1], 3)]
TEXT = apt_text(PATHS)


def test_what_is_written_is_read_back():
    found = read_apt(apt_text(PATHS, "BONE_1"))
    assert found.name == "BONE_1"
    assert [(one.level, one.tool) for one in found.paths] == [(7, 1), (6, 1), (0, 2)]
    for one, meant in zip(found.paths, PATHS, strict=True):
        rapid = meant.kinds == MoveKind.RAPID
        assert (one.diameter, one.corner) == (2 * meant.cutter.radius, meant.cutter.radius)
        np.testing.assert_allclose(one.tips, meant.tips, atol=5.1e-7)
        np.testing.assert_allclose(one.axes, meant.axes, atol=1e-9)
        np.testing.assert_array_equal(one.rapid, rapid)
        assert one.links is not None
        np.testing.assert_array_equal(one.links[~rapid], meant.kinds[~rapid] == MoveKind.LINK)
        np.testing.assert_allclose(one.feed_rates[~rapid], meant.feed_rates[~rapid], atol=5e-4)
        assert np.isnan(one.feed_rates[rapid]).all()


def test_other_systems_texts_are_read():
    text = """PARTNO/BLADE 7  $$ from elsewhere
UNITS/INCHES
LOADTL/3,ADJUST,4
CUTTER/0.5
SPINDL/4500,CLW
FROM/0,0,10
RAPID
GOTO/ 1., 2., 3., $
0, 0.6, 0.8
FEDRAT/10,IPM
GOTO/1,2,-.5
FINI
"""
    one = read_apt(text).paths[0]
    assert (one.level, one.tool, one.diameter, one.corner) == (None, 3, 12.7, 0.0)
    np.testing.assert_allclose(one.tips, 25.4 * np.array([[0, 0, 10], [1, 2, 3], [1, 2, -0.5]]))
    np.testing.assert_allclose(one.axes, [[0, 0, 1], [0, 0.6, 0.8], [0, 0, 1]])
    np.testing.assert_array_equal(one.rapid, [True, True, False])
    assert one.feed_rates[2] == 254.0
    assert one.links is None


HEAD = "LOADTL/1\nCUTTER/4,2\nFEDRAT/900\n"
DAMAGED = {
    "GOTO/1,2": "line 4: GOTO with 2 numbers",
    "GOTO/1,2,x": "line 4: GOTO with 'x'",
    "GOTO/1,2,nan": "line 4",
    "GOTO/1,2,1e999": "line 4",
    "GOTO/1,2,3,0,0,2": "line 4: the tool axis",
    "CIRCLE/1,2,3": "line 4: the word CIRCLE is not known",
    "goto/1,2,3": "line 4: 'goto/1,2,3' is no APT statement",
    "FEDRAT/-1": "line 4: a feed of -1",
    "FEDRAT/MMPM": "line 4: FEDRAT",
    "CUTTER/4,3": "line 4: CUTTER",
    "LOADTL/1.5": "line 4: LOADTL",
    "UNITS/CM": "line 4: UNITS",
    "FINI\nGOTO/1,2,3": "line 5: GOTO behind FINI",
}


@pytest.mark.parametrize("statement", DAMAGED)
def test_damaged_statements_are_refused_with_their_line(statement):
    with pytest.raises(ProgramError, match=DAMAGED[statement]):
        read_apt(f"{HEAD}{statement}\nFINI\n")


@pytest.mark.parametrize("text", ["", HEAD, "GOTO/1,2,3\nFINI", "LOADTL/1\nCUTTER/4\nGOTO/1,2,3\nFINI", "GOTO/1,$"])
def test_texts_without_end_tool_or_feed_are_refused(text):
    with pytest.raises(ProgramError, match="line"):
        read_apt(text)


@settings(max_examples=100)
@given(st.integers(0, 3000), st.integers(0, 3000), st.text(max_size=5))
@example(63, 834, "\x1f")  # white space to Python's strip, not to its float
def test_a_text_damaged_anywhere_is_read_or_refused(first, last, put):
    low, high = sorted((first, last))
    with contextlib.suppress(ProgramError):
        read_apt(TEXT[:low] + put + TEXT[high:])
