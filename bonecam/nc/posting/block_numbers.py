"""The numbers of the blocks of a program."""

from bonecam.nc.dialect import Dialect


def number_blocks(lines: list[str], dialect: Dialect) -> tuple[str, int]:
    """The text with block numbers where the dialect has them, and the number of blocks."""
    form = dialect.numbering.format
    mark = dialect.numbering.continuation
    number = dialect.numbering.first
    blocks = 0
    continued = False
    texts = []
    for line in lines:
        if continued or not form:
            texts.append(line)
        else:
            texts.append(form.format(number=number, text=line))
            number += 1
        blocks += not continued
        continued = mark is not None and line.endswith(mark)
    return "\n".join(texts) + "\n", blocks
