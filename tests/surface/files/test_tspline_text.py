"""The text form of a row-structured T-spline."""

import numpy as np
import pytest
from tsplines import bone_like

from bonecam.errors import FileError
from bonecam.surface import load_surface, save_surface
from bonecam.surface.files.tspline_text import rows_text


def test_a_round_trip_of_rows_is_bit_equal(tmp_path):
    surface = bone_like(9, 7, 5)
    save_surface(surface, tmp_path / "a.tspline")
    again = load_surface(tmp_path / "a.tspline")
    assert again.control_points.tobytes() == surface.control_points.tobytes()
    assert again.weights.tobytes() == surface.weights.tobytes()
    assert again.tmesh.t_knots.tobytes() == surface.tmesh.t_knots.tobytes()
    assert [row.tobytes() for row in again.tmesh.s_knots] == [row.tobytes() for row in surface.tmesh.s_knots]
    assert rows_text(again) == rows_text(surface)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("#bonecam-tspline 1", "solid bone", 1),
        ("degree 3", "degree 2", 2),
        ("row 1 6", "row 2 6", 7),
        ("row 1 6", "row 1 x", 7),
        ("row 0 1\n0.0 ", "row 0 1\nnan ", 6),
        ("row 0 1\n0.0 ", "row 0 1\n0_0 ", 6),
        ("row 0 1\n0.0 ", "row 0 1\n0.0 1.0 ", 6),
        ("\nend\n", "\n", 43),
        ("\nend\n", "\nend\nrow 7 1\n", 45),
    ],
)
def test_a_broken_file_is_refused_with_its_line(tmp_path, old, new, line):
    text = rows_text(bone_like(7, 6, spread=0.0))
    assert old in text
    (tmp_path / "bad.tspline").write_text(text.replace(old, new))
    with pytest.raises(FileError) as caught:
        load_surface(tmp_path / "bad.tspline")
    assert caught.value.evidence["line"] == line


def test_decreasing_knots_and_bad_weights_are_refused(tmp_path):
    surface = bone_like(7, 6, spread=0.0)
    text = rows_text(surface)
    (tmp_path / "bad.tspline").write_text(text.replace(" 1.0\nrow 2", " -1.0\nrow 2"))
    with pytest.raises(FileError, match="weight"):
        load_surface(tmp_path / "bad.tspline")
    first, second = (repr(float(k)) for k in surface.tmesh.s_knots[1][:2])
    (tmp_path / "bad.tspline").write_text(text.replace(f"\n{second} ", f"\n{first} ", 1))
    with pytest.raises(FileError, match="row 1"):
        load_surface(tmp_path / "bad.tspline")
    with pytest.raises(FileError, match="cannot be read"):
        load_surface(tmp_path / "absent.tspline")
    assert np.isfinite(surface.control_points).all()
