"""Smooth fields of tool axes over a level (Xu et al. 2013, Eq. 22, in the angles of the machine).

Facets between the contacts of a path, made once a level (Xu et al. 2013, sections 2 and 4).

Delaunay triangles of the contacts in a plane where they lie as on the surface, with a normal, a curvature and a
Voronoi cell at each contact. Differs from the paper in:

1. Facets across places without contacts (left out, or beyond the edge of the surface) are none: those with an edge
   much longer than most.

A plane in which the contacts of a surface, given by their parameters, lie nearly as they do on the surface.

An open surface is laid out by its mean lengths along s and t. One that is closed round is turned about a point of the
plane: with the length l along it and the mean radius rho (circumference / 2 pi) a place lies at

    r (cos 2 pi s, sin 2 pi s),    ln r = -int dl / rho

which keeps angles and circles on a surface of revolution: circles that hold no other point there hold none here. So
neither the seam nor the pole at the highest t, the free end, needs points of its own; at the lowest t is the post.

A field of tool axes over the parameters of a level or a surface: splines for the two angles of the axis.

    polar angle theta(s, t),    azimuth phi(s, t) = 2 pi w s + (a spline),    w = 1, -1, or 0 where s is open

Both splines are bicubic, periodic in s where the surface is closed round. On a machine with a turning table theta and
phi are, but for signs and offsets, the angles of the two rotary axes: what is smooth here turns the machine smoothly.

The elastic energy of a field of tool axes, as residuals of a least-squares problem.

With the turn D of a rotary axis of speed w over a move that takes the time T at the feed, the rate is D / (w T); 1
means that the axis is as slow as the feed. Differs from Xu et al. (2013), Eq. 22, in:

1. The membrane is taken along the passes only, where a move costs time, not in all directions of the surface.
2. It is taken in the machine's angles, divided by its speeds, not in the components of the axes.
3. The thin plate is the second difference of the control values, not an integral: its matrix is banded.
4. Cones and machine limits are one-sided residuals, so that a field leaves a cone where none holds a smooth one.

On the phalanx's own level the mean feed is 869 of 900 mm/min (501 along the normals): `docs/pages/theory/axes.md`.

Smooth tool axes inside certified cones (Xu et al. 2013, section 5): the field of least elastic energy.

Rounds of two steps: of the free axes at every contact the cone that holds the field best, then the field of least
energy within these cones. The cones are chosen anew from round to round, so the field may leave one cone for another.

The energy of a field of tool axes over a path, a first field, and its minimum near a field.

Samples are contacts about SPACING apart along the passes. Levenberg's and Marquardt's method minimises the energy.

The smooth axes of a level, from those of the level round it.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import BSpline
from scipy.linalg import solve, solveh_banded
from scipy.sparse import csr_array, eye_array, kron, vstack

from bonecam.arrays import AXIS_QUANTUM, dots, frozen, lengths, settled, unit
from bonecam.job import PathJob
from bonecam.kernels.matrices import add_pairs, csr_parts, width
from bonecam.levels.measure import MachinedLevel
from bonecam.machine.limits import MachineLimits, polar_angles, rotary_turns
from bonecam.mesh.facets import delaunay, voronoi_areas
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.cones import AxisCones, admissible_cones, verified_cones
from bonecam.planning.axes.tool_axes import WantedAxes
from bonecam.planning.scene import Scene
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.surface.tspline import TSpline
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ContactPath

GRID_AROUND, GRID_ALONG = 32, 96
"""Places along s and t by which lengths are measured; those along t are denser at the ends, where poles may be."""
LEAST_RADIUS = 1e-3
"""Of a pole, as a share of the largest mean radius."""


def plane_points(surface: TSpline, parameters: Float[ndarray, "n 2"]) -> Float[ndarray, "n 2"]:
    """The places of (s, t) in the plane; in mm where the surface is open round, of no unit where it is closed."""
    s, t = ((float(low), float(high)) for low, high in surface.domain)
    closed = surface.closed_in_s
    around = np.linspace(s[0], s[1], GRID_AROUND + 1)
    along = t[0] + np.ptp(t) * (1 - np.cos(np.linspace(0, np.pi, GRID_ALONG))) / 2
    grid = np.stack(np.meshgrid(along, around, indexing="ij"), axis=2).reshape(-1, 2)
    points = surface.positions(grid[:, 1], grid[:, 0]).reshape(GRID_ALONG, GRID_AROUND + 1, 3)
    rings = np.linalg.norm(np.diff(points, axis=1), axis=2).sum(axis=1)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
    way = np.r_[0.0, np.cumsum(steps)]
    share = (parameters[:, 0] - s[0]) / np.ptp(s)
    if not closed:
        return np.column_stack([share * rings.mean(), np.interp(parameters[:, 1], along, way)])
    radii = rings / (2 * np.pi)
    radii = np.maximum(radii, LEAST_RADIUS * radii.max())
    log = cumulative_trapezoid(1 / radii, way, initial=0)
    r = np.exp(np.interp(parameters[:, 1], along, -log))
    return np.column_stack([r * np.cos(2 * np.pi * share), r * np.sin(2 * np.pi * share)])


SAME = 1e-6
"""Contacts less than about this apart (mm) are one vertex: the paper's unique vertices."""
LONG = 3.0
"""Facets with an edge so many times as long as MOST edges are none."""
MOST = 95
"""Percentile of the lengths of edges."""
THIN = 1e-6
"""A facet lower than this share of its longest edge in the plane is none: its contacts lie on a line."""


