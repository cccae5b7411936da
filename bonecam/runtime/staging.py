"""Outputs are written in temporary folders on the file system where they belong, and take their places together.

A file is made beside the one it replaces, the files of a folder inside that folder: so a folder may be a mount
point, a link to another file system, or lie in a folder that cannot be written. Each file is replaced in one
step (`os.replace`), and keeps its mode. Runs that write into one folder take their turns, so that what stands
there in the end is of one run.
"""

import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bonecam.errors import BonecamError, FileError
from bonecam.runtime.locking import locked
from bonecam.runtime.own_files import OWN_FILES, is_own, list_of_own, stale_files
from bonecam.runtime.signals import undisturbed
from bonecam.runtime.temporary import is_temporary, make_temporary, remove_temporary

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
                    folders = missing_folders(target)
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
        _require_free(target, output)
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
        if not is_temporary(target):
            placed.append(str(target))
    for item in stale:
        item.unlink()


def _discard(output: _Output) -> None:
    remove_temporary(output.work)
    remove_empty(output.made)


def _require_free(place: Path, output: _Output) -> None:
    """FileError where a file of an output cannot, or may not, take its place."""
    if place.is_dir():
        raise FileError(
            f"{place}: is a folder, and a file is to be written there: remove it or name another folder",
            file=str(place),
        )
    if leads_out(place, output.target):
        raise FileError(f"{place}: a link leads out of the folder: remove it", file=str(place))
    name = str(place.relative_to(output.target))
    if not output.replace and os.path.lexists(place) and not is_own(output.target, name):
        raise FileError(f"{place}: exists already: name another folder, or write over it with --force", file=str(place))


def leads_out(place: Path, folder: Path) -> bool:
    """Whether a link on the way to a place in the folder leads out of it."""
    root, inside = (Path(os.path.realpath(each)) for each in (folder, place.parent))
    return root != inside and root not in inside.parents


def missing_folders(folder: Path) -> list[Path]:
    """What `mkdir(parents=True)` would make, the innermost first."""
    return [place for place in (folder, *folder.parents) if not place.exists()]


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
