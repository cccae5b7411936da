"""The comments of a program's header on its axes: the room that they take, and how their words are written."""

from bonecam.machine.machine import Machine
from bonecam.nc.dialect import Dialect
from bonecam.nc.posting.travel import Travel


def axis_texts(machine: Machine, travel: Travel, dialect: Dialect) -> list[str]:
    """The room that the program takes, and how endless axes are written."""
    linear = ", ".join(
        f"{axis.letter} {high - low:.1f} of {axis.travel:.1f}"
        for axis, (low, high) in zip(machine.linear, travel.ranges.tolist(), strict=False)
    )
    rotary = ", ".join(
        f"{axis.letter} {low:+.3f} to {high:+.3f}"
        for axis, (low, high) in zip(machine.own_rotary, travel.ranges[3:].tolist(), strict=False)
    )
    return [
        f"travel, mm: {linear}, pivots and tool lengths as assumed",
        f"rotary axes, degrees unwound: {rotary}",
        *(text for axis in machine.rotary if axis.endless for text in _endless_texts(axis.letter, dialect)),
    ]


def _endless_texts(letter: str, dialect: Dialect) -> list[str]:
    """How the words of an endless axis are written, and what the control must do with them."""
    block = f" under {dialect.endless_block}" if dialect.endless_block else ""
    if dialect.endless_words == "wrapped":
        lowest = f"{dialect.endless_from_deg:.0f}..{dialect.endless_from_deg + 360:.0f}"
        form = f" as {dialect.endless_word.format(letter=letter, number='')}" if dialect.has_own_form else ""
        return [
            f"{letter} words: wrapped to {lowest}{form}{block}, the control takes the short way",
            f"{letter} must be a modulo axis, its display reduced to 360 degrees",
        ]
    return [
        f"{letter} words: wound up over many turns{block}, the control drives them as they are",
        f"{letter} must not be a modulo axis, its display not reduced to 360 degrees",
    ]
