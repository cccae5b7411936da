"""The schema of a dialect's templates: their names, and the fields that each may have."""

from collections.abc import Mapping

from pydantic import model_validator

from bonecam.text.record import KeyFault, Record
from bonecam.text.template import check_template

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
