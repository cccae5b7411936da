"""`python -m bonecam`: the command line."""

import sys

from bonecam.cli import main

sys.exit(main())
