"""Runs that put files into one folder take their turns, by a lock of the folder (flock)."""

import fcntl
import os
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

MAX_WAIT = 10.0
"""Longest wait for another run that is putting its files in place, s. That takes milliseconds; a run that was
stopped in between must not hold up this one."""


@contextmanager
def locked(folders: Iterable[Path]) -> Iterator[None]:
    """Keep other runs from placing files in the folders; without it where the file system knows no locks, or
    another run holds one for longer than MAX_WAIT. Blocks may stand inside each other."""
    with ExitStack() as held:
        for folder in sorted({Path(os.path.realpath(folder)) for folder in folders} - _held):
            handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            held.callback(os.close, handle)
            _lock(handle)
            _held.add(folder)
            held.callback(_held.discard, folder)
        yield


_held: set[Path] = set()
"""The folders that this process has locked."""


def _lock(handle: int) -> None:
    end = time.monotonic() + MAX_WAIT
    while time.monotonic() < end:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            time.sleep(0.01)
        except OSError:
            return
        else:
            return
