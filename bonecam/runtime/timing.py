"""The wall time of the stages of a run."""

import time
from collections.abc import Iterator
from contextlib import contextmanager


class StageTimes:
    """The wall times of stages: `seconds` holds that of each stage that has ended, by its name, rounded to a
    millisecond."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure the block as the stage `name`; a stage that fails is left out."""
        began = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - began, 3)