@dataclass(frozen=True, eq=False)
class ContactFacets:
    """Facets `mesh` between the contacts of a `path`; `vertex_of` each contact (n), -1 of one without facets, and a
    contact at each vertex (`contact_of`, v)."""

    path: ContactPath
    mesh: TriangleMesh
    vertex_of: Int[ndarray, " n"]
    contact_of: Int[ndarray, " v"]

    def __post_init__(self) -> None:
        for name in ("vertex_of", "contact_of"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64))

    @property
    def found(self) -> Bool[ndarray, " n"]:
        """Which contacts have facets."""
        return self.vertex_of >= 0

    @cached_property
    def areas(self) -> Float[ndarray, " n"]:
        """The area (mm^2) of the Voronoi cell of each contact, shared among contacts at one place; that of the median
        contact where there are no facets."""
        each = voronoi_areas(self.mesh)
        sharing = np.bincount(self.vertex_of[self.found], minlength=len(each))
        areas = (each / np.maximum(sharing, 1))[self.vertex_of]
        return np.where(self.found, areas, np.median(areas[self.found]))


def contact_facets(path: ContactPath, surface: TSpline) -> ContactFacets | None:
    """The facets between the contacts of a path on a surface; None where there are none, since all contacts lie on a
    line or there are fewer than three."""
    rounded = np.round(path.contacts / SAME)
    _, first, vertex_of = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    points = plane_points(surface, path.parameters[first])
    try:
        faces = delaunay(points)
    except ValueError:
        return None
    vertices = path.contacts[first]
    # Facets that have no edge much longer than most, and are no line in the plane
    edges = np.linalg.norm(np.roll(vertices[faces], -1, axis=1) - vertices[faces], axis=2)
    a, b, c = np.swapaxes(points[faces], 0, 1)
    ways = np.stack([b - a, c - a, c - b])
    doubled = ways[0, :, 0] * ways[1, :, 1] - ways[0, :, 1] * ways[1, :, 0]
    longest = (ways**2).sum(axis=2).max(axis=0)
    near = edges.max(axis=1) <= LONG * np.percentile(edges, MOST)
    faces = faces[near & (doubled > THIN * longest)]
    if not len(faces):
        return None
    used, index = np.unique(faces, return_inverse=True)
    number = np.full(len(vertices), -1)
    number[used] = np.arange(len(used))
    mesh = TriangleMesh(vertices[used], index.reshape(-1, 3).astype(np.int32))
    outward = dots(mesh.face_vectors, path.normals[first][faces].mean(axis=1)).sum()
    if outward < 0:
        mesh = TriangleMesh(mesh.vertices, mesh.faces[:, ::-1])
    return ContactFacets(path, mesh, number[vertex_of.ravel()], first[used])


AROUND = 20
"""Control values along s."""
ALONG = 24
"""Control values along t."""
DEGREE = 3
"""Of the splines in both parameters."""


@dataclass(frozen=True)
class FieldDomain:
    """Lowest and highest s and t; `closed`: s comes round to itself."""

    s: tuple[float, float]
    t: tuple[float, float]
    closed: bool

    @classmethod
    def of(cls, surface: TSpline) -> "FieldDomain":
        """The parameters of a surface."""
        (s0, s1), (t0, t1) = ((float(low), float(high)) for low, high in surface.domain)
        return cls((s0, s1), (t0, t1), bool(surface.elements().period[0] > 0))

    def round(self, s: Float[ndarray, " n"]) -> Float[ndarray, " n"]:
        """Which part of the way from the lowest to the highest s."""
        return (s - self.s[0]) / (self.s[1] - self.s[0])


