"""Where the edge of a ball end lies in material before a move is cut, and its force there, compiled for a set of rays.

The ball is divided into cells (kappa, phi): kappa from the tip, phi about the tool axis a from the feed on. With
e_r the radial direction, a cell has the outward normal n = sin(kappa) e_r - cos(kappa) a; it cuts where n . f > 0
(f the unit feed) and the point c + R n + s f lies in material (c the middle of the move's centre line; s looks ahead of
it by what the rays do not resolve). Each cell is asked of the set of rays that lies most along n. One edge of length
db = R dkappa then loads the work by (mechanistic, with edge forces; Lee & Altintas 1996)

    (Ktc h + Kte) db v + (Krc h + Kre) db n + (Kac h + Kae) db m,    h = fz n . f,

where v = -a x e_r is the way of the edge (M3) and m = cos(kappa) e_r + sin(kappa) a the direction along it. Flutes
above the centre continue the ball with kappa = 90 degrees.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from bonecam.kernels import inner_njit, njit
from bonecam.kernels.removal.rays import ROUNDING, TILE, RaySet, tiles_reached

ROWS = 24
"""Cells from the tip to the ball's equator. With TURN about the axis the mean force of a demo is 0.2 % off that of 60 x
180 cells, its mean peak 1 %."""
TURN = 72
"""Cells about the axis: a multiple of 2, 3 and 4 flutes."""
COARSER = 3.0
"""Cells of the flutes are at most so many times as high as those of the ball: walls that reach them are even."""
_KAPPA = (np.arange(ROWS) + 0.5) * 0.5 * np.pi / ROWS
_KAPPA_COSINES = np.cos(_KAPPA)
_KAPPA_SINES = np.sin(_KAPPA)
_PHI = (np.arange(TURN) + 0.5) * 2 * np.pi / TURN
_COSINES = np.cos(_PHI)
_SINES = np.sin(_PHI)


class Edges(NamedTuple):
    """The edges of the ball on n pieces of moves, in the coordinates of one set of rays, and what they find there.

    `frames` (n, 3, 3): e_1 (across the axis, towards the feed), e_2 = a x e_1 and the axis a; `centres` (n, 3): middle
    of the ball's centre line, moved ahead; `feeds` (n, 2): the unit feed along e_1 and a; `chips` (n,): feed a tooth
    fz, mm, 0 for a piece that is not asked; `coefficients` (6,): Ktc, Krc, Kac (N/mm^2), Kte, Kre, Kae (N/mm).
    `forces` (n, TURN, 3): that of one edge at each phi along v, e_r and a, N; `engaged` (n, 5): length of the edge,
    summed over the turn, with that times the place along e_1, e_2 and a from `centres` (mm, mm^2), and the area across
    the feed (mm^2); `asked` (n,): the piece has been. The arc that cuts has the radius of the `corner` (mm), about
    places of a `ring` (mm) round the axis, whose middle the `centres` are: it lies so far `below` (mm) the centre of
    the ball that moves. Of a ball-end cutter ring and below are 0.
    """

    frames: ndarray
    centres: ndarray
    feeds: ndarray
    chips: ndarray
    coefficients: ndarray
    forces: ndarray
    engaged: ndarray
    asked: ndarray
    ring: float = 0.0
    corner: float = 0.0
    below: float = 0.0


@njit(cache=True, nogil=True, inline="always")
def _meets(
    rays: RaySet, u: float, v: float, centre: ndarray, axis: ndarray, radius: float, flutes: bool, upper: bool
) -> bool:
    """Whether the upper or lower side of a ball, or of the cylinder of its `flutes`, lies in material on the ray
    nearest to (u, v)."""
    i, j = int(np.floor(u / rays.cell)), int(np.floor(v / rays.cell))
    rows, columns = rays.tile_of.shape
    if i < 0 or j < 0 or i >= rows * TILE or j >= columns * TILE:
        return False
    tile = rays.tile_of[i // TILE, j // TILE]
    if tile < 0:
        return False
    # the square of the distance from the centre, or from the axis, is square + 2 t slope + t^2 steep on the ray
    x, y = (i + 0.5) * rays.cell - centre[0], (j + 0.5) * rays.cell - centre[1]
    along = x * axis[0] + y * axis[1] if flutes else 0.0
    rise = axis[2] if flutes else 0.0
    square = x * x + y * y - along * along
    slope = -along * rise
    steep = 1.0 - rise * rise
    rest = slope * slope - steep * (square - radius * radius)
    if rest <= 0.0:
        return False
    at = centre[2] + (np.sqrt(rest) if upper else -np.sqrt(rest)) / steep - slope / steep
    ray = (j % TILE) * TILE + i % TILE
    for k in range(rays.counts[tile, ray]):
        if rays.spans[tile, ray, 2 * k] <= at <= rays.spans[tile, ray, 2 * k + 1]:
            return True
    return False


@inner_njit()
def engage(rays: RaySet, edges: Edges, i: int, radius: float, reach: float) -> None:
    """Ask this set of rays for the cells of piece `i` that lie most along it; flutes up to `reach` (mm) above the
    ball's centre. A piece that is asked again, when a ray had no more room, keeps its first answer."""
    if edges.asked[i] or edges.chips[i] <= 0.0:
        return
    edges.asked[i] = True
    ring, below = edges.ring, edges.below
    wide = ring + edges.corner if ring > 0.0 else radius
    if ring > 0.0:
        radius, reach = edges.corner, max(reach, 0.0) + below
    one = edges.frames[i, 0]
    two = edges.frames[i, 1]
    axis = edges.frames[i, 2]
    centre = edges.centres[i]
    if reach <= 0.0 and len(tiles_reached(rays, centre, centre, axis, 0.0, wide)) == 0:
        return
    inner = radius - ROUNDING
    shifted = centre.copy()
    db = radius * 0.5 * np.pi / ROWS
    # a sharp corner has no arc
    first_row = 0 if radius > 0.0 else ROWS
    flutes = int(np.ceil(reach / max(COARSER * db, rays.cell)))
    ahead = edges.feeds[i, 0]
    up = edges.feeds[i, 1]
    chip = edges.chips[i]
    a_u, a_v, a_w = axis
    ktc, krc, kac, kte, kre, kae = edges.coefficients
    for k in range(TURN):
        e_u = _COSINES[k] * one[0] + _SINES[k] * two[0]
        e_v = _COSINES[k] * one[1] + _SINES[k] * two[1]
        e_w = _COSINES[k] * one[2] + _SINES[k] * two[2]
        along_e = _COSINES[k] * ahead
        shifted[0], shifted[1] = centre[0] + ring * e_u, centre[1] + ring * e_v
        shifted[2] = centre[2] + ring * e_w
        way, radial, axial, edge, out, level, area, ahead_of_ring = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for row in range(first_row, ROWS + flutes):
            sine, cosine, height, length = 1.0, 0.0, 0.0, db
            if row < ROWS:
                sine, cosine = _KAPPA_SINES[row], _KAPPA_COSINES[row]
            else:
                height = (row - ROWS + 0.5) * reach / flutes
                length = reach / flutes
            along = sine * along_e - cosine * up
            if along <= 0.0:
                continue
            nu, nv, nw = sine * e_u - cosine * a_u, sine * e_v - cosine * a_v, sine * e_w - cosine * a_w
            # of two that lie as much along it one set is asked, going round u, v, w
            if abs(nw) < abs(nu) or abs(nw) <= abs(nv):
                if row >= ROWS:
                    break  # the flutes have one normal
                continue
            u, v = shifted[0] + radius * nu + height * a_u, shifted[1] + radius * nv + height * a_v
            about, within = (centre, ring + inner) if row >= ROWS else (shifted, inner)
            if not _meets(rays, u, v, about, axis, within, row >= ROWS, nw > 0.0):
                continue
            normal, meridian = krc * chip * along + kre, kac * chip * along + kae
            way += length * (ktc * chip * along + kte)
            radial += length * (normal * sine + meridian * cosine)
            axial += length * (meridian * sine - normal * cosine)
            edge += length
            out += length * sine
            level += length * (height - radius * cosine)
            area += length * along * sine
            ahead_of_ring += length * along
        if edge > 0.0:
            edges.forces[i, k, 0] = way
            edges.forces[i, k, 1] = radial
            edges.forces[i, k, 2] = axial
            edges.engaged[i, 0] += edge
            edges.engaged[i, 1] += (out * radius + ring * edge) * _COSINES[k]
            edges.engaged[i, 2] += (out * radius + ring * edge) * _SINES[k]
            edges.engaged[i, 3] += level
            edges.engaged[i, 4] += (area * radius + ahead_of_ring * ring) * 2 * np.pi / TURN


