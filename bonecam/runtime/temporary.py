"""Temporary folders beside outputs, `.bonecam-HOST-PID-xxxxxxxx.part`: removed by the process that made them,
however it ends, and after a kill by the next one that writes there.

A folder of another host, or of a process that runs, is never touched, nor is a file of any other name.
"""

import atexit
import os
import platform
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import RLock

from bonecam.runtime.signals import undisturbed

HOST = re.sub(r"[^\w.]", "_", platform.node())[:64] or "localhost"
"""The name of this computer as it stands in names of folders."""
NAME = re.compile(r"\.bonecam-(?P<host>[\w.]+)-(?P<process>\d+)-\w+\.part")
"""The name of a temporary folder."""
_LIVE: set[Path] = set()
"""The temporary folders of this process."""
_MAKING = RLock()
"""Held while a folder is made and entered into `_LIVE`, so that no other thread takes it for abandoned in between."""


def make_temporary(parent: Path) -> Path:
    """A new folder in `parent`, for files on their way to it; abandoned ones there are removed first. OSError
    where none can be made."""
    remove_abandoned(parent)
    with undisturbed(), _MAKING:
        name = f".bonecam-{HOST}-{os.getpid()}-"
        folder = Path(tempfile.mkdtemp(dir=parent.absolute(), prefix=name, suffix=".part"))
        _LIVE.add(folder)
    return folder


def is_temporary(file: Path) -> bool:
    """Whether a file is in a temporary folder."""
    return any(NAME.fullmatch(folder.name) for folder in file.parents)


def remove_temporary(folder: Path) -> None:
    """Remove a folder that `make_temporary` made, with what is in it."""
    with undisturbed():
        shutil.rmtree(folder, ignore_errors=True)
        _LIVE.discard(folder)


@contextmanager
def temporary_folder(parent: str | Path | None = None) -> Iterator[Path]:
    """A folder in `parent` (default: the system's folder of temporary files) that is removed after the block."""
    folder = make_temporary(Path(tempfile.gettempdir() if parent is None else parent))
    try:
        yield folder
    finally:
        remove_temporary(folder)


def remove_abandoned(parent: Path) -> None:
    """Remove from `parent` the temporary folders of processes of this computer that are gone.

    What cannot be removed is left, with no error: the work does not need it gone.
    """
    try:
        with _MAKING:
            abandoned = [item for item in parent.iterdir() if _is_abandoned(item)]
    except OSError:
        return
    for item in abandoned:
        shutil.rmtree(item, ignore_errors=True)


def _is_abandoned(item: Path) -> bool:
    name = NAME.fullmatch(item.name)
    if name is None or name["host"] != HOST or item.is_symlink():
        return False
    process = int(name["process"])
    return item.absolute() not in _LIVE if process == os.getpid() else not is_running(process)


def is_running(process: int) -> bool:
    """Whether a process of that number works: one that has ended and whose parent has not asked yet how (a zombie, as
    for ever where process 1 of a container asks nobody) does not."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return not _is_zombie(process)


def _is_zombie(process: int) -> bool:
    """Whether a process has ended, as Linux tells it: False where the system does not."""
    try:
        reported = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return reported.rpartition(")")[2].split()[0] in "ZX"


@atexit.register
def remove_all() -> None:
    """Remove the temporary folders that this process still has."""
    for folder in [folder for folder in _LIVE if f"-{os.getpid()}-" in folder.name]:
        remove_temporary(folder)
