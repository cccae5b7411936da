"""The section [nc] of a job."""

from dataclasses import dataclass

from bonecam.job.parameter import JobSection, millimetres, parameter
from bonecam.job.tool_list import ENDINGS

FARTHEST = 1e5
"""No park position is farther from the machine's zero, mm."""
LINK_FEED = 10000.0
"""Feed (mm/min) of links between passes and of retracts, straight moves in air: that of rapid moves where a control
needs a number for them."""
HOME = "home"
"""The park position that is the reference point of X and Y."""


def park_position(text: str) -> tuple[float, float] | None:
    """X and Y (mm) of a park position, None of an empty text and of HOME; ValueError where it is none."""
    if text.strip() in ("", HOME):
        return None
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError("give X and Y of the machine, like '0, 450', or home") from None
    if not (abs(x) <= FARTHEST and abs(y) <= FARTHEST):
        raise ValueError(f"give X and Y within {FARTHEST:g} mm")
    return x, y


@dataclass(frozen=True)
class NcJob(JobSection):
    """Machine, controller, and the feeds between the cuts."""

    machine: str = parameter("mikron-ucp600", "Machine", "Name of a machine, or path of its .toml file.", file=".toml")
    controller: str = parameter(
        "",
        "Controller",
        "Name of a dialect, or path of its .toml file; empty: the usual one, which the machine's file names, "
        "heidenhain where it names none.",
        file=".toml",
    )
    tools: str = parameter(
        "",
        "Tools",
        "List of the cutters that there are: its name, or the path of a file of Fusion (.json, .tools), FreeCAD "
        "(.fctl, .fctb), LinuxCNC (.tbl), a table (.csv) or a .toml file; empty: the catalogue.",
        file=ENDINGS,
    )
    plunge_feed: float = parameter(
        300.0, "Plunge feed", "Feed of the approach to the part.", 1.0, 30000.0, unit="mm/min"
    )
    rapid_feed: float = parameter(
        10000.0,
        "Rapid rate",
        "Speed of rapid moves where the controller needs a number; others are as fast as the axes.",
        1.0,
        100000.0,
        unit="mm/min",
    )
    axes: str = parameter(
        "controller",
        "Axes",
        "Words of the tool's direction: as the controller's file has them, rotary angles under tool-centre control, "
        "vectors, or joints in inverse time without it.",
        choices=("controller", "angles", "vectors", "joints"),
    )
    endless_words: str = parameter(
        "controller",
        "Endless words",
        "Words of endless axes: wrapped to -180..180, wound up over many turns, or as the controller's file says.",
        choices=("controller", "wrapped", "wound"),
    )
    tool_change: str = parameter(
        "changer",
        "Tool change",
        "changer: the machine puts the tools in; stop: the program halts (M0) at each tool call, for a change by hand.",
        choices=("changer", "stop"),
    )
    coolant: bool = parameter(True, "Coolant", "Switch the coolant on while cutting.")
    coolant_kind: str = parameter(
        "flood",
        "Coolant kind",
        "Which coolant is switched on; the controller's file has the words of each.",
        choices=("flood", "mist", "air", "through"),
    )
    work_offset: int = parameter(
        1, "Work offset", "Number of the datum of this setup: 1 is G54, or row 1 of the preset table.", 1, 99
    )
    program_number: int = parameter(
        0,
        "Program number",
        "Number of the program where a control calls it by one; 0: drawn from the program's name.",
        0,
        7999,
    )
    block_numbers: bool = parameter(
        True, "Block numbers", "Number the blocks, where the controller's file numbers them."
    )
    decimals: int = parameter(0, "Decimals", "Decimals of lengths and angles; 0: those of the controller's file.", 0, 6)
    split: str = parameter(
        "none",
        "Split",
        "Files of the program: one, or a caller and a numbered file of each level, or of each tool.",
        choices=("none", "level", "tool"),
    )
    split_blocks: int = parameter(
        0,
        "Blocks a file",
        "Most blocks of a numbered file, which has whole levels; 0: as many as there are.",
        0,
        10_000_000,
    )
    optional_stop: str = parameter(
        "none",
        "Optional stop",
        "Where the program has an optional stop (M1), the spindle standing: nowhere, before each level, or before "
        "each tool but the first.",
        choices=("none", "level", "tool"),
    )
    table_level: bool = parameter(False, "Table level", "Turn the rotary axes to zero at the end, above everything.")
    park: str = parameter(
        "",
        "Park position",
        "X and Y of the spindle nose at the end in machine coordinates (mm), like '0, 450', home: their reference "
        "point; empty: it stays.",
        form=park_position,
    )
    part_zero: str = parameter(
        "bar",
        "Part zero",
        "The program's zero on the axis of the bar: on its end as it is clamped, where a probe reaches (of a second "
        "clamping the rim of the shell), or on the table under it. Paths alone, without a blank, have it on the table.",
        choices=("bar", "table"),
    )
    probe: bool = parameter(
        False,
        "Probing program",
        "Write beside the program another (bone_probe.h) that finds axis and end of the clamped bar with a touch probe "
        "and writes the datum.",
    )
    probe_tool: int = parameter(99, "Probe tool", "Number of the touch probe in the tool table.", 1, 99)
    probe_radius: float = millimetres(3.0, "Probe radius", "Radius of the ball of the touch probe.", 0.25, 10.0)
    probe_length: float = millimetres(
        50.0, "Probe length", "Length of the stylus, from the middle of its ball to the body of the probe.", 5.0, 500.0
    )

    @property
    def is_split(self) -> bool:
        """Whether the program is wanted in more than one file."""
        return self.split != "none" or self.split_blocks > 0

    @property
    def one_piece(self) -> bool:
        """Whether the program is one file without a stop at each level."""
        return not self.is_split and self.optional_stop != "level"
