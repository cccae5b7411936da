"""Control points of skinned T-splines against the published counts.

Yang & Zheng, "Approximate T-spline surface skinning", Computer-Aided Design 44(12), 2012, skin four bodies. The
sections are those of github.com/aijm/TSpline; the tolerance is a share of the diagonal of their bounding box.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from bonecam.surface.skinning import RowCurves, row_parameters, skin

PUBLISHED = [
    ("bonnet", 1e-3, 175),
    ("bonnet", 1e-2, 78),
    ("door", 1e-3, 50),
    ("ring", 1e-3, 45),
    ("helicoidal", 1e-3, 55),
]
"""Body, tolerance in diagonals, control points of the published T-spline: none may need more."""


def sections(shared: Path, name: str) -> list[ndarray]:
    """The rows of points of a body, in order."""
    folder = shared / "tspline" / "skinning_sections"
    files = sorted(folder.glob(f"{name}[0-9]*.txt"), key=lambda file: int(file.stem.removeprefix(name)))
    if not files:
        pytest.skip(f"no sections {name}*.txt in {folder}")
    return [np.loadtxt(file, skiprows=1) for file in files]


@pytest.mark.parametrize(("name", "share", "count"), PUBLISHED)
def test_published_counts_are_not_exceeded_at_the_verified_tolerance(shared, name, share, count):
    rows = sections(shared, name)
    tolerance = share * float(np.linalg.norm(np.ptp(np.vstack(rows), axis=0)))

    surface = skin(rows, tolerance, closed=False)
    assert surface.tmesh.size <= count

    curves = RowCurves.through(rows, closed=False)
    t = row_parameters(curves)
    s = np.linspace(0, 1, 301)[:-1]
    points = surface.positions(np.tile(s, len(t)), np.repeat(t, len(s)))
    assert np.linalg.norm(points - curves.at(s).reshape(-1, 3), axis=1).max() < tolerance
