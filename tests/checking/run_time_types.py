"""Checks of arguments and results while tests run: types by beartype, shapes of arrays by jaxtyping.

jaxtyping's import hook puts its own decorator before each function. That one binds the arguments of every call to the
signature, and compiles two checks of each function as it is imported; here one check is compiled at the first call, and
the sizes of a call's arrays are known from its arguments to its result.
"""

import dataclasses
import inspect
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, get_type_hints

import jaxtyping
from beartype import BeartypeConf, beartype
from jaxtyping import install_import_hook

CONF = BeartypeConf(violation_type=TypeError)
BY_SIGNATURE = jaxtyping.jaxtyped
SIZES = BY_SIGNATURE("context")
"""While it is entered, each letter of an annotation is one size."""


def check_stages(modules: Sequence[str]) -> None:
    """Check all functions and dataclasses of these modules, which are imported later."""
    jaxtyping.jaxtyped = lambda typechecker: checked
    install_import_hook(modules, "beartype.beartype")


def checked(item: Any) -> Any:
    """A function with its checks; a class whose `__init__` is checked if it is a dataclass."""
    if inspect.isclass(item):
        if dataclasses.is_dataclass(item) and "__init__" in vars(item):
            item.__init__ = checked(item.__init__)
        return item
    if inspect.isgeneratorfunction(item):  # it runs when its call, and what is known of sizes, is over
        return BY_SIGNATURE(item, typechecker=beartype(conf=CONF))
    item.__annotations__ = {name: _resolved(kind, item) for name, kind in item.__annotations__.items()}
    compiled: list[Callable[..., Any]] = []

    @wraps(item)
    def call(*given: Any, **named: Any) -> Any:
        if not compiled:
            compiled.append(beartype(item, conf=CONF))
        with SIZES:
            return compiled[0](*given, **named)

    return call


def _resolved(kind: Any, function: Callable[..., Any]) -> Any:
    """An annotation whose texts are what they name; Any where that is not known yet, as in a class of itself."""
    if isinstance(kind, type):
        return kind

    def one(value: Any) -> None: ...

    one.__annotations__ = {"value": kind}
    try:
        return get_type_hints(one, function.__globals__, include_extras=True)["value"]
    except Exception:
        return Any
