"""Numbers that a control does not take: its word is beyond what the dialect's file tells of it."""

from bonecam.nc.reading.line_error import line_error
from bonecam.nc.schema.number_format import NumbersTable


def check_range(numbers: NumbersTable, words: dict[str, float], line: int) -> None:
    """ProgramError where a word of an axis or the feed F has a number outside the range of its kind."""
    for letter, value in words.items():
        kind = numbers.length if letter in "XYZ" else numbers.feed if letter == "F" else numbers.angle
        if not kind.lowest <= value <= kind.highest:
            bounds = f"{kind.lowest:g} .. {kind.highest:g}"
            raise line_error(line, f"{letter} {value:g} leaves the control's range {bounds}")
