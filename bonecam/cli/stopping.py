"""SIGINT (Ctrl-C), SIGTERM and SIGHUP stop the command with one line, and leave nothing behind.

The signal raises KeyboardInterrupt, which clears up on its way; while a module is imported it waits, as compiled
modules that an error cuts short print of it or abort. A library may turn the stop into another error, or lose it: any
error after a signal counts as the stop, and where the command goes on for GRACE, its temporary files are removed and
the process ends. `bonecam.cli.main` holds signals back until the handlers are here.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from types import FrameType
from typing import NoReturn

from bonecam.runtime.signals import STOPPING

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
    if _importing(frame):
        _come_again()
    else:
        raise KeyboardInterrupt


def _importing(frame: FrameType | None) -> bool:
    """Whether the frame works for an import."""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


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
    temporary = sys.modules.get("bonecam.runtime.temporary")
    remove = getattr(temporary, "remove_all", None)
    if remove is not None:
        remove()
    os._exit(128 + arrived[0])
