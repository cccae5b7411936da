"""The schemas of machine and dialect files, told once.

What codes of ISO 6983 and of the makers mean wherever they are known: a dialect's file can give them no other
effect, least of all none, and a text that has one unknown to its dialect is told what it is.

Only codes that change where or how an axis, the spindle or the coolant runs are here. Sources: ISO 6983-1:2009; the
manuals named in the dialects' files.

The numbers of NC words: fixed decimals, no exponent, no negative zero.

The numbers of blocks: their table in a dialect file, which lines have one, which it is, and how a line with its
number looks.

The schema of a dialect's templates: their names, and the fields that each may have.

The schema of a dialect's table [calls]: how one program calls another, and how such a program begins and ends.

The schema of a dialect's table [probe]: the program that finds the clamped bar.

The schema of a dialect's grammar: the statements and the codes that the reader knows, and what they do.

The schema of a dialect file: keys, types, ranges, and what templates may hold. The text of `nc.dialect` says what
they mean.
"""

import math
import re
import string
from collections.abc import Mapping
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple, get_args

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import AfterValidator, Field, model_validator

from bonecam.errors import ProgramError
from bonecam.machine.machine_file import Name, merged
from bonecam.text.numbers import Faults, check_printable, check_template
from bonecam.text.pattern import Pattern
from bonecam.text.record import KeyFault, Record, checked


def no_items() -> Any:
    """The default of a field that is a list: an empty one, which schemas leave out."""
    return Field(default_factory=list)


class Meaning(NamedTuple):
    """What a code does, in words, and its effect in [codes]; no such effect where no reader knows it."""

    text: str
    effect: str


_ROWS = (
    ("inches", "", "G20 G70 G700 INCH"),
    ("increments", "incremental", "G91"),
    ("another plane", "", "G18 G19"),
    ("a rapid", "rapid", "G0"),
    ("a feed move", "feed", "G1"),
    ("an arc", "", "G2 G3 CIP"),
    ("a change of offsets", "", "G10"),
    ("polar coordinates", "", "G16 G111"),
    ("a reference return", "reference_return", "G28"),
    ("a second reference return", "", "G30"),
    ("a compensation of the radius", "", "G41 G42 G41.1 G42.1 G41.2 G42.2"),
    ("the length of a tool", "tool_length", "G43"),
    ("a negative length of a tool", "", "G44"),
    ("tool-centre control", "tool_centre_on", "G43.4 TRAORI"),
    ("tool-centre control by vectors", "tool_centre_on", "G43.5"),
    ("a scale", "", "G51 SCALE ASCALE"),
    ("a mirror image", "", "G51.1 MIRROR AMIRROR"),
    ("a shift of the zero", "", "G52 G92 ATRANS"),
    ("machine coordinates", "machine_coordinates", "G53 G153 SUPA"),
    ("a rotation", "", "G68 ROT AROT"),
    ("a tilted plane", "", "G68.2 G53.1 TCARR TOROT PAROT"),
    ("a cycle", "", "G73 G74 G76 G81 G82 G83 G84 G85 G86 G87 G88 G89"),
    ("inverse time", "inverse_time", "G93"),
    ("feed per minute", "per_minute", "G94"),
    ("feed per revolution", "", "G95"),
    ("a constant cutting speed", "", "G96"),
    ("the end of the program", "program_end", "M2 M30"),
    ("the spindle's start", "spindle_on", "M3"),
    ("the spindle's start the wrong way round", "", "M4 M14"),
    ("the spindle's stop", "spindle_stop", "M5"),
    ("a tool change", "tool_change", "M6"),
    ("coolant on", "coolant_on", "M7 M8"),
    ("coolant off", "coolant_off", "M9"),
    ("the start of spindle and coolant", "", "M13"),
    ("a subprogram", "", "M97 M98 M99"),
)
MEANINGS = {code: Meaning(text, effect) for text, effect, codes in _ROWS for code in codes.split()}
"""By code, without leading zeros."""
WHOLE_BLOCKS = MEANINGS | {"BEGIN PGM A INCH": MEANINGS["INCH"]}
"""By whole block: of Klartext too."""


