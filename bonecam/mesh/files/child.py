"""Work on a file in a process of its own, for libraries that end their process on damaged files."""

from typing import Any

from bonecam.errors import FileError
from bonecam.runtime.worker import WorkerError, call_in_worker


def call_in_child(
    work: str, file: str, *words: Any, library: str, remedy: str, seconds: float | None = None, memory: int = 0
) -> Any:
    """What a function, named "module:function", returns for `file`, `words` and a progress in a process of its own.

    FileError where the function raised one, or the process broke down, took longer than `seconds`, or wanted
    more than `memory` bytes (0: as many as there are); `library` is whose fault that is.
    """
    try:
        return call_in_worker(work, file, *words, seconds=seconds, memory=memory)
    except WorkerError as error:
        raise FileError(f"{file}: {library} {error}: {remedy}", file=file) from error
