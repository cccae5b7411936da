"""Output files are written whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bonecam.errors import FileError


def write_whole(path: str | Path, text: str) -> None:
    """Write `text` (UTF-8) to `path` in one step; FileError names the file and the reason."""
    target = Path(path)
    try:
        with tempfile.NamedTemporaryFile(
            "w", dir=target.parent, prefix=f".{target.name}.", encoding="utf-8", newline="", delete=False
        ) as file:
            file.write(text)
        os.chmod(file.name, 0o644)
        os.replace(file.name, target)
    except OSError as error:
        raise FileError(f"{target}: {error.strerror}: choose a folder that exists and may be written", file=str(target)) from error


@contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """A temporary folder whose files move into `path` when the block ends well; nothing is left where it fails."""
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}."))
    except OSError as error:
        raise FileError(f"{target}: {error.strerror}: choose a folder that may be written", file=str(target)) from error
    try:
        yield work
        target.mkdir(exist_ok=True)
        for item in sorted(work.iterdir()):
            os.replace(item, target / item.name)
    except FileExistsError as error:
        raise FileError(f"{target}: is a file: name a folder", file=str(target)) from error
    finally:
        shutil.rmtree(work, ignore_errors=True)
