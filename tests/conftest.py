"""Data beside the checkout, and the run-time check of array shapes."""

from pathlib import Path

import hypothesis
import pytest
from run_time_types import check_stages

STAGES = [
    *"machine tool mesh workholding setup surface levels material mechanics planning nc verify".split(),
    *"report.page report.sheet report.pictures report.summary report.axis_comparison".split(),
]
hypothesis.settings.register_profile("bonecam", deadline=None)  # other work on the machine takes time too
hypothesis.settings.load_profile("bonecam")
check_stages([f"bonecam.{stage}" for stage in STAGES])

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared():
    if not (SHARED / "meshes").is_dir():
        pytest.skip("the measuring data beside the checkout (../shared) is absent")
    return SHARED


def pytest_collection_modifyitems(items):
    """What lies in tests/plugins, and in tests/fuzz, which damages files of every kind, needs plugins."""
    for item in items:
        if {"plugins", "fuzz"} & set(Path(item.path).relative_to(Path(__file__).parent).parts[:1]):
            item.add_marker("plugged")
