"""Pictures of the docs in a palette of 256 colours where that is what keeps a page small."""

from pathlib import Path

from PIL import Image

LARGEST = 300_000
"""Bytes above which a picture is written in a palette."""


def shrink(file: Path) -> None:
    """Write a PNG file that is larger than LARGEST again, in a palette of its own."""
    if file.stat().st_size > LARGEST:
        with Image.open(file) as picture:
            small = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
        small.save(file, optimize=True)
