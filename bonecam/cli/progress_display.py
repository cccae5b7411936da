"""Progress on stderr: one line that is written over on a terminal, or a line for each message."""

import argparse
import ctypes
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from bonecam.progress import Progress, silent
from bonecam.text.faults import in_one_line

LINE_WIDTH = 100
"""A progress line is cut off after this many characters."""
STDOUT, STDERR = 1, 2
"""Numbers of the process's streams (POSIX)."""


@contextmanager
def shown_progress(options: argparse.Namespace) -> Iterator[Progress]:
    """A progress that is shown as the options ask for: -v a log, -q nothing, else a line on a terminal."""
    if options.verbose:
        yield ProgressLog()
    elif options.quiet or not sys.stderr.isatty():
        yield silent
    else:
        line = ProgressLine()
        try:
            yield line
        finally:
            line.clear()


class ProgressLine:
    """The progress as one line of a terminal: share done, seconds, message."""

    def __init__(self) -> None:
        self.began = time.perf_counter()
        self.width = 0

    def __call__(self, fraction: float, message: str) -> None:
        """Show a message in place of the one before."""
        line = f"{fraction:4.0%} {time.perf_counter() - self.began:5.0f} s  {in_one_line(message)}"[
            :LINE_WIDTH
        ]
        print(f"\r{line.ljust(self.width)}", end="", file=sys.stderr, flush=True)
        self.width = len(line)

    def clear(self) -> None:
        """Remove the line."""
        print(f"\r{' ' * self.width}\r", end="", file=sys.stderr, flush=True)


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
