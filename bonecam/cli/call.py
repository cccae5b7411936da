"""One call of the command line: parse, run, and turn errors into one line on stderr and an exit code.

Exit codes: 0 done; 1 some part of a batch failed; 2 wrong input, job or call; 130 stopped by Ctrl-C.
"""

import os
import signal
import sys
from collections.abc import Sequence

from bonecam.cli.arguments import make_parser
from bonecam.errors import BonecamError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    parser = make_parser()
    options, unknown = parser.parse_known_args(arguments)
    if unknown:
        options.refuse_unknown(unknown)
    if options.run is None:
        parser.print_help()
        return 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # SIGTERM cleans up like Ctrl-C
    try:
        code = int(options.run(options))
        sys.stdout.flush()
        return code
    except BonecamError as error:
        print(f"bonecam: {' '.join(str(error).splitlines())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"bonecam: stopped; {options.stopped}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of the output has closed it, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