@dataclass(frozen=True, eq=False)
class AxisField:
    """The field over a domain; `polar` and `azimuth` are control values in radians, s the faster index; `winding`
    is w."""

    domain: FieldDomain
    winding: int
    azimuth: Float[ndarray, " k"]
    polar: Float[ndarray, " k"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "azimuth", frozen(self.azimuth))
        object.__setattr__(self, "polar", frozen(self.polar))

    @classmethod
    def constant(cls, domain: FieldDomain, axis: Float[ndarray, "3"]) -> "AxisField":
        """The field of winding 0 that is one unit axis everywhere."""
        each = np.ones(AROUND * ALONG)
        return cls(domain, 0, np.arctan2(axis[1], axis[0]) * each, np.arccos(np.clip(axis[2], -1, 1)) * each)

    def axes(self, parameters: Float[ndarray, "n 2"]) -> Float[ndarray, "n 3"]:
        """Unit tool axes at (s, t)."""
        B = basis(parameters, self.domain)
        wound = 2 * np.pi * self.winding * self.domain.round(parameters[:, 0])
        return axes_of(wound + B @ self.azimuth, B @ self.polar)


def basis(parameters: Float[ndarray, "n 2"], domain: FieldDomain) -> csr_array:
    """Values of the products of B-splines at (s, t): sparse (n, AROUND ALONG)."""
    if not len(parameters):
        return csr_array((0, AROUND * ALONG))
    share = domain.round(parameters[:, 0])
    t = np.clip(parameters[:, 1], *domain.t)
    if domain.closed:
        s_knots = np.arange(-DEGREE, AROUND + DEGREE + 1) / AROUND
        around = BSpline.design_matrix(np.mod(share, 1.0), s_knots, DEGREE)
    else:
        around = BSpline.design_matrix(np.clip(share, 0, 1), _clamped((0.0, 1.0), AROUND), DEGREE)
    along = BSpline.design_matrix(t, _clamped(domain.t, ALONG), DEGREE)
    count = len(t)
    each = DEGREE + 1
    values = along.data.reshape(count, each, 1) * around.data.reshape(count, 1, each)
    columns = along.indices.reshape(count, each, 1) * AROUND + around.indices.reshape(count, 1, each) % AROUND
    rows = np.repeat(np.arange(count), each**2)
    return csr_array((values.ravel(), (rows, columns.ravel())), shape=(count, AROUND * ALONG))


def second_differences(domain: FieldDomain) -> csr_array:
    """Second differences of control values: along s, of a closed domain those of its rings, and along t."""
    ring = np.eye(AROUND)
    around = 2 * ring - np.roll(ring, 1, axis=1) - np.roll(ring, -1, axis=1)
    if not domain.closed:
        around = np.diff(ring, 2, axis=0)
    along = np.diff(np.eye(ALONG), 2, axis=0)
    parts = [kron(eye_array(ALONG), csr_array(around)), kron(csr_array(along), eye_array(AROUND))]
    return vstack(parts, format="csr")


def axes_of(azimuth: Float[ndarray, " n"], polar: Float[ndarray, " n"]) -> Float[ndarray, "n 3"]:
    """Unit vectors of azimuth and polar angle."""
    across = np.sin(polar)
    return np.column_stack([across * np.cos(azimuth), across * np.sin(azimuth), np.cos(polar)])


def _clamped(interval: tuple[float, float], count: int) -> Float[ndarray, " k"]:
    """Knots of `count` B-splines over an interval, at whose ends the first and the last are 1."""
    low, high = interval
    inner = np.linspace(low, high, count - DEGREE + 1)
    return np.concatenate([np.full(DEGREE, low), inner, np.full(DEGREE, high)])


SPEED_SHARE = 0.9
"""Rates above this are what the field is freed of first."""
SPEED_WEIGHT = 60.0
"""Of a rate above SPEED_SHARE, against one below it."""
BOUND_WEIGHT = 200.0
"""Of an angle beyond a bound or a cone, in rates a radian."""
SOFT_POLAR = np.radians(95.0)
"""A tool that droops below this polar angle (radians) comes near to table and housing: it costs,"""
SOFT_WEIGHT = 20.0
"""so much, in rates a radian: a tenth of a bound, so that cones come first."""
LEAST_SINE = np.sin(np.radians(5.0))
"""Of a bound from the normal: that of less than 5 degrees weighs no more."""
STRAIGHT = 1e-6
"""Sines below this are taken for it: an angle has no derivative at 0."""
WEIGHTS = 10.0, 0.2
"""Of the rates, and of second differences of control values in rates a radian. With 10 bones take 15 to 20 % fewer
minutes as their axes move than with 1; with 30 they take 1 % fewer again, and more axes leave their cones."""

