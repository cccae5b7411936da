"""Compiled loops: the only door to numba. Plain arrays in, plain arrays out.

What numba has compiled is kept beside the sources, or in the user's cache. Where neither can be written, as for a
service without a home, this process keeps it in a temporary folder, and the next one compiles for as long again: the
variable NUMBA_CACHE_DIR names a folder that lasts.
"""

import hashlib
import os
import pickle
import platform
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import IndexDataCacheFile

from bonecam.runtime.own_files import folder_digest
from bonecam.runtime.staging import make_temporary

TARGET = "x86-64-v3"
"""The processor that kernels are compiled for, where the machine has what it has: what is kept serves every such
machine, and a program is the same on all of them. What a newer one could do beside made no run faster (benchmarks)."""
FEATURES = ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
"""What the target needs, as LLVM calls it."""


def _fix_target() -> str:
    """Have kernels compiled for TARGET, unless the machine has less or NUMBA_CPU_NAME names another; the one that is
    taken."""
    host = numba.core.codegen.ll.get_host_cpu_features() if platform.machine() in ("x86_64", "AMD64") else {}
    if numba.config.CPU_NAME is None and all(host.get(name) for name in FEATURES):
        numba.config.CPU_NAME, numba.config.CPU_FEATURES = TARGET, ""
    return str(numba.config.CPU_NAME or numba.core.codegen.ll.get_host_cpu_name())


def _find_room() -> None:
    """Have a place for what is compiled."""
    try:
        numba.njit(cache=True)(_find_room)  # looks for a place, and compiles nothing yet
    except RuntimeError:
        os.environ["NUMBA_CACHE_DIR"] = str(make_temporary(Path(tempfile.gettempdir())))
        numba.config.reload_config()
        _fix_target()


COMPILED_FOR = _fix_target()
"""The processor that this process compiles for."""
_find_room()

SOURCES = folder_digest(Path(__file__).parent)
"""One for the sources of all kernels together."""
CONTRACT = {"contract", "nsz"}
"""LLVM's flags of what the compiled loops may do with floating point numbers: a product and a sum may become one
operation, the sign of a zero may be lost. The order of sums stays, so a run gives the same bits again."""
CHECKSUM = hashlib.sha256().digest_size
"""Bytes of the checksum before what is kept."""


class _KeptFile(IndexDataCacheFile):  # type: ignore[misc]
    """What numba keeps of a kernel, each entry with its origin and a checksum. One that is cut off or damaged is none,
    and the kernel is compiled again; so is one of another processor, by a race in a shared folder, or of older sources
    or another numba, where a run ended between its index, which is written first, and its data."""

    def _origin(self, key: Any) -> Any:
        return self._source_stamp, self._version, key

    def save(self, key: Any, data: Any) -> None:
        super().save(key, (self._origin(key), data))

    def load(self, key: Any) -> Any:
        kept = super().load(key)
        return kept[1] if kept is not None and kept[0] == self._origin(key) else None

    def _load_index(self) -> dict[Any, str]:
        try:
            return dict(super()._load_index())
        except Exception:  # damaged pickles raise errors of any kind
            return {}

    def _save_data(self, name: str, data: Any) -> None:
        dumped = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(hashlib.sha256(dumped).digest() + dumped)

    def _load_data(self, name: str) -> Any:
        content = Path(self._data_path(name)).read_bytes()
        checksum, dumped = content[:CHECKSUM], content[CHECKSUM:]
        return pickle.loads(dumped) if hashlib.sha256(dumped).digest() == checksum else None


@contextmanager
def _where_it_can_be_kept() -> Iterator[None]:
    """Goes on without keeping a kernel where a disk is full or a folder cannot be written."""
    with suppress(OSError):
        yield


def njit(*, cache: bool = False, **options: Any) -> Callable[[Any], Any]:
    """numba's decorator, whose kept kernel is compiled again when the source of any kernel has changed: numba looks at
    the file of the kernel alone, and would go on with those of other files that it has compiled into it."""

    def decorate(function: Any) -> Any:
        kernel = numba.njit(cache=cache, **options)(function)
        if cache:
            kept = kernel._cache
            kept._cache_file = _KeptFile(kept._cache_path, kept._impl.filename_base, SOURCES)
            kept._guard_against_spurious_io_errors = _where_it_can_be_kept
        return kernel

    return decorate


inner_njit = partial(njit, cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Decorates a kernel that other kernels alone call. No entry for Python or C is compiled, which takes as long as a
short kernel itself; a call from Python would find nothing to run (`tests/test_kernels.py` looks for any)."""
