"""Checks of arguments and results while tests run: types by beartype, shapes of arrays by jaxtyping.

jaxtyping's import hook puts its own decorator before each function. That one binds the arguments of every call to the
signature, and compiles two checks of each function as it is imported; here one check is compiled at the first call, and
the sizes of a call's arrays are known from its arguments to its result.

Whether a value fits depends on its type, and of an array on its data type and shape. So a call whose arguments and
result are of kinds that were found to fit together before is not checked again (`_kind`).
"""

import dataclasses
import inspect
import threading
from collections.abc import Callable, Collection, Hashable, Sequence
from functools import cache, cached_property, wraps
from typing import Any, get_type_hints

import jaxtyping
import numpy as np
from beartype import BeartypeConf, beartype
from beartype.door import is_bearable
from jaxtyping import install_import_hook

CONF = BeartypeConf(violation_type=TypeError)
BY_SIGNATURE = jaxtyping.jaxtyped
SIZES = BY_SIGNATURE("context")
"""While it is entered, each letter of an annotation is one size."""


def check_stages(modules: Sequence[str]) -> None:
    """Check all functions and dataclasses of these modules, which are imported later."""
    jaxtyping.jaxtyped = lambda typechecker: checked
    install_import_hook(modules, "beartype.beartype")


class Checks:
    """What the functions of one piece of code share: an inner function is made anew in each call of its outer one."""

    def __init__(self, item: Callable[..., Any]) -> None:
        self.annotations = {name: _resolved(kind, item) for name, kind in item.__annotations__.items()}
        self.literal = "Literal[" in repr(self.annotations)
        self.fitting: dict[Hashable, set[Hashable]] = {}
        """Kinds of results by the kinds of arguments that they were found to fit."""
        self._called = threading.local()
        self._item = item  # and its code with it

    def call(self, item: Callable[..., Any], given: tuple[Any, ...], named: dict[str, Any]) -> Any:
        """The result of a function of this code, checked like its arguments."""
        self._called.item = item
        with SIZES:
            return self._compiled(*given, **named)

    @cached_property
    def _compiled(self) -> Callable[..., Any]:
        @wraps(self._item)
        def run(*given: Any, **named: Any) -> Any:
            return self._called.item(*given, **named)

        run.__annotations__ = self.annotations
        return beartype(run, conf=CONF)


CHECKS: dict[int, Checks] = {}
"""By the identity of their code, which they keep: dataclasses of the same names of fields have equal code."""


def checked(item: Any) -> Any:
    """A function with its checks; a class whose `__init__` is checked if it is a dataclass."""
    if inspect.isclass(item):
        if dataclasses.is_dataclass(item) and "__init__" in vars(item):
            item.__init__ = checked(item.__init__)
        return item
    if inspect.isgeneratorfunction(item):  # it runs when its call, and what is known of sizes, is over
        return BY_SIGNATURE(item, typechecker=beartype(conf=CONF))
    checks = CHECKS.get(id(item.__code__))
    if checks is None:
        checks = CHECKS[id(item.__code__)] = Checks(item)
    item.__annotations__ = checks.annotations

    @wraps(item)
    def call(*given: Any, **named: Any) -> Any:
        kinds = (len(given), *map(_kind, given), *named, *map(_kind, named.values()))
        results = checks.fitting.get(kinds)
        if results is None:
            result = checks.call(item, given, named)
            kind = None if None in kinds else _kind(result)
            if kind is not None and not checks.literal:
                checks.fitting[kinds] = {kind}
            return result
        result = item(*given, **named)
        kind = _kind(result)
        if kind is None or kind not in results:
            _check(result, item, inspect.signature(item).bind(*given, **named))
            if kind is not None:
                results.add(kind)
        return result

    return call


@cache
def _has_contents(kind: type) -> bool:
    """Whether values of this type fit by what they hold, or are themselves: collections, classes."""
    return issubclass(kind, Collection | type) and not issubclass(kind, str | np.ndarray)


def _kind(value: Any) -> Hashable:
    """What two values share that fit the same annotations; None where more than that decides."""
    kind = type(value)
    if kind is np.ndarray:
        return value.dtype.str, value.shape
    if kind is tuple:
        kinds = tuple(map(_kind, value))
        return None if None in kinds else kinds
    return None if _has_contents(kind) else kind


def _check(result: Any, function: Callable[..., Any], given: inspect.BoundArguments) -> None:
    """TypeError where a result does not fit, its sizes being those of the arguments, which fit."""
    annotations = function.__annotations__
    with SIZES:
        for name, value in given.arguments.items():
            kind = given.signature.parameters[name].kind
            each = value if kind is kind.VAR_POSITIONAL else value.values() if kind is kind.VAR_KEYWORD else (value,)
            for one in each if name in annotations else ():
                assert is_bearable(one, annotations[name], conf=CONF)
        if not is_bearable(result, annotations.get("return", Any), conf=CONF):
            raise TypeError(f"{function.__qualname__}() returns {result!r}: not {annotations['return']}")


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
