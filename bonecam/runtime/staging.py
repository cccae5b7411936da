"""Signals that stop a run: put off while files take their place, and kept from the processes that work for it.

Temporary folders beside outputs, `.bonecam-HOST-PID-xxxxxxxx.part`: removed by the process that made them,
however it ends, and after a kill by the next one that writes there.

A folder of another host, or of a process that runs, is never touched, nor is a file of any other name.

Outputs are written in temporary folders on the file system where they belong, and take their places together.

A file is made beside the one it replaces, the files of a folder inside that folder: so a folder may be a mount
point, a link to another file system, or lie in a folder that cannot be written. Each file is replaced in one
step (`os.replace`), and keeps its mode. Runs that write into one folder take their turns, so that what stands
there in the end is of one run.
"""

import atexit
import errno
import os
import platform
import re
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import RLock

from bonecam.errors import BonecamError, FileError
from bonecam.runtime.own_files import OWN_FILES, is_own, list_of_own, locked, stale_files

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
    abandoned = []
    try:
        with _MAKING:
            for item in parent.iterdir():
                name = NAME.fullmatch(item.name)
                if name is None or name["host"] != HOST or item.is_symlink():
                    continue
                process = int(name["process"])
                own = process == os.getpid()
                if item.absolute() not in _LIVE if own else not is_running(process):
                    abandoned.append(item)
    except OSError:
        return
    for item in abandoned:
        shutil.rmtree(item, ignore_errors=True)


def is_running(process: int) -> bool:
    """Whether a process of that number works: one that has ended and whose parent has not asked yet how (a zombie, as
    for ever where process 1 of a container asks nobody) does not."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    try:  # as Linux tells whether it has ended
        reported = Path(f"/proc/{process}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return True
    return reported.rpartition(")")[2].split()[0] not in "ZX"


@atexit.register
def remove_all() -> None:
    """Remove the temporary folders that this process still has."""
    for folder in [folder for folder in _LIVE if f"-{os.getpid()}-" in folder.name]:
        remove_temporary(folder)


FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
PERMISSIONS = 0o777
"""The bits of a file's mode that the one keeps that takes its place."""
NAME_BYTES = "surrogateescape"
"""How a text holds names of files that are not in UTF-8: by their bytes, as the system gives them."""
placed: list[str] = []
"""What this process has put in its place so far."""


@dataclass(frozen=True)
class _Output:
    """A file or folder on its way: its temporary folder `work`, the `names` of the files in it (None: all), the
    folder they go to, the name that the user gave."""

    given: str | Path
    work: Path
    target: Path
    names: tuple[str, ...] | None
    made: tuple[Path, ...] = ()
    own: str | None = None
    replace: bool = True

    def moves(self) -> list[tuple[Path, Path]]:
        """Each file in its temporary place, and its place."""
        files = [item for item in self.work.rglob("*") if item.is_file()]
        names = self.names or sorted(str(item.relative_to(self.work)) for item in files)
        return [(self.work / name, self.target / name) for name in names]


