"""Open borders of .tsm files that name `end-conditions SUBD_CREASES` (Fusion writes them): the borders of a
subdivision surface with creases.

Such a border is not clamped: knots and control points are mirrored beyond it, P_{-1} = 2 P_0 - P_1, so that
the border is the cubic B-spline of the control points on it, the corners are met and the second derivative
across the border vanishes (Catmull & Clark 1978 with the crease rules of Hoppe et al. 1994, on any knots).
The mirrored points are vertices outside the domain. Only rectangular T-meshes are treated, and the two lines
next to a border must run along all of it.
"""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import SurfaceError
from bonecam.surface.tmesh.general import TMesh

MIRRORED = "SUBD_CREASES"


def with_mirrored_borders(tmesh: TMesh, points: Float[ndarray, "n 4"]) -> tuple[TMesh, Float[ndarray, "m 4"]]:
    """The T-mesh and the homogeneous control points with one more, mirrored, beside every one on an open
    border; the given ones come first.

    Raises SurfaceError where the T-mesh is no rectangle, a line ends beside a border, or a mirrored weight is
    not positive.
    """
    if not tmesh.inside.all():
        raise SurfaceError("its open border is no rectangle: give clamped borders ('0m cg' records)")
    for axis in (0, 1):
        if not tmesh.period[axis]:
            tmesh, points = _mirror_across_s(_with_axis_first(tmesh, axis), points)
            tmesh = _with_axis_first(tmesh, axis)
    wrong = np.flatnonzero(~(points[:, 3] > 0))
    if len(wrong):
        raise SurfaceError(
            f"the weights at its open border fall to {points[wrong[0], 3]:.6g} beyond it: make them more even"
        )
    return tmesh, points


def _with_axis_first(mesh: TMesh, axis: int) -> TMesh:
    """The T-mesh with s and t exchanged where `axis` is 1, so that `axis` comes first."""
    if axis == 0:
        return mesh
    return TMesh(
        s_lines=mesh.t_lines,
        t_lines=mesh.s_lines,
        vertices=mesh.vertices[:, ::-1],
        along_s=mesh.along_t.T,
        along_t=mesh.along_s.T,
        inside=mesh.inside.T,
        period=mesh.period[::-1],
    )


def _mirror_across_s(mesh: TMesh, points: ndarray) -> tuple[TMesh, ndarray]:
    """The T-mesh and its homogeneous control points (m, 4) with mirrored ones beyond both borders across
    s."""
    crossings = mesh.crossings
    last = len(mesh.s_lines) - 1
    new = []
    rows = []
    for border, step in ((0, 1), (last, -1)):
        near = [border, border + step, border + 2 * step][: last + 1]
        outer = crossings[border]
        inner = crossings[border + step]
        if not mesh.along_t[near].all() or ((outer >= 0) != (inner >= 0)).any():
            raise SurfaceError(
                f"a line ends beside its open border at s- or t-line {border}: let two lines run along all of it"
            )
        rows.append(np.flatnonzero(outer >= 0))
        new.append(2 * points[outer[rows[-1]]] - points[inner[rows[-1]]])
    added = [np.column_stack([np.full(len(row), line), row]) for row, line in zip(rows, (1, last + 3))]
    vertices = np.vstack([mesh.vertices + np.array([2, 0]), *added])
    steps = np.diff(mesh.s_lines)
    low = steps[:2]
    high = steps[::-1][:2]
    before = mesh.s_lines[0] - np.cumsum(np.resize(low, 2))
    behind = mesh.s_lines[-1] + np.cumsum(np.resize(high, 2))
    lines = np.concatenate([before[::-1], mesh.s_lines, behind])
    along_s, along_t = (np.pad(edges, ((2, 2), (0, 0)), mode="edge") for edges in (mesh.along_s, mesh.along_t))
    inside = np.pad(mesh.inside, ((2, 2), (0, 0)))
    return TMesh(
        lines, mesh.t_lines, vertices=vertices, along_s=along_s, along_t=along_t, inside=inside, period=mesh.period
    ), np.vstack([points, *new])
