"""The energy of a field of tool axes over a path, a first field, and its minimum near a field.

Samples are contacts about SPACING apart along the passes. Levenberg's and Marquardt's method minimises the energy.
"""

from typing import Any

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.linalg import solve, solveh_banded

from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits, polar_angles
from bonecam.planning.axes.cones.admissible_cones import AxisCones
from bonecam.planning.axes.facets.contact_facets import ContactFacets
from bonecam.planning.axes.field.axis_energy import AxisBounds, AxisEnergy
from bonecam.planning.axes.field.axis_field import FieldDomain, second_differences
from bonecam.planning.axes.field.facet_energy import FacetEnergy
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


def minimise(
    energy: AxisEnergy, values: Float[ndarray, "2 c"], steps: int
) -> tuple[Float[ndarray, "2 c"], float]:
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
            step = solveh_banded(
                damped.T, gradient.T.ravel(), overwrite_ab=True, lower=True, check_finite=False
            )
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
