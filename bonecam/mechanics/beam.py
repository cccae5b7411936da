"""What stands as an upright beam, held at its lower end: compliance, stress and lowest frequency.

It is cut into slices, of columns, meshes and ray sets, with area, centroid and second moments of each. A slice is even:
what a cone or a leaning bone does within its 0.5 mm is left out. All that is at one height counts as one section, also
where it is in two pieces.

A force F at the place p bends the slice at the place c by the moment (p - c) x F, and a turn of that slice moves p.
With the flexibility S of a slice a length, P = [p]x and [c]x the matrices of the cross product, all slices below p give

    C(p) = P^T A0 P - P^T A1 - A1^T P + A2 + shear + axial,
    A0 = int S,    A1 = int S [c]x,    A2 = int [c]x^T S [c]x,
    S = blockdiag(inv(E [[Ixx, -Ixy], [-Ixy, Iyy]]), 1 / (G J)),    J = A^4 / (4 pi^2 (Ixx + Iyy))

(Saint-Venant's J; Ixx = int y^2), as sums over slices that are made once. Shear is that of a round section (Cowper
1966: 6 (1 + nu) / (7 + 6 nu)). Left out: what the holder of the lower end gives way, and all that is not bending of
slender pieces (a shoulder is a slice of `shoulder`).

A shell of plastic that holds the lower end gives way too. The part in it is a rigid bar in an elastic wall that pushes
back with k = 0.65 E_s / (1 - nu^2) on each mm of the height h in which it holds (Winkler's foundation, Vesic 1961), so
that it moves by 1 / (k h) and turns by 12 / (k h^3); the shell below the middle of that height is a cantilever of
which each piece (half) bends by itself. Their integrals are the first of the sums above. Left out: the gap, which the
screws draw shut; what the screws themselves give way.

A tailstock holds the free end. Its pin or upper neck bends as a cantilever under the arm, hinged at the part; the arm
bends across itself, and the column bends and, where the force is across the arm, twists:

    pin     L^3 / (3 E I)
    along   H^3 / (3 E Ic) + a / (E w^2)
    across  H^3 / (3 E Ic) + a^2 H / (G Jc) + a^3 / (3 E Ia)

of a pin of length L, an arm of length a and width w (Ia = w^4 / 12) and a round column of height H. Of a pin of steel
of 2 x 10 mm the first alone is 495 N/mm. Left out, on the safe side: that a neck holds the part's end upright too, and
any force along it. Left out besides: the joints of the bracket.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.linalg import eigh

from bonecam.arrays import numbered
from bonecam.job import HoldingJob
from bonecam.job.holding_section import NECK
from bonecam.kernels.rays import TILE, RaySet
from bonecam.material.rays import RayGrid, order
from bonecam.mesh.solids import pieces_of
from bonecam.mesh.triangle_mesh import TriangleMesh, keep_faces
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.workholding.post import Column

SLICE = 0.5
"""Height of a slice, mm."""
LEAST_AREA = 4.0
"""Slices of a free end whose area is smaller are rigid, mm^2: the cap of a stock would bend without bound in its last
tenths of a millimetre."""
SHOULDER = 0.24
"""A shoulder between a round neck of the diameter d and a much wider piece gives way as so many d more of the neck:
with finite elements (linear elastic, bodies of revolution) 0.12 d where the wide piece has 1.5 d, 0.18 at 2 d, 0.22 at
3 d, 0.23 at 4 d, near 0.24 (1 - (d / D)^2). A rigid disc on a half space gives 0.26 d."""


@dataclass(frozen=True, eq=False)
class Sections:
    """Slices from `low` to `high` (n,) upwards, one on the other, mm: `area` (n,) mm^2, `centroid` (n, 2) mm, `second`
    moments of area about it (n, 2, 2) mm^4 (xx, xy; xy, yy), and the `flexible` length (n,) that bends, mm: 0 of a
    rigid slice; a shoulder has some, and no extent."""

    low: Float[ndarray, " n"]
    high: Float[ndarray, " n"]
    area: Float[ndarray, " n"]
    centroid: Float[ndarray, "n 2"]
    second: Float[ndarray, "n 2 2"]
    flexible: Float[ndarray, " n"]

    @property
    def z(self) -> Float[ndarray, " n"]:
        """Heights of the middles of the slices, mm."""
        return (self.low + self.high) / 2

    @property
    def rigid(self) -> int:
        """How many slices are taken as rigid."""
        return int(((self.flexible == 0) & (self.high > self.low)).sum())

    def between(self, low: float, high: float) -> "Sections":
        """The slices between two heights, those at the ends cut there."""
        kept = (self.high > low) & (self.low < high) | (self.low == self.high) & (low <= self.low) & (self.low <= high)
        whole = {each.name: getattr(self, each.name)[kept] for each in fields(self)}
        extent = whole["high"] - whole["low"]
        whole["low"], whole["high"] = np.maximum(whole["low"], low), np.minimum(whole["high"], high)
        share = np.where(extent > 0, (whole["high"] - whole["low"]) / np.where(extent > 0, extent, 1.0), 1.0)
        return Sections(**{**whole, "flexible": whole["flexible"] * share})


def column_sections(radius: float, low: float, high: float) -> Sections:
    """The slices of an upright cylinder about the Z axis, mm."""
    ends = _ends(low, high)
    count = len(ends) - 1
    area = np.full(count, np.pi * radius**2)
    second = np.broadcast_to(np.pi / 4 * radius**4 * np.eye(2), (count, 2, 2))
    return Sections(
        ends[:-1], ends[1:], area=area, centroid=np.zeros((count, 2)), second=second, flexible=np.diff(ends)
    )


def shoulder(diameter: float, height: float, wider: float = np.inf) -> Sections:
    """The shoulder between a round neck of a `diameter` and a piece of a `wider` one at a height, mm."""
    neck = column_sections(diameter / 2, height, height + SLICE)
    at = np.array([height])
    length = SHOULDER * diameter * (1 - min(diameter / wider, 1.0) ** 2)
    return Sections(at, at, area=neck.area, centroid=neck.centroid, second=neck.second, flexible=np.array([length]))


def join(pieces: Sequence[Sections]) -> Sections:
    """Pieces one on the other, the lowest first."""
    return Sections(*(np.concatenate([getattr(piece, each.name) for piece in pieces]) for each in fields(Sections)))


def mesh_sections(mesh: TriangleMesh, low: float | None = None, high: float | None = None) -> Sections:
    """The slices of a closed mesh between two heights (mm; None: its ends), each as at its middle."""
    bottom, top = mesh.bounds[:, 2]
    ends = _ends(float(bottom) if low is None else low, float(top) if high is None else high)
    planes = (ends[1:] + ends[:-1]) / 2
    heights = mesh.vertices[mesh.faces][:, :, 2]
    first = np.searchsorted(planes, heights.min(axis=1), side="right")
    last = np.searchsorted(planes, heights.max(axis=1), side="right")
    face, number = numbered(last - first)
    plane = first[face] + number

    # where planes cross triangles, the corner that is alone on its side first; the inside is to the left of p q
    corners, height = mesh.vertices[mesh.faces[face]], planes[plane]
    row = np.arange(len(corners))
    above = corners[:, :, 2] >= height[:, None]
    alone = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)
    a, b, c = (corners[row, (alone + k) % 3] for k in range(3))
    one, other = (a[:, :2] + ((height - a[:, 2]) / (end[:, 2] - a[:, 2]))[:, None] * (end - a)[:, :2] for end in (b, c))
    up = above[row, alone][:, None]
    p, q = np.where(up, one, other), np.where(up, other, one)

    # integrals of (1, x, y) (1, x, y)^T over the triangle from the origin to each edge p q
    triangles = np.zeros((len(p), 3, 3))
    triangles[:, :, 0] = 1.0
    triangles[:, 1, 1:], triangles[:, 2, 1:] = p, q
    twice = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    weights = (np.ones((3, 3)) + np.eye(3)) / 24
    each = np.einsum("m,mai,ab,mbk->mik", twice, triangles, weights, triangles).reshape(-1, 9)
    sums = np.column_stack([np.bincount(plane, entry, len(planes)) for entry in each.T])
    return _from_moments(ends, sums.reshape(-1, 3, 3))


def ray_sections(sets: Sequence[RaySet], grid: RayGrid, low: float, high: float) -> Sections:
    """The slices of what stands on rays between two heights, mm, each as the mean over its height and all sets."""
    ends = _ends(low, high)
    moments = [_ray_moments(rays, grid, direction, ends) for direction, rays in enumerate(sets)]
    return _from_moments(ends, np.mean(moments, axis=0) / np.diff(ends)[:, None, None])


def _ends(low: float, high: float) -> Float[ndarray, " n"]:
    """The ends of slices of SLICE at most, mm."""
    return np.linspace(low, high, max(int(np.ceil((high - low) / SLICE - 1e-9)), 1) + 1)


def _ray_moments(rays: RaySet, grid: RayGrid, direction: int, ends: Float[ndarray, " e"]) -> Float[ndarray, "n 3 3"]:
    """Integrals of (1, x, y) (1, x, y)^T over each slice of one set of rays, over its height.

    On all rays x and y grow alike with z, from a foot at z = 0. Of a slice that rays run through only the sums over
    their feet are needed; the slices in which a ray begins and ends are added ray by ray.
    """
    # The lower and the upper end of each piece of material on a set of rays, in the part's frame.
    tiles = np.argwhere(rays.tile_of >= 0)
    tiles = tiles[np.argsort(rays.tile_of[tiles[:, 0], tiles[:, 1]])]
    room = rays.spans.shape[2] // 2
    tile, ray, piece = np.nonzero(np.arange(room) < rays.counts[:, :, None])
    u, v, w = order(direction)
    local = np.empty((2, len(tile), 3))
    local[:, :, u] = (tiles[tile, 0] * TILE + ray % TILE + 0.5) * rays.cell
    local[:, :, v] = (tiles[tile, 1] * TILE + ray // TILE + 0.5) * rays.cell
    local[0, :, w], local[1, :, w] = rays.spans[tile, ray, 2 * piece], rays.spans[tile, ray, 2 * piece + 1]
    one, other = (grid.in_part(each) for each in local)
    low, high = (one, other) if grid.rotation[direction, 2] > 0 else (other, one)
    rise = grid.rotation[direction]  # downwards where the material was turned over
    slope = rise / rise[2]
    across = np.array([0.0, *slope[:2]])
    met = (high[:, 2] > ends[0]) & (low[:, 2] < ends[-1])
    bottom, top = np.maximum(low[met, 2], ends[0]), np.minimum(high[met, 2], ends[-1])
    foot = (low - low[:, 2:] * slope)[met]
    foot[:, 2] = 0.0
    count = len(ends) - 1
    first = np.searchsorted(ends[1:-1], bottom, side="right")
    last = np.searchsorted(ends[1:-1], top, side="left")
    tall = last > first
    taller = last > first + 1

    def partly(slices: ndarray, start: ndarray, end: ndarray, feet: ndarray) -> Float[ndarray, "n 3 3"]:
        span = end - start
        moments = _binned(slices, feet + (start + end)[:, None] / 2 * slope, span, count)
        return moments + np.bincount(slices, span**3 / 12, count)[:, None, None] * np.outer(across, across)

    moments = partly(first, bottom, np.minimum(top, ends[first + 1]), foot)
    moments += partly(last[tall], ends[last[tall]], top[tall], foot[tall])

    through = _binned(first[taller] + 1, foot[taller], np.ones(taller.sum()), count)
    through = np.cumsum(through - _binned(last[taller], foot[taller], np.ones(taller.sum()), count), axis=0)
    height = np.diff(ends)
    shift = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    shift[:, 1:, 0] = ((ends[1:] + ends[:-1]) / 2)[:, None] * slope[:2]
    within = (through[:, 0, 0] * height**3 / 12)[:, None, None] * np.outer(across, across)
    risen = height[:, None, None] * (shift @ through @ shift.transpose(0, 2, 1)) + within
    return (moments + risen) * (grid.cell**2 / abs(rise[2]))


def _binned(
    slices: Int[ndarray, " m"], points: Float[ndarray, "m 3"], weights: Float[ndarray, " m"], count: int
) -> Float[ndarray, "n 3 3"]:
    """The sums of weights times (1, x, y) (1, x, y)^T of the points of each slice."""
    ones = np.column_stack([np.ones(len(points)), points[:, :2]])
    sums = np.empty((count, 3, 3))
    for i in range(3):
        for k in range(i + 1):
            sums[:, i, k] = sums[:, k, i] = np.bincount(slices, weights * ones[:, i] * ones[:, k], count)
    return sums


def _from_moments(ends: Float[ndarray, " e"], moments: Float[ndarray, "n 3 3"]) -> Sections:
    """Sections with these integrals of (1, x, y) (1, x, y)^T; small ones of the upper end are rigid."""
    area = np.maximum(moments[:, 0, 0], 0.0)
    centroid = moments[:, 0, 1:] / np.where(area > 0, area, 1.0)[:, None]
    second = moments[:, 1:, 1:] - area[:, None, None] * centroid[:, :, None] * centroid[:, None, :]
    flexible = np.diff(ends)
    solid = np.flatnonzero(area >= LEAST_AREA)
    flexible[solid[-1] + 1 if len(solid) else 0 :] = 0.0
    return Sections(ends[:-1], ends[1:], area=area, centroid=centroid, second=second, flexible=flexible)


POISSON = 0.33
"""Poisson's ratio where a material states none: aluminium and titanium 0.33, PEEK 0.38 to 0.40, bone 0.3 to 0.4; from
0.3 to 0.4 a compliance changes by less than 1 %."""
WALL_MODULUS = 0.65
"""The wall of a shell pushes back with so many times E / (1 - nu^2) on each mm of height: a bar on a half-space (Vesic
1961), without its factor ((E d^4 / (E_b I))^(1/12), 0.8 to 1 here)."""
AT_ONCE = 4000
"""Contacts whose stress is found at once."""


Integrals = tuple[Float[ndarray, "n 3 3"], Float[ndarray, "n 3 3"], Float[ndarray, "n 3 3"]]
"""Sums over the slices below a height: A0, A1, A2 of the bending, with what shear and pull give; mm, N."""


@dataclass(frozen=True, eq=False)
class Support:
    """What holds a beam at a further `place` (3,), mm: its `stiffness` (3, 3), N/mm. A pin that carries no force along
    itself has zeros there."""

    place: Float[ndarray, "3"]
    stiffness: Float[ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class Seat:
    """What a shell that holds a beam from the height `low` up gives way there, and the `youngs` modulus (MPa) of the
    shell: the integrals A0 (1/(N mm)), A1 (1/N), A2 (mm/N) of what is below the beam."""

    low: float
    youngs: float
    integrals: Integrals


@dataclass(frozen=True, eq=False)
class Beam:
    """A beam of `sections`, held below the first, rigidly or in a `seat`, of a material with `youngs` modulus (MPa) and
    Poisson's ratio, and with a further `support` if it has one.

    ValueError where the modulus is not positive, the ratio is not between -1 and 0.5, or a slice has no area.
    """

    sections: Sections
    youngs: float
    poisson: float = POISSON
    support: Support | None = None
    seat: Seat | None = None

    def __post_init__(self) -> None:
        if not (self.youngs > 0 and -1 < self.poisson < 0.5):
            raise ValueError(f"E = {self.youngs:g} MPa, nu = {self.poisson:g}: give E > 0 and -1 < nu < 0.5")
        empty = (self.sections.area <= 0) & (self.sections.flexible > 0)
        if empty.any():
            raise ValueError(f"nothing stands at z = {self.sections.z[empty][0]:.2f} mm, below other material")

    def compliance(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
        """Displacement of each point for a unit force there, mm/N; row i is that along coordinate i."""
        compliance = self._free(points, points)
        if self.support is None:
            return compliance
        place = np.broadcast_to(self.support.place, points.shape)
        there = self._free(place, points)
        return compliance - self._free(points, place) @ self._reaction @ there

    def moment_stress(self, forces: Float[ndarray, "n 3"], points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """The largest bending stress (MPa) in the slices below each point under a force (N) there, each slice as the
        ellipse with its second moments: exact for a round neck."""
        stresses = [
            self._stress(forces[start : start + AT_ONCE], points[start : start + AT_ONCE])
            for start in range(0, len(points), AT_ONCE)
        ]
        return np.concatenate(stresses) if stresses else np.zeros(0)

    @on_one_blas_thread
    def first_frequency(self, density: float) -> float:
        """The lowest natural frequency (Hz) of the beam, the mass of a `density` (kg/m^3) in the middles of slices."""
        cut = self.sections
        mass = cut.area * (cut.high - cut.low)
        solid = np.flatnonzero(mass > 0)
        centroids = np.column_stack([cut.centroid, cut.z])[solid]
        count = len(solid)
        one, other = np.tril_indices(count)  # `eigh` reads no more
        pairs = self._free(centroids[one], centroids[other])
        if self.support is not None:
            fixed = np.broadcast_to(self.support.place, centroids.shape)
            to, back = self._free(centroids, fixed), self._free(fixed, centroids)
            pairs = pairs - to[one] @ self._reaction @ back[other]
        root = np.repeat(np.sqrt(1e-12 * density * mass[solid]), 3)
        blocks = np.zeros((count, count, 3, 3))
        blocks[one, other] = pairs
        flexibility = blocks.transpose(0, 2, 1, 3).reshape(3 * count, -1)
        matrix = root[:, None] * flexibility * root
        largest = eigh(matrix, eigvals_only=True, subset_by_index=[3 * count - 1] * 2)[0]
        return float(1 / (2 * np.pi * np.sqrt(largest)))

    def _free(self, at: Float[ndarray, "n 3"], load: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
        """Displacement of the places `at` for unit forces at `load`, without the support, mm/N."""
        # The integrals over what is below each height.
        heights = np.minimum(at[:, 2], load[:, 2])
        cut = self.sections
        full = np.searchsorted(cut.high, heights, side="right")
        which = np.minimum(full, len(cut.low) - 1)
        top = np.clip(heights, cut.low[which], cut.high[which])
        extent = cut.high[which] - cut.low[which]
        within = (full < len(cut.low)) & (extent > 0)
        share = np.where(within, (top - cut.low[which]) / np.where(extent > 0, extent, 1.0), 0.0)
        part = self._pieces(which, top, cut.flexible[which] * share)
        a0, a1, a2 = (whole[full] + one for whole, one in zip(self._sums, part, strict=True))
        to, by = _cross_matrix(at), _cross_matrix(load)
        turned = to.transpose(0, 2, 1)
        return turned @ a0 @ by - turned @ a1 - a1.transpose(0, 2, 1) @ by + a2

    @cached_property
    def _reaction(self) -> Float[ndarray, "3 3"]:
        """Force of the support for a displacement that its place would have without it, N/mm."""
        assert self.support is not None
        place = self.support.place[None]
        stiffness = self.support.stiffness
        return stiffness @ np.linalg.inv(np.eye(3) + self._free(place, place)[0] @ stiffness)

    @cached_property
    def _flexibility(self) -> Float[ndarray, "n 3 3"]:
        """S of each slice; zero of one that is rigid."""
        cut = self.sections
        bends = cut.flexible > 0
        second = np.where(bends[:, None, None], cut.second, np.eye(2))
        polar = second[:, 0, 0] + second[:, 1, 1]
        area = np.where(bends, cut.area, 1.0)
        flexibility = np.zeros((len(second), 3, 3))
        # inv([[Ixx, -Ixy], [-Ixy, Iyy]]) is that of `second`, (yy and xx changed over) over the determinant
        flexibility[:, :2, :2] = second / np.linalg.det(second)[:, None, None] / self.youngs
        flexibility[:, 2, 2] = 4 * np.pi**2 * polar / area**4 * 2 * (1 + self.poisson) / self.youngs
        return np.where(bends[:, None, None], flexibility, 0.0)

    @cached_property
    def _stretch(self) -> Float[ndarray, "n 3"]:
        """What shear (x, y) and pull (z) give, a length; mm/N/mm."""
        area = np.where(self.sections.flexible > 0, self.sections.area, np.inf)
        factor = 6 * (1 + self.poisson) / (7 + 6 * self.poisson)
        shear = 2 * (1 + self.poisson) / factor
        return np.array([shear, shear, 1.0]) / (self.youngs * area[:, None])

    def _pieces(
        self, which: Int[ndarray, " n"], top: Float[ndarray, " n"], flexible: Float[ndarray, " n"]
    ) -> Integrals:
        """The integrals over slices from their lower ends to `top`, a `flexible` length of which bends."""
        low = self.sections.low[which]
        place = np.column_stack([self.sections.centroid[which], (low + top) / 2])
        each = self._flexibility[which] * flexible[:, None, None]
        cross = _cross_matrix(place)
        upward = _cross_matrix(np.array([[0.0, 0.0, 1.0]]))
        within = ((top - low) ** 2 / 12)[:, None, None] * (upward.transpose(0, 2, 1) @ each @ upward)
        second = cross.transpose(0, 2, 1) @ each @ cross + within
        straight = (self._stretch[which] * flexible[:, None])[:, :, None] * np.eye(3)
        return each, each @ cross, second + straight

    @cached_property
    def _sums(self) -> Integrals:
        """The integrals over all that gives way below each slice, that above the last one too."""
        whole = self._pieces(np.arange(len(self.sections.low)), self.sections.high, self.sections.flexible)
        first = self.seat.integrals if self.seat is not None else np.zeros((3, 1, 3, 3))
        both = zip(first, whole, strict=True)
        a0, a1, a2 = (np.cumsum(np.concatenate([below, part]), axis=0) for below, part in both)
        return a0, a1, a2

    def _stress(self, forces: Float[ndarray, "n 3"], points: Float[ndarray, "n 3"]) -> Float[ndarray, " n"]:
        """As `moment_stress`; of a run of like slices both ends tell all."""
        loads = [(points, forces)]
        if self.support is not None:
            place = np.broadcast_to(self.support.place, points.shape)
            moved = (self._free(place, points) @ forces[:, :, None])[:, :, 0]
            loads.append((place, -moved @ self._reaction.T))
        cut = self.sections
        bends = np.flatnonzero((cut.flexible > 0) & (cut.high > cut.low))
        strength = 4 * self.youngs / cut.area[bends, None, None] * self._flexibility[bends, :2, :2]
        centroids = cut.centroid[bends]
        new = np.r_[True, (strength[1:] != strength[:-1]).any(axis=(1, 2)) | (np.diff(centroids, axis=0) != 0).any(1)]
        runs = np.flatnonzero(new)
        low, high = cut.low[bends][runs], cut.high[bends][np.r_[runs[1:], len(bends)] - 1]
        met = points[:, 2:] > low
        worst = np.zeros(len(points))
        for ends in (np.broadcast_to(low, met.shape), np.minimum(high, points[:, 2:])):
            # bending moments (Nmm) about X and Y at the heights of the ends, of all forces above
            moment = np.zeros((*met.shape, 2))
            for place, force in loads:
                x, y = (place[:, None, k] - centroids[runs, k] for k in range(2))
                up = place[:, 2:] - ends
                above = up >= 0
                moment[:, :, 0] += np.where(above, y * force[:, 2:] - up * force[:, 1:2], 0.0)
                moment[:, :, 1] += np.where(above, up * force[:, :1] - x * force[:, 2:], 0.0)
            square = np.einsum("nsi,sij,nsj->ns", moment, strength[runs], moment)
            worst = np.maximum(worst, np.where(met, square, 0.0).max(axis=1, initial=0.0))
        return np.sqrt(worst)


def shell_seat(shell: TriangleMesh, part: TriangleMesh, foot: float, high: float, youngs: float) -> Seat:
    """What a shell of a `youngs` modulus (MPa) gives way that is held rigidly below the height `foot`, and holds the
    lower end of a `part` up to the height `high`, mm."""
    low = float(part.bounds[0, 2])
    height, middle = high - low, (low + high) / 2
    inside = mesh_sections(part, low, high)
    x, y = np.average(inside.centroid, axis=0, weights=inside.area)
    wall = WALL_MODULUS * youngs / (1 - POISSON**2)
    turns = np.diag([12 / height**2, 12 / height**2, np.pi / float(inside.area.mean())]) / (wall * height)
    cross = _cross_matrix(np.array([[x, y, middle]]))[0]
    integrals = [turns, turns @ cross, cross.T @ turns @ cross + np.eye(3) / (wall * height)]
    if foot < middle:
        names = pieces_of(shell)
        pieces = [mesh_sections(keep_faces(shell, names == name), foot, middle) for name in np.unique(names)]
        area = np.sum([each.area for each in pieces], axis=0)
        moved = np.sum([each.area[:, None] * each.centroid for each in pieces], axis=0)
        second = np.sum([each.second for each in pieces], axis=0)
        whole = Sections(
            pieces[0].low,
            pieces[0].high,
            area=area,
            centroid=moved / np.maximum(area, LEAST_AREA)[:, None],
            second=second,
            flexible=np.diff(_ends(foot, middle)),
        )
        integrals = [one + below[-1] for one, below in zip(integrals, Beam(whole, youngs)._sums, strict=True)]
    a0, a1, a2 = (one[None] for one in integrals)
    return Seat(low, youngs, (a0, a1, a2))


def _cross_matrix(vectors: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3 3"]:
    """[v]x, with [v]x w = v x w."""
    matrices = np.zeros((len(vectors), 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrices[:, j, k], matrices[:, k, j] = -vectors[:, i], vectors[:, i]
    return matrices


STEEL = 210_000.0
"""Elasticity of steel, MPa."""
STEEL_SHEAR = 81_000.0
"""Its shear modulus, MPa."""


def tailstock_support(holding: HoldingJob, pin: Column | None, youngs: float) -> Support | None:
    """What the tailstock of a holding, whose pin or upper neck this is, does to a part whose material has this `youngs`
    modulus (MPa); None where it has none."""
    if pin is None:
        return None
    angle = np.radians(holding.tailstock_azimuth_deg)
    way = holding.tailstock_reach * np.array([np.cos(angle), np.sin(angle)]) - [pin.x, pin.y]
    length = float(np.linalg.norm(way))
    height = pin.top + holding.tailstock_arm / 2
    arm = holding.tailstock_arm
    column = np.pi / 64 * holding.tailstock_column**4

    of_pin = youngs if holding.tailstock == NECK else STEEL
    hinged = (pin.top - pin.bottom) ** 3 / (3 * of_pin * np.pi / 4 * pin.radius**4)
    bends = hinged + height**3 / (3 * STEEL * column)
    along = bends + length / (STEEL * arm**2)
    across = bends + length**2 * height / (STEEL_SHEAR * 2 * column) + length**3 / (STEEL * arm**4 / 4)

    toward = way / length
    sideways = np.array([-toward[1], toward[0]])
    stiffness = np.zeros((3, 3))
    stiffness[:2, :2] = np.outer(toward, toward) / along + np.outer(sideways, sideways) / across
    return Support(np.array([pin.x, pin.y, pin.bottom]), stiffness)
