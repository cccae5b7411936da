"""Fixtures for every stage, and the run-time check of array shapes."""

from pathlib import Path

import pytest
from jaxtyping import install_import_hook

STAGES = ("mesh", "setup", "surface", "levels", "toolpath", "orientation", "nc", "verify")
install_import_hook([f"bonecam.{stage}" for stage in STAGES], "beartype.beartype")

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    if not (SHARED / "meshes").is_dir():
        pytest.skip("the measuring data beside the checkout (../shared) is absent")
    return SHARED
