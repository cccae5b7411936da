"""The meshes that ship with bonecam and the recipes that made them; all lengths in mm."""

from pathlib import Path as _Path


def names() -> tuple[str, ...]:
    """The shipped meshes, in alphabetical order."""
    return tuple(sorted(file.stem for file in _Path(__file__).parent.glob("*.ply")))


def path(name: str) -> _Path:
    """The PLY file of a shipped mesh. Raises ValueError where there is none of that name."""
    if name not in names():
        raise ValueError(f"no mesh {name!r} ships with bonecam: take one of {', '.join(names())}")
    return _Path(__file__).parent / f"{name}.ply"
