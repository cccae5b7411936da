"""The schema of a dialect file: keys, types, ranges, and what templates may hold. The text of `nc.dialect` says what
they mean."""

from functools import partial
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from bonecam.machine.machine_file import Name
from bonecam.machine.tables import merged
from bonecam.nc.schema.calls_table import CallsTable
from bonecam.nc.schema.grammar_tables import CODES, CodesTable, StatedTable, StatementTable
from bonecam.nc.schema.number_format import NumberFormat, NumbersTable
from bonecam.nc.schema.numbering import Block, NumberingTable, one_block
from bonecam.nc.schema.template_tables import TemplatesTable
from bonecam.text.faults import Faults
from bonecam.text.pattern import Pattern
from bonecam.text.record import KeyFault, Record, checked
from bonecam.text.template import check_template

PLAIN_WORD = "{letter}{number}"
"""The form of a word that has no other."""


SWITCHED: dict[str, str | int] = {"tool": 1, "height": "100.0"}
"""Samples of what the blocks that switch tool-centre control on may have."""
Form = Literal["angles", "vectors", "joints"]
"""The words of the axes that a job may ask for."""
SwitchOn = Annotated[str, Field(max_length=400), AfterValidator(partial(check_template, fields=SWITCHED))]
SwitchOff = Annotated[str, Field(max_length=400), AfterValidator(partial(check_template, fields={}))]
Lines = Annotated[list[Block], Field(max_length=20)]


class SwitchTable(Record):
    """The blocks that switch a function of the control on and off."""

    on: Block
    off: Block


class ToolCentreTable(Record):
    """The blocks that switch tool-centre control on and off, and what the header says of the point that it keeps:
    where the machine programs the tip, and where it programs the ball's centre."""

    on: SwitchOn
    off: SwitchOff
    tip: Lines = Field(default_factory=list)
    centre: Lines = Field(default_factory=list)


def _vector_word(text: str) -> str:
    check_template(text, {"number": "1.0"})
    if text.count("{number}") != 1 or not text.endswith("{number}") or len(text.split()) != 1 or text[0] == "{":
        raise ValueError(f"{text!r}: give letters and then {{number}}, in one word")
    return text


class VectorTable(Record):
    """The three words of the tool's direction, and the numbers of its components; whether the control `takes_angles` in
    blocks between those with vectors, and how such blocks begin `instead`."""

    words: Annotated[list[Annotated[str, AfterValidator(_vector_word)]], Field(min_length=3, max_length=3)]
    number: NumberFormat
    takes_angles: bool = False
    instead: Annotated[dict[str, Block], Field(max_length=5)] = Field(default_factory=dict)


class MachiningTable(Record):
    """The words of the control for the two kinds of levels."""

    roughing: Block = ""
    finishing: Block = ""


def _endless_word(text: str) -> str:
    check_template(text, {"letter": "C", "number": "1.0"})
    positions = [text.find("{letter}"), text.find("{number}")]
    once = all(text.count(field) == 1 for field in ("{letter}", "{number}"))
    if not once or positions != sorted(positions) or text.count("{") != 2 or " " in text or "\n" in text:
        raise ValueError(f"{text!r}: give {{letter}} and then {{number}}, each once, in one word")
    return text


OFFSET = {"number": 1, "code": 54}
"""Samples of what the forms of a work offset may have."""


def _comment(text: str) -> str:
    check_template(text, {"text": "X"})
    if text.count("{text}") != 1 or "\n" in text:
        raise ValueError(f"{text!r}: give one line with the field {{text}}")
    return text


def _regular(text: str) -> str:
    Pattern(text)
    return text


class FileNameTable(Record):
    """Names of programs that the control takes, without their endings: the `longest`, and a regular expression that
    all of them match."""

    longest: Annotated[int, Field(ge=8, le=255)] = 255
    pattern: Annotated[str, Field(max_length=100), AfterValidator(_regular)] = ".+"


