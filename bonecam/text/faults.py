"""What is wrong in a text, by its keys: all of it, in one line."""

from collections.abc import Sequence

MOST_TOLD = 8
"""Faults that a message tells one by one; of more it tells the number."""


class Faults(ValueError):
    """What is wrong in a text: (key, what and remedy) of each place; the key is empty where it is the whole."""

    def __init__(self, found: Sequence[tuple[str, str]]) -> None:
        self.found = tuple(found)
        told = [f"{key}: {why}" if key else why for key, why in self.found[:MOST_TOLD]]
        more = len(self.found) - len(told)
        super().__init__("; ".join([*told, f"and {more} more"] if more else told))


def shown(value: object) -> str:
    """A value as messages show it: one short line, however long or deep the value is."""
    if isinstance(value, dict | list | tuple):
        return "a table" if isinstance(value, dict) else f"a list of {len(value)}"
    if isinstance(value, int) and value.bit_length() > 64:
        return f"a number of {value.bit_length()} bits"
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