def meaning_of(code: str) -> Meaning | None:
    """What a code means, with or without leading zeros; None where it is not known."""
    return MEANINGS.get(re.sub(r"^([A-Z])0+(?=[0-9])", r"\1", code))


def remark_on(code: str) -> str:
    """A remark on an unknown code, such as " (inches)"; nothing where its meaning is not known."""
    meaning = meaning_of(code)
    return f" ({meaning.text})" if meaning else ""


def blocks_of_pattern(pattern: str) -> list[tuple[str, Meaning]]:
    """What a statement of this `pattern` takes as a whole block, or names, and what that means."""
    compiled = Pattern(pattern)
    named = [word.replace("\\", "") for word in re.findall(r"(?<![A-Z0-9])[A-Z]+[0-9]*(?:\\?\.[0-9])?", pattern)]
    taken = [(block, meaning) for block, meaning in WHOLE_BLOCKS.items() if compiled.match(block) is not None]
    meanings = [(word, meaning_of(word)) for word in named]
    return taken + [(word, meaning) for word, meaning in meanings if meaning is not None]


LARGEST_NUMBER = 1e9
"""No number of a program is larger."""
Bound = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]


class NumberFormat(Record):
    """How numbers of a kind are written: decimals, whether a plus is written, and the range that the control takes."""

    decimals: Annotated[int, Field(ge=0, le=8)]
    sign: bool
    lowest: Bound = -math.inf
    highest: Bound = math.inf

    @model_validator(mode="after")
    def _has_a_range(self) -> "NumberFormat":
        if self.lowest >= self.highest:
            raise KeyFault("lowest", f"{self.lowest:g}: give less than highest ({self.highest:g})")
        return self

    @property
    def step(self) -> float:
        """The value of one unit in the last decimal."""
        return 10.0**-self.decimals

    @property
    def spec(self) -> str:
        """The printf format of a number that is already rounded."""
        return f"%{'+' if self.sign else ''}.{self.decimals}f"

    def steps(self, values: Float[ndarray, "*n"]) -> Int[ndarray, "*n"]:
        """Values in units of the last decimal; ProgramError where one is not finite."""
        if not np.isfinite(values).all():
            raise ProgramError(
                f"word {int(np.argmin(np.isfinite(values)))} is not a finite number: the path before it is wrong"
            )
        return np.rint(np.asarray(values) * 10.0**self.decimals).astype(np.int64)

    def rounded(self, values: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
        """The values as the control will read them."""
        return np.asarray(self.steps(values) / 10.0**self.decimals)

    def rounded_down(self, values: Float[ndarray, "*n"]) -> Float[ndarray, "*n"]:
        """The largest numbers of this kind that are no larger than the values, within the control's range: a feed that
        is rounded up may be beyond what an axis can."""
        whole = np.floor(np.asarray(values) / self.step + 1e-6) * self.step
        return self.rounded(np.clip(whole, self.lowest, self.highest))

    def check(self, values: Float[ndarray, "*n"]) -> None:
        """ProgramError where a value leaves the control's range."""
        outside = ~((values >= self.lowest) & (values <= self.highest))
        if outside.any():
            value = float(values[outside].flat[0])
            raise ProgramError(
                f"{value:g} leaves the control's range {self.lowest:g} .. {self.highest:g}: change the job", value=value
            )

    def text(self, value: float) -> str:
        """One number; ProgramError outside the control's range."""
        self.check(np.array([value], dtype=np.float64))
        # whole steps divided have no negative zero
        return self.spec % float(self.rounded(np.array([value], dtype=np.float64))[0])


class NumbersTable(Record):
    """The kinds of numbers: lengths (mm), angles (deg), feeds and spindle speeds."""

    length: NumberFormat
    angle: NumberFormat
    feed: NumberFormat
    spindle: NumberFormat


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
    unnumbered: Annotated[list[Annotated[str, Field(min_length=1, max_length=8)]], Field(max_length=20)] = no_items()
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


_CORNERS = dict.fromkeys("low_x low_y low_z high_x high_y high_z".split(), "+1.0")
FIELDS: Mapping[str, Mapping[str, str | int]] = {
    "header": {
        "name": "BONE",
        "number": 1001,
        "comments": "; X",
        "tolerance": "0.01",
        "rotary_tolerance": "0.1",
        "tool_centre_off": "M129",
        **_CORNERS,
    },
    "tool": {"tool": 1, "spindle": "1", "retract": "1.0", "endless": "M126", "over_zero": "X+0.0 Y+0.0", "stop": "M0"},
    "stop": {"tool": 1},
    "restart": {"title": "LEVEL 1", "tool": 1, "tool_centre_off": "M129"},
    "level": {"tolerance": "0.01", "rotary_tolerance": "0.1", "hsc_mode": 1, "machining": "FINISH"},
    "position": {"rotary": "B+1.0 C+1.0"},
    "approach": {"linear": "X+1.0 Y+1.0 Z+1.0", "plane": "X+1.0 Y+1.0", "above": "X+1.0 Y+1.0 Z+9.0", "rapid": "1"},
    "rapid": {"words": "X+1.0"},
    "feed": {"words": "X+1.0", "feed": "1"},
    "feed_kept": {"words": "X+1.0"},
    "coolant_on": {},
    "coolant_off": {},
    "lift": {"lifted": "X+1.0 Y+1.0 Z+9.0", "rapid": "1"},
    "retract": {"retract": "1.0"},
    "tool_end": {},
    "optional_stop": {},
    "park": {"linear": "X+1.0 Y+1.0"},
    "home": {},
    "footer": {"name": "BONE"},
}
"""The templates, and a sample of each field that they may have. The first letters of a move's words are those of a
machine, its numbers are filled in later: `words` and `feed` have no format."""


class TemplatesTable(Record):
    """The templates of the blocks: with their own fields only."""

    header: str
    tool: str
    stop: str = ""
    restart: str = ""
    level: str
    position: str
    approach: str
    rapid: str
    feed: str
    feed_kept: str = ""
    coolant_on: str
    coolant_off: str
    lift: str = ""
    retract: str
    tool_end: str
    optional_stop: str = ""
    park: str = ""
    home: str = ""
    footer: str

    @model_validator(mode="after")
    def _have_known_fields(self) -> "TemplatesTable":
        for name, fields in FIELDS.items():
            text = getattr(self, name)
            try:
                check_template(text, fields)
                if name in ("rapid", "feed") or (name == "feed_kept" and text):
                    # ValueError where the numbers of a move could not be filled in one after the other
                    wanted = ["{words}", "{feed}"] if name == "feed" else ["{words}"]
                    positions = [text.find(field) for field in wanted]
                    once = all(text.count(field) == 1 for field in wanted)
                    if not once or positions != sorted(positions) or text.count("{") != len(wanted):
                        raise ValueError(f"give {' and then '.join(wanted)}, each once and without a format")
            except ValueError as error:
                raise KeyFault(name, str(error)) from error
        return self


PROBE_FIELDS: dict[str, str | int] = {
    "name": "BONE_PROBE",
    "number": 1001,
    "comments": "; X",
    "tool_centre_off": "M129",
    "endless": "M126",
    "rotary": "B+0.0 C+0.0",
    "tool": 99,
    "stop": "M0",
    "row": 1,
    "datum": "X0.0 Y0.0 Z1.0",
    **dict.fromkeys("x y end near search upper lower clear upper_drop lower_drop retract".split(), "+1.0"),
    **dict.fromkeys("diameter radius side start beyond off lean room".split(), "1.0"),
}
"""The fields that a probing program may have, and a sample of each."""


class ProbeTable(Record):
    """The probing `program`, whole, and what the control `needs` for it; empty where it has no words for one."""

    program: Annotated[str, Field(max_length=10000), AfterValidator(partial(check_template, fields=PROBE_FIELDS))] = ""
    needs: Annotated[list[Block], Field(max_length=20)] = no_items()


SAMPLES: dict[str, str | int] = {"name": "BONE_1", "lower": "bone_1", "number": 1002, "file": "BONE_1.h"}
"""What a called program is told by, with samples: its name, the same in small letters, its number, its file."""
FORMS = {"name": "[A-Z0-9_]+", "lower": "[a-z0-9_]+", "number": "[0-9]+", "file": r"[A-Za-z0-9_]+\.[A-Za-z0-9]+"}
"""The patterns of these."""


def _of_part(text: str) -> str:
    return check_template(text, SAMPLES)


def _call(text: str) -> str:
    return _of_part(one_block(text))


def _file(text: str) -> str:
    check_template(one_block(text), {name: value for name, value in SAMPLES.items() if name != "file"})
    if not re.fullmatch(FORMS["file"], text.format(**SAMPLES)) or not fields_of(text):
        raise ValueError(f"{text!r}: give a name with a field and an ending, like {{name}}.h, without a folder")
    return text


class CallsTable(Record):
    """The name of the `file` of a called program, the block that calls it, the blocks that it begins and ends with,
    and what the control `needs` for it, as lines of the header."""

    file: Annotated[str, Field(max_length=60), AfterValidator(_file)]
    call: Annotated[str, Field(max_length=200), AfterValidator(_call)]
    begin: Annotated[str, Field(max_length=400), AfterValidator(_of_part)] = ""
    end: Annotated[str, Field(max_length=400), AfterValidator(_of_part)] = ""
    needs: Annotated[list[Block], Field(max_length=20)] = no_items()

    @model_validator(mode="after")
    def _leads_to_the_file(self) -> "CallsTable":
        known = fields_of(self.call)
        if "file" in known:
            known |= fields_of(self.file)
        for key in ("file", "begin", "end"):
            missing = fields_of(getattr(self, key)) - known
            if missing:
                raise KeyFault(key, f"{{{min(missing)}}} cannot be told from call: give call this field, or {{file}}")
        return self

    def wrapping(self, fields: dict[str, str | int]) -> tuple[list[str], list[str]]:
        """The lines that a called program begins and ends with, by what it is called by."""
        begin, end = (text.format(**fields).split("\n") for text in (self.begin, self.end))
        return [line for line in begin if line], [line for line in end if line]

    def called_by(self, block: str) -> dict[str, str | int] | None:
        """What a block calls, by field, its `file` too; None where it calls nothing."""
        match = re.fullmatch(_pattern(self.call), block)
        if match is None:
            return None
        fields = _values(match)
        if "file" in fields:
            of_file = re.fullmatch(_pattern(self.file), str(fields["file"]))
            fields = {**fields, **(_values(of_file) if of_file else {})}
        return {**fields, "file": fields.get("file") or self.file.format(**fields)}


def fields_of(text: str) -> set[str]:
    """The fields of a template."""
    return {name for _, name, _, _ in string.Formatter().parse(text) if name}


def _pattern(template: str) -> str:
    """The regular expression of a template whose fields are its groups."""
    parts = string.Formatter().parse(template)
    pattern = ""
    seen = set[str]()
    for literal, name, _, _ in parts:
        pattern += re.escape(literal)
        if name:
            pattern += f"(?P={name})" if name in seen else f"(?P<{name}>{FORMS[name]})"
            seen.add(name)
    return pattern


def _values(match: re.Match[str]) -> dict[str, str | int]:
    return {name: int(text) if name == "number" else text for name, text in match.groupdict().items()}


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

    none: Codes = no_items()
    rapid: Codes = no_items()
    feed: Codes = no_items()
    inverse_time: Codes = no_items()
    per_minute: Codes = no_items()
    tool_change: Codes = no_items()
    tool_length: Codes = no_items()
    tool_length_off: Codes = no_items()
    tool_centre_on: Codes = no_items()
    tool_centre_off: Codes = no_items()
    machine_coordinates: Codes = no_items()
    absolute: Codes = no_items()
    incremental: Codes = no_items()
    reference_return: Codes = no_items()
    spindle_on: Codes = no_items()
    spindle_stop: Codes = no_items()
    coolant_on: Codes = no_items()
    coolant_off: Codes = no_items()
    tolerance: Codes = no_items()
    program_end: Codes = no_items()

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

    moves: Names = no_items()
    tool_centre: Names = no_items()


CODES = tuple(CodesTable.model_fields)
"""What a code of an ISO dialect may do."""


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
    tip: Lines = no_items()
    centre: Lines = no_items()


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
    needs: Lines = no_items()
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
    probe: ProbeTable = ProbeTable()
    statements: Annotated[list[StatementTable], Field(max_length=200)] = no_items()
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
