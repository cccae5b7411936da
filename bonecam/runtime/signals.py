"""Signals that stop a run: put off while files take their place, and kept from the processes that work for it."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

STOPPING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""The signals that ask a run to stop: Ctrl-C, `kill`, and the end of the terminal, which Windows has not."""


@contextmanager
def undisturbed() -> Iterator[None]:
    """Signals that stop a run take effect when the block has ended, not inside it.

    Blocks may stand inside each other. Python handles signals in the main thread only, so that in another
    thread nothing has to be put off. Handlers that were not set from Python, and ignored signals, stay.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    handlers = {kind: signal.getsignal(kind) for kind in STOPPING}
    handlers = {kind: handler for kind, handler in handlers.items() if handler not in (None, signal.SIG_IGN)}
    try:
        for kind in handlers:
            signal.signal(kind, lambda number, frame: arrived.append(number))
        yield
    finally:
        for kind, handler in handlers.items():
            signal.signal(kind, handler)
        if arrived:
            signal.raise_signal(arrived[0])


@contextmanager
def kept_from_children() -> Iterator[None]:
    """Processes that are started in the block never see the signals that stop a run: Ctrl-C and the end of a
    terminal reach a whole group of processes, and the one that started them decides."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows: a console tells each process by itself
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOPPING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
