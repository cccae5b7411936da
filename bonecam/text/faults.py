"""What is wrong in a text, by its keys: all of it, in one line."""

from collections.abc import Sequence

MOST_CHARACTERS = 800
"""Characters of a message after which it tells only the number of further faults."""


class Faults(ValueError):
    """What is wrong in a text: (key, what and remedy) of each place; the key is empty where it is the whole."""

    def __init__(self, found: Sequence[tuple[str, str]]) -> None:
        self.found = tuple(found)
        texts: list[str] = []
        for key, why in self.found:
            text = f"{shortened(key, 200)}: {why}" if key else why
            if texts and len("; ".join([*texts, text])) > MOST_CHARACTERS:
                break
            texts.append(shortened(text, MOST_CHARACTERS))
        more = len(self.found) - len(texts)
        super().__init__("; ".join([*texts, f"and {more} more"] if more else texts))


def shown(value: object) -> str:
    """A value as messages show it: one short line, however long or deep the value is."""
    if isinstance(value, dict | list | tuple) and value:
        return "a table" if isinstance(value, dict) else f"a list of {len(value)}"
    if isinstance(value, int) and value.bit_length() > 64:
        return f"a number of {value.bit_length()} bits"
    text = repr(value)
    return shortened(text if isinstance(value, str) else " ".join(text.split()), 40)


def in_one_line(text: str) -> str:
    """A text for a terminal: in one line, with control characters, which it would obey, written as Python does."""
    line = " ".join(text.splitlines())
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in line)


def shortened(text: str, length: int) -> str:
    """A text cut to a length, with dots where it was cut."""
    return text if len(text) <= length else f"{text[: length - 3]}..."
