"""A dialect is data: number formats, block templates and the reader's grammar, read from a TOML file.

How to add a dialect: copy a file of `bonecam/nc/dialects/` (name it, or give its path) and fill in
- `grammar`: "klartext" (statements by pattern, moves as `L` blocks) or "iso" (letter and number words);
  `interpolation`: "tool-centre" (the control keeps the tip: X Y Z in the part) or "joints" (machine
  coordinates by our inverse kinematics); `feed_mode`: "per-minute" or "inverse-time";
- `endless_words`: how endless axes are written where the job does not choose: "wrapped" (-180..180, the control
  takes the short way) or "wound"; `short_way`: the blocks that switch the short way `on` and `off`, where there
  are any, or `endless_word`: the form of a word that takes it, such as "{letter}=DC({number})": with either of them
  the job may choose; `endless_from_deg`: the lowest of the wrapped words (-180 where it is not stated);
- `work_offset`: texts of the file that name the first datum, and their forms with {number} or {code} (53 and the
  number), and `work_offsets`, how many there are; [coolants]: the blocks of `mist`, `air` and `through`, which the
  reader must know too, flood being the template coolant_on;
- `longest_line`: the most characters of a line that the control loads, block number and comment included (1000 where
  it is not stated); [file_name]: the `longest` name of a program, without its ending, and the `pattern` that it matches
  as a whole; what the control would refuse is refused before anything is planned, with a name that it takes;
- `decimal_point`: true where a number of an axis or a feed without its point may mean thousandths: then it is refused;
- `straight_rapids`: true where the control drives rapids on a straight line (all axes arrive together); where it
  is false or not stated, what would be a rapid beside the part is written as a feed move at the rapid rate;
- `starts_at_zero`: true where X, Y, Z are fixed to the table as it stands when tool-centre control is switched on: then
  that is done with all rotary axes at zero, and they turn under it;
- `tolerance_factor`: the control's contour tolerance as a multiple of the path's chord tolerance; for the time,
  `corners`, how the control goes round them: "smoothed" within that tolerance, or "parabolic" as LinuxCNC, and
  `look_ahead`, over how many blocks it plans its speed (1000 where it is not stated); `needs`: what the machine
  must have, as lines of the header, which like those of the tool-centre control may have {count} (of the axes, in
  words), {rotary} (B and C), {zero} (B 0 C 0) and {wound} (the endless axes); `frame` (iso): the first and
  the last line, "%" where it is not stated, "" where the program ends with the code of its end; `moving_blocks`: how
  the blocks begin that move an axis; [machining]: the words of the control for `roughing` and `finishing` levels;
- [numbers]: decimals, sign and range of lengths (mm), angles (deg), feeds and spindle speeds;
- [calls]: how a program in parts is written: the name of the `file` of a part, the block that makes the `call`, the
  blocks that a part has at its `begin` and `end`, with the fields {name} {lower} (in small letters) {number} {file},
  and what the control `needs` for it;
- [probe]: the whole `program` that finds axis and end of the bar with a touch probe (see `nc/probing.py`), and what the
  control `needs` for it; a form without one has an empty program. Fields: those of a header, {tool} (the probe)
  {stop} {endless} {rotary} (all at zero) {row} (number of the datum) {datum} (X Y Z of the zero of the words in
  machine coordinates, where words are joints), and lengths: {x} {y} (of the axis), heights as words: {end} of the bar,
  {near} above and {search} below it, {upper} {lower} (of the ball's centre at the side), {clear} over the end,
  {retract} above everything; {upper_drop} {lower_drop} (from clear, negative); {diameter} of the bar, {radius} of the
  ball, {side} beside the bar, {start} and {beyond} (from the axis, of the ball's centre before a touch and where it is
  given up); how far the axis may be {off}, how far the bar may {lean} between the heights, the end's {room};
- [templates]: header, tool, stop, restart, level, position, approach, rapid, feed, feed_kept, coolant_on, coolant_off,
  lift, retract, tool_end, optional_stop, park, home, footer. One line is one block; an empty template writes nothing.
  Fields, by template:
  header {name} {number} (of the program, drawn from its name) {comments} {low_x}..{high_z} {tolerance} (a length)
  {rotary_tolerance} (degrees) {tool_centre_off};
  tool {tool} {spindle} {retract} (height above everything) {endless} (the short way on or off) {over_zero} (X and Y
  where tools start: over the program's zero, or over a part that lies) {stop} (the template stop, where the job asks
  for one); stop {tool};
  restart {title} (of the path) {tool} {tool_centre_off} (before each path but the first, with the template tool behind
  it: all that the header states, so that a program may begin there);
  level {tolerance} {rotary_tolerance} {hsc_mode} (1: roughing) {machining} (the word for it); position {rotary};
  approach {above} (X Y Z at the retract height) {plane} (X and Y of the approach) {linear} (its X Y Z) {rapid} (the
  rapid rate as a feed); lift {lifted} (X Y Z so high above the end that switching off may lower the tool by its
  length) {rapid};
  rapid {words} (all five); feed {words} {feed}; feed_kept {words} (a feed move at the feed of the one before; without
  it every block states its feed); retract {retract}; park {linear} (X and Y of the machine); footer {name}. A field
  may have a width, like {tool:02d};
- [tool_centre_control]: `on` and `off` blocks (with the fields {tool} and, Z before the rotary
  axes turn, {height}) by name, the machine file picks one, or takes
  the only one, and lines for the header that
  say which point it keeps, `tip` or `centre` by the machine's programmed_point; [numbering]: `format`, `first`,
  `step`, `highest` (then they begin again), `unnumbered` (how lines without a number begin), `continuation`;
- the reader's grammar: [[statements]] (whole blocks: `pattern`, a regular expression of RE2, and `effect`), and for iso
  [codes]: what each G, M and D code and each word of letters alone does; where there are codes of `tool_length`, every
  tool must have its length, by H, or by D of the tool in the spindle, before it moves; an absolute rapid to Z0 in
  `machine_coordinates` is a retract where lengths are those of D, one of X and Y behind it a park position (as a
  statement: `machine position` with the groups x and y), and so is a `reference_return` of Z by `incremental` words;
  the group `spindle` of a statement `tool`, or S, is the spindle's speed; M3 is `spindle_on`, M5 `spindle_stop`, M7 and
  M8 are `coolant_on`, M9 is `coolant_off`; `tolerance` is the contour's, by P, or by the group of that name of a
  statement. What a code means everywhere (`nc/schema.py`) it cannot mean otherwise: units, planes, arcs
  and increments are never without effect;
- [stated]: what the proof takes for granted and a text must therefore state, by codes, or by names that statements
  have as `states`: before the first move of an axis (`moves`), and again after each start of tool-centre control
  (`tool_centre`);
- [vector]: `words`, three forms with {number}, such as "A3={number}", which give the tool's direction (from the tip to
  the spindle, a unit vector, along the axes of the machine as those of X, Y, Z) in the place of the rotary axes in
  moves under tool-centre control, and the `number` of their components; `takes_angles`: a block between them may have
  rotary words, and begins as `instead` says, such as "LN " = "L ";
- [forms.angles], [forms.vectors], [forms.joints]: what is other in the file where nc.axes asks for rotary words under
  tool-centre control, for tool vectors, or for joints without it; a list in it replaces the whole list;
- `like`: the name of a dialect that ships and has all that the file leaves out; a list in the file replaces the whole
  list.
Say in the file which words are proved and which were only read.
"""

