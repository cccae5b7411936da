"""Regular expressions of strangers: matched in a time linear in the text, whatever the expression is (RE2).

Python's `re` tries one way after another: `(a+)+b` takes it hours for a line of 40 letters. RE2 (R. Cox, Regular
Expression Matching in the Wild, 2010) follows all ways at once; it has no backreferences and no looking around.
"""

import re2

LARGEST = 500
"""Most characters of an expression: the longest of ours has 80."""


class Pattern:
    """A regular expression; ValueError where it is none, or is too long."""

    def __init__(self, text: str) -> None:
        if len(text) > LARGEST:
            raise ValueError(f"has {len(text)} characters: give at most {LARGEST}")
        options = re2.Options()
        options.log_errors = False
        try:
            self._compiled = re2.compile(text, options)
        except re2.error as error:
            why = error.args[0].decode(errors="replace") if error.args else "it is none"
            raise ValueError(f"{why[:80]}: give a regular expression (RE2)") from error

    @property
    def groups(self) -> set[str]:
        """The names of its groups."""
        return set(self._compiled.groupindex)

    def match(self, text: str) -> dict[str, str] | None:
        """The texts of the named groups where the whole text matches; a group that is not in it has none.

        Bytes of a file's name that are not in UTF-8 count as question marks."""
        match = self._compiled.fullmatch(text.encode(errors="replace").decode())
        return {name: part or "" for name, part in match.groupdict().items()} if match else None
