"""Distances of points from one segment or triangle each, parameters inside a triangle, and the edges to cut
where triangles are bisected; compiled."""

import numpy as np
from numpy import ndarray

from bonecam.kernels import njit
from bonecam.kernels.vectors import squared_segment_distance


@njit(cache=True)
def segment_distances(points: ndarray, vertices: ndarray, edges: ndarray) -> ndarray:
    """Largest distance (n,) of the points[n] (k, 3) from the segment between the vertices edges[n]."""
    result = np.zeros(len(edges))
    for n in range(len(edges)):
        worst = 0.0
        for k in range(points.shape[1]):
            p = points[n, k]
            worst = max(worst, squared_segment_distance(p, vertices[edges[n, 0]], vertices[edges[n, 1]]))
        result[n] = np.sqrt(worst)
    return result


@njit(cache=True)
def triangle_distances(points: ndarray, vertices: ndarray, faces: ndarray) -> ndarray:
    """Distance of points[n] from the triangle faces[n]: to its plane where the footpoint lies inside, else to
    its nearest edge."""
    result = np.zeros(len(faces))
    for n in range(len(faces)):
        a, b, c = faces[n, 0], faces[n, 1], faces[n, 2]
        u, v, w = vertices[b] - vertices[a], vertices[c] - vertices[a], points[n] - vertices[a]
        uu, uv, vv = np.dot(u, u), np.dot(u, v), np.dot(v, v)
        wu, wv = np.dot(w, u), np.dot(w, v)
        d = uu * vv - uv * uv
        x, y = vv * wu - uv * wv, uu * wv - uv * wu
        if d > 0.0 and x >= 0.0 and y >= 0.0 and x + y <= d:
            r = w - (x / d) * u - (y / d) * v
            result[n] = np.sqrt(np.dot(r, r))
        else:
            p = points[n]
            best = squared_segment_distance(p, vertices[a], vertices[b])
            best = min(best, squared_segment_distance(p, vertices[b], vertices[c]))
            result[n] = np.sqrt(min(best, squared_segment_distance(p, vertices[c], vertices[a])))
    return result


@njit(cache=True)
def interpolate_parameters(
    parameters: ndarray,
    poles: ndarray,
    corners: ndarray,
    shares: ndarray,
    origin: tuple[float, float],
    period: tuple[float, float],
) -> tuple[ndarray, ndarray]:
    """s and t (n k,) at the barycentric coordinates `shares` (k, c) between the vertices `corners` (n, c).

    `parameters` (v, 2) are s and t of the vertices. A pole has no s of its own and counts for t alone. A
    direction with a period is closed: its results lie in [origin, origin + period).
    """
    count = len(shares)
    s, t = np.empty(len(corners) * count), np.empty(len(corners) * count)
    for n in range(len(corners)):
        first = corners[n, 0]
        if poles[first]:
            first = corners[n, 1]
        reference = parameters[first, 0]
        for k in range(count):
            weight = offset = height = 0.0
            for c in range(corners.shape[1]):
                v = corners[n, c]
                if period[1] > 0.0:
                    d = parameters[v, 1] - parameters[first, 1]
                    height += shares[k, c] * (d - period[1] * np.round(d / period[1]))
                else:
                    height += shares[k, c] * parameters[v, 1]
                if not poles[v]:
                    d = parameters[v, 0] - reference
                    if period[0] > 0.0:
                        d -= period[0] * np.round(d / period[0])
                    offset += shares[k, c] * d
                    weight += shares[k, c]
            x = reference + offset / weight
            if period[0] > 0.0:
                x -= period[0] * np.floor((x - origin[0]) / period[0])
            if period[1] > 0.0:
                height += parameters[first, 1]
                height -= period[1] * np.floor((height - origin[1]) / period[1])
            s[n * count + k] = x
            t[n * count + k] = height
    return s, t


@njit(cache=True)
def mark_longest(marked: ndarray, edge_of_face: ndarray, longest: ndarray) -> None:
    """Mark, in place, the longest edge of every face that has a marked edge, until every such face has it
    marked (Rivara 1984)."""
    changed = True
    while changed:
        changed = False
        for f in range(len(edge_of_face)):
            e = edge_of_face[f]
            if not marked[longest[f]] and (marked[e[0]] or marked[e[1]] or marked[e[2]]):
                marked[longest[f]] = True
                changed = True
