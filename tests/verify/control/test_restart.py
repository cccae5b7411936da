"""A program restarts at a tool call or a level, behind its safe start, and nowhere else."""

import re

import pytest

from bonecam.errors import ProgramError, VerifyError
from bonecam.nc.reading import read_program
from bonecam.verify.control import check_control

RETRACTS = {"siemens-840d": 1, "fanuc-30i": 2, "makino": 2, "mitsubishi": 2}
"""Blocks of the retract before the call of a tool."""


def place(posted, pattern):
    return next(at for at, block in enumerate(posted.blocks) if re.search(pattern, block))


def tool_start(posted, number):
    """The first block of a tool's start."""
    return place(posted, rf"^(TOOL CALL {number} |T{number}\b)") - RETRACTS.get(posted.dialect.name, 0)


def judge(posted, blocks):
    motions = read_program(posted.text(blocks), posted.machine, posted.dialect)
    check_control(motions, posted.machine, posted.dialect, posted.job)
    return motions


def test_behind_the_safe_start_a_program_begins_at_a_later_tool(posted):
    blocks = list(posted.blocks)
    motions = judge(posted, blocks[: tool_start(posted, 1)] + blocks[tool_start(posted, 2) :])
    assert set(motions.tools) == {2}


def test_behind_the_start_of_its_tool_a_program_begins_at_a_level(posted):
    blocks = list(posted.blocks)
    level = place(posted, r"^[;(] ?LEVEL 0")
    start = blocks[: tool_start(posted, 1)] + blocks[tool_start(posted, 2) : level]
    whole = judge(posted, blocks)
    motions = judge(posted, start + blocks[level:])
    assert (motions.tips == whole.tips[whole.tools == 2]).all()


def test_from_a_level_on_a_program_states_all_that_it_needs(posted):
    """The frame of the program and what describes its tools are all that stands before."""
    blocks = list(posted.blocks)
    level = place(posted, r"^[;(] ?LEVEL 0")
    frame = [block for block in blocks[:level] if re.match(r"%|BEGIN|O\d{4}$|[;(] ?TOOL \d BALL", block)]
    assert "RESTART MAY BEGIN HERE" in "".join(blocks[level : level + 3])
    whole = judge(posted, blocks)
    motions = judge(posted, frame + blocks[level:])
    assert (motions.tips == whole.tips[whole.tools == 2]).all()
    modes = next(k for k, block in enumerate(blocks[level:]) if re.match(r"TRAFOOF|G49|G21|FUNCTION RESET", block))
    with pytest.raises(ProgramError, match="is stated"):
        judge(posted, frame + blocks[level + modes + 6 :])


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_program_does_not_begin_within_a_run(posted, share):
    blocks = list(posted.blocks)
    cut = posted.cuts[int(share * len(posted.cuts) / 2)]
    level = place(posted, r"^[;(] ?LEVEL 1")
    with pytest.raises((ProgramError, VerifyError), match=r"line \d+: "):
        judge(posted, blocks[:level] + blocks[cut:])
    with pytest.raises((ProgramError, VerifyError), match=r"line \d+: "):
        judge(posted, blocks[: tool_start(posted, 1)] + blocks[cut:])
