"""One call of the command line: parse, run, and turn errors into one line on stderr and an exit code.

Exit codes: 0 done; 1 some part of a batch failed; 2 wrong input, job or call; 129, 130, 143 stopped by SIGHUP,
SIGINT (Ctrl-C), SIGTERM.
"""

import os
import sys
from collections.abc import Sequence

from bonecam.cli.arguments import make_parser
from bonecam.cli.stopping import arrived, tell
from bonecam.errors import BonecamError
from bonecam.runtime.staging import placed
from bonecam.text.numbers import in_one_line

STOPPED = 130
"""Exit code after Ctrl-C: 128 and the number of the signal, as shells have it."""


def call(arguments: Sequence[str]) -> int:
    """Run the command with these arguments; its exit code. `help COMMAND` is `COMMAND --help`."""
    try:
        return _run(arguments)
    except BrokenPipeError:  # the reader of the output has closed it, as `head` does
        _mute()
        return 0
    except OSError:
        trouble = _trouble_of_stdout()
        if trouble is None:
            raise
        print(f"bonecam: standard output: {trouble}: write it elsewhere", file=sys.stderr)
        return 2


def _run(arguments: Sequence[str]) -> int:
    """Parse and run; OSError where standard output takes nothing."""
    parser = make_parser()
    if arguments and arguments[0] == "help":
        arguments = [*arguments[1:], "--help"]
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        options.refuse_unknown(unknown)
    if options.run is None:
        parser.print_help()
        return 0
    before = len(placed)
    try:
        code = int(options.run(options))
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except (Exception, KeyboardInterrupt) as error:
        if isinstance(error, KeyboardInterrupt) or arrived:
            tell(options.stopped if len(placed) == before else options.stopped_late)
            return STOPPED
        if not isinstance(error, BonecamError):
            raise
        print(f"bonecam: {in_one_line(str(error))}", file=sys.stderr)
        return 2
    if arrived:
        tell(options.stopped_late)
    return code


def _trouble_of_stdout() -> str | None:
    """Why nothing can be printed, if so: a full disk for instance. What is printed later goes nowhere then."""
    try:
        print(flush=True)
    except OSError as error:
        _mute()
        return error.strerror or str(error)
    return None


def _mute() -> None:
    """What is printed from now on, and what waits to be, goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
