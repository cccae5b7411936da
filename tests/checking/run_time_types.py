"""Checks of arguments and results while tests run: jaxtyping has this decorate its two copies of a function's
signature, of which the first is called with the arguments, and the second with them and what the function returned."""

from collections.abc import Callable
from typing import Any

from beartype import beartype


def checked(signature: Callable[..., Any]) -> Callable[..., Any]:
    """The signature with its checks. The one with a result checks that alone: the arguments were checked before the
    call, and the sizes of their arrays stay known. (A call with two arrays costs 22 us instead of 32.)"""
    returned = signature.__annotations__.get("return", Any)
    if returned is not Any:
        signature.__annotations__ = {"return": returned}
    return beartype(signature)
