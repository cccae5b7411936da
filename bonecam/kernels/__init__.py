"""Compiled loops: the only door to numba. Plain arrays in, plain arrays out.

What numba has compiled is kept beside the sources, or in the user's cache. Where neither can be written, as for a
service without a home, this process keeps it in a temporary folder, and the next one compiles for as long again: the
variable NUMBA_CACHE_DIR names a folder that lasts.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numba

from bonecam.runtime.temporary import make_temporary


def _find_room() -> None:
    """Have a place for what is compiled."""
    try:
        numba.njit(cache=True)(_find_room)  # looks for a place, and compiles nothing yet
    except RuntimeError:
        os.environ["NUMBA_CACHE_DIR"] = str(make_temporary(Path(tempfile.gettempdir())))
        numba.config.reload_config()


_find_room()


def _digest_of_sources() -> str:
    """One for the sources of all kernels together."""
    sources = sorted(Path(__file__).parent.rglob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()


SOURCES = _digest_of_sources()


def njit(*, cache: bool = False, **options: Any) -> Callable[[Any], Any]:
    """numba's decorator, whose kept kernel is compiled again when the source of any kernel has changed: numba looks at
    the file of the kernel alone, and would go on with those of other files that it has compiled into it."""

    def decorate(function: Any) -> Any:
        kernel = numba.njit(cache=cache, **options)(function)
        if cache:
            kernel._cache._cache_file._source_stamp = SOURCES
        return kernel

    return decorate


inner_njit = partial(njit, cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Decorates a kernel that other kernels alone call. No entry for Python or C is compiled, which takes as long as a
short kernel itself; a call from Python would find nothing to run (`tests/test_kernels.py` looks for any)."""
