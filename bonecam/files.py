"""Files in and out: special files are refused before they are opened; output files are written whole or not at
all, and what cannot be written is refused before the work."""

import errno
import os
import re
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bonecam.errors import FileError
from bonecam.runtime.staging import FULL, staged, temporary_folder, unwritable

LARGEST_INPUT = 2**30
"""Most bytes of a file that is read: what is larger does not fit into 2 GB of memory with what is made of it."""
SPECIAL = {
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFDIR: "a folder",
}
"""Kinds of files that are never opened."""
PROBE = bytes(4096)
"""What is written to see whether a folder takes files: one block."""


def input_bytes(path: str | Path) -> bytes:
    """The bytes of a regular file. Every input file is read here.

    OSError where it cannot be read; its strerror says so too of a folder, a pipe, a socket or a device, which
    are not opened (a pipe would wait for ever, /dev/zero never ends), and of a file above LARGEST_INPUT.
    """
    status = os.stat(path)
    if not stat.S_ISREG(status.st_mode):
        kind = SPECIAL.get(stat.S_IFMT(status.st_mode), "no regular file")
        raise OSError(errno.EINVAL, f"it is {kind}", str(path))
    if status.st_size > LARGEST_INPUT:
        size = f"it has {status.st_size / 2**30:.1f} GiB, {LARGEST_INPUT / 2**30:.0f} are allowed"
        raise OSError(errno.EFBIG, size, str(path))
    with open(path, "rb") as file:
        return file.read(status.st_size)


def input_text(path: str | Path) -> str:
    """The text of a regular file in UTF-8, with or without its mark, line ends made LF. OSError as
    `input_bytes`, UnicodeDecodeError where it is no text."""
    text = input_bytes(path).decode("utf-8-sig")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def required_text(path: str | Path, what: str) -> str:
    """`input_text` of a file that must be `what` ("an NC program"); FileError where it cannot be read."""
    try:
        return input_text(path)
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "it is no text"
        raise FileError(f"{path}: cannot be read ({why}): give {what}", file=str(path)) from error


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A name to write to, in a temporary folder beside `path`; the file moves there when the block ends well.

    A link is followed: what it leads to is written. FileError names the file and the reason.
    """
    with staged() as staging:
        yield staging.file(path)


def write_whole(path: str | Path, text: str) -> None:
    """Write `text` (UTF-8, names of files that are not by their bytes) to `path` in one step; FileError names the file
    and the reason."""
    with staged() as staging:
        staging.write(path, text)


@contextmanager
def whole_folder(path: str | Path, own: str | None = None, *, replace: bool = True) -> Iterator[Path]:
    """A temporary folder whose files move into `path` when the block ends well; nothing is left where it
    fails.

    Where `own` (a regular expression) is given, files that an earlier run wrote there, unchanged since, and
    whose whole names match it, go where no new one takes their place. Without `replace`, FileError where a file
    would be written over that no earlier run wrote.
    """
    with staged() as staging:
        yield staging.folder(path, own, replace)


def second_file(file: str | Path, mark: str = ".") -> Path:
    """The file of the second clamping beside that of the first: bone.second.h beside bone.h; another `mark` than the
    point where a control takes none in names."""
    path = Path(file)
    return path.with_name(f"{path.stem}{mark}second{path.suffix}")


def require_room(path: Path) -> None:
    """OSError where not one block more fits behind a file. MeshLab does not notice a full disk where only the
    last bytes are lost (measured: up to 33 of an STL)."""
    size = path.stat().st_size
    with open(path, "ab") as file:
        file.write(PROBE)
        file.flush()
        file.truncate(size)


def require_name(path: object) -> None:
    """TypeError where a value is no name of a file; FileError where no file can have the name."""
    if not isinstance(path, str | os.PathLike):
        raise TypeError(f"{path!r} is of type {type(path).__name__}: give the name of a file as text or a Path")
    name = os.fspath(path)
    if not isinstance(name, str):
        raise TypeError(f"{name!r} are bytes: give the name of a file as text or a Path")
    try:
        possible = b"\0" not in os.fsencode(name)
    except UnicodeEncodeError:
        possible = False
    if not possible:
        raise FileError(f"{name!a}: is no name that a file can have: choose another", file=ascii(name))


@contextmanager
def library_name(file: str | Path) -> Iterator[str]:
    """The name of a file or folder for libraries, which take names in UTF-8 only: where its own has other bytes, that
    of a link to it."""
    if is_unicode(str(file)):
        yield str(file)
        return
    with temporary_folder() as folder:
        link = folder / in_unicode(Path(file).name)
        link.symlink_to(Path(file).absolute())
        yield str(link)


def in_unicode(name: str) -> str:
    """The name with the replacement character for bytes that are not UTF-8."""
    return os.fsencode(name).decode("utf-8", "replace")


def is_unicode(text: str) -> bool:
    """Whether a text can be written as UTF-8: a name of a file with other bytes cannot."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def check_files(outputs: Iterable[str | Path | None], inputs: Iterable[object] = ()) -> None:
    """FileError, before any work is done for them, where a file cannot be written, is named twice, or would
    overwrite an input. Inputs that are no names of files are passed over, and outputs that are None."""
    read = "is read as well, and would be overwritten: choose another name"
    named = {os.path.realpath(path): read for path in inputs if isinstance(path, str | Path)}
    for path in outputs:
        if path is None:
            continue
        require_name(path)
        place = os.path.realpath(path)
        trouble = named.get(place) or _trouble_of(path, Path(place))
        if trouble:
            raise FileError(f"{path}: {trouble}", file=str(path))
        named[place] = "is named for two outputs: choose another name"
        _probe(path, Path(place).parent)


