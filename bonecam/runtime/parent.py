"""A process that works for another one imports nothing from the current folder, and ends with the other, however that
ends."""

import ctypes
import os
import pickle
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from threading import Thread
from typing import NoReturn

PR_SET_PDEATHSIG = 1
"""Number of the call that names the signal at the parent's end (Linux, prctl(2))."""
INTERVAL = 1.0
"""How often the parent is looked at where the kernel tells nothing, s."""


@contextmanager
def safe_path() -> Iterator[None]:
    """Python that is started in the block takes no module from the current folder: a stranger's `socket.py` beside
    the meshes would be run, as multiprocessing starts `python -c`, which looks there first."""
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before


def end_with_parent(parent: int) -> None:
    """End this process, at once and with no word, as soon as the process `parent` is gone, killed for instance.

    On Linux the kernel sees to it, so that it holds inside a library's long call too; elsewhere a thread looks.
    """
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it has ended before the kernel was told
        os._exit(1)
    Thread(target=_watch, args=(parent,), daemon=True).start()


def work_for(parent: int, answer: Connection, work: bytes) -> None:
    """In a new process: call a function with `answer` and its other arguments, all pickled as `work`.

    It is unpickled, which imports its modules, once this process ends with its parent.
    """
    end_with_parent(parent)
    function, arguments = pickle.loads(work)
    function(answer, *arguments)


def _watch(parent: int) -> NoReturn:
    while os.getppid() == parent:
        time.sleep(INTERVAL)
    os._exit(1)
