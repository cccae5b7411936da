"""The schema of a dialect's grammar: the statements and the codes that the reader knows, and what they do."""

from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from bonecam.nc.schema.code_meanings import blocks_of_pattern, meaning_of
from bonecam.text.pattern import Pattern
from bonecam.text.record import KeyFault, Record

CODE = r"^([A-Z][0-9]{1,4}(\.[0-9])?|[A-Z]{3,12})$"
"""A code: a letter and its number, or a word."""
Effect = Literal[
    "none", "begin", "end", "comment", "tool", "retract", "tool-centre on", "tool-centre off",
    "short way on", "short way off", "machine position",
    "spindle on", "spindle stop", "coolant on", "coolant off", "halt", "tolerance", "program end",
]  # fmt: skip
"""What a statement may do; `halt` is a stop of the program that stops spindle and coolant too, `tolerance` gives the
contour's in the group of that name (mm), or without one leaves it to the control."""
GROUPS_OF = {"comment": "comment", "tool": "tool", "machine position": "x y"}
"""The named groups that the pattern of an effect must have: the text, the number of the tool, or X and Y (mm)."""


class StatementTable(Record):
    """A statement: what the whole block looks like, what it does, and the name of the mode that it `states`, if any."""

    pattern: str
    effect: Effect
    states: Annotated[str, Field(max_length=60)] = ""

    @model_validator(mode="after")
    def _can_be_matched(self) -> "StatementTable":
        try:
            groups = Pattern(self.pattern).groups
        except ValueError as error:
            raise KeyFault("pattern", str(error)) from error
        for group in GROUPS_OF.get(self.effect, "").split():
            if group not in groups:
                raise KeyFault("pattern", f"has no group {group!r}: name one, like (?P<{group}>...)")
        return self

    @model_validator(mode="after")
    def _is_harmless(self) -> "StatementTable":
        if self.effect in ("none", "begin"):
            for code, meaning in blocks_of_pattern(self.pattern):
                effect = meaning.effect.replace("_", " ")
                remedy = f"give it the effect {effect!r}" if effect in get_args(Effect) else "leave it out"
                raise KeyFault("pattern", f"takes {code}, {meaning.text}, for harmless: {remedy}")
        return self


Codes = Annotated[list[Annotated[str, Field(pattern=CODE)]], Field(max_length=200)]


class CodesTable(Record):
    """What the codes of an ISO dialect do: G, M and D with their numbers, or words like TRAORI."""

    none: Codes = Field(default_factory=list)
    rapid: Codes = Field(default_factory=list)
    feed: Codes = Field(default_factory=list)
    inverse_time: Codes = Field(default_factory=list)
    per_minute: Codes = Field(default_factory=list)
    tool_change: Codes = Field(default_factory=list)
    tool_length: Codes = Field(default_factory=list)
    tool_length_off: Codes = Field(default_factory=list)
    tool_centre_on: Codes = Field(default_factory=list)
    tool_centre_off: Codes = Field(default_factory=list)
    machine_coordinates: Codes = Field(default_factory=list)
    absolute: Codes = Field(default_factory=list)
    incremental: Codes = Field(default_factory=list)
    reference_return: Codes = Field(default_factory=list)
    spindle_on: Codes = Field(default_factory=list)
    spindle_stop: Codes = Field(default_factory=list)
    coolant_on: Codes = Field(default_factory=list)
    coolant_off: Codes = Field(default_factory=list)
    tolerance: Codes = Field(default_factory=list)
    program_end: Codes = Field(default_factory=list)

    @model_validator(mode="after")
    def _do_what_they_mean(self) -> "CodesTable":
        for effect in type(self).model_fields:
            for code in getattr(self, effect):
                meaning = meaning_of(code)
                if meaning is not None and effect != meaning.effect:
                    known = meaning.effect in type(self).model_fields
                    remedy = f"list it in {meaning.effect}" if known else "leave it out, no reader knows it"
                    raise KeyFault(effect, f"{code} is {meaning.text}: {remedy}")
        return self

    @model_validator(mode="after")
    def _do_one_thing(self) -> "CodesTable":
        known: dict[str, str] = {}
        for effect in type(self).model_fields:
            for code in getattr(self, effect):
                if known.setdefault(code, effect) != effect:
                    raise KeyFault(effect, f"{code} is in {known[code]} too: a code does one thing")
        return self


Names = Annotated[list[Annotated[str, Field(min_length=1, max_length=60)]], Field(max_length=50)]


class StatedTable(Record):
    """What a program must have stated: codes, and names of what statements state. `moves`: before an axis moves;
    `tool_centre`: between the start of tool-centre control and the next move of X, Y or Z."""

    moves: Names = Field(default_factory=list)
    tool_centre: Names = Field(default_factory=list)


CODES = tuple(CodesTable.model_fields)
"""What a code of an ISO dialect may do."""
