"""Runs that put files into one folder take their turns, by a lock file in it while they do so: on any system and file
system, between computers that share the folder too."""

import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import local

MAX_WAIT = 10.0
"""Longest wait for another run that is putting its files in place, s. That takes milliseconds; a run that was
stopped in between must not hold up this one."""
POLL = 0.01
"""How often the lock is tried, s."""
LOCK = ".bonecam-lock"
"""Name of the lock file."""


@contextmanager
def locked(folders: Iterable[Path]) -> Iterator[None]:
    """Keep other runs, and other threads, from placing files in the folders; without it where no lock can be made, or
    another run holds one for longer than MAX_WAIT. Blocks may stand inside each other."""
    held: set[Path] = _of_thread.__dict__.setdefault("held", set())
    with ExitStack() as locks:
        for folder in sorted({Path(os.path.realpath(folder)) for folder in folders} - held):
            locks.enter_context(_lock(folder / LOCK))
            held.add(folder)
            locks.callback(held.discard, folder)
        yield


_of_thread = local()
"""The folders that each thread has locked (`held`)."""


@contextmanager
def _lock(file: Path) -> Iterator[None]:
    """Hold a lock file that is there while the block lasts."""
    from filelock import SoftFileLock, Timeout

    lock = SoftFileLock(file)
    try:
        lock.acquire(timeout=MAX_WAIT, poll_interval=POLL)
    except Timeout:  # its run was killed or stopped: the next one need not wait
        with suppress(OSError):
            file.unlink()
    except OSError:
        pass
    try:
        yield
    finally:
        lock.release()
