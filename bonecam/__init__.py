"""bonecam: from a bone mesh to a verified five-axis NC program.

    import bonecam
    result = bonecam.convert("bone.stl", bonecam.Job())
    print(result.report["levels_lower_bound"], result.program.text[:80])

Public names load when first used.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "convert": "bonecam.pipeline",
    "morph_levels": "bonecam.pipeline",
    "Morphed": "bonecam.pipeline",
    "Result": "bonecam.pipeline",
    "Job": "bonecam.job",
    "read_job": "bonecam.job",
    "BonecamError": "bonecam.errors",
    "MeshSet": "bonecam.filters.meshset",
}
__all__ = ["BonecamError", "Job", "MeshSet", "Morphed", "Result", "convert", "morph_levels", "read_job"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'bonecam' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
