"""Smooth tool axes inside certified cones (Xu et al. 2013, section 5): the field of least elastic energy.

Rounds of two steps: of the free axes at every contact the cone that holds the field best, then the field of least
energy within these cones. The cones are chosen anew from round to round, so the field may leave one cone for another.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from bonecam.arrays import AXIS_QUANTUM, lengths, settled, unit
from bonecam.job import PathJob
from bonecam.machine.limits import MachineLimits, rotary_turns
from bonecam.planning.axes.cones.admissible_cones import AxisCones
from bonecam.planning.axes.cones.verify_cones import verified_cones
from bonecam.planning.axes.facets.contact_facets import ContactFacets
from bonecam.planning.axes.field.axis_energy import PRESETS, AxisEnergy
from bonecam.planning.axes.field.axis_field import AxisField, FieldDomain
from bonecam.planning.axes.field.fit_axes import axis_energy, first_values, minimise, sample_rows
from bonecam.planning.axes.tool_axes import WantedAxes
from bonecam.planning.collision.scene import Scene
from bonecam.runtime.threads import on_one_blas_thread
from bonecam.tool.path import ContactPath

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
            smooth_axes(
                cones, domain, limits=limits, job=job, preset=one, start=start, haste=haste, facets=facets
            )
            for one in PRESETS
        ]
        return min(candidates, key=lambda one: machine_minutes(cones.path, one.axes, limits))
    if preset not in PRESETS:
        raise ValueError(f"preset = {preset!r}: give {', '.join(PRESETS)} or {AUTOMATIC}")
    rows = sample_rows(cones.path)
    energy = axis_energy(
        cones, rows, domain=domain, limits=limits, job=job, weights=PRESETS[preset], facets=facets
    )
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
        machine_minutes(one.cones.path, one.axes, limits) / max(int(one.wanted.certified.sum()), 1)
        for one in found
    ]
    as_soon = [one for one, cost in zip(found, costs, strict=True) if cost <= AS_SOON * min(costs)]
    return min(as_soon, key=lambda one: rotary_travel(one.cones.path, one.axes))


def rotary_travel(path: ContactPath, axes: Float[ndarray, "n 3"]) -> float:
    """How far both rotary axes turn in all along the passes, radians."""
    same = path.pass_index[1:] == path.pass_index[:-1]
    return float(np.abs(rotary_turns(axes)[same]).sum())
