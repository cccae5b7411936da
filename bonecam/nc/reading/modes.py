"""What holds as a program is read: what it must have stated before its axes move, its spindle and coolant.

A control begins with what its machine's parameters choose, or with what the program before left on: inches, increments,
another plane, a tilted plane. A dialect lists what the proof takes for granted (`stated` of `nc.dialect`); a text that
leaves one of these out may be driven otherwise than it is read.
"""

from bonecam.nc.dialect import Dialect
from bonecam.nc.reading.line_error import line_error


class Stated:
    """What a program has not stated yet, as it is read."""

    def __init__(self, dialect: Dialect) -> None:
        self._again = tuple(dialect.stated.tool_centre)
        self._missing = set(dialect.stated.moves)
        self._missing_within: set[str] = set()

    def read(self, name: str) -> None:
        """Take a code, or the name of what a statement states, as read."""
        self._missing.discard(name)
        self._missing_within.discard(name)

    def begin_tool_centre(self) -> None:
        """Await what is to be stated after the start of tool-centre control."""
        self._missing_within = set(self._again)

    def check(self, letters: str, tool_centre: bool, line: int) -> None:
        """ProgramError where the axes `letters` move before all was stated that they need."""
        if self._missing:
            raise line_error(line, f"an axis moves before {min(self._missing)} is stated")
        if tool_centre and self._missing_within and not {*letters}.isdisjoint("XYZ"):
            what = f"{min(self._missing_within)} is stated under tool-centre control"
            raise line_error(line, f"an axis moves before {what}")


class SpindleAndCoolant:
    """What spindle and coolant do: `programmed` is the last speed that was read (S, 1/min), `turns` whether the
    spindle has been started since the last tool change or stop."""

    def __init__(self) -> None:
        self.programmed = 0.0
        self.turns = False
        self.coolant = False

    @property
    def speed(self) -> float:
        """The speed of the spindle, 1/min; 0 where it stands."""
        return self.programmed if self.turns else 0.0

    def apply(self, effect: str) -> None:
        """Apply the effect of a code or a statement, if it is one of theirs (see `nc.dialect`)."""
        effect = effect.replace("_", " ")
        if effect in ("spindle on", "spindle stop", "halt"):
            self.turns = effect == "spindle on"
        if effect in ("coolant on", "coolant off", "halt"):
            self.coolant = effect == "coolant on"

    def change_tool(self) -> None:
        """A tool change: the spindle stands, its speed is kept."""
        self.turns = False
