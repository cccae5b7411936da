"""Docstrings as the reference shows them: plain text in which square brackets are no links."""

import re
from typing import Any

import griffe

CODE = re.compile(r"(``.*?``|`[^`]*`|^ {4}.*$)", re.MULTILINE)
"""What Markdown shows as it stands: words in backquotes, and indented formulas."""


class PlainBrackets(griffe.Extension):
    """Escapes the square brackets of every docstring outside code, so that `[0, 1)` and `Q[j](s)` stay text."""

    def on_instance(self, *, obj: griffe.Object, **_: Any) -> None:
        """Change one docstring after it was read."""
        if obj.docstring is None:
            return
        parts = CODE.split(obj.docstring.value)
        obj.docstring.value = "".join(
            part if CODE.fullmatch(part) else re.sub(r"([\[\]<])", r"\\\1", part) for part in parts
        )
