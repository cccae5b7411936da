"""The numbers of the blocks of a program."""

from bonecam.nc.dialect import Dialect
from bonecam.nc.schema.numbering import block_number, has_number


def number_blocks(lines: list[str], dialect: Dialect) -> tuple[str, int]:
    """The text with block numbers where the dialect has them, and the number of blocks."""
    numbering = dialect.numbering
    mark = numbering.continuation
    ordinal = 0
    blocks = 0
    continued = False
    texts = []
    for line in lines:
        if continued or not has_number(line, numbering):
            texts.append(line)
        else:
            texts.append(str(numbering.format).format(number=block_number(numbering, ordinal), text=line))
            ordinal += 1
        blocks += not continued
        continued = mark is not None and line.endswith(mark)
    return "\n".join(texts) + "\n", blocks
