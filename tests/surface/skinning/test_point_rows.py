"""Rows of points from files, skinned."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from bonecam.errors import FileError
from bonecam.surface.skinning import holds_rows, read_rows


def test_rows_between_two_poles_are_skinned_to_a_closed_outward_surface(
    write_rows: Callable[..., Path], poles: ndarray, sections: Callable[..., list[ndarray]], tmp_path: Path
) -> None:
    rows = read_rows(write_rows([poles[:1], *sections(), poles[1:]], tmp_path / "rows.csv"))
    assert rows.closed
    assert rows.poles is not None
    surface = rows.skin(0.02)
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 4 * 3 * 9, rel=0.02)
    assert surface.project(np.vstack(rows.rows)).distances.max() < 0.02


@pytest.mark.parametrize("turned", [False, True])
def test_rows_that_run_the_wrong_way_or_start_anywhere_are_put_right(
    write_rows: Callable[..., Path],
    poles: ndarray,
    sections: Callable[..., list[ndarray]],
    turned: bool,
    tmp_path: Path,
) -> None:
    straight = read_rows(write_rows([poles[:1], *sections(), poles[1:]], tmp_path / "straight.csv"))
    rng = np.random.default_rng(3)
    mixed = [np.roll(row, rng.integers(len(row)) if k else 0, axis=0) for k, row in enumerate(sections())]
    mixed = [np.roll(row[::-1], 1, axis=0) for row in mixed] if turned else mixed
    found = read_rows(write_rows([poles[:1], *mixed, poles[1:]], tmp_path / "mixed.csv"))
    for row, expected in zip(found.rows, straight.rows):
        np.testing.assert_allclose(row, expected, rtol=0, atol=1e-12)


def test_rows_that_end_where_they_began_are_closed_and_others_open(
    write_rows: Callable[..., Path], sections: Callable[..., list[ndarray]], tmp_path: Path
) -> None:
    looped = read_rows(write_rows([np.vstack([row, row[:1]]) for row in sections()], tmp_path / "looped.txt"))
    assert looped.closed
    assert looped.poles is None
    assert [len(row) for row in looped.rows] == [len(row) for row in sections()]
    open_rows = read_rows(write_rows([row[:12] for row in sections()], tmp_path / "blade.txt"))
    assert not open_rows.closed
    assert np.diff(open_rows.skin(0.05).domain).tolist() == [[1.0], [1.0]]


def test_the_sections_of_the_measuring_data_are_open_rows(shared: Path, tmp_path: Path) -> None:
    files = [shared / "tspline" / "skinning_sections" / f"door{k}.txt" for k in range(1, 11)]
    (tmp_path / "door.txt").write_text("\n".join(file.read_text() for file in files))
    rows = read_rows(tmp_path / "door.txt")
    assert [len(row) for row in rows.rows[:2]] == [6, 5]
    assert not rows.closed


def test_a_file_holds_rows_or_one_cloud(
    write_rows: Callable[..., Path], sections: Callable[..., list[ndarray]], tmp_path: Path
) -> None:
    assert holds_rows(write_rows(sections(), tmp_path / "rows.xyz"))
    assert not holds_rows(write_rows(sections()[:1], tmp_path / "cloud.xyz"))
    assert not holds_rows(tmp_path / "part.stl")


def test_another_unit_scales_rows_and_poles(
    write_rows: Callable[..., Path], poles: ndarray, sections: Callable[..., list[ndarray]], tmp_path: Path
) -> None:
    rows = read_rows(write_rows([poles[:1], *sections(), poles[1:]], tmp_path / "rows.csv")).scaled(1000.0)
    assert rows.poles is not None
    np.testing.assert_array_equal(rows.poles, poles * 1000)
    assert np.vstack(rows.rows)[:, 0].max() > 3900


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("one.csv", "holds one block of 24 points: give two rows or more"),
        ("poles.csv", "has no row between its poles"),
        ("between.csv", "has one row only between its poles"),
        ("pole.csv", "has one pole only"),
        ("short.csv", "row 1 has 3 points"),
        ("twice.csv", "row 1: points 1 and the next coincide"),
    ],
)
def test_bad_rows_are_refused_in_one_line_that_names_the_row(
    sections: Callable[..., list[ndarray]],
    poles: ndarray,
    write_rows: Callable[..., Path],
    name: str,
    reason: str,
    tmp_path: Path,
) -> None:
    rows = sections()
    blocks = {
        "one.csv": rows[:1],
        "poles.csv": [poles[:1], poles[1:]],
        "between.csv": [poles[:1], rows[0], poles[1:]],
        "pole.csv": [poles[:1], *rows],
        "short.csv": [rows[0], rows[1][:3]],
        "twice.csv": [rows[0], rows[1][[0, 1, 1, 2, 3]]],
    }
    with pytest.raises(FileError, match=name) as caught:
        read_rows(write_rows(blocks[name], tmp_path / name))
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
