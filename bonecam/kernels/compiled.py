"""Options of kernels that numba compiles: those that Python calls are `njit` themselves."""

from functools import partial

from numba import njit

inner = partial(njit, cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""Decorates a kernel that other kernels alone call. No entry for Python or C is compiled, which takes as long as a
short kernel itself; a call from Python would find nothing to run (`tests/test_kernels.py` looks for any)."""