Residual = tuple[Float[ndarray, " m"], Float[ndarray, " m"], Float[ndarray, " m"]]
"""Residuals, and their derivatives by azimuth and polar angle."""


@dataclass(frozen=True, eq=False)
class AxisBounds:
    """What the axes at n samples must keep, radians: polar angles between `least_polar` and `largest_polar`, angles
    from the surface normal between `least_lead` and `largest_tilt`, and within the `cones`, `cone_margin` inside their
    rims as `EllipticCones.off` measures it."""

    least_polar: float
    largest_polar: Float[ndarray, " n"]
    least_lead: float
    largest_tilt: Float[ndarray, " n"]
    cones: EllipticCones
    cone_margin: Float[ndarray, " n"]


@dataclass(frozen=True, eq=False)
class AxisEnergy:
    """The energy over n samples in the order of their passes.

    Move k leads from sample `moves[k]` to the next and takes `times[k]` (min) at the feed; `speeds` are those of
    azimuth and polar angle, rad/min. `areas` (mm^2) of the samples weigh their bounds, all alike where none are
    given.
    """

    parameters: Float[ndarray, "n 2"]
    normals: Float[ndarray, "n 3"]
    domain: FieldDomain
    winding: int
    moves: Int[ndarray, " m"]
    times: Float[ndarray, " m"]
    speeds: tuple[float, float]
    bounds: AxisBounds
    areas: Float[ndarray, " n"] | None = None

    @cached_property
    def values_at(self) -> csr_array:
        """From control values to values at the samples, (n, c)."""
        return basis(self.parameters, self.domain)

    @cached_property
    def steps(self) -> csr_array:
        """From control values to differences over the moves, (m, c)."""
        at = self.values_at
        return (at[self.moves + 1] - at[self.moves]).tocsr()

    @cached_property
    def roughness(self) -> csr_array:
        """From control values to their second differences both ways, weighted."""
        differences = second_differences(self.domain)
        return differences * (WEIGHTS[1] / np.sqrt(differences.shape[0]))

    @cached_property
    def bandwidth(self) -> int:
        """How many diagonals the lower band of the normal equations of both angles has."""
        matrices = [self.values_at, self.steps, self.roughness]
        return 2 * max(width(*csr_parts(matrix)[:2]) for matrix in matrices)

    @cached_property
    def shares(self) -> Float[ndarray, " n"]:
        """Roots of the shares of the whole area that belong to the samples."""
        areas = np.ones(len(self.parameters)) if self.areas is None else self.areas
        return np.sqrt(areas / areas.sum())

    def angles(self, values: Float[ndarray, "2 c"]) -> tuple[Float[ndarray, " n"], Float[ndarray, " n"]]:
        """Azimuth and polar angle at the samples, radians."""
        wound = 2 * np.pi * self.winding * self.domain.round(self.parameters[:, 0])
        return wound + self.values_at @ values[0], self.values_at @ values[1]

    def residuals(self, values: Float[ndarray, "2 c"]) -> tuple["Residuals", ...]:
        """The residuals of moves, of samples, and of second differences."""
        rough = (self.roughness @ values.T).T
        each = np.ones(rough.shape[1])
        roughness = Residuals.of(self.roughness, [(rough[0], each, 0 * each), (rough[1], 0 * each, each)])
        # The rates of both angles, and what they exceed SPEED_SHARE by; a move round the part whose winding alone is
        # faster cannot be helped.
        residuals: list[Residual] = []
        share = np.sqrt(self.times / self.times.sum())
        s = self.domain.round(self.parameters[:, 0])
        short_way = np.mod(s[self.moves + 1] - s[self.moves] + 0.5, 1.0) - 0.5
        none = np.zeros(len(short_way))
        for angle, wound in ((0, 2 * np.pi * self.winding * short_way), (1, none)):
            scale = share / (self.speeds[angle] * self.times)
            rate = scale * (wound + self.steps @ values[angle])
            avoidable = np.abs(scale * wound) < SPEED_SHARE * share
            over = np.where(avoidable, np.maximum(np.abs(rate) - SPEED_SHARE * share, 0.0), 0.0)
            slope = SPEED_WEIGHT * np.sign(rate) * (over > 0) * scale
            for residual, by_angle in ((WEIGHTS[0] * rate, WEIGHTS[0] * scale), (SPEED_WEIGHT * over, slope)):
                residuals.append((residual, none, by_angle) if angle else (residual, by_angle, none))
        return Residuals.of(self.steps, residuals), self._bounds(*self.angles(values)), roughness

    def _bounds(self, azimuth: Float[ndarray, " n"], polar: Float[ndarray, " n"]) -> "Residuals":
        """What angles exceed their bounds by, and how far axes are outside their cones."""
        residuals: list[Residual] = []
        bounds = self.bounds
        weight = BOUND_WEIGHT * self.shares
        drooping = SOFT_WEIGHT / BOUND_WEIGHT
        for beyond, sign, share in (
            (polar - bounds.largest_polar, 1.0, 1.0),
            (bounds.least_polar - polar, -1.0, 1.0),
            (polar - SOFT_POLAR, 1.0, drooping),
        ):
            slope = sign * share * weight * (beyond > 0)
            residuals.append((share * weight * np.maximum(beyond, 0.0), 0 * slope, slope))

        axes = axes_of(azimuth, polar)
        by_azimuth = np.column_stack([-axes[:, 1], axes[:, 0], np.zeros(len(axes))])
        by_polar = axes_of(azimuth, polar + np.pi / 2)
        cosine = dots(axes, self.normals)
        gradients = dots(by_azimuth, self.normals), dots(by_polar, self.normals)
        for bound, sign in ((bounds.largest_tilt, -1.0), (bounds.least_lead, 1.0)):
            beyond = sign * (cosine - np.cos(bound))
            scale = weight / np.maximum(np.sin(bound), LEAST_SINE)  # so that it is an angle near the bound
            slope = sign * scale * (beyond > 0)
            residuals.append((scale * np.maximum(beyond, 0.0), slope * gradients[0], slope * gradients[1]))

        matrices = bounds.cones.matrices
        mean = np.maximum(bounds.cones.mean_angles, 0.0)
        q, *slopes = (np.einsum("nij,nj->ni", matrices, part) for part in (axes, by_azimuth, by_polar))
        across = np.maximum(lengths(q[:, :2]), STRAIGHT)
        flat = np.tan(mean)
        beyond = np.arctan2(flat * across, q[:, 2]) - (mean - bounds.cone_margin)
        beyond = np.where(bounds.cones.found, np.maximum(beyond, 0.0), 0.0)
        scale = (beyond > 0) * weight * flat / np.maximum((flat * across) ** 2 + q[:, 2] ** 2, STRAIGHT)
        by_azimuth, by_polar = (
            scale * (q[:, 2] * dots(q[:, :2], slope[:, :2]) / across - across * slope[:, 2]) for slope in slopes
        )
        residuals.append((weight * beyond, by_azimuth, by_polar))
        return Residuals.of(self.values_at, residuals)


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals (q, m) that depend on the two angles at the rows of `matrix` (m, c), which leads to these from
    control values; `slopes` (q, m, 2) are their derivatives by azimuth and polar angle."""

    matrix: csr_array
    values: Float[ndarray, "q m"]
    slopes: Float[ndarray, "q m 2"]

    @classmethod
    def of(cls, matrix: csr_array, found: Sequence[Residual]) -> "Residuals":
        """Of residuals and their derivatives by either angle."""
        values, by_azimuth, by_polar = (np.array(part) for part in zip(*found))
        return cls(matrix, values, np.stack([by_azimuth, by_polar], axis=-1))

    @property
    def energy(self) -> float:
        """The sum of their squares."""
        return float((self.values**2).sum())

    @property
    def gradient(self) -> Float[ndarray, "2 c"]:
        """Half the derivatives of their energy by the control values."""
        return np.asarray((self.matrix.T @ np.einsum("qm,qma->ma", self.values, self.slopes)).T)

    def add_to(self, band: Float[ndarray, "k w"]) -> None:
        """Add their normal equations to a band whose unknown 2 j + a is angle a of control value j."""
        metric = np.einsum("qma,qmb->mab", self.slopes, self.slopes)
        add_pairs(band, *csr_parts(self.matrix), metric)


SPACING = 0.5
"""Distance of the samples along the passes, mm."""
LEAST_DROP = 5e-3
"""A step that lowers the energy by a smaller share is the last one."""
FIRST_DAMPING, LARGEST_DAMPING = 1e-3, 1e6
"""Of the steps, in diagonal entries of the normal equations."""
TILT_SHARE = 0.87
"""Part of the largest tilt that the field uses: contacts between the samples need the rest."""
REACH = np.radians(5.0)
"""Where a normal points beyond the polar limits, the tilt may exceed the least possible one by this, radians."""
MARGIN = np.radians(2.0)
"""The field keeps this far from the polar limits, radians."""
LEAST_POLAR = np.radians(10.0)
"""And this far from the pole of the rotary axes, radians."""
FIRST_LEAN, FIRST_LOWEST, FIRST_HIGHEST = np.radians([20.0, 35.0, 90.0])
"""The first axes lean up from the normal by this, within these polar angles, radians."""
FIT_ROUGHNESS = 0.02
"""Weight of second differences in the first fit."""


def axis_energy(
    cones: AxisCones,
    rows: Int[ndarray, " k"],
    domain: FieldDomain,
    limits: MachineLimits,
    job: PathJob,
    facets: ContactFacets | None,
) -> AxisEnergy:
    """The energy at the contacts `rows`, as yet without their cones; without facets all samples count alike."""
    path = cones.path
    centres, passes = path.centres[rows], path.pass_index[rows]
    normals = path.normals[rows]
    moves = np.flatnonzero(passes[1:] == passes[:-1])
    lengths = np.linalg.norm(centres[moves + 1] - centres[moves], axis=1)
    winding = 0
    if domain.closed:
        # whether the azimuth of the normals grows (1) or falls (-1) with the share of the way round
        horizontal = normals[:, 0] + 1j * normals[:, 1]
        turned = np.exp(2j * np.pi * domain.round(path.parameters[rows, 0]))
        winding = 1 if abs((horizontal * turned.conj()).sum()) >= abs((horizontal * turned).sum()) else -1
    return AxisEnergy(
        parameters=path.parameters[rows],
        normals=normals,
        domain=domain,
        winding=winding,
        moves=moves,
        times=np.maximum(lengths, SPACING / 100) / path.cutter.feed,
        speeds=(limits.turn_speed, limits.tilt_speed),
        bounds=_bounds(normals, cones.largest_polar[rows], limits, job),
        areas=None if facets is None else np.add.reduceat(facets.areas, rows),
    )


def _bounds(
    normals: Float[ndarray, "n 3"], largest: Float[ndarray, " n"], limits: MachineLimits, job: PathJob
) -> AxisBounds:
    """The bounds of the job and the machine; where a normal points beyond the polar limits the tilt is allowed what
    the axis needs."""
    margin = min(MARGIN, (limits.largest - limits.smallest) / 2)
    least = max(limits.smallest + margin, LEAST_POLAR)
    largest = np.maximum(largest - margin, least)
    angle = polar_angles(normals)
    needed = np.maximum(angle - largest, least - angle)
    tilt = np.maximum(TILT_SHARE * np.radians(job.max_tilt_deg), needed + REACH)
    lead = min(np.radians(job.least_lead_deg), float(tilt.min()) / 2)
    return AxisBounds(
        least_polar=least,
        largest_polar=largest,
        least_lead=lead,
        largest_tilt=tilt,
        cones=EllipticCones.none(len(normals)),
        cone_margin=np.zeros(len(normals)),
    )


def first_values(energy: AxisEnergy, normals: Float[ndarray, "n 3"]) -> Float[ndarray, "2 c"]:
    """Control values fitted to normals at the samples, turned towards +Z by FIRST_LEAN; a sample counts by its area."""
    horizontal = normals[:, 0] + 1j * normals[:, 1]
    wound = 2 * np.pi * energy.winding * energy.domain.round(energy.parameters[:, 0])
    relative = horizontal * np.exp(-1j * wound)
    middle = relative.sum()
    azimuth = np.angle(middle) + np.angle(relative * np.conj(middle))
    polar = np.clip(polar_angles(normals) - FIRST_LEAN, FIRST_LOWEST, FIRST_HIGHEST)
    differences = second_differences(energy.domain)
    rough = FIT_ROUGHNESS * len(normals) / differences.shape[0] * (differences.T @ differences)
    each = energy.values_at.T * (len(normals) * energy.shares**2)
    weighted = each * np.abs(horizontal)
    return np.array(
        [
            _solve(weighted @ energy.values_at + rough, weighted @ azimuth),
            _solve(each @ energy.values_at + rough, each @ polar),
        ]
    )


def _solve(matrix: Any, right: Float[ndarray, " c"]) -> Float[ndarray, " c"]:
    dense = matrix.toarray()
    return solve(dense + 1e-9 * np.trace(dense) * np.eye(len(dense)), right, assume_a="pos")


def minimise(energy: AxisEnergy, values: Float[ndarray, "2 c"], steps: int) -> tuple[Float[ndarray, "2 c"], float]:
    """Control values of least energy near `values`, by Levenberg's and Marquardt's method in at most `steps` steps,
    and their energy."""
    damping = FIRST_DAMPING
    residuals = energy.residuals(values)
    least = sum(part.energy for part in residuals)
    for _ in range(steps):
        band = np.zeros((values.size, energy.bandwidth))
        for part in residuals:
            part.add_to(band)
        gradient = np.sum([part.gradient for part in residuals], axis=0)
        diagonal = band[:, 0] + 1e-3 * band[:, 0].mean()
        while damping < LARGEST_DAMPING:
            damped = band.copy()
            damped[:, 0] += damping * diagonal
            step = solveh_banded(damped.T, gradient.T.ravel(), overwrite_ab=True, lower=True, check_finite=False)
            tried = values - step.reshape(-1, 2).T
            residuals = energy.residuals(tried)
            tried_energy = sum(part.energy for part in residuals)
            if tried_energy < least:
                break
            damping *= 5
        else:
            break
        dropped = least - tried_energy
        values, least = tried, tried_energy
        damping /= 3
        if dropped < LEAST_DROP * least:
            break
    return values, least


FIRST_STEPS, STEPS = 20, 5
"""Steps of the minimisation before there are cones, and in each round."""
ROUNDS = 8
"""Times that cones are chosen at most."""
INSIDE = 0.999
"""Share of the contacts that are in their cones when no more are chosen,"""
SETTLED = 0.02
"""and by which share of the energy the last round has changed it."""
CONE_MARGIN = np.radians(1.5)
"""The field keeps this far inside its cones at the samples, radians: contacts between them need the rest."""
HASTES = (5.0, 8.0)
"""How many times faster than the feed the machine is taken to go when a field is made smoother than the feed asks: on
the blade of the shipped impeller the axes turn 4,116 / 5,599, 996 / 1,262 and 639 / 784 degrees with 1, 5 and 8."""
AS_SOON = 1.01
"""Axes that cost no more than this many times the least are as soon."""


@dataclass(frozen=True, eq=False)
class SmoothAxes:
    """The field, its unit `axes` at the contacts, and the cones about them."""

    field: AxisField
    axes: Float[ndarray, "n 3"]
    cones: AxisCones

    def verified(self, scene: Scene) -> "SmoothAxes":
        """These axes, with FCL's word on the cones in the scene that they were made in."""
        return replace(self, cones=verified_cones(self.cones, scene))

    @cached_property
    def wanted(self) -> WantedAxes:
        """The axes, and which of them are free by their cones, with their halves of the moves to their neighbours on
        the pass."""
        passes = self.cones.path.pass_index
        middles = unit(self.axes[1:] + self.axes[:-1])
        apart = passes[1:] != passes[:-1]
        before = np.vstack([self.axes[:1], np.where(apart[:, None], self.axes[1:], middles)])
        behind = np.vstack([np.where(apart[:, None], self.axes[:-1], middles), self.axes[-1:]])
        held = [self.cones.contain(axes) for axes in (self.axes, before, behind)]
        return WantedAxes(self.axes, np.logical_and.reduce(held), self.cones.of(self.cones.path))

    def wanted_for(self, path: ContactPath) -> WantedAxes:
        """The field's axes at the contacts of a path on the same surface; certified are only those of the cones' own
        path."""
        if path is self.cones.path:
            return self.wanted
        axes = self.field.axes(path.parameters)
        return WantedAxes(axes, np.zeros(len(axes), dtype=bool), self.cones.of(path))


