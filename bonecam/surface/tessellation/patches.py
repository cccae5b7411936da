"""The coarse mesh a tessellation of a general T-spline starts from: its Bezier elements, conforming across
T-junctions and seams.

The corners of all elements are vertices; an element takes those that lie on its sides. Opposite sides of a
closed direction are one, and a side t = const on which the surface is one point (a pole) is one vertex.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.surface.tmesh.surface import Surface

WIDEST = 0.24
"""Share of a period: what is wider would have two ways round."""

ONE_POINT = 1e-12
"""Share of the size: points nearer to each other are one."""


def patch_mesh(surface: Surface) -> tuple[Float[ndarray, "n 2"], Bool[ndarray, " n"], Int[ndarray, "m 3"]]:
    """Parameters of the vertices, which of them are poles, and faces counter-clockwise in (s, t)."""
    elements = surface.elements()
    boxes = _narrow(elements.boxes, elements.period)
    corners = boxes[:, [0, 2, 1, 2, 1, 3, 0, 3]].reshape(-1, 2)
    wrapped = corners.copy()
    low = elements.domain[:, 0]
    for axis in (0, 1):
        if elements.period[axis]:
            end = elements.domain[axis, 1]
            wrapped[:, axis] = np.where(
                np.abs(wrapped[:, axis] - end) <= ONE_POINT * np.abs(elements.domain).max(), low[axis], wrapped[:, axis]
            )
    parameters, vertex = np.unique(wrapped, axis=0, return_inverse=True)
    faces, centres = _triangles(boxes, parameters, vertex.reshape(-1, 4), elements.domain, elements.period)
    parameters = np.vstack([parameters, centres])
    return _with_poles(surface, parameters, faces)


def _narrow(boxes: ndarray, period: tuple[float, float]) -> ndarray:
    """Boxes halved until none is too wide for a closed direction; neighbours need not agree."""
    for axis in (0, 1):
        while period[axis]:
            low = boxes[:, 2 * axis]
            high = boxes[:, 2 * axis + 1]
            wide = high - low > WIDEST * period[axis]
            if not wide.any():
                break
            first, second = boxes[wide].copy(), boxes[wide].copy()
            first[:, 2 * axis + 1] = second[:, 2 * axis] = (low + high)[wide] / 2
            boxes = np.vstack([boxes[~wide], first, second])
    return boxes


def _triangles(
    boxes: ndarray, parameters: ndarray, vertex: ndarray, domain: ndarray, period: tuple[float, float]
) -> tuple[ndarray, ndarray]:
    """Two triangles for an element without further vertices on its sides, else a fan round its centre."""
    on_line: list[dict[float, ndarray]] = []
    for axis in (0, 1):
        order = np.lexsort((parameters[:, 1 - axis], parameters[:, axis]))
        values, starts = np.unique(parameters[order, axis], return_index=True)
        on_line.append(dict(zip(values.tolist(), np.split(order, starts[1:]))))
    faces: list[tuple[int, int, int]] = []
    centres: list[tuple[float, float]] = []
    for box, corner in zip(boxes, vertex.tolist()):
        loop: list[int] = []
        for side, axis in enumerate((1, 0, 1, 0)):  # bottom, right, top, left
            start = box[2 * (1 - axis)]
            end = box[2 * (1 - axis) + 1]
            level = float(parameters[corner[(0, 1, 2, 0)[side]], axis])
            here = on_line[axis][level]
            along = parameters[here, 1 - axis]
            between = here[(along > start) & (along < end)].tolist()
            loop += [corner[side], *(between if side < 2 else between[::-1])]
        if len(loop) == 4:
            faces += [(loop[0], loop[1], loop[2]), (loop[0], loop[2], loop[3])]
        else:
            centre = len(parameters) + len(centres)
            centres.append(((box[0] + box[1]) / 2, (box[2] + box[3]) / 2))
            faces += [(loop[k], loop[(k + 1) % len(loop)], centre) for k in range(len(loop))]
    return np.array(faces, dtype=np.int64), np.array(centres, dtype=np.float64).reshape(-1, 2)


def _with_poles(surface: Surface, parameters: ndarray, faces: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """The vertices of a side t = const on which the surface is one point made one, faces that vanish with it
    left out."""
    poles = np.zeros(len(parameters), dtype=bool)
    target = np.arange(len(parameters))
    size = float(np.ptp(surface.control_points, axis=0).max())
    for level in surface.domain[1] if not surface.elements().period[1] else ():
        here = np.flatnonzero(parameters[:, 1] == level)
        points = surface.positions(*parameters[here].T)
        if len(here) > 1 and np.ptp(points, axis=0).max() <= ONE_POINT * size:
            target[here] = here[0]
            poles[here[0]] = True
    faces = target[faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, index = np.unique(faces, return_inverse=True)
    return parameters[used], poles[used], index.reshape(-1, 3)
