"""The numbers of blocks: their table in a dialect file, which lines have one, which it is, and how a line with its
number looks."""

import re
import string
from typing import Annotated

import numpy as np
from jaxtyping import Int
from numpy import ndarray
from pydantic import AfterValidator, Field, model_validator

from bonecam.text.record import KeyFault, Record
from bonecam.text.template import check_printable, check_template


def one_block(text: str) -> str:
    """The text of one block; ValueError where it is none."""
    if "\n" in text:
        raise ValueError("has a line end: give one block")
    return check_printable(text)


Block = Annotated[str, Field(max_length=200), AfterValidator(one_block)]


def _numbering(text: str) -> str:
    check_template(text, {"number": 1, "text": "M5"})
    if not -1 < text.find("{number") < text.find("{text") or "\n" in text:
        raise ValueError(f"{text!r}: give one line with the fields {{number}} and then {{text}}")
    return text


class NumberingTable(Record):
    """The numbers of blocks: the first, the step to the next, the highest, behind which they begin again; and how
    the lines begin that have none."""

    format: Annotated[str, Field(max_length=50), AfterValidator(_numbering)] | None = None
    first: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    step: Annotated[int, Field(ge=1, le=1000)] = 1
    highest: Annotated[int, Field(ge=1, le=999_999_999)] = 999_999_999
    unnumbered: Annotated[list[Annotated[str, Field(min_length=1, max_length=8)]], Field(max_length=20)] = Field(
        default_factory=list
    )
    continuation: Annotated[str, Field(min_length=1, max_length=8), AfterValidator(one_block)] | None = None

    @model_validator(mode="after")
    def _has_room(self) -> "NumberingTable":
        if self.highest <= self.first:
            raise KeyFault("highest", f"{self.highest}: give more than first ({self.first})")
        return self


WHOLE = "[0-9]{1,9}"
"""The pattern of a whole number; it fits 32 bits."""


def has_number(line: str, numbering: NumberingTable) -> bool:
    """Whether a line (without its number) is one that gets a number, where it does not continue another."""
    return numbering.format is not None and not line.startswith(tuple(numbering.unnumbered))


def block_numbers(numbering: NumberingTable, ordinals: Int[ndarray, "*n"]) -> Int[ndarray, "*n"]:
    """The numbers of numbered blocks, by how many there are before them."""
    count = (numbering.highest - numbering.first) // numbering.step + 1
    return np.asarray(numbering.first + numbering.step * (ordinals % count))


def block_number(numbering: NumberingTable, ordinal: int) -> int:
    """The number of one numbered block, by how many there are before it."""
    return int(block_numbers(numbering, np.array(ordinal)))


def numbered_pattern(numbering: NumberingTable, text: str) -> str:
    """The regular expression of a numbered line whose text matches the expression `text`; its first group is the
    number, empty where blocks have none."""
    if numbering.format is None:
        return "()" + text
    parts = string.Formatter().parse(numbering.format)
    inner = {"number": f"({WHOLE})", "text": text, None: ""}
    return "".join(re.escape(literal) + inner[name] for literal, name, _, _ in parts)