@on_one_blas_thread
def smooth_axes(
    cones: AxisCones,
    domain: FieldDomain,
    limits: MachineLimits,
    job: PathJob,
    start: AxisField | None = None,
    haste: float = 1.0,
    facets: ContactFacets | None = None,
) -> SmoothAxes:
    """Axes of least elastic energy for the contacts of `cones`, inside the cones where a smooth field can be.

    `domain` holds the contacts' (s, t). `start` is the field of a neighbouring level; `facets` are those between the
    contacts. The energy is that of cuts `haste` times as fast as the feed: rates weigh as much more against leaving the
    cones.
    """
    # Contacts about SPACING apart along each pass, its ends included.
    passes = cones.path.pass_index
    begins = np.r_[True, passes[1:] != passes[:-1]]
    moved = np.r_[0.0, np.linalg.norm(np.diff(cones.path.centres, axis=0), axis=1)]
    way = np.cumsum(np.where(begins, 0.0, moved))
    along = way - way[begins][np.cumsum(begins) - 1]
    cell = np.floor(along / SPACING)
    rows = np.flatnonzero(begins | np.r_[begins[1:], True] | np.r_[True, cell[1:] != cell[:-1]])
    energy = axis_energy(cones, rows, domain=domain, limits=limits, job=job, facets=facets)
    energy = replace(energy, times=energy.times / haste)
    if start is None:
        values, least = minimise(energy, first_values(energy, cones.path.normals[rows]), FIRST_STEPS)
    else:
        energy = replace(energy, winding=start.winding)
        values = np.array([start.azimuth, start.polar])
        least = np.inf
    field = AxisField(domain, energy.winding, azimuth=values[0], polar=values[1])
    axes = field.axes(cones.path.parameters)
    for _ in range(ROUNDS):
        cones = cones.about(axes)
        before = least
        values, least = minimise(_within(energy, cones, rows), values, STEPS)
        field = AxisField(domain, energy.winding, azimuth=values[0], polar=values[1])
        axes = field.axes(cones.path.parameters)
        outside = cones.depths(axes)[cones.found] < 0
        if outside.sum() <= (1 - INSIDE) * len(outside) and abs(before - least) < SETTLED * least:
            break
    azimuth, polar = settled(values, AXIS_QUANTUM)
    field = AxisField(domain, energy.winding, azimuth, polar)
    axes = field.axes(cones.path.parameters)
    if limits.narrow:
        axes = limits.nearest(axes)
    return SmoothAxes(field, axes, cones.about(axes))


