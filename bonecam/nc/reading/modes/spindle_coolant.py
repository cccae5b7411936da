"""Spindle and coolant while a program is read."""


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
