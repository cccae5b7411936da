"""Turns blocks of LaTeX (```math, as GitHub shows them) into MathML when the pages are built: no script has to."""

import re
from typing import Any

from latex2mathml.converter import convert

BLOCK = re.compile(r"^```math\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Each block as MathML of its own line, which all current browsers show."""
    return BLOCK.sub(lambda block: convert(block.group(1).strip(), display="block"), markdown)
