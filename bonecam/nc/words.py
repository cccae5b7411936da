"""Angles and texts as words of a program take them."""

import re

import numpy as np
from jaxtyping import Float
from numpy import ndarray


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
