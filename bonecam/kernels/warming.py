"""The kernels of a default run, compiled on all cores before they are needed.

`first_run.txt` lists them, each with the seconds that it took to compile and the types that it is called with. Numba
compiles a kernel where it is first called, one after the other on one core; here each core has some of the modules, in
a process of its own, and all of it is kept (`bonecam.kernels`). Kernels of a module share others, which are compiled
once. `tests/kernels/test_warming.py` holds the list against what a run calls.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from threading import Event
from typing import Any

import numba
from numba import types
from numba.core.registry import CPUDispatcher

from bonecam.kernels import COMPILED_FOR, SOURCES, njit
from bonecam.progress import Progress, report
from bonecam.runtime.threads import cores
from bonecam.runtime.worker import call_in_worker

LIST = Path(__file__).with_name("first_run.txt")
EVERY = 0.5
"""Seconds between two looks at how far the processes are."""


@njit(cache=True)
def _shows_where() -> int:
    return 0


def kept_in() -> Path:
    """The folder in which what is compiled of the kernels is kept."""
    return Path(_shows_where._cache._cache_path)  # type: ignore[attr-defined]


def first_run() -> list[tuple[float, str, str]]:
    """The kernels of a default run: seconds that each takes to compile, its module and name, its arguments' types."""
    rows = (line.split(" ", 2) for line in LIST.read_text(encoding="utf-8").splitlines())
    return [(float(seconds), name, kinds) for seconds, name, kinds in rows]


def called() -> set[tuple[str, str]]:
    """The kernels that this process has called so far, as in `first_run`, without those that only kernels call."""
    found = set()
    for module in sorted(path.stem for path in LIST.parent.glob("[a-z]*.py")):
        for name, kernel in vars(import_module(f"bonecam.kernels.{module}")).items():
            own = isinstance(kernel, CPUDispatcher) and kernel.py_func.__module__ == f"bonecam.kernels.{module}"
            if own and not kernel.targetoptions.get("no_cpython_wrapper"):
                found |= {(f"{module}.{name}", ", ".join(map(_text_of, kinds))) for kinds in kernel.overloads}
    return found


def _text_of(kind: Any) -> str:
    """A type as an expression of NAMES."""
    if isinstance(kind, types.Array) and kind.layout == "C":
        return f"{'A' if kind.mutable else 'R'}({kind.dtype}, {kind.ndim})"
    if isinstance(kind, types.BaseNamedTuple):
        place = f"{kind.instance_class.__module__.rpartition('.')[2]}.{kind.instance_class.__name__}"
        return f"N({', '.join([repr(place), *map(_text_of, kind.types)])})"
    if isinstance(kind, types.BaseTuple):
        return f"T({', '.join(map(_text_of, kind.types))})"
    return f"literal({kind.literal_value})" if isinstance(kind, types.Literal) else repr(kind)


def _named(place: str, *kinds: Any) -> Any:
    module, _, name = place.partition(".")
    return types.BaseTuple.from_types(kinds, getattr(import_module(f"bonecam.kernels.{module}"), name))


NAMES = {
    **vars(types),
    "bool": types.boolean,
    "A": lambda dtype, ndim: types.Array(dtype, ndim, "C"),
    "R": lambda dtype, ndim: types.Array(dtype, ndim, "C", readonly=True),
    "T": lambda *kinds: types.BaseTuple.from_types(kinds),
    "N": _named,
}
"""What the list calls types, beside numba's own words: arrays of a type and dimension, and read-only ones; tuples, and
named ones of a module."""


def shares_of(count: int) -> list[list[tuple[str, str]]]:
    """The list, shared out by modules: the one that takes longest goes to whoever has least so far."""
    modules: dict[str, list[tuple[float, str, str]]] = {}
    for row in first_run():
        modules.setdefault(row[1].partition(".")[0], []).append(row)
    shares: list[list[tuple[float, str, str]]] = [[] for _ in range(count)]
    for rows in sorted(modules.values(), key=lambda rows: -sum(row[0] for row in rows)):
        min(shares, key=lambda share: sum(row[0] for row in share)).extend(rows)
    return [[(name, kinds) for _, name, kinds in share] for share in shares if share]


def compile_kernels(kernels: Sequence[tuple[str, str]], progress: Progress) -> None:
    """Compile and keep kernels by name and types."""
    for name, kinds in kernels:
        module, _, kernel = name.partition(".")
        getattr(import_module(f"bonecam.kernels.{module}"), kernel).compile(tuple(eval(f"[{kinds}]", NAMES)))
        report(progress, 0.0, name)


@contextmanager
def warming(progress: Progress) -> Iterator[None]:
    """A block during which the kernels of a default run are compiled, and which ends when they are; nothing is done
    where that was done before, or on one core. What a process fails to compile is compiled where it is called."""
    mark = kept_in() / f"first_run-{COMPILED_FOR}-{numba.__version__}-{SOURCES[:16]}.nbi"  # goes with what numba keeps
    if mark.is_file() or cores() < 2:
        yield
        return
    stopped, ready = Event(), []

    def one(kernels: Sequence[tuple[str, str]]) -> None:
        work = f"{__name__}:{compile_kernels.__name__}"
        call_in_worker(work, kernels, progress=lambda *step: ready.append(step), stopped=stopped)

    with ThreadPoolExecutor(cores()) as pool:
        try:
            shares = [pool.submit(one, kernels) for kernels in shares_of(cores())]
            yield
            left: Any = shares
            while left:
                report(
                    progress,
                    0.0,
                    f"compiling for {COMPILED_FOR}, the first run only: {len(ready)} of {len(first_run())} kernels",
                )
                left = wait(shares, EVERY).not_done
        except BaseException:
            stopped.set()
            raise
    if not any(share.exception() for share in shares):
        with suppress(OSError):
            mark.touch()
