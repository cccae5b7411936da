"""What codes of ISO 6983 and of the makers mean wherever they are known: a dialect's file can give them no other
effect, least of all none, and a text that has one unknown to its dialect is told what it is.

Only codes that change where or how an axis, the spindle or the coolant runs are here. Sources: ISO 6983-1:2009; the
manuals named in the dialects' files.
"""

import re
from typing import NamedTuple

from bonecam.text.pattern import Pattern


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
