"""The numbers of the blocks of a program."""

import numpy as np

from bonecam.nc.dialect import Dialect
from bonecam.nc.schema.numbering import block_numbers, has_number


def number_blocks(lines: list[str], dialect: Dialect) -> tuple[str, int]:
    """The text with block numbers where the dialect has them, and the number of blocks."""
    numbering = dialect.numbering
    mark = numbering.continuation
    before = zip(["", *lines], lines, strict=False)
    continued = [mark is not None and line.endswith(mark) for line, _ in before]
    pairs = zip(lines, continued, strict=True)
    numbered = [not behind and has_number(line, numbering) for line, behind in pairs]
    numbers = iter(block_numbers(numbering, np.arange(sum(numbered))).tolist())
    form = str(numbering.format)
    texts = [
        form.format(number=next(numbers), text=line) if counts else line
        for line, counts in zip(lines, numbered, strict=True)
    ]
    return "\n".join(texts) + "\n", len(lines) - sum(continued)
