"""How a batch goes on: a line on stdout for each part that has come to its end, and on stderr what runs, how much is
done, and the time that is left.

The command `batch`: its arguments, and what it does.
"""

import argparse
import sys
import time
from contextlib import nullcontext
from threading import Lock
from types import TracebackType
from typing import Any

import bonecam
from bonecam.batch.run import WAITING
from bonecam.cli.parser import add_job_options, job_of, share_of
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


def add_batch(add_command: Any, parsers: Any) -> None:
    """The command `batch`."""
    text = "Make the NC programs of several parts, each in a process of its own."
    batch = add_command(parsers, "batch", text, run_batch)
    kept = "finished programs are kept, --resume continues from there"
    batch.set_defaults(stopped=kept, stopped_late=kept)
    parts = "parts as for `convert`, folders of parts, or a table of parts (parts.csv: file, job, units, stock, output)"
    batch.add_argument("parts", metavar="PART", nargs="+", help=parts)
    folder = "folder for programs, reports and batch.csv"
    batch.add_argument("-o", "--output", metavar="DIR", required=True, help=folder)
    batch.add_argument("--jobs", metavar="N", type=int, default=2, help="number of parts at a time (2)")
    resume = "skip parts that an earlier run finished with the same mesh, job, files of the job, and package"
    batch.add_argument("--resume", action="store_true", help=resume)
    batch.add_argument("--html", action="store_true", help="write a page of each part, NAME.html")
    batch.add_argument("--sheet", action="store_true", help="write a setup sheet of each part, NAME.sheet.html")
    keep = "write a folder of each part, NAME: surface, levels, tool path and pictures"
    batch.add_argument("--keep", action="store_true", help=keep)
    scheduler = "run on the workers of a Dask scheduler (tcp://HOST:8786), or of one started here (local)"
    batch.add_argument("--scheduler", metavar="ADDRESS", help=scheduler)
    share = "do the Kth of N shares of the parts alone, as a task of an array of jobs does"
    batch.add_argument("--share", metavar="K/N", type=share_of, default=(1, 1), help=share)
    add_job_options(batch)
    batch.add_argument("-q", "--quiet", action="store_true", help="print no line for each part")
    batch.add_argument("-v", "--verbose", action="store_true", help="print the steps of each part as lines")


def run_batch(options: argparse.Namespace) -> int:
    """`bonecam batch`: the NC programs of several parts."""
    from bonecam.batch import Wanted, cluster_executor

    address = options.scheduler
    cluster = cluster_executor(address, options.jobs) if address else nullcontext()
    with cluster as executor, BatchDisplay(options) as shown:
        outcomes = bonecam.convert_many(
            options.parts,
            options.output,
            job_of(options),
            jobs=options.jobs,
            executor=executor,
            resume=options.resume,
            share=options.share,
            wanted=Wanted(html=options.html, sheet=options.sheet, keep=options.keep),
            told=shown.told,
            progress=shown.progress,
        )
    return int(any(outcome.state == "failed" for outcome in outcomes))