def _within(energy: AxisEnergy, cones: AxisCones, rows: Int[ndarray, " k"]) -> AxisEnergy:
    """The energy with the cones of its samples."""
    shapes = cones.shapes.take(cones.free.net.node_of[rows])
    mean = shapes.mean_angles
    margin = np.minimum(CONE_MARGIN * mean / np.maximum(shapes.angles[:, 1], 1e-9), mean / 2)
    return replace(energy, bounds=replace(energy.bounds, cones=shapes, cone_margin=margin))


def machine_minutes(path: ContactPath, axes: Float[ndarray, "n 3"], limits: MachineLimits) -> float:
    """Minutes that the cuts of a path take with these axes, each move at the feed or as fast as the slowest rotary
    axis; accelerations are left out."""
    same = path.pass_index[1:] == path.pass_index[:-1]
    moved = lengths(np.diff(path.centres, axis=0)[same]) / path.cutter.feed
    return float(np.maximum(moved, limits.turning_minutes(axes)[same]).sum())


def soonest(found: Sequence[SmoothAxes], limits: MachineLimits) -> SmoothAxes:
    """Of several axes of one path those that cost the fewest minutes for each contact certified free; of those that
    are as soon, the ones with the least travel of the rotary axes."""
    costs = [
        machine_minutes(one.cones.path, one.axes, limits) / max(int(one.wanted.certified.sum()), 1) for one in found
    ]
    as_soon = [one for one, cost in zip(found, costs, strict=True) if cost <= AS_SOON * min(costs)]
    return min(as_soon, key=lambda one: rotary_travel(one.cones.path, one.axes))


