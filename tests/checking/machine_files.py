"""Machine files of every kind of chain, as text."""

from pathlib import Path

AXES = """
[X]
travel = 4000.0
speed = 10000.0
[Y]
travel = 4000.0
speed = 10000.0
[Z]
travel = 4000.0
speed = 10000.0
"""


def machine_text(chain: list[str], rotary: dict[str, dict[str, object]], extra: str = "") -> str:
    """Makes the TOML of a machine; `rotary` gives direction, pivot, sign and limits_deg or endless by letter."""
    text = (
        f'title = "test"\nchain = {chain}\npart_zero = [1.0, -2.0, 3.0]\ntool_centre_control = "M128"\n{extra}\n{AXES}'
    )
    for letter, values in rotary.items():
        text += f"[{letter}]\nspeed_deg_s = 60.0\n" + "".join(
            f"{key} = {str(value).lower()}\n" for key, value in values.items()
        )
    return text


def axis(
    direction: list[float], pivot: list[float], sign: int = 1, low: float = -179.0, high: float = 179.0
) -> dict[str, object]:
    """Makes the values of a rotary axis with limits."""
    return {"direction": direction, "pivot": pivot, "sign": sign, "limits_deg": [low, high]}


def write_machine(folder: Path, text: str, name: str = "test") -> Path:
    """Writes a machine file into a folder."""
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


_TURNTABLE = {"direction": [0, 0, 1], "pivot": [1, 2, 0], "sign": -1, "endless": True}
CHAINS = {
    "table-table": machine_text(["C", "A", "XYZ"], {"C": _TURNTABLE, "A": axis([1, 0, 0], [0, 5, -7], -1)}),
    "head-table": machine_text(["C", "XYZ", "B"], {"C": _TURNTABLE, "B": axis([0, 1, 0], [0, 0, 40])}),
    "head-head": machine_text(["XYZ", "C", "A"], {"C": axis([0, 0, 1], [0, 0, 90]), "A": axis([1, 0, 0], [3, 0, 60])}),
    "nutating": machine_text(
        ["C", "B", "XYZ"], {"C": _TURNTABLE, "B": axis([0.0, 0.5**0.5, 0.5**0.5], [0, 5, -7], -1)}
    ),
}
"""A machine file of each kind of chain, by its name."""
