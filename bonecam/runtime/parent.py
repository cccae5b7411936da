"""A process that works for another one ends with it, however that ends."""

import ctypes
import os
import signal
import time
from threading import Thread
from typing import NoReturn

PR_SET_PDEATHSIG = 1
"""Number of the call that names the signal at the parent's end (Linux, prctl(2))."""
INTERVAL = 1.0
"""How often the parent is looked at where the kernel tells nothing, s."""


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


def _watch(parent: int) -> NoReturn:
    while os.getppid() == parent:
        time.sleep(INTERVAL)
    os._exit(1)