def rotary_travel(path: ContactPath, axes: Float[ndarray, "n 3"]) -> float:
    """How far both rotary axes turn in all along the passes, radians."""
    same = path.pass_index[1:] == path.pass_index[:-1]
    return float(np.abs(rotary_turns(axes)[same]).sum())


SLOW = 1.15
"""Axes with which the cuts take more than this many times what they take at the feed are sought anew: those of outer
levels, of which little is cut, lead inner ones astray (scaphoid: 8.1 min on level 0, anew 5.6)."""


def level_axes(
    contacts: ContactPath,
    level: MachinedLevel,
    scene: Scene,
    limits: MachineLimits,
    job: PathJob,
    before: SmoothAxes | None,
) -> SmoothAxes | None:
    """Smooth axes of a level in elliptic cones of free ones, from the field of the level `before`; where the machine is
    too SLOW for these, the soonest of these, of those in circular cones, and of those made anew. None where the job
    wants none. Where no contact has a cone there is nothing to smooth."""
    if job.orientation != "cones" or not len(contacts.contacts):
        return before
    with ThreadPoolExecutor(1) as thread:
        meanwhile = thread.submit(contact_facets, contacts, level.surface)
        cones = admissible_cones(contacts, scene, limits, job)
    if not cones.found.any():
        return before
    domain = FieldDomain.of(level.surface)
    start = before.field if before else None
    facets = meanwhile.result()
    make = partial(smooth_axes, domain=domain, limits=limits, job=job, facets=facets)
    smooth = make(cones, start=start)
    at_feed = machine_minutes(contacts, smooth.axes, MachineLimits(limits.largest))
    if machine_minutes(contacts, smooth.axes, limits) > SLOW * at_feed:
        others = [(cones.as_circles(), start), *([(cones, None)] if start else [])]
        smooth = soonest([smooth, *(make(shapes, start=from_) for shapes, from_ in others)], limits)
    return smooth if job.certify == "distances" else smooth.verified(scene)