class Staging:
    """Outputs on their way. `staged` makes one."""

    def __init__(self) -> None:
        self._outputs: list[_Output] = []
        self._stale: list[Path] = []

    def file(self, path: str | Path) -> Path:
        """A name to write to, for the file `path` (or that a link leads to). FileError where none can be made."""
        target = Path(os.path.realpath(path))
        if target.is_dir():
            raise FileError(f"{path}: is a folder: name a file in it", file=str(path))
        return self._add(path, target.parent, (target.name,)) / target.name

    def write(self, path: str | Path, text: str) -> None:
        """Write `text` (UTF-8, names of files that are not by their bytes) for the file `path`. FileError names the
        file and the reason."""
        work = self.file(path)
        try:
            work.write_text(text, encoding="utf-8", errors=NAME_BYTES, newline="")
        except OSError as error:
            raise unwritable(path, error) from error

    def folder(self, path: str | Path, own: str | None = None, replace: bool = True) -> Path:
        """A folder to write to, for files of the folder `path`, which is made if it is not there.

        Where `own` (a regular expression) is given, files of an earlier run whose whole names match it go when
        no new ones take their places. Without `replace`, files that no earlier run wrote are not written over.
        FileError where nothing can be made there.
        """
        return self._add(path, Path(os.path.realpath(path)), None, own, replace)

    def _add(
        self,
        path: str | Path,
        target: Path,
        names: tuple[str, ...] | None,
        own: str | None = None,
        replace: bool = True,
    ) -> Path:
        folders: list[Path] = []
        with undisturbed():
            try:
                if names is None:
                    folders = [place for place in (target, *target.parents) if not place.exists()]  # innermost first
                    target.mkdir(parents=True, exist_ok=True)
                work = make_temporary(target)
            except OSError as error:
                remove_empty(folders)
                raise unwritable(path, error) from error
            self._outputs.append(
                _Output(path, work, target=target, names=names, made=tuple(folders), own=own, replace=replace)
            )
        return work

    def remove(self, file: Path) -> None:
        """Remove a file once all outputs are in their places: what they replace."""
        self._stale.append(file)

    def drop(self, path: str | Path) -> None:
        """Give up the output `path`: nothing of it is written."""
        for output in [output for output in self._outputs if output.given == path]:
            self._outputs.remove(output)
            _discard(output)

    def told(self, error: Exception) -> Exception:
        """The error with the names that the user gave in place of the temporary ones; an OSError as FileError
        of the output whose place it names, else of the last."""
        if isinstance(error, OSError) and self._outputs:
            named = [output for output in self._outputs if str(output.work) in str(error.filename)]
            return unwritable((named or self._outputs)[-1].given, error)
        if not isinstance(error, BonecamError):
            return error
        message = str(error)
        file = str(error.evidence.get("file", ""))
        for output in self._outputs:
            work = output.work / output.names[0] if output.names else output.work
            message = message.replace(str(work), str(output.given))
            file = file.replace(str(work), str(output.given))
        changed = {"file": file} if file else {}
        return error if message == str(error) else type(error)(message, **{**error.evidence, **changed})

    def commit(self) -> None:
        """Put the files in their places, in the order of the outputs. An output that cannot be placed does not
        keep the others from theirs; FileError then names the first."""
        troubles: list[FileError] = []
        with locked([output.target for output in self._outputs]):
            for output in self._outputs:
                try:
                    _place(output)
                except FileError as error:
                    troubles.append(error)
                except OSError as error:
                    troubles.append(unwritable(output.given, error))
            if not troubles:
                for file in self._stale:
                    file.unlink(missing_ok=True)
        if troubles:
            raise troubles[0]

    def discard(self) -> None:
        """Remove what is temporary, and the folders that were made for nothing."""
        for output in self._outputs:
            _discard(output)


@contextmanager
def staged() -> Iterator[Staging]:
    """Outputs that take their places when the block ends well; nothing of them is left where it fails."""
    staging = Staging()
    try:
        yield staging
        with undisturbed():
            staging.commit()
            staging.discard()
    except (BonecamError, OSError) as error:
        reported = staging.told(error)
        if reported is error:
            raise
        raise reported from error
    finally:
        with undisturbed():
            staging.discard()


def _place(output: _Output) -> None:
    """Replace the files of one output, and remove the stale ones of its folder; nothing where one is not free."""
    moves = output.moves()
    for _, target in moves:
        if target.is_dir():
            what = "is a folder, and a file is to be written there: remove it or name another folder"
            raise FileError(f"{target}: {what}", file=str(target))
        if leads_out(target, output.target):
            raise FileError(f"{target}: a link leads out of the folder: remove it", file=str(target))
        own = output.replace or not os.path.lexists(target)
        if not own and not is_own(output.target, str(target.relative_to(output.target))):
            what = "exists already: name another folder, or write over it with --force"
            raise FileError(f"{target}: {what}", file=str(target))
    stale: list[Path] = []
    if output.own is not None:
        new = [str(target.relative_to(output.target)) for _, target in moves]
        stale = stale_files(output.target, output.own, new)
        listed = list_of_own(output.target, output.work, new, stale)
        (output.work / OWN_FILES).write_text(listed, encoding="utf-8")
        moves = [*moves, (output.work / OWN_FILES, output.target / OWN_FILES)]
    for work, target in moves:
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.is_file() and not target.is_symlink():
            os.chmod(work, target.stat().st_mode & PERMISSIONS)
        os.replace(work, target)
        if not any(NAME.fullmatch(folder.name) for folder in target.parents):  # no step on the way to another output
            placed.append(str(target))
    for item in stale:
        item.unlink()


def _discard(output: _Output) -> None:
    remove_temporary(output.work)
    remove_empty(output.made)


def leads_out(place: Path, folder: Path) -> bool:
    """Whether a link on the way to a place in the folder leads out of it."""
    root, inside = (Path(os.path.realpath(each)) for each in (folder, place.parent))
    return root != inside and root not in inside.parents


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove those of the folders that hold nothing."""
    for folder in folders:
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def unwritable(path: str | Path, error: OSError) -> FileError:
    """FileError of an output that cannot be written, with the remedy."""
    if isinstance(error, FileExistsError | NotADirectoryError):
        return FileError(f"{path}: is a file: name a folder", file=str(path))
    remedy = (
        "make room there or choose another folder"
        if error.errno in FULL
        else "choose a folder that exists and may be written"
    )
    return FileError(f"{path}: {error.strerror or error}: {remedy}", file=str(path))
