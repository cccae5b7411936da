"""The command line: `bonecam convert | demo | levels | batch | script | filters | job`."""

import _signal  # type: ignore[import-not-found]  # built in: `signal` imports for some ms
import gc
from collections.abc import Sequence

COLLECT_AFTER = 50_000
"""New objects before Python looks for cycles among them (700 by default): compiling the kernels makes millions that
stay, and takes a tenth less time."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Without arguments those of the process are taken, and the process is the command's: SIGINT, SIGTERM and
    SIGHUP stop it with one line and the exit code 130, 143 or 129, while modules are imported too.
    """
    if arguments is None:
        # until the handlers are here Ctrl-C would be a traceback, and the others an end without a word
        if hasattr(_signal, "pthread_sigmask"):  # Windows has none
            _signal.pthread_sigmask(_signal.SIG_BLOCK, (_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP))
        from bonecam.cli.stopping import open_closed_streams, run_stoppable

        open_closed_streams()
        gc.set_threshold(COLLECT_AFTER)
        return run_stoppable(_call)
    return _call(arguments)


def _call(arguments: Sequence[str]) -> int:
    """`call`, whose modules take a while to import."""
    from bonecam.cli.parser import call

    return call(arguments)


__all__ = ["main"]