from functools import cached_property
from pathlib import Path
from typing import Any

from bonecam.errors import MachineError
from bonecam.machine.machine import Machine
from bonecam.machine.machine_file import read_table
from bonecam.nc.schema import CODES, PLAIN_WORD, DialectFile, Form, StatementTable, ToolCentreTable
from bonecam.plugins import named_files
from bonecam.text.pattern import Pattern

DIALECTS = Path(__file__).parent / "dialects"


class Dialect(DialectFile):
    """The language of a control: its file, whose fields the module's text describes, under the `name` of that file."""

    name: str = ""

    @cached_property
    def effect_of(self) -> dict[str, str]:
        """The effect of each G and M code."""
        return {word: effect for effect in CODES for word in getattr(self.codes, effect)}

    @property
    def tool_centre(self) -> bool:
        """Whether the control moves the linear axes so that the tip stays while rotary axes turn (TCPM,
        RTCP)."""
        return self.interpolation == "tool-centre"

    @cached_property
    def patterns(self) -> tuple[tuple[Pattern, StatementTable], ...]:
        """The reader's statements with their patterns, compiled."""
        return tuple((Pattern(item.pattern), item) for item in self.statements)

    def in_form(self, axes: str) -> "Dialect":
        """This dialect with the words of the axes that a job asks for: "controller" (its own), "angles", "vectors" or
        "joints". MachineError where it has no such form."""
        if axes in ("controller", self.own_form):
            return self
        form: Form | None = next((each for each in self.forms if each == axes), None)
        if form is None:
            known = " or ".join(repr(form) for form in (self.own_form, *self.forms))
            what = f"{self.name} has no [forms.{axes}]: give nc.axes = {known}, or another controller"
            raise MachineError(what, dialect=self.name)
        return Dialect.model_construct(name=self.name, **dict(self.formed(form)))

    @property
    def own_form(self) -> str:
        """The words of its axes as its file has them."""
        return "joints" if not self.tool_centre else "vectors" if self.vector else "angles"

    def lines(self, template: str, **fields: Any) -> list[str]:
        """The blocks of a template with its fields filled in."""
        text = getattr(self.templates, template).format(**fields)
        return [line for line in text.split("\n") if line]

    def move_lines(self, template: str, **forms: str) -> list[str]:
        """The blocks of a template of moves, as printf formats: its fields are filled with such formats."""
        text = getattr(self.templates, template).replace("%", "%%").format(**forms)
        return [line for line in text.split("\n") if line]

    def writing_endless_words(self, choice: str, machine: Machine) -> "Dialect":
        """This dialect with endless axes written as the job chooses: "wrapped", "wound", or "controller": wound where
        limits bound the winding, else as the dialect says. MachineError where the control knows one way only, or
        wrapped words would leave the turn of such an axis to it."""
        bounded = [axis.letter for axis in machine.rotary if axis.endless and axis.bounded]
        if bounded and choice != "wound":
            message = f"{bounded[0]} of {machine.title} winds within limits, its turn must be in the words"
            if choice == "wrapped":
                remedy = 'leave nc.endless_words = "wrapped" out, or limits_deg in the machine\'s file'
                raise MachineError(f"{message}: {remedy}", machine=machine.name)
            if self.endless_words != "wound" and not self.chooses_way:
                remedy = "take endless = false, if the axis then takes no short way, or leave limits_deg out"
                raise MachineError(f"{message}, {self.name} wraps them: {remedy}", dialect=self.name)
            choice = "wound"
        if choice in ("controller", self.endless_words):
            return self
        if not self.chooses_way:
            what = f"{self.name} has no blocks that switch the short way of endless axes"
            raise MachineError(
                f"{what}: leave nc.endless_words = {choice!r} out, or add short_way to its file", dialect=self.name
            )
        return self.model_copy(update={"endless_words": choice})

    @property
    def chooses_way(self) -> bool:
        """Whether a text says, by blocks or by the form of the words, which way endless axes turn."""
        return self.short_way is not None or self.has_own_form

    @property
    def has_own_form(self) -> bool:
        """Whether a word of an endless axis that takes the short way looks unlike others."""
        return self.endless_word != PLAIN_WORD

    @property
    def word_of_endless(self) -> str:
        """The form of the words of endless axes, with the fields {letter} and {number}."""
        return self.endless_word if self.endless_words == "wrapped" else PLAIN_WORD

    @property
    def endless_block(self) -> str:
        """The block by which the control reads the words of endless axes as they are written; "" without one."""
        if self.short_way is None:
            return ""
        return self.short_way.on if self.endless_words == "wrapped" else self.short_way.off

    def tool_centre_switch(self, machine: Machine) -> ToolCentreTable | None:
        """The blocks that switch tool-centre control on and off, None where the control has none; the only ones, or
        those that the machine names, and MachineError where it names none of ours."""
        if not self.tool_centre:
            return None
        if len(self.tool_centre_control) == 1:
            return next(iter(self.tool_centre_control.values()))
        if machine.tool_centre_control not in self.tool_centre_control:
            known = ", ".join(self.tool_centre_control)
            raise MachineError(
                f"{machine.name}: tool_centre_control {machine.tool_centre_control!r} is none of {self.name}'s "
                f"({known}): choose another controller (--controller), or correct the machine's file",
                machine=machine.name,
                dialect=self.name,
            )
        return self.tool_centre_control[machine.tool_centre_control]


def dialect_names() -> tuple[str, ...]:
    """The dialects that come with bonecam, are the user's, or come with other packages."""
    return tuple(dialect_files())


def dialect_files() -> dict[str, Path]:
    """Their files by name."""
    return named_files("dialects", DIALECTS)


def read_dialect(name: str | Path) -> Dialect:
    """The dialect of a name, or of a path to a TOML file; MachineError names file and every key that is wrong."""
    path, table = read_table("controller", name, dialect_files(), DialectFile, may_be_like=True)
    fields = {field: getattr(table, field) for field in DialectFile.model_fields}
    return Dialect.model_construct(name=path.stem, **fields)
