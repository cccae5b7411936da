"""Machine files of every kind of chain, as text."""

from collections.abc import Callable
from pathlib import Path

import pytest

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


@pytest.fixture(scope="session")
def machine_text() -> Callable[..., str]:
    """Makes the TOML of a machine; `rotary` gives direction, pivot, sign and limits_deg or endless by letter."""

    def build(chain: list[str], rotary: dict[str, dict[str, object]], extra: str = "") -> str:
        text = (
            f'title = "test"\nchain = {chain}\npart_zero = [1.0, -2.0, 3.0]\n'
            f'tool_centre_control = "M128"\n{extra}\n{AXES}'
        )
        for letter, values in rotary.items():
            text += f"[{letter}]\nspeed_deg_s = 60.0\n" + "".join(
                f"{key} = {str(value).lower()}\n" for key, value in values.items()
            )
        return text

    return build


@pytest.fixture(scope="session")
def axis() -> Callable[..., dict[str, object]]:
    """Makes the values of a rotary axis with limits."""

    def build(
        direction: list[float], pivot: list[float], sign: int = 1, low: float = -179.0, high: float = 179.0
    ) -> dict[str, object]:
        return {"direction": direction, "pivot": pivot, "sign": sign, "limits_deg": [low, high]}

    return build


@pytest.fixture(scope="session")
def chains(machine_text: Callable[..., str], axis: Callable[..., dict[str, object]]) -> dict[str, str]:
    """A machine file of each kind of chain, by its name."""
    turntable = {"direction": [0, 0, 1], "pivot": [1, 2, 0], "sign": -1, "endless": True}
    tilted = [0.0, 0.5**0.5, 0.5**0.5]
    return {
        "table-table": machine_text(["C", "A", "XYZ"], {"C": turntable, "A": axis([1, 0, 0], [0, 5, -7], -1)}),
        "head-table": machine_text(["C", "XYZ", "B"], {"C": turntable, "B": axis([0, 1, 0], [0, 0, 40])}),
        "head-head": machine_text(
            ["XYZ", "C", "A"], {"C": axis([0, 0, 1], [0, 0, 90]), "A": axis([1, 0, 0], [3, 0, 60])}
        ),
        "nutating": machine_text(["C", "B", "XYZ"], {"C": turntable, "B": axis(tilted, [0, 5, -7], -1)}),
    }


@pytest.fixture(scope="session")
def write_machine() -> Callable[..., Path]:
    """Writes a machine file into a folder."""

    def write(folder: Path, text: str, name: str = "test") -> Path:
        path = folder / f"{name}.toml"
        path.write_text(text)
        return path

    return write
