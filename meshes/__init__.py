"""The meshes that ship with bonecam and the recipes that made them; all lengths in mm."""

from pathlib import Path as _Path


def names() -> tuple[str, ...]:
    """The shipped meshes, in alphabetical order."""
    return tuple(sorted(file.stem for file in _files()))


def path(name: str) -> _Path:
    """The file of a shipped mesh (PLY) or of shipped rows of points (text). Raises ValueError where there is none of
    that name."""
    if name not in names():
        raise ValueError(f"no mesh {name!r} ships with bonecam: take one of {', '.join(names())}")
    return next(file for file in _files() if file.stem == name)


def job(name: str) -> _Path:
    """The job file (TOML) that goes with a shipped part. Raises ValueError where there is none of that name."""
    file = _Path(__file__).parent / f"{name}.toml"
    if not file.exists():
        raise ValueError(f"no job {name!r} ships with bonecam: take impeller")
    return file


def _files() -> list[_Path]:
    """The shipped files."""
    return [file for file in _Path(__file__).parent.iterdir() if file.suffix in (".ply", ".txt")]
