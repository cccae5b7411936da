"""Areas of published Bezier-extraction files whose domains are known in closed form.

The files (extension .iga) are examples of the T-spline plug-in of GeoPDEs (github.com/rafavzqz/geopdes, branch
tsplines_plugin); the extraction is that of Scott, Borden, Verhoosel, Sederberg & Hughes, "Isogeometric finite
element data structures based on Bezier extraction of T-splines", Int. J. Numer. Meth. Engng 88, 2011. Rational
quarter circles are exact, so that areas are too.
"""

import numpy as np
import pytest
from bonecam_plugins.tsplines import read_iga

AREAS = {
    "arch_nurbs": np.pi * (2**2 - 1**2) / 4,
    "arch_tsplines": np.pi * (2**2 - 1**2) / 4,
    "plate_with_hole": 4**2 - np.pi * 1**2 / 4,
    "square_structured": 1.0,
    "square_unstructured": 1.0,
}
"""Quarter rings of radii 1 and 2, a quarter of a plate of side 8 with a hole of radius 1, unit squares."""


@pytest.mark.parametrize("name", AREAS)
def test_areas_are_exact(shared, name):
    file = shared / "tspline" / "iga" / f"{name}.iga"
    if not file.is_file():
        pytest.skip(f"{file} is absent")
    assert abs(read_iga(file).area - AREAS[name]) <= 1e-12
