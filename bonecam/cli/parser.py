"""The parser of the command line: a wrong call is one line, with the nearest word that is known."""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from bonecam.errors import did_you_mean
from bonecam.text.faults import in_one_line


class Parser(argparse.ArgumentParser):
    """A parser that answers a wrong call with one line and exit code 2."""

    def error(self, message: str) -> NoReturn:
        """End with one line on stderr and exit code 2."""
        self.exit(2, f"{self.prog}: {in_one_line(message)}: see {self.prog} --help\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        """argparse's printing of helps and versions, but with an OSError where standard output takes nothing."""
        if file is not sys.stdout:
            return super()._print_message(message, file)
        file.write(message)
        file.flush()

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """argparse's check of a choice, with the nearest one in the message."""
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            close = did_you_mean(str(value), known)
            raise argparse.ArgumentError(action, f"{value!r} is unknown{close}: use one of {', '.join(known)}")

    def refuse_unknown(self, arguments: Sequence[str]) -> NoReturn:
        """End with one line that names the arguments that this command does not know."""
        close = did_you_mean(arguments[0].partition("=")[0], self._option_string_actions)
        self.error(f"unrecognized arguments: {' '.join(arguments)}{close}")


def positive(most: float = math.inf) -> Callable[[str], float]:
    """argparse's type of a finite number above 0, at most `most`; its message has the name of the function."""

    def number(text: str) -> float:
        value = float(text)
        if not (0 < value <= most and math.isfinite(value)):
            raise ValueError(text)
        return value

    number.__name__ = f"number above 0{'' if most == math.inf else f', at most {most:,.0f},'}"
    return number


def share_of(text: str) -> tuple[int, int]:
    """argparse's type of a share K/N, K from 1 to N."""
    number, slash, count = text.partition("/")
    if not slash or not 1 <= int(number) <= int(count):
        raise argparse.ArgumentTypeError(f"{text!r}: give K/N, K from 1 to N, like 3/30")
    return int(number), int(count)
