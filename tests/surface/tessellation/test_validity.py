"""Surfaces that bound no body are told with the place."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.errors import SurfaceError
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.surface.tessellation import require_valid
from bonecam.surface.tspline import TSpline


def test_a_surface_that_cuts_itself_is_refused_with_the_place(
    pebble: Callable[..., TSpline], mesh_of: Callable[..., TriangleMesh]
) -> None:
    sound = pebble()
    require_valid(sound, 0.05, "bone.stl")
    points = np.array(sound.control_points)
    waist = slice(1 + 12 * 4, 1 + 12 * 7)
    points[waist, :2] *= -0.3  # turned through the axis: the wall passes through itself
    crossed = TSpline(sound.tmesh, points, sound.weights)
    with pytest.raises(
        SurfaceError,
        match=r"bone\.stl: the surface of \d+ control points cuts itself in \d+ faces, first near \(.*\): raise",
    ) as caught:
        require_valid(crossed, 0.05, "bone.stl")
    low, high = mesh_of(crossed).bounds
    assert ((caught.value.evidence["place"] >= low - 0.1) & (caught.value.evidence["place"] <= high + 0.1)).all()