def check_folder(path: str | Path) -> None:
    """FileError, before any work is done for it, where a folder cannot be made or written to."""
    require_name(path)
    if not str(path).strip():
        raise FileError("'': is an empty name: name a folder", file=str(path))
    target = Path(os.path.realpath(path))
    try:
        place = next(place for place in (target, *target.parents) if place.exists())
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: name another folder", file=str(path)) from error
    if not place.is_dir():
        what = "" if place == target else f"{place} "
        raise FileError(f"{path}: {what}is a file: name a folder", file=str(path))
    _probe(path, place)


def _trouble_of(path: str | Path, target: Path) -> str | None:
    """Why no file can be written to `target`, which is where `path` leads, and the remedy."""
    try:
        kinds = {
            "is an empty name: name a file": not str(path).strip(),
            "is a folder: name a file in it": target.is_dir(),
            f"its folder {target.parent} does not exist: make it first": not target.parent.exists(),
            f"{target.parent} is a file: name a folder": target.parent.is_file(),
            "is no regular file: choose another name": Path(path).exists() and not Path(path).is_file(),
            "is write-protected: choose another name, or let it be written (chmod u+w)": (
                target.is_file() and not target.stat().st_mode & 0o222
            ),
            "is a mount point, which no new file can replace: mount its folder, or name another file": (
                target.is_file() and is_mounted(target)
            ),
        }
    except OSError as error:
        return f"{error.strerror}: choose another name"
    return next((what for what, applies in kinds.items() if applies), None)


def is_mounted(file: Path) -> bool:
    """Whether a file is mounted over another (`mount --bind`, a single file of a container): it cannot be replaced.

    False where the system does not tell (it is no Linux).
    """
    try:
        return _mount(file) != _mount(file.parent)
    except (OSError, AttributeError):
        return False


def _mount(place: Path) -> str:
    """The number of the mount that a file or folder is on, as Linux tells it."""
    handle = os.open(place, os.O_PATH)
    try:
        return re.findall(r"^mnt_id:.*$", Path(f"/proc/self/fdinfo/{handle}").read_text(), re.MULTILINE)[0]
    finally:
        os.close(handle)


def _probe(path: str | Path, folder: Path) -> None:
    """FileError where no file can be written in the folder. Temporary files of killed runs there are removed."""
    try:
        with temporary_folder(folder) as work:
            (work / "probe").write_bytes(PROBE)
    except OSError as error:
        if error.errno in FULL:
            raise unwritable(path, error) from error
        what = f"no file can be made in {folder} ({error.strerror or error})"
        raise FileError(f"{path}: {what}: choose a folder that may be written", file=str(path)) from error
