"""How a command meets its terminal: what stops it, its streams, and its progress.

SIGINT (Ctrl-C), SIGTERM and SIGHUP stop the command with one line, and leave nothing behind.

The signal raises KeyboardInterrupt, which clears up on its way; while a module is imported it waits, as compiled
modules that an error cuts short print of it or abort. A library may turn the stop into another error, or lose it: any
error after a signal counts as the stop, and where the command goes on for GRACE, its temporary files are removed and
the process ends. `bonecam.cli.main` holds signals back until the handlers are here.

Streams that the caller has closed (`>&-`) lead nowhere, as those to /dev/null. Progress is a bar, in a notebook or on a
terminal of any width, or a line for each message.
"""

import argparse
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any, NoReturn, TextIO

from bonecam.progress import Progress, silent
from bonecam.runtime.compiling import Compiling
from bonecam.runtime.staging import STOPPING, remove_all
from bonecam.text.numbers import in_one_line


def open_closed_streams() -> None:
    """Open the closed ones of stdin, stdout and stderr.

    Python has None for them, and the next files that a process opens would get their numbers: what a library prints
    would go into one of these.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is not None:
            continue
        nowhere = os.open(os.devnull, os.O_RDWR)
        if nowhere != number:
            os.dup2(nowhere, number)
            os.close(nowhere)
        setattr(sys, name, os.fdopen(number, mode, encoding="utf-8"))


GRACE = 3.0
"""How long the command may take to end by itself after a signal, s: ten times what the longest call of a
library takes."""
RETRY = 0.01
"""How long after a stop was lost or put off it comes again, s: in a place that can raise it."""
NOTHING = "nothing was written"
"""What the line of a stopped command says where nothing else is known."""
arrived: list[int] = []
"""The signals that have come."""
_again: list[int] = []
"""The signal of a stop that was lost or put off and is to come again."""


def run_stoppable(call: Callable[[Sequence[str]], int]) -> int:
    """Run `call` on the arguments of this process; its exit code."""
    sys.unraisablehook = _raise_again
    for kind in STOPPING:
        if signal.getsignal(kind) is not signal.SIG_IGN:  # as `nohup` and a shell's `&` do
            signal.signal(kind, _stop)
    try:
        if hasattr(signal, "pthread_sigmask"):
            signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPPING)  # which `main` holds back
        code = call(sys.argv[1:])
    except BaseException:
        if not arrived:
            _ignore_signals()
            raise
        tell(NOTHING)
    if arrived:
        end()
    _ignore_signals()
    return code


def _ignore_signals() -> None:
    """All is done: the interpreter ends undisturbed."""
    for kind in STOPPING:
        signal.signal(kind, signal.SIG_IGN)


def _stop(number: int, frame: FrameType | None) -> None:
    """The handler: the first signal counts, and what `_come_again` sends after it."""
    if arrived and not _again:
        return
    if not arrived:
        arrived.append(number)
        _later(GRACE, _give_up)
    _again.clear()
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    if frame is None:
        raise KeyboardInterrupt
    _come_again()  # an import is at work


def _raise_again(unraisable: "sys.UnraisableHookArgs") -> None:
    """The hook for errors in places that can raise none (a finaliser, a weak reference's callback): a stop that
    is lost there comes again."""
    if arrived and isinstance(unraisable.exc_value, KeyboardInterrupt):
        _come_again()
    else:
        sys.__unraisablehook__(unraisable)


def _come_again() -> None:
    _again.append(arrived[0])
    _later(RETRY, lambda: os.kill(os.getpid(), arrived[0]))


def _later(seconds: float, work: Callable[[], None]) -> None:
    timer = threading.Timer(seconds, work)
    timer.daemon = True
    timer.start()


def _give_up() -> None:
    tell(NOTHING)
    end()


_told: list[str] = []


def tell(what: str) -> None:
    """Print the line of a stopped command, after a signal once; where the terminal is gone, nobody reads it."""
    if arrived:
        if _told:
            return
        _told.append(what)
    try:
        print(f"bonecam: stopped; {what}", file=sys.stderr, flush=True)
    except OSError:
        return


def end() -> NoReturn:
    """Remove temporary files and end the process with the signal's exit code."""
    remove_all()
    os._exit(128 + arrived[0])


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
