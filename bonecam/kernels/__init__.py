"""Compiled loops: the only door to numba. Plain arrays in, plain arrays out.

What numba has compiled is kept beside the sources, or in the user's cache. Where neither can be written, as for a
service without a home, this process keeps it in a temporary folder, and the next one compiles for a minute again: the
variable NUMBA_CACHE_DIR names a folder that lasts.
"""

import os
import tempfile
from functools import partial
from pathlib import Path

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

inner_njit = partial(numba.njit, cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Decorates a kernel that other kernels alone call. No entry for Python or C is compiled, which takes as long as a
short kernel itself; a call from Python would find nothing to run (`tests/test_kernels.py` looks for any)."""
