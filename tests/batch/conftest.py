import pytest

import bonecam
from bonecam.batch import run
from bonecam.runtime.worker import function_of


@pytest.fixture
def quick(monkeypatch):
    """Parts are done in this process, for tests of what is kept of their work: a new one imports for a second."""

    def called(work, *given, progress, stopped=None):
        return function_of(work)(*given, progress)

    monkeypatch.setattr(bonecam, "convert", bonecam.convert)  # which the stand-in replaces
    monkeypatch.setattr(run, "call_in_worker", called)
