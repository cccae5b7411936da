"""The time of the stages of a run, by the wall clock and of the processor."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class StageTimes:
    """The times of stages: `seconds` holds the wall time of each stage that has ended, by its name, `cpu_seconds` what
    all threads of this process have computed in it, rounded to a millisecond. On a busy machine only the latter tells
    how much work a stage is. `reached` is the stage that began last."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.cpu_seconds: dict[str, float] = {}
        self.reached = ""

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure the block as the stage `name`; a stage that fails is left out."""
        self.reached = name
        began, computed = time.perf_counter(), time.process_time()
        yield
        self.seconds[name] = round(time.perf_counter() - began, 3)
        self.cpu_seconds[name] = round(time.process_time() - computed, 3)
