"""The anatomical axes that a mesh file states in its header: `SPACE=LPS`, as 3D Slicer writes it.

The three letters tell where x, y and z point: Left or Right, Anterior or Posterior, Superior or Inferior. LPS (DICOM)
and RAS (3D Slicer inside) are right-handed; coordinates in left-handed axes are a mirror image of the bone.
"""

import re

import numpy as np

STATED = re.compile(rb"\b(?:space|coordinate[ _-]?system)\s*[=:]\s*([a-z]+(?:-[a-z]+)*)", re.IGNORECASE)
"""A statement in a comment."""
POINTS_TO = {
    "L": (-1, 0, 0, "left"),
    "R": (1, 0, 0, "right"),
    "P": (0, -1, 0, "back"),
    "A": (0, 1, 0, "front"),
    "I": (0, 0, -1, "feet"),
    "S": (0, 0, 1, "head"),
}
"""Direction of each letter in RAS, and in plain words."""
COMMENTS = (b"comment", b"obj_info", b"#", b"solid")
"""How lines that hold comments begin, in PLY, OBJ, OFF and ASCII STL."""
STL_HEADER = 80
"""Bytes of the text that a binary STL begins with."""
LOOKED_AT = 2**16
"""Bytes from a file's beginning in which a comment is looked for."""


def stated_axes(data: bytes) -> str:
    """The three letters that the bytes of a mesh file state, like LPS; empty where they state none."""
    head = data[:LOOKED_AT]
    lines = [line for line in head.splitlines() if line.lstrip().lower().startswith(COMMENTS)]
    for match in STATED.finditer(b"\n".join([head[:STL_HEADER], *lines])):
        words = match[1].decode().upper()
        letters = "".join(word[0] for word in words.split("-")) if "-" in words else words
        if len(letters) == 3 and all(letter in POINTS_TO for letter in letters) and _directions(letters):
            return letters
    return ""


def _directions(letters: str) -> float:
    """1 where the axes are right-handed, -1 where left-handed, 0 where they are no axes of space."""
    return float(np.linalg.det([POINTS_TO[letter][:3] for letter in letters]))


def axes_text(letters: str) -> str:
    """What is told of stated axes."""
    where = ", ".join(f"{axis} to the {POINTS_TO[letter][3]}" for axis, letter in zip("xyz", letters, strict=True))
    message = f"its header states the axes {letters}: {where}"
    return message if _directions(letters) > 0 else f"{message}; they are left-handed: check that it is no mirror image"
