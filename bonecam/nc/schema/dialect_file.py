"""The schema of a dialect file: keys, types, ranges, and what templates may hold. The text of `nc.dialect` says what
they mean."""

from collections.abc import Mapping
from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, Field, model_validator

from bonecam.nc.schema.machine_file import Name
from bonecam.text.pattern import Pattern
from bonecam.text.record import KeyFault, Record
from bonecam.text.template import check_printable, check_template

LARGEST_NUMBER = 1e9
"""No number of a program is larger."""
_CORNERS = dict.fromkeys("low_x low_y low_z high_x high_y high_z".split(), "+1.0")
FIELDS: Mapping[str, Mapping[str, str | int]] = {
    "header": {
        "name": "BONE",
        "comments": "; X",
        "tolerance": "0.01",
        "rotary_tolerance": "0.1",
        "tool_centre_off": "M129",
        **_CORNERS,
    },
    "tool": {
        "tool": 1,
        "spindle": "1",
        "retract": "1.0",
        "endless": "M126",
        "over_zero": "X+0.0 Y+0.0",
        "stop": "M0",
    },
    "stop": {"tool": 1},
    "level": {"tolerance": "0.01", "rotary_tolerance": "0.1", "hsc_mode": 1},
    "position": {"rotary": "B+1.0 C+1.0"},
    "approach": {"linear": "X+1.0 Y+1.0 Z+1.0", "plane": "X+1.0 Y+1.0", "above": "X+1.0 Y+1.0 Z+9.0"},
    "rapid": {"words": "X+1.0"},
    "feed": {"words": "X+1.0", "feed": "1"},
    "coolant_on": {},
    "coolant_off": {},
    "retract": {"retract": "1.0"},
    "tool_end": {},
    "footer": {"name": "BONE"},
}
"""The templates, and a sample of each field that they may have. The first letters of a move's words are those of a
machine, its numbers are filled in later: `words` and `feed` have no format."""
Effect = Literal[
    "none", "begin", "end", "comment", "tool", "retract", "tool-centre on", "tool-centre off",
    "short way on", "short way off", "program end",
]  # fmt: skip
"""What a statement of a Klartext dialect may do."""
GROUP_OF = {"comment": "comment", "tool": "tool"}
"""The named group that the pattern of an effect must have: the text, or the number of the tool."""


class NumberTable(Record):
    """How numbers of a kind are written, and the range that the control takes."""

    decimals: Annotated[int, Field(ge=0, le=8)]
    sign: bool
    lowest: Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)] | None = None
    highest: Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)] | None = None

    @model_validator(mode="after")
    def _has_a_range(self) -> "NumberTable":
        if self.lowest is not None and self.highest is not None and self.lowest >= self.highest:
            raise KeyFault("lowest", f"{self.lowest:g}: give less than highest ({self.highest:g})")
        return self


class NumbersTable(Record):
    """The kinds of numbers: lengths (mm), angles (deg), feeds and spindle speeds."""

    length: NumberTable
    angle: NumberTable
    feed: NumberTable
    spindle: NumberTable


def _numbering(text: str) -> str:
    check_template(text, {"number": 1, "text": "M5"})
    if "{number" not in text or "{text" not in text or "\n" in text:
        raise ValueError(f"{text!r}: give one line with the fields {{number}} and {{text}}")
    return text


def _block(text: str) -> str:
    if "\n" in text:
        raise ValueError("has a line end: give one block")
    return check_printable(text)


Block = Annotated[str, Field(max_length=200), AfterValidator(_block)]
Lines = Annotated[list[Block], Field(max_length=20)]


class NumberingTable(Record):
    """The numbers of blocks."""

    format: Annotated[str, Field(max_length=50), AfterValidator(_numbering)] | None = None
    first: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    continuation: Annotated[str, Field(min_length=1, max_length=8), AfterValidator(_block)] | None = None


class SwitchTable(Record):
    """The blocks that switch a function of the control on and off."""

    on: Block
    off: Block


class ToolCentreTable(SwitchTable):
    """The blocks that switch tool-centre control, and what the header says of the point that it keeps: where the
    machine programs the tip, and where it programs the ball's centre."""

    tip: Lines = Field(default_factory=list)
    centre: Lines = Field(default_factory=list)


