"""Loading of libraries whose code must not be loaded by a thread that ends before the process does.

pymeshlab and open3d together, both loaded by threads that have ended, leave a free chunk of these threads' memory
overwritten when their libraries are closed: the process ends with SIGABRT (exit code 134; glibc prints
"malloc_consolidate(): unaligned fastbin chunk detected"). Loaded by the main thread, or by a thread that is alive at
the end, they do not.
"""

from collections.abc import Callable
from concurrent.futures import Future
from functools import cache, wraps
from threading import Event, Thread, current_thread, main_thread
from typing import TypeVar

A = TypeVar("A")


def loaded_once(load: Callable[[], A]) -> Callable[[], A]:
    """A function that loads a library, called once: by the main thread, or by one that then sleeps as long as the
    process lives. What it raises is raised, and it is called again the next time."""

    @cache
    @wraps(load)
    def loaded() -> A:
        if current_thread() is main_thread():
            return load()
        outcome: Future[A] = Future()
        asked = [(load, outcome)]
        Thread(target=_load_and_sleep, args=(asked,), name="bonecam libraries", daemon=True).start()
        return outcome.result()

    return loaded


def _load_and_sleep(asked: list[tuple[Callable[[], A], "Future[A]"]]) -> None:
    """Load what is asked, and sleep without holding on to it: what a module keeps can be freed at the end."""
    load, outcome = asked.pop()
    try:
        outcome.set_result(load())
    except BaseException as error:  # told to the thread that asked
        outcome.set_exception(error)
        return
    del load, outcome
    Event().wait()
