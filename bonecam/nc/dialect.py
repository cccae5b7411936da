"""A dialect is data: number formats, block templates and the reader's grammar, read from a TOML file.

How to add a dialect: copy a file of `bonecam/nc/dialects/` (name it, or give its path) and fill in
- `grammar`: "klartext" (statements by pattern, moves as `L` blocks) or "iso" (letter and number words);
  `interpolation`: "tool-centre" (the control keeps the tip: X Y Z in the part) or "joints" (machine
  coordinates by our inverse kinematics); `feed_mode`: "per-minute" or "inverse-time"; `endless_words`:
  "wrapped" (-180..180, the control takes the short way) or "wound";
- [numbers]: decimals, sign and range of lengths (mm), angles (deg), feeds and spindle speeds;
- [templates]: header, tool, level, position, approach, rapid, feed, coolant_on, coolant_off, retract,
  tool_end, footer. One line is one block; an empty template writes nothing. Fields: {name} {comments}
  {low_x}..{high_z} {tool} {spindle} {tolerance} (a length) {hsc_mode} {rotary} {linear} {plane} (X and Y)
  {words} (all five) {feed} {retract} (height above everything);
- [tool_centre_control]: on and off blocks by name, the machine file picks one; [numbering]: `format`,
  `first`, `continuation`;
- the reader's grammar: [[statements]] (klartext: `pattern`, `effect`) or [codes] (iso: what each G and M code
  does).
Say in the file which words are proved and which were only read.
"""

import re
import string
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from bonecam.errors import MachineError
from bonecam.nc.machine import Machine
from bonecam.nc.tables import names_in, read_table
from bonecam.nc.words import NumberFormat

FOLDER = Path(__file__).parent / "dialects"
TEMPLATES = tuple(
    "header tool level position approach rapid feed coolant_on coolant_off retract tool_end footer".split()
)
"""The templates that a dialect must have."""
FIELDS = set(
    "name comments low_x low_y low_z high_x high_y high_z tool spindle tolerance hsc_mode rotary linear plane words feed retract".split()
)
EFFECTS = (
    *("none", "begin", "end", "comment", "tool", "retract", "tool-centre on", "tool-centre off"),
    *("short way on", "short way off", "program end"),
)
"""What a statement of a Klartext dialect may do."""
CODES = ("none", "rapid", "feed", "inverse_time", "per_minute", "tool_change", "program_end")
"""What a G or M code of an ISO dialect may do."""
_CHOICES = {
    "grammar": ("klartext", "iso"),
    "interpolation": ("tool-centre", "joints"),
    "feed_mode": ("per-minute", "inverse-time"),
    "endless_words": ("wrapped", "wound"),
}
_TEXTS = ("title", "extension", "comment", "comment_characters")
_KEYS = {*_TEXTS, "numbers", "numbering", "tool_centre_control", "templates"}


@dataclass(frozen=True, eq=False)
class Dialect:
    """The language of a control. The module's text describes the fields; `codes` maps a G or M code to its
    effect."""

    name: str
    title: str
    extension: str
    grammar: str
    interpolation: str
    feed_mode: str
    endless_words: str
    comment: str
    comment_characters: str
    numbers: dict[str, NumberFormat]
    numbering: dict[str, Any]
    tool_centre_control: dict[str, dict[str, str]]
    templates: dict[str, str]
    statements: tuple[tuple[str, str], ...]
    codes: dict[str, str]

    @property
    def tool_centre(self) -> bool:
        """Whether the control moves the linear axes so that the tip stays while rotary axes turn (TCPM,
        RTCP)."""
        return self.interpolation == "tool-centre"

    @cached_property
    def patterns(self) -> tuple[tuple[re.Pattern[str], str], ...]:
        """The reader's statements, compiled, with their effects."""
        return tuple((re.compile(pattern), effect) for pattern, effect in self.statements)

    def lines(self, template: str, **fields: Any) -> list[str]:
        """The blocks of a template with its fields filled in."""
        text = self.templates[template].format(**fields)
        return [line for line in text.split("\n") if line]

    def tool_centre_blocks(self, machine: Machine) -> tuple[list[str], list[str]]:
        """The blocks that switch tool-centre control on and off; MachineError where the machine names none of
        ours."""
        if not self.tool_centre:
            return [], []
        if machine.tool_centre_control not in self.tool_centre_control:
            known = ", ".join(self.tool_centre_control)
            raise MachineError(
                f"{machine.name}: tool_centre_control {machine.tool_centre_control!r} is none of {self.name}'s: use one of {known}",
                machine=machine.name,
                dialect=self.name,
            )
        chosen = self.tool_centre_control[machine.tool_centre_control]
        return [chosen["on"]], [chosen["off"]]


