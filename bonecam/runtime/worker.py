"""Work in a process of its own, with limits of time and memory: for libraries that end their process, or never come
back, and for work that a stranger asks for. It ends with this process, however that ends."""

import ctypes
import errno
import math
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Event, Thread
from typing import IO, Any, NoReturn

from bonecam.errors import Cancelled
from bonecam.progress import Progress, report, silent
from bonecam.runtime.staging import kept_from_children, remove_abandoned

CHILD = "from bonecam.runtime.worker import serve; serve()"
"""Python code that the process runs."""
POLL = 0.1
"""How often it is asked whether the work is to be stopped, s."""
STDOUT, STDERR = 1, 2
"""Numbers of the process's streams (POSIX)."""


class WorkerError(Exception):
    """The process gave no answer; the message tells what it did, like "took more than 2 s"."""


def call_in_worker(
    work: str,
    *arguments: Any,
    seconds: float | None = None,
    memory: int = 0,
    progress: Progress = silent,
    heard: bool = False,
    stopped: Event | None = None,
) -> Any:
    """What the function `work`, named "module:function", returns for the arguments and a progress, in a new process.

    An error that it raises is raised here. WorkerError where the process broke down, took longer than `seconds`, or
    wanted more than `memory` bytes for its data (0: as many as there are); Cancelled once another thread has set
    `stopped`. What it prints goes to stderr where it is to be `heard`, once it has answered.
    """
    here, there = Pipe()
    process: subprocess.Popen[bytes] | None = None
    with here, tempfile.TemporaryFile() as said:
        try:
            with there, kept_from_children():
                process = _start(there, said, memory)
            with suppress(OSError):  # it is gone already: its end is told below
                here.send((work, arguments))
            answer = _answer(here, process, seconds, progress, stopped or Event())
        finally:
            if process is not None:
                process.kill()
                process.wait()
                remove_abandoned(Path(tempfile.gettempdir()))
        if heard and sys.stderr is not None:
            said.seek(0)
            sys.stderr.write(said.read().decode(errors="replace"))
    if isinstance(answer, BaseException):
        raise answer
    return answer


def _start(answer: Connection, said: IO[bytes], memory: int) -> "subprocess.Popen[bytes]":
    """The new process, with Python's path as it is here."""
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    order = (str(os.getpid()), str(memory), str(answer.fileno()))
    return subprocess.Popen(
        [sys.executable, "-P", "-c", CHILD, *order],
        env={**os.environ, "PYTHONPATH": paths},
        stdin=subprocess.DEVNULL,
        stdout=said,
        stderr=said,
        pass_fds=(answer.fileno(),),
    )


def _answer(
    here: Connection, process: "subprocess.Popen[bytes]", seconds: float | None, progress: Progress, stopped: Event
) -> Any:
    """What the process answers, an error among it; WorkerError where it does not."""
    end = math.inf if seconds is None else time.monotonic() + seconds
    while True:
        while not here.poll(max(0.0, min(POLL, end - time.monotonic()))):
            if stopped.is_set():
                raise Cancelled("stopped by the caller")
            if time.monotonic() >= end:
                raise WorkerError(f"took more than {seconds:g} s")
        try:
            done, answer = here.recv()
        except (EOFError, OSError) as error:
            raise WorkerError(f"broke down (exit {process.wait()})") from error
        if done:
            return answer
        report(progress, *answer)


def function_of(work: str) -> Callable[..., Any]:
    """The function that is named "module:function"."""
    module, _, function = work.partition(":")
    target: Callable[..., Any] = getattr(import_module(module), function)
    return target


def serve() -> None:
    """The process's main function. Its arguments are the number of its parent's process, the bytes of memory that
    its data may take, and the number of the connection over which it is told what to do, and answers."""
    parent, memory, connection = map(int, sys.argv[1:])
    end_with_parent(parent)
    with suppress(ImportError):  # Windows
        import resource

        if memory:  # of its data: address space that is only reserved, as that of threads is, does not count
            most = resource.getrlimit(resource.RLIMIT_DATA)[1]
            resource.setrlimit(resource.RLIMIT_DATA, (memory if most < 0 else min(memory, most), most))
    answer = Connection(connection)
    work, arguments = answer.recv()
    try:
        outcome = function_of(work)(*arguments, lambda *step: answer.send((False, step)))
    except Exception as error:
        error.add_note(traceback.format_exc())
        outcome = error
        unloaded = isinstance(error, ImportError) and not isinstance(error, ModuleNotFoundError)  # no room for it
        if (
            isinstance(error, MemoryError)
            or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
            or (memory and unloaded)
        ):
            outcome = WorkerError(f"wanted more than {memory / 2**30:.3g} GB of memory")
    sys.stdout.flush()
    try:
        packed = pickle.dumps((True, outcome))
    except Exception as error:
        packed = pickle.dumps((True, RuntimeError(f"{outcome!r} cannot be sent: {error}")))
    answer.send_bytes(packed)


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
