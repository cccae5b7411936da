"""The console command `bonecam`: holds signals back at once, then imports what takes time.

Until `bonecam.cli` has its handlers Ctrl-C would print a traceback, and SIGTERM and SIGHUP would end the process
without a word. The built-in module is taken: `signal` itself imports for some ms.
"""

import _signal  # type: ignore[import-not-found]


def main() -> int:
    """Run the command line and return its exit code."""
    _signal.pthread_sigmask(_signal.SIG_BLOCK, (_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP))
    from bonecam.cli import main

    return main()
