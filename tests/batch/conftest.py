from collections.abc import Callable
from typing import Any

import pytest

import bonecam
from bonecam.batch import run
from bonecam.runtime.worker import function_of


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts are done in this process, for tests of what is kept of their work: a new one imports for a second."""

    def called(work: str, *given: Any, progress: Callable, stopped: Any = None) -> Any:
        return function_of(work)(*given, progress)

    monkeypatch.setattr(bonecam, "convert", bonecam.convert)  # which the stand-in replaces
    monkeypatch.setattr(run, "call_in_worker", called)
