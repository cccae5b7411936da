"""Taking the convex body of a bull nose out of material, compiled.

The body is what lies in all of its cones (`Cutter.body`): with h along the axis from the ball's centre and r from the
axis, sin(phi) r - cos(phi) h <= s. On the line p + t n, n being unit, h = h0 + h' t, and a cone is

    sin^2 (|p + t n|^2 - h^2) <= (s + cos h)^2,    s + cos h >= 0,

a quadratic in t whose solutions on one side of the apex are one interval, or a half line.
"""

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.removal.air import air_on_set
from bonecam.kernels.removal.cut import ALONG_U, ALONG_V, cut_tile
from bonecam.kernels.removal.flutes import FLUTE_STEP, Ways, piece_pose, travel_of
from bonecam.kernels.removal.normal_probes import ProbesByCell
from bonecam.kernels.removal.rays import TILE, TINY, RaySet, tiles_reached


@inner_njit()
def _cone_chord(sine: float, s: float, rise: float, across: float, turn: float, square: float) -> tuple[float, float]:
    """Where a line lies in a cone: t; the first is larger where it misses. On it s + cos h = `s` + `rise` t, and the
    square of the distance from the axis is `square` + 2 `turn` t + `across` t^2."""
    if sine == 0.0:
        if abs(rise) < TINY:
            return (-np.inf, np.inf) if s >= 0.0 else (np.inf, -np.inf)
        return (-s / rise, np.inf) if rise > 0.0 else (-np.inf, -s / rise)
    a = sine * sine * across - rise * rise
    b = sine * sine * turn - s * rise
    c = sine * sine * square - s * s
    if abs(a) < TINY:
        # along a side of the cone: in it towards where it widens
        if rise == 0.0:
            return (-np.inf, np.inf) if c <= 0.0 and s >= 0.0 else (np.inf, -np.inf)
        if b * rise >= 0.0:
            return np.inf, -np.inf
        return (-c / (2 * b), np.inf) if rise > 0.0 else (-np.inf, -c / (2 * b))
    rest = b * b - a * c
    if a > 0.0:
        if rest <= 0.0 or s - rise * b / a < 0.0:
            return np.inf, -np.inf
        root = np.sqrt(rest)
        return (-b - root) / a, (-b + root) / a
    root = np.sqrt(max(rest, 0.0))
    return ((-b - root) / a, np.inf) if rise > 0.0 else (-np.inf, (-b + root) / a)


@njit(cache=True, nogil=True)
def body_chord(
    px: float, py: float, pz: float, nx: float, ny: float, nz: float, axis: ndarray, body: ndarray
) -> tuple[float, float]:
    """Where the line through (px, py, pz), told from the ball's centre, along the unit (nx, ny, nz) lies in a body
    about the unit `axis`: t; the first is larger where it misses."""
    height = px * axis[0] + py * axis[1] + pz * axis[2]
    slope = nx * axis[0] + ny * axis[1] + nz * axis[2]
    square = px * px + py * py + pz * pz - height * height
    turn = px * nx + py * ny + pz * nz - height * slope
    across = max(1.0 - slope * slope, 0.0)
    low, high = -np.inf, np.inf
    # the side and the top first: they miss most lines
    for k in range(len(body) - 1, -1, -1):
        sine, cosine = body[k, 0], body[k, 1]
        first, last = _cone_chord(sine, body[k, 2] + cosine * height, cosine * slope, across, turn, square)
        low, high = max(low, first), min(high, last)
        if low >= high:
            return np.inf, -np.inf
    return low, high


@inner_njit()
def _travel(ways: Ways, i: int) -> float:
    """How far a point of the body travels on way `i` at most, mm."""
    side, top = ways.body[-2, 2], ways.body[-1, 2]
    return travel_of(ways, i, np.hypot(max(ways.body[0, 2], abs(top)), side))


@inner_njit()
def _steps_of(ways: Ways, i: int) -> int:
    """Poses on way `i` that the body is taken out at."""
    return max(int(np.ceil(_travel(ways, i) / FLUTE_STEP)), 1)


@njit(cache=True, nogil=True)
def body_ends(ways: Ways, foot: ndarray, axis: ndarray, start: ndarray, end: ndarray) -> float:
    """Write the `start` and the `end` of the capsule that holds the body whose ball's centre is at `foot`: on its axis,
    at tip and top. Its radius."""
    for k in range(3):
        start[k] = foot[k] - ways.body[0, 2] * axis[k]
        end[k] = foot[k] + ways.body[-1, 2] * axis[k]
    return ways.body[-2, 2]


@njit(cache=True, nogil=True)
def body_in_motion(ways: Ways, i: int, foot: ndarray, axis: ndarray, start: ndarray, end: ndarray) -> float:
    """Write the ends of a capsule that holds the body all along way `i`, as `body_ends` does; its radius."""
    piece_pose(ways, i, 0.5, foot, axis)
    return body_ends(ways, foot, axis, start, end) + _travel(ways, i) / 2


@inner_njit()
def _tiles_at(rays: RaySet, ways: Ways, foot: ndarray, axis: ndarray) -> ndarray:
    """The tiles whose material the body in a pose may reach."""
    start, end = np.empty(3), np.empty(3)
    radius = body_ends(ways, foot, axis, start, end)
    return tiles_reached(rays, start, end, axis, ways.body[0, 2] + ways.body[-1, 2], radius)


