"""Angles and texts as words of a program take them."""

import re
import textwrap

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.nc.dialect import Dialect
from bonecam.text.faults import shortened

NUMBER = 12
"""Characters that a comment's line keeps free for its number."""


def wrapped(angles_deg: Float[ndarray, "*n"], lowest: float = -180.0) -> Float[ndarray, "*n"]:
    """Angles brought into [lowest, lowest + 360)."""
    turned = (np.asarray(angles_deg) - lowest) % 360.0 + lowest
    # an angle less than a rounding below the lowest comes out as a whole turn above it
    return np.where(turned >= lowest + 360.0, lowest, turned)


def plain_text(text: str, characters: str) -> str:
    """`text` in capitals, with a blank for every character that the control's comments cannot have; the + of a
    direction such as X+, which would be lost beside X-, becomes PLUS."""
    if "+" not in characters:
        text = re.sub(r"(?<=[XYZ])\+", " PLUS", text)
    return "".join(letter if letter in characters else " " for letter in text.upper()).strip()


def comment(text: str, dialect: Dialect) -> str:
    """A comment in the form and the characters of the dialect, cut where its control loads no longer line."""
    plain = plain_text(text, dialect.comment_characters)
    return dialect.comment.format(text=shortened(plain, _room(dialect)))


def comments_of(text: str, dialect: Dialect) -> list[str]:
    """A text in as many comments as it takes for no line to be longer than the control loads."""
    plain = plain_text(text, dialect.comment_characters)
    return [dialect.comment.format(text=piece) for piece in textwrap.wrap(plain, _room(dialect))]


def _room(dialect: Dialect) -> int:
    """Characters of a comment's text."""
    return dialect.longest_line - len(dialect.comment.format(text="")) - NUMBER
