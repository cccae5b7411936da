"""Damaged surface files: whatever bytes change, the reader raises a typed error or gives a surface that can
be evaluated."""

import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bonecam.errors import FileError
from bonecam.surface import TSpline, read_iga, read_tsm, write_iga, write_tsm

WORDS = (
    b"nan",
    b"inf",
    b"-1",
    b"1e308",
    b"-1e308",
    b"1e-320",
    b"0",
    b"99999999999999999999",
    b"",
    b"-5",
    b"7",
    b"0x10",
    b"\xff",
)
SIGNS = b"0123456789-. e\n"


def damaged(data: bytes, rng: random.Random) -> bytes:
    """One to five changes: a byte, a sign, a hole, something put in, a line in another's place, a word."""
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        k, kind = rng.randrange(len(data)), rng.randrange(6)
        if kind < 2:
            data = data[:k] + bytes([rng.randrange(256) if kind else rng.choice(SIGNS)]) + data[k + 1 :]
        elif kind == 2:
            data = data[:k] + data[k + rng.choice((1, 1, 5, 100)) :] or b" "
        elif kind == 3:
            data = data[:k] + bytes(rng.choice(SIGNS) for _ in range(rng.choice((1, 2, 8)))) + data[k:]
        else:
            mark = b"\n" if kind == 4 else b" "
            parts = data.split(mark)
            parts[rng.randrange(len(parts))] = rng.choice(parts) if kind == 4 else rng.choice(WORDS)
            data = mark.join(parts)
    return data


def outcome(data: bytes, path: Path, seed: int) -> bool:
    """Whether the file is read; then 20 random points with second derivatives must be finite."""
    path.write_bytes(data)
    try:
        surface: TSpline = (read_iga if path.suffix == ".iga" else read_tsm)(path)
    except FileError:
        return False
    boxes = surface.elements().boxes
    rng = np.random.default_rng(seed)
    box, u = boxes[rng.integers(0, len(boxes), 20)], rng.random((2, 20))
    found = surface.evaluate(box[:, 0] + (box[:, 1] - box[:, 0]) * u[0], box[:, 2] + (box[:, 3] - box[:, 2]) * u[1], 2)
    assert all(np.isfinite(one).all() for one in found), f"seed {seed}"
    return True


def survive(originals: list[Path], folder: Path, seeds: range) -> float:
    """The part of the damaged files that is still read."""
    read = 0
    for seed in seeds:
        original = originals[seed % len(originals)]
        read += outcome(damaged(original.read_bytes(), random.Random(seed)), folder / f"damaged{original.suffix}", seed)
    return read / len(seeds)


def test_of_a_thousand_damaged_files_none_gives_more_than_an_error_or_a_surface(
    random_tspline: Callable[..., TSpline], bone_like: Callable[..., TSpline], tmp_path: Path
) -> None:
    write_tsm(random_tspline(1), tmp_path / "a.tsm")
    write_tsm(random_tspline(2, closed=True), tmp_path / "b.tsm")
    write_tsm(bone_like(6, 5, 1), tmp_path / "c.tspline")
    write_iga(bone_like(4, 4, 1), tmp_path / "d.iga")
    originals = sorted(tmp_path.iterdir())
    assert 0.05 < survive(originals, tmp_path, range(1000)) < 0.6


@pytest.mark.slow
def test_of_a_thousand_damaged_models_none_gives_more_than_an_error_or_a_surface(shared: Path, tmp_path: Path) -> None:
    models = sorted(file for file in (shared / "tspline").glob("[ti]*/*.[ti]*") if file.suffix in (".tsm", ".iga"))
    assert len(models) == 11
    assert 0.05 < survive(models, tmp_path, range(1000)) < 0.6


@pytest.mark.parametrize(
    ("record", "match"),
    [
        ("0g 1e308 0 0 1", "size below"),
        ("0g 0 0 0 1e-320", "weight 2 is not positive"),
        ("0m gvp 99999999999999999999", "size below"),
    ],
)
def test_numbers_that_would_overflow_are_refused(
    random_tspline: Callable[..., TSpline], tmp_path: Path, record: str, match: str
) -> None:
    write_tsm(random_tspline(1), tmp_path / "a.tsm")
    lines = (tmp_path / "a.tsm").read_text().splitlines()
    kind = record.split()[0]
    places = [k for k, line in enumerate(lines) if line.startswith(f"{kind} ")]
    lines[places[2]] = record
    (tmp_path / "a.tsm").write_text("\n".join(lines))
    with pytest.raises(FileError, match=match):
        read_tsm(tmp_path / "a.tsm")
