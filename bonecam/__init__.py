"""bonecam: from a bone mesh to a verified five-axis NC program.

    import bonecam
    result = bonecam.convert("bone.stl", bonecam.Job())
    print(result.report["levels_lower_bound"], result.program.text[:80])

`machine`, `tool`, `mesh`, `surface`, `workholding`, `setup`, `levels`, `material`, `mechanics`, `planning`, `nc`,
`verify` and `report` are the stages, in the order of the flow. Names load when first used; `__init__.pyi` lists them.
Plugins add names of their own (`bonecam.plugins`).
"""

from typing import Any

import lazy_loader

__version__ = "0.1.0"

_own, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """A name of the stub, or one that a plugin adds."""
    if name not in __all__:
        from bonecam.plugins import added, added_names

        if name in added_names("names"):
            return added("names", name)
    return _own(name)
