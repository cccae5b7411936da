"""Benchmarks and drawings, which no other test runs, keep up with the code: each imports (`mypy` checks its
calls)."""

import runpy
from pathlib import Path

import pytest

HERE = Path(__file__).parent
EXTRAS = {"clarabel", "cvxpy", "splinepy"}
"""What the extra `bench` brings."""


@pytest.mark.parametrize(
    "path", sorted([*HERE.glob("benchmarks/*.py"), *HERE.glob("figures/*.py")]), ids=lambda path: path.name
)
def test_it_imports(path, monkeypatch):
    monkeypatch.syspath_prepend(path.parent)
    try:
        runpy.run_path(str(path))
    except ModuleNotFoundError as error:
        if error.name not in EXTRAS:
            raise
        pytest.skip(f"{error.name} is not installed: pip install -e '.[bench]'")
