"""Progress as a bar, in a notebook or on a terminal of any width, or as a line for each message."""

import argparse
import ctypes
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from bonecam.progress import Progress, silent
from bonecam.runtime.compiling import Compiling
from bonecam.text.faults import in_one_line

STDOUT, STDERR = 1, 2
"""Numbers of the process's streams (POSIX)."""
EVERY = 0.5
"""Seconds between two looks at what runs."""
COMPILING = "compiling, the first run only: "
"""What stands before a message while kernels are compiled."""


@contextmanager
def shown_progress(options: argparse.Namespace) -> Iterator[Progress]:
    """A progress that is shown as the options ask for: -v a log, -q nothing, else a bar on a terminal."""
    if options.verbose:
        yield ProgressLog()
    elif options.quiet or not sys.stderr.isatty():
        yield silent
    else:
        with ProgressBar() as bar:
            yield bar


class ProgressBar:
    """A `progress` for `convert` and its like: share done, seconds gone and left, the stage at work, and whether it is
    compiling. Close it, or take it in a `with` block, when the work is done."""

    def __init__(self, file: TextIO | None = None) -> None:
        from tqdm.auto import tqdm

        shape = "{percentage:3.0f}% |{bar:10}| {elapsed}<{remaining} {desc}"
        self._bar: Any = tqdm(total=1.0, bar_format=shape, dynamic_ncols=True, leave=False, position=0, file=file)
        self._message = ""
        self._compiling = Compiling()
        self._closed = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def __call__(self, fraction: float, message: str) -> None:
        """Show the share that is done, from 0 to 1, and what is done now."""
        self._message = in_one_line(message)
        self._bar.n = max(self._bar.n, min(fraction, 1.0))
        self._show()

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def clear(self) -> None:
        """Take the bar away until it is shown again, so that a line can be printed."""
        self._bar.clear()

    def close(self) -> None:
        """Remove the bar."""
        self._closed.set()
        self._bar.close()

    def _show(self) -> None:
        """Write the line anew."""
        if not self._closed.is_set():
            self._bar.set_description_str(f"{COMPILING * bool(self._compiling)}{self._message}")

    def _watch(self) -> None:
        """Write the line anew now and then, as a long step tells nothing: its seconds go on."""
        while not self._closed.wait(EVERY):
            self._show()


class ProgressLog:
    """The progress as a line for each new message: seconds, share done, message."""

    def __init__(self) -> None:
        self.began = time.perf_counter()
        self.message = ""

    def __call__(self, fraction: float, message: str) -> None:
        """Print a message that differs from the one before."""
        if message != self.message:
            seconds = time.perf_counter() - self.began
            print(f"{seconds:7.1f} s {fraction:4.0%}  {in_one_line(message)}", file=sys.stderr, flush=True)
        self.message = message


@contextmanager
def native_output_to_stderr() -> Iterator[None]:
    """What libraries write to the process's stdout (MeshLab's filters do) goes to its stderr."""
    sys.stdout.flush()
    stdout = os.dup(STDOUT)
    os.dup2(STDERR, STDOUT)
    try:
        yield
    finally:
        ctypes.CDLL(None).fflush(None)  # what C keeps for stdout
        os.dup2(stdout, STDOUT)
        os.close(stdout)
