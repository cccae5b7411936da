"""How a batch goes on: a line on stdout for each part that has come to its end, and on stderr what runs, how much is
done, and the time that is left."""

import argparse
import sys
import time
from threading import Lock
from types import TracebackType

from bonecam.batch.run import WAITING
from bonecam.cli.stopping import ProgressBar, ProgressLog
from bonecam.progress import silent
from bonecam.report.tables import Outcome
from bonecam.text.numbers import in_one_line

MINUTE = 60.0
"""Seconds."""


class BatchDisplay:
    """The display of a batch as the options ask for: -v a log of every step, -q nothing, else a line on a terminal."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.quiet = options.quiet
        self.line = ProgressBar() if sys.stderr.isatty() and not (self.quiet or options.verbose) else None
        self.log = ProgressLog() if options.verbose else silent
        self.began = time.perf_counter()
        self.ended = 0
        self.failed = 0
        self.waiting: set[str] = set()
        self.running: dict[str, tuple[float, str]] = {}
        self.lock = Lock()

    def __enter__(self) -> "BatchDisplay":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.line:
            self.line.close()

    def told(self, outcome: Outcome, left: int) -> None:
        """A part has come to its end."""
        with self.lock:
            self.waiting.discard(outcome.name)
            self.running.pop(outcome.name, None)
            self.ended += outcome.state != "kept"
            self.failed += outcome.state == "failed"
            if self.line:
                self.line.clear()
            if not self.quiet:
                text = outcome.message.removeprefix(f"{outcome.mesh}: ") or outcome.program
                warned = f"  warnings: {outcome.warnings}" if outcome.warnings else ""
                line = f"{outcome.state:6} {outcome.mesh}  {text}{warned}  ({left} left{self._time_left})"
                print(in_one_line(line), flush=True)
            self._show()

    def progress(self, name: str, fraction: float, message: str) -> None:
        """A part goes on, or waits for its turn."""
        with self.lock:
            if message == WAITING:
                self.waiting.add(name)
                return
            self.waiting.discard(name)
            self.running[name] = fraction, message
            self.log(fraction, f"{name}: {message}")
            self._show()

    @property
    def _done(self) -> float:
        """How many parts are done, with the shares of those that run."""
        return self.ended + sum(fraction for fraction, _ in self.running.values())

    @property
    def _whole(self) -> int:
        return self.ended + len(self.running) + len(self.waiting)

    @property
    def _time_left(self) -> str:
        """The time that is left at the pace so far, as a remark; nothing where no part has ended or none is left."""
        if not (self.ended and self._whole > self.ended):
            return ""
        seconds = (time.perf_counter() - self.began) / self._done * (self._whole - self._done)
        return f", about {seconds / MINUTE:.0f} min" if seconds > 2 * MINUTE else f", about {seconds:.0f} s"

    def _show(self) -> None:
        """The line of the terminal: share done, parts left, what runs."""
        if self.line and self._whole:
            runs = ", ".join(f"{name} {share:.0%} {step}" for name, (share, step) in self.running.items())
            lost = f", {self.failed} failed" if self.failed else ""
            left = f"{self._whole - self.ended} left{lost}{self._time_left}"
            self.line(self._done / self._whole, f"{left}: {runs}")