class TemplatesTable(Record):
    """The templates of the blocks: with their own fields only."""

    header: str
    tool: str
    stop: str = ""
    level: str
    position: str
    approach: str
    rapid: str
    feed: str
    coolant_on: str
    coolant_off: str
    retract: str
    tool_end: str
    footer: str

    @model_validator(mode="after")
    def _have_known_fields(self) -> "TemplatesTable":
        for name, fields in FIELDS.items():
            text = getattr(self, name)
            try:
                check_template(text, fields)
                if name in ("rapid", "feed"):
                    _check_move(text, name)
            except ValueError as error:
                raise KeyFault(name, str(error)) from error
        return self


def _check_move(text: str, name: str) -> None:
    """ValueError where the numbers of a move could not be filled in one after the other."""
    wanted = ["{words}", "{feed}"] if name == "feed" else ["{words}"]
    places = [text.find(field) for field in wanted]
    once = all(text.count(field) == 1 for field in wanted)
    if not once or places != sorted(places) or text.count("{") != len(wanted):
        raise ValueError(f"give {' and then '.join(wanted)}, each once and without a format")


class StatementTable(Record):
    """A statement of Klartext: what it looks like and what it does."""

    pattern: str
    effect: Effect

    @model_validator(mode="after")
    def _can_be_matched(self) -> "StatementTable":
        try:
            groups = Pattern(self.pattern).groups
        except ValueError as error:
            raise KeyFault("pattern", str(error)) from error
        group = GROUP_OF.get(self.effect)
        if group and group not in groups:
            raise KeyFault("pattern", f"has no group {group!r}: name one, like (?P<{group}>...)")
        return self


Codes = Annotated[list[Annotated[str, Field(pattern=r"^[A-Z][0-9]{1,4}(\.[0-9])?$")]], Field(max_length=200)]


class CodesTable(Record):
    """What the G and M codes of an ISO dialect do."""

    none: Codes = Field(default_factory=list)
    rapid: Codes = Field(default_factory=list)
    feed: Codes = Field(default_factory=list)
    inverse_time: Codes = Field(default_factory=list)
    per_minute: Codes = Field(default_factory=list)
    tool_change: Codes = Field(default_factory=list)
    tool_length: Codes = Field(default_factory=list)
    tool_length_off: Codes = Field(default_factory=list)
    program_end: Codes = Field(default_factory=list)


def _comment(text: str) -> str:
    check_template(text, {"text": "X"})
    if text.count("{text}") != 1 or "\n" in text:
        raise ValueError(f"{text!r}: give one line with the field {{text}}")
    return text


class DialectFile(Record):
    """A dialect file."""

    title: Name
    extension: Annotated[str, Field(pattern=r"^\.[A-Za-z0-9]{1,8}$")]
    grammar: Literal["klartext", "iso"]
    interpolation: Literal["tool-centre", "joints"]
    feed_mode: Literal["per-minute", "inverse-time"]
    endless_words: Literal["wrapped", "wound"]
    short_way: SwitchTable | None = None
    straight_rapids: bool = False
    tolerance_factor: Annotated[float, Field(gt=0, le=10)] = 1.0
    needs: Lines = Field(default_factory=list)
    comment: Annotated[str, Field(max_length=100), AfterValidator(_comment)]
    comment_characters: Annotated[str, Field(max_length=1000), AfterValidator(_block)]
    numbers: NumbersTable
    numbering: NumberingTable = NumberingTable()
    tool_centre_control: Annotated[dict[str, ToolCentreTable], Field(max_length=50)] = Field(
        default_factory=dict
    )
    templates: TemplatesTable
    statements: Annotated[list[StatementTable], Field(max_length=200)] = Field(default_factory=list)
    codes: CodesTable = CodesTable()

    @model_validator(mode="after")
    def _can_switch(self) -> "DialectFile":
        if self.interpolation == "tool-centre" and not self.tool_centre_control:
            why = "a tool-centre dialect needs at least one table with on and off: add it"
            raise KeyFault("tool_centre_control", why)
        if self.grammar == "klartext" and self.endless_words == "wrapped" and self.short_way is None:
            raise KeyFault("short_way", "missing: add the blocks that switch the short way on and off")
        return self


TEMPLATES = tuple(FIELDS)
"""The templates that a dialect must have."""
EFFECTS: tuple[str, ...] = get_args(Effect)
"""What a statement of a Klartext dialect may do."""
CODES = tuple(CodesTable.model_fields)
"""What a G or M code of an ISO dialect may do."""