class DialectFile(Record):
    """A dialect file."""

    title: Name
    extension: Annotated[str, Field(pattern=r"^\.[A-Za-z0-9]{1,8}$")]
    grammar: Literal["klartext", "iso"]
    interpolation: Literal["tool-centre", "joints"]
    feed_mode: Literal["per-minute", "inverse-time"]
    endless_words: Literal["wrapped", "wound"]
    short_way: SwitchTable | None = None
    endless_word: Annotated[str, Field(max_length=40), AfterValidator(_endless_word)] = PLAIN_WORD
    endless_from_deg: Annotated[float, Field(ge=-360, le=0)] = -180.0
    frame: Block = "%"
    moving_blocks: Lines = Field(default_factory=lambda: ["L ", "G0 "])
    machining: MachiningTable = MachiningTable()
    decimal_point: bool = False
    straight_rapids: bool = False
    starts_at_zero: bool = False
    tolerance_factor: Annotated[float, Field(gt=0, le=10)] = 1.0
    corners: Literal["smoothed", "parabolic"] = "smoothed"
    look_ahead: Annotated[int, Field(ge=1, le=1_000_000)] = 1000
    needs: Lines = Field(default_factory=list)
    file_name: FileNameTable = FileNameTable()
    longest_line: Annotated[int, Field(ge=60, le=10000)] = 1000
    comment: Annotated[str, Field(max_length=100), AfterValidator(_comment)]
    comment_characters: Annotated[str, Field(max_length=1000), AfterValidator(one_block)]
    work_offset: Annotated[
        dict[str, Annotated[str, AfterValidator(partial(check_template, fields=OFFSET))]], Field(max_length=10)
    ] = Field(default_factory=dict)
    work_offsets: Annotated[int, Field(ge=1, le=999)] = 1
    coolants: Annotated[dict[Literal["mist", "air", "through"], Block], Field(max_length=3)] = Field(
        default_factory=dict
    )
    numbers: NumbersTable
    numbering: NumberingTable = NumberingTable()
    tool_centre_control: Annotated[dict[str, ToolCentreTable], Field(max_length=50)] = Field(default_factory=dict)
    calls: CallsTable | None = None
    vector: VectorTable | None = None
    forms: Annotated[dict[Form, dict[str, Any]], Field(max_length=3)] = Field(default_factory=dict)
    templates: TemplatesTable
    statements: Annotated[list[StatementTable], Field(max_length=200)] = Field(default_factory=list)
    codes: CodesTable = CodesTable()
    stated: StatedTable = StatedTable()

    @model_validator(mode="after")
    def _can_switch(self) -> "DialectFile":
        if self.interpolation == "tool-centre" and not self.tool_centre_control:
            why = "a tool-centre dialect needs at least one table with on and off: add it"
            raise KeyFault("tool_centre_control", why)
        if self.grammar == "klartext" and self.endless_words == "wrapped" and self.short_way is None:
            raise KeyFault("short_way", "missing: add the blocks that switch the short way on and off")
        if self.templates.feed_kept and self.feed_mode == "inverse-time":
            why = "in inverse time every block has its own feed: leave it out"
            raise KeyFault("templates.feed_kept", why)
        chooses = self.short_way is not None or self.endless_word != PLAIN_WORD
        if self.starts_at_zero and (self.interpolation != "tool-centre" or self.endless_words != "wrapped" or chooses):
            why = "true: only with tool-centre control and words that are always wrapped: leave it out"
            raise KeyFault("starts_at_zero", why)
        return self

    def formed(self, form: Form) -> "DialectFile":
        """The file with what one of its forms changes; KeyFault where that is no dialect."""
        values = self.model_dump(exclude={"forms", "name"}, exclude_unset=True)
        try:
            return checked(DialectFile, merged(values, self.forms[form]))
        except Faults as error:
            raise KeyFault(f"forms.{form}.{error.found[0][0]}", error.found[0][1]) from error

    @model_validator(mode="after")
    def _have_forms(self) -> "DialectFile":
        for form in self.forms:
            self.formed(form)
        return self

    @model_validator(mode="after")
    def _turns_by_vectors(self) -> "DialectFile":
        by_vectors = "G43.5" in self.codes.tool_centre_on
        if self.vector and self.interpolation != "tool-centre":
            raise KeyFault("vector", "only a tool-centre dialect takes vectors: leave it out")
        if by_vectors and not self.vector:
            raise KeyFault("codes.tool_centre_on", "G43.5 takes vectors: add a table [vector]")
        return self

    @model_validator(mode="after")
    def _can_state(self) -> "DialectFile":
        known = {item.states for item in self.statements}
        known.update(code for effect in CODES for code in getattr(self.codes, effect))
        for key in ("moves", "tool_centre"):
            for name in getattr(self.stated, key):
                if name not in known:
                    why = f"{name!r} is no code and no statement states it: add it to [codes] or a statement"
                    raise KeyFault(f"stated.{key}", why)
        return self
