"""The picture of a machine file."""

from pathlib import Path

import pytest

from bonecam.machine import machine_names, read_machine
from bonecam.report import draw_machine_file


@pytest.mark.parametrize("name", [name for name in machine_names() if name in ("mill-4axis", "dmu-45")])
def test_a_machine_file_is_drawn(name: str, tmp_path: Path) -> None:
    draw_machine_file(read_machine(name), tmp_path / "machine.png")
    assert (tmp_path / "machine.png").read_bytes().startswith(b"\x89PNG")
