"""Whether kernels are being compiled, which the first run alone does: it takes up to a minute."""

import sys
from typing import Any


class Compiling:
    """Watches numba once it is loaded; true while it compiles a kernel, not while it loads one that is kept."""

    def __init__(self) -> None:
        self.depth = 0
        self.watches = False

    def __bool__(self) -> bool:
        if not self.watches and "numba" in sys.modules:
            self._watch()
        return self.depth > 0

    def _watch(self) -> None:
        """Count the compilations that begin and end."""
        from numba.core import event

        compiling = self

        class Listener(event.Listener):  # type: ignore[misc]
            def on_start(self, event: Any) -> None:
                compiling.depth += 1

            def on_end(self, event: Any) -> None:
                compiling.depth -= 1

        event.register("numba:compile", Listener())
        self.watches = True
