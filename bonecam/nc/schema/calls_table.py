"""The schema of a dialect's table [calls]: how one program calls another, and how such a program begins and ends."""

import re
import string
from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from bonecam.nc.schema.numbering import Block, one_block
from bonecam.text.record import KeyFault, Record
from bonecam.text.template import check_template

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
    needs: Annotated[list[Block], Field(max_length=20)] = Field(default_factory=list)

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
