"""The numbers of the blocks of a program."""

from bonecam.nc.dialect import Dialect


def number_blocks(lines: list[str], dialect: Dialect) -> tuple[str, int]:
    """The text with block numbers where the dialect has them, and the number of blocks."""
    form, mark = dialect.numbering.get("format"), dialect.numbering.get("continuation")
    number = int(dialect.numbering.get("first", 0))
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
        continued = bool(mark) and line.endswith(str(mark))
    return "\n".join(texts) + "\n", blocks
