"""Smooth tool axes inside certified cones (Xu et al. 2013, section 5): the field of least elastic energy.

Rounds of two steps: of the free axes at every contact the cone that holds the field best, then the field of least
energy within these cones. The cones are chosen anew from round to round, so the field may leave one cone for another.

The energy of a field of tool axes over a path, a first field, and its minimum near a field.

Samples are contacts about SPACING apart along the passes. Levenberg's and Marquardt's method minimises the energy.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.linalg import solve, solveh_banded

from bonecam.arrays import AXIS_QUANTUM, lengths, settled, unit
from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits, polar_angles, rotary_turns
from bonecam.planning.axes.cones.admissible_cones import AxisCones
from bonecam.planning.axes.cones.verify_cones import verified_cones
from bonecam.planning.axes.facets.contact_facets import ContactFacets
from bonecam.planning.axes.field.axis_energy import PRESETS, AxisBounds, AxisEnergy
from bonecam.planning.axes.field.axis_field import AxisField, FieldDomain, second_differences
from bonecam.planning.axes.field.facet_energy import FacetEnergy
from bonecam.planning.axes.tool_axes import WantedAxes
from bonecam.planning.collision.scene import Scene
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ContactPath

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


def sample_rows(path: ContactPath) -> Int[ndarray, " k"]:
    """Contacts about SPACING apart along each pass, its ends included."""
    passes = path.pass_index
    begins = np.r_[True, passes[1:] != passes[:-1]]
    moved = np.r_[0.0, np.linalg.norm(np.diff(path.centres, axis=0), axis=1)]
    way = np.cumsum(np.where(begins, 0.0, moved))
    along = way - way[begins][np.cumsum(begins) - 1]
    cell = np.floor(along / SPACING)
    return np.flatnonzero(begins | np.r_[begins[1:], True] | np.r_[True, cell[1:] != cell[:-1]])


def axis_energy(
    cones: AxisCones,
    rows: Int[ndarray, " k"],
    domain: FieldDomain,
    limits: MachineLimits,
    job: PathJob,
    weights: tuple[float, float],
    facets: ContactFacets | None,
) -> AxisEnergy:
    """The energy at the contacts `rows`, as yet without their cones, and on the facets; without facets all samples
    count alike."""
    path = cones.path
    centres, passes = path.centres[rows], path.pass_index[rows]
    normals = path.normals[rows]
    moves = np.flatnonzero(passes[1:] == passes[:-1])
    lengths = np.linalg.norm(centres[moves + 1] - centres[moves], axis=1)
    return AxisEnergy(
        parameters=path.parameters[rows],
        normals=normals,
        domain=domain,
        winding=_winding(domain.round(path.parameters[rows, 0]), normals) if domain.closed else 0,
        moves=moves,
        times=np.maximum(lengths, SPACING / 100) / path.cutter.feed,
        speeds=(limits.turn_speed, limits.tilt_speed),
        bounds=_bounds(normals, cones.largest_polar[rows], limits, job),
        weights=weights,
        areas=None if facets is None else np.add.reduceat(facets.areas, rows),
        facets=_on_facets(facets, domain, job),
    )


def _on_facets(facets: ContactFacets | None, domain: FieldDomain, job: PathJob) -> FacetEnergy | None:
    """The energy on facets with the job's weights, where one is above 0."""
    weights = job.membrane, job.thin_plate
    return FacetEnergy.of(facets, domain, *weights) if facets is not None and any(weights) else None


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


def _winding(share: Float[ndarray, " n"], normals: Float[ndarray, "n 3"]) -> int:
    """Whether the azimuth of the normals grows (1) or falls (-1) with the share of the way round."""
    horizontal = normals[:, 0] + 1j * normals[:, 1]
    turned = np.exp(2j * np.pi * share)
    return 1 if abs((horizontal * turned.conj()).sum()) >= abs((horizontal * turned).sum()) else -1


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
AUTOMATIC = "automatic"
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
    preset: str = AUTOMATIC,
    start: AxisField | None = None,
    haste: float = 1.0,
    facets: ContactFacets | None = None,
) -> SmoothAxes:
    """Axes of least elastic energy for the contacts of `cones`, inside the cones where a smooth field can be.

    `domain` holds the contacts' (s, t). `preset` weighs turning (`membrane`) or its change (`thin-plate`);
    `automatic` takes what the machine, by the speeds in `limits`, does sooner. `start` is the field of a neighbouring
    level; `facets` are those between the contacts. The energy is that of cuts `haste` times as fast as the feed: rates
    weigh as much more against leaving the cones. ValueError for another preset.
    """
    if preset == AUTOMATIC:
        candidates = [
            smooth_axes(cones, domain, limits=limits, job=job, preset=one, start=start, haste=haste, facets=facets)
            for one in PRESETS
        ]
        return min(candidates, key=lambda one: machine_minutes(cones.path, one.axes, limits))
    if preset not in PRESETS:
        raise ValueError(f"preset = {preset!r}: give {', '.join(PRESETS)} or {AUTOMATIC}")
    rows = sample_rows(cones.path)
    energy = axis_energy(cones, rows, domain=domain, limits=limits, job=job, weights=PRESETS[preset], facets=facets)
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