@njit(cache=True, nogil=True)
def over_turns(forces: ndarray, frames: ndarray, flutes: int, means: ndarray, peaks: ndarray) -> None:
    """Write the mean force over a turn and the largest one (n, 3) of a cutter with so many `flutes`, N, in the frame of
    `frames` (n, 3, 3); `forces` (n, TURN, 3) is that of one edge, as in Edges."""
    share = TURN // flutes
    total = np.empty((TURN, 3))
    for i in range(len(forces)):
        for c in range(3):
            means[i, c] = peaks[i, c] = 0.0
        for k in range(TURN):
            cosine, sine = _COSINES[k], _SINES[k]
            t, r, a = forces[i, k]
            for c in range(3):
                one, two = frames[i, 0, c], frames[i, 1, c]
                total[k, c] = t * (sine * one - cosine * two) + r * (cosine * one + sine * two) + a * frames[i, 2, c]
                means[i, c] += flutes * total[k, c] / TURN
        largest = 0.0
        for k in range(share):
            x, y, z = 0.0, 0.0, 0.0
            for flute in range(flutes):
                x += total[k + flute * share, 0]
                y += total[k + flute * share, 1]
                z += total[k + flute * share, 2]
            size = x * x + y * y + z * z
            if size > largest:
                largest = size
                peaks[i, 0], peaks[i, 1], peaks[i, 2] = x, y, z
