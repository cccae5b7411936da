"""Compiled work on all cores that this process may use; linear algebra on one."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache, wraps
from typing import ParamSpec, TypeVar

from threadpoolctl import threadpool_limits

A = TypeVar("A")
P = ParamSpec("P")


def cores() -> int:
    """How many cores this process may use."""
    tell = getattr(os, "sched_getaffinity", None)  # which macOS and Windows have not
    return len(tell(0)) if tell else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores())


def in_pieces(work: Callable[[slice], A], count: int, size: int) -> list[A]:
    """What `work` returns for each slice of `size` of `count` items, in their order, worked on in parallel.
    `work` must release the interpreter's lock, and not call this function.

    The slices are the same whatever the number of cores; without items there is one, which is empty.
    """
    pieces = [slice(first, first + size) for first in range(0, max(count, 1), size)]
    return list(_pool().map(work, pieces)) if len(pieces) > 1 else [work(piece) for piece in pieces]


def on_one_blas_thread(work: Callable[P, A]) -> Callable[P, A]:
    """A function that does `work` with one thread of the linear algebra library. On small matrices threads
    only wait for each other (a factorisation of 0.2 ms took 240 ms), and their number changes the last
    digits."""

    @wraps(work)
    def alone(*args: P.args, **keywords: P.kwargs) -> A:
        with threadpool_limits(1, user_api="blas"):
            return work(*args, **keywords)

    return alone
