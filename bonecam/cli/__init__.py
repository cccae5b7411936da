"""The command line: `bonecam convert | demo | levels | batch | script | filters | job`."""

from bonecam.cli.call import main

__all__ = ["main"]
