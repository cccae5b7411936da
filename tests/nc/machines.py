"""Machine files of every kind of chain, written for the tests."""

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
    """TOML of a machine; `rotary` gives direction, pivot, sign and limits_deg or endless by letter."""
    text = f'title = "test"\nchain = {chain}\npart_zero = [1.0, -2.0, 3.0]\ntool_centre_control = "M128"\n{extra}\n{AXES}'
    for letter, values in rotary.items():
        text += f"[{letter}]\nspeed_deg_s = 60.0\n" + "".join(
            f"{key} = {str(value).lower()}\n" for key, value in values.items()
        )
    return text


def axis(
    direction: list[float], pivot: list[float], sign: int = 1, low: float = -179.0, high: float = 179.0
) -> dict[str, object]:
    return {"direction": direction, "pivot": pivot, "sign": sign, "limits_deg": [low, high]}


def table(pivot: list[float]) -> dict[str, object]:
    return {"direction": [0, 0, 1], "pivot": pivot, "sign": -1, "endless": True}


TILTED = [0.0, 0.5**0.5, 0.5**0.5]
CHAINS = {
    "table-table": machine_text(
        ["C", "A", "XYZ"], {"C": table([1, 2, 0]), "A": axis([1, 0, 0], [0, 5, -7], -1)}
    ),
    "head-table": machine_text(["C", "XYZ", "B"], {"C": table([1, 2, 0]), "B": axis([0, 1, 0], [0, 0, 40])}),
    "head-head": machine_text(
        ["XYZ", "C", "A"], {"C": axis([0, 0, 1], [0, 0, 90]), "A": axis([1, 0, 0], [3, 0, 60])}
    ),
    "nutating": machine_text(["C", "B", "XYZ"], {"C": table([1, 2, 0]), "B": axis(TILTED, [0, 5, -7], -1)}),
}


def write(folder: Path, text: str, name: str = "test") -> Path:
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path
