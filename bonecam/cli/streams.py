"""Streams that the caller has closed (`>&-`) lead nowhere, as those to /dev/null."""

import os
import sys


def open_closed_streams() -> None:
    """Open the closed ones of stdin, stdout and stderr.

    Python has None for them, and the next files that a process opens would get their numbers: what a library prints
    would go into one of these.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is not None:
            continue
        nowhere = os.open(os.devnull, os.O_RDWR)
        if nowhere != number:
            os.dup2(nowhere, number)
            os.close(nowhere)
        setattr(sys, name, os.fdopen(number, mode, encoding="utf-8"))