def dialect_names() -> tuple[str, ...]:
    """The dialects that come with bonecam."""
    return names_in(FOLDER)


def read_dialect(name: str | Path) -> Dialect:
    """The dialect of a name, or of a path to a TOML file; MachineError names file and key."""
    path, values = read_table("controller", name, FOLDER)
    return _dialect(path, values)


def _wrong(path: Path, key: str, why: str) -> MachineError:
    return MachineError(f"{path}: {key}: {why}", file=str(path), key=key)


def _dialect(path: Path, values: dict[str, Any]) -> Dialect:
    for key in values:
        if key not in _KEYS | set(_CHOICES) | {"statements", "codes"}:
            raise _wrong(path, key, "unknown key")
    for key, choices in _CHOICES.items():
        if values.get(key) not in choices:
            raise _wrong(path, key, f"{values.get(key)!r}: choose one of {', '.join(choices)}")
    for key in _TEXTS:
        if not isinstance(values.get(key), str):
            raise _wrong(path, key, "give a text")
    return Dialect(
        name=path.stem,
        title=values["title"],
        extension=values["extension"],
        grammar=values["grammar"],
        interpolation=values["interpolation"],
        feed_mode=values["feed_mode"],
        endless_words=values["endless_words"],
        comment=values["comment"],
        comment_characters=values["comment_characters"],
        numbers=_numbers(path, values.get("numbers")),
        numbering=values.get("numbering", {}),
        tool_centre_control=_switches(path, values),
        templates=_templates(path, values.get("templates")),
        statements=_statements(path, values),
        codes=_codes(path, values),
    )


def _numbers(path: Path, values: Any) -> dict[str, NumberFormat]:
    formats = {}
    for key in ("length", "angle", "feed", "spindle"):
        entry = values.get(key) if isinstance(values, dict) else None
        if (
            not isinstance(entry, dict)
            or not isinstance(entry.get("decimals"), int)
            or not isinstance(entry.get("sign"), bool)
        ):
            raise _wrong(path, f"numbers.{key}", "give decimals and sign")
        unknown = set(entry) - {"decimals", "sign", "lowest", "highest"}
        if unknown:
            raise _wrong(
                path,
                f"numbers.{key}.{sorted(unknown)[0]}",
                "unknown key: use decimals, sign, lowest, highest",
            )
        limits = {name: float(entry[name]) for name in ("lowest", "highest") if name in entry}
        formats[key] = NumberFormat(entry["decimals"], entry["sign"], **limits)
    return formats


def _switches(path: Path, values: dict[str, Any]) -> dict[str, dict[str, str]]:
    switches: dict[str, dict[str, str]] = values.get("tool_centre_control", {})
    if values["interpolation"] == "tool-centre" and not switches:
        raise _wrong(
            path, "tool_centre_control", "a tool-centre dialect needs at least one table with on and off"
        )
    for name, entry in switches.items():
        if set(entry) != {"on", "off"}:
            raise _wrong(path, f"tool_centre_control.{name}", "give on and off")
    return switches


def _templates(path: Path, values: Any) -> dict[str, str]:
    for key in TEMPLATES:
        if not isinstance(values, dict) or not isinstance(values.get(key), str):
            raise _wrong(path, f"templates.{key}", "missing: give a text, empty where nothing is written")
        unknown = {
            field for _, field, _, _ in string.Formatter().parse(values[key]) if field is not None
        } - FIELDS
        if unknown:
            raise _wrong(
                path,
                f"templates.{key}",
                f"field {sorted(unknown)[0]!r} is unknown: use one of {', '.join(sorted(FIELDS))}",
            )
    return dict(values)


def _statements(path: Path, values: dict[str, Any]) -> tuple[tuple[str, str], ...]:
    found = []
    for number, entry in enumerate(values.get("statements", [])):
        if entry.get("effect") not in EFFECTS:
            raise _wrong(
                path,
                f"statements[{number}].effect",
                f"{entry.get('effect')!r}: choose one of {', '.join(EFFECTS)}",
            )
        try:
            re.compile(entry.get("pattern", ""))
        except re.error as error:
            raise _wrong(path, f"statements[{number}].pattern", str(error)) from error
        found.append((entry["pattern"], entry["effect"]))
    return tuple(found)


def _codes(path: Path, values: dict[str, Any]) -> dict[str, str]:
    codes = {}
    for effect, words in values.get("codes", {}).items():
        if effect not in CODES:
            raise _wrong(path, f"codes.{effect}", f"choose one of {', '.join(CODES)}")
        codes.update(dict.fromkeys(words, effect))
    return codes
