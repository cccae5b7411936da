"""The chain of the tutorial, stage by stage, makes the program of `convert`."""

import re
from pathlib import Path

import pytest

import bonecam

pytestmark = pytest.mark.whole

PAGE = Path(__file__).parents[2] / "docs" / "pages" / "tutorials" / "python.md"


def moves(text: str) -> list[str]:
    """The blocks of a Klartext program without their numbers and without comments."""
    blocks = [re.sub(r"^\d+ ", "", line) for line in text.splitlines()]
    return [block for block in blocks if not block.startswith(";")]


def test_the_tutorial_s_chain_makes_the_same_program(small_run):
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    (chain,) = [block for block in blocks if "def program_of" in block]
    names: dict[str, object] = {"bonecam": bonecam}
    exec(chain, names)
    made = small_run[0]
    program = names["program_of"](made.part.given, made.job)  # type: ignore[operator]
    assert moves(program.text) == moves(made.program.text)
