"""Work on a file in a process of its own, for libraries that end their process on damaged files."""

import os
import subprocess
import sys
from importlib import import_module

from bonecam.errors import FileError
from bonecam.runtime.parent import end_with_parent

REFUSED = 2
"""Exit code of the child where it raised FileError, whose message is the last line of its stderr."""
STDOUT, STDERR = 1, 2
"""Numbers of the child's streams (POSIX)."""
CHILD = "from bonecam.mesh.files.child import serve; serve()"
"""Python code that the child runs."""


def call_in_child(
    work: str,
    file: str,
    *words: str,
    library: str,
    remedy: str,
    seconds: float | None = None,
    memory: int = 0,
) -> bytes:
    """What a function, named "module:function", returns for `file` and `words` in a process of its own, which
    ends with this one.

    FileError where the function raised one, or the process broke down, took longer than `seconds`, or wanted
    more than `memory` bytes (0: as many as there are); `library` is whose fault that is.
    """
    paths = os.pathsep.join(path for path in sys.path if path)
    try:
        done = subprocess.run(
            [sys.executable, "-c", CHILD, str(os.getpid()), str(memory), work, file, *words],
            env={**os.environ, "PYTHONPATH": paths},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=seconds,
        )
    except subprocess.TimeoutExpired as error:
        raise FileError(
            f"{file}: {library} took more than {seconds:.0f} s for it: {remedy}", file=file
        ) from error
    if done.returncode == REFUSED:
        raise FileError(done.stderr.decode(errors="replace").strip().splitlines()[-1], file=file)
    if done.returncode or not done.stdout:
        what = f"{library} broke down on it (exit {done.returncode}): it is damaged"
        raise FileError(f"{file}: {what}: {remedy}", file=file)
    return done.stdout


def serve() -> None:
    """The child's main function. Its arguments are the number of its parent's process, the bytes of memory it
    may have, a "module:function" and what that is called with.

    What the function returns goes to stdout, the message of a FileError to stderr, as does what the library
    prints.
    """
    _, parent, memory, work, *words = sys.argv
    end_with_parent(int(parent))
    if int(memory):
        _limit_memory(int(memory))
    answer = os.dup(STDOUT)
    os.dup2(STDERR, STDOUT)
    module, _, function = work.partition(":")
    try:
        found = getattr(import_module(module), function)(*words)
    except FileError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(REFUSED)
    with open(answer, "wb") as pipe:
        pipe.write(found)


def _limit_memory(size: int) -> None:
    """Limit the address space where the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (size if most < 0 else min(size, most), most))