@inner_njit()
def _tile_chords(
    rays: RaySet, i: int, j: int, ways: Ways, foot: ndarray, axis: ndarray, lows: ndarray, highs: ndarray
) -> None:
    """Write where each ray of tile (i, j) lies in the body: w from its ball's centre."""
    for ray in range(TILE * TILE):
        u = (i * TILE + ALONG_U[ray]) * rays.cell - foot[0]
        v = (j * TILE + ALONG_V[ray]) * rays.cell - foot[1]
        lows[ray], highs[ray] = body_chord(u, v, 0.0, 0.0, 0.0, 1.0, axis, ways.body)


@inner_njit()
def _deepest_end(rays: RaySet, i: int, j: int, w: float, lows: ndarray, highs: ndarray) -> float:
    """The largest distance to the nearest air, mm, of the ends of the chords, told from `w`, of tile (i, j)."""
    deepest = 0.0
    for ray in range(TILE * TILE):
        if lows[ray] < highs[ray]:
            u = (i * TILE + ALONG_U[ray]) * rays.cell
            v = (j * TILE + ALONG_V[ray]) * rays.cell
            deepest = max(deepest, air_on_set(rays, u, v, w + lows[ray]))
            deepest = max(deepest, air_on_set(rays, u, v, w + highs[ray]))
    return deepest


@inner_njit()
def _walk(rays: RaySet, ways: Ways, i: int, foot: ndarray, axis: ndarray, cuts: bool) -> tuple[float, float, bool]:
    """What the body meets on way `i`, its place at the start left out. Where it `cuts`, that goes: the volume (mm^3),
    and last whether a ray has no room for one more interval. Else how deep its ends lie in what stands (mm), second."""
    lows, highs = np.empty(TILE * TILE), np.empty(TILE * TILE)
    removed, deepest, full = 0.0, 0.0, False
    steps = _steps_of(ways, i)
    for k in range(1, steps + 1):
        piece_pose(ways, i, k / steps, foot, axis)
        for a, b in _tiles_at(rays, ways, foot, axis):
            _tile_chords(rays, a, b, ways, foot, axis, lows, highs)
            if not cuts:
                deepest = max(deepest, _deepest_end(rays, a, b, foot[2], lows, highs))
                continue
            in_tile, full = cut_tile(rays, np.int64(rays.tile_of[a, b]), foot[2], lows, highs)
            removed += in_tile * rays.cell * rays.cell
            if full:
                return removed, deepest, full
    return removed, deepest, full


@njit(cache=True, nogil=True)
def cut_body(rays: RaySet, ways: Ways, i: int, foot: ndarray, axis: ndarray) -> tuple[float, bool]:
    """Take what the body sweeps on way `i` out of the material, its place at the start left out; the volume removed
    (mm^3), and whether a ray has no room for one more interval. `foot` and `axis` (3,) are written on."""
    removed, _, full = _walk(rays, ways, i, foot, axis, True)
    return removed, full


@njit(cache=True, nogil=True)
def body_depth(rays: RaySet, ways: Ways, i: int, foot: ndarray, axis: ndarray) -> float:
    """The largest distance to the nearest air, mm, of the places where the rays leave the body inside material on way
    `i`; 0 where it meets none. `foot` and `axis` (3,) are written on."""
    return _walk(rays, ways, i, foot, axis, False)[1]


@inner_njit()
def _off_body(px: float, py: float, pz: float, axis: ndarray, body: ndarray) -> float:
    """How far a point, told from the ball's centre, lies off the body of which it is inside, mm: not more than 0."""
    height = px * axis[0] + py * axis[1] + pz * axis[2]
    out = np.sqrt(max(px * px + py * py + pz * pz - height * height, 0.0))
    off = -np.inf
    for k in range(len(body)):
        off = max(off, body[k, 0] * out - body[k, 1] * height - body[k, 2])
    return min(off, 0.0)


@njit(cache=True, nogil=True)
def cut_probes_by_body(
    probes: ProbesByCell, reach: float, ways: Ways, heights: ndarray, names: ndarray, owners: ndarray, from_top: bool
) -> None:
    """Lower `heights` (n,) to where the body cuts the normal probes on its ways (w,), and set `owners` (n,) to the one
    of the `names` (w,) that did; as `cut_normal_probes` does by capsules."""
    points, normals, cell_starts, corner, size = probes
    shape = cell_starts.shape
    flat = cell_starts.ravel()
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    foot, axis, start, end = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for i in range(len(ways.starts)):
        steps = _steps_of(ways, i)
        for step in range(1, steps + 1):
            piece_pose(ways, i, step / steps, foot, axis)
            radius = body_ends(ways, foot, axis, start, end) + reach
            beside = False
            for k in range(3):
                low[k] = max(int(np.floor((min(start[k], end[k]) - radius - corner[k]) / size)), 0)
                last = int(np.floor((max(start[k], end[k]) + radius - corner[k]) / size))
                high[k] = min(last, shape[k] - 1 - (k == 2))
                beside = beside or low[k] > high[k]
            if beside:
                continue
            for a in range(low[0], high[0] + 1):
                for b in range(low[1], high[1] + 1):
                    row = (a * shape[1] + b) * shape[2]
                    for m in range(flat[row + low[2]], flat[row + high[2] + 1]):
                        p, n = points[m], normals[m]
                        x, y, z = p[0] - foot[0], p[1] - foot[1], p[2] - foot[2]
                        enter, leave = body_chord(x, y, z, n[0], n[1], n[2], axis, ways.body)
                        lowest = heights[m] if from_top else 0.0
                        if enter < leave and leave > lowest and enter < heights[m]:
                            height = enter if enter > 0.0 else _off_body(x, y, z, axis, ways.body)
                            if height < heights[m]:
                                heights[m] = height
                                owners[m] = names[i]
