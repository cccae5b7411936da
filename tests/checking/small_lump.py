"""A lump with a groove, the contacts on it, and what stands round it."""

import numpy as np
from small_parts import (
    FINISHING_CUTTER,
    HOLDING,
    ROUGHING_CUTTER,
    UPRIGHT_CAPSULE,
    grooved_pebble,
    level_of,
    mesh_of,
    revolved,
)

from bonecam.job import PathJob
from bonecam.mesh import MeshDistance
from bonecam.planning import Scene, candidate_contacts, contact_path
from bonecam.surface import TSpline
from bonecam.tool import ContactPath, Cutter
from bonecam.workholding import Clamping, post_below


def at_parameters(surface: TSpline, parameters: np.ndarray, passes: np.ndarray | None = None) -> ContactPath:
    """Makes the contacts of a surface at parameters (n, 2), of one pass or of the passes given."""
    s, t = parameters.T
    count = len(s)
    points, normals = surface.positions(s, t), surface.normals(s, t)
    return ContactPath(
        level=0,
        cutter=FINISHING_CUTTER,
        pass_index=np.zeros(count, dtype=np.int64) if passes is None else passes,
        parameters=parameters,
        contacts=points,
        normals=normals,
        feeds=np.zeros((count, 3)),
        centres=points + FINISHING_CUTTER.radius * normals,
        lifts=np.zeros(count),
        ramp=np.zeros(count, dtype=bool),
        uncut=np.zeros((0, 3)),
        reasons=(),
    )


def cylinder_contacts(surface: TSpline) -> ContactPath:
    """Makes contacts on 24 lines along the middle of a closed surface."""
    (low, high), (bottom, top) = surface.domain
    s, t = np.meshgrid(np.arange(24) / 24, np.linspace(0.3, 0.7, 15), indexing="ij")
    parameters = np.column_stack([low + s.ravel() * (high - low), bottom + t.ravel() * (top - bottom)])
    return at_parameters(surface, parameters, np.repeat(np.arange(24), 15))


def lump(
    job: PathJob, clamping: Clamping, cutter: Cutter = ROUGHING_CUTTER, waist: float = 0.8
) -> tuple[TSpline, ContactPath, Scene]:
    """Makes a lump with a groove of depth `waist` (mm) under 0.4 mm of material, its contacts for a cutter, and their
    scene."""
    surface = grooved_pebble(waist)
    level, material = mesh_of(surface), mesh_of(grooved_pebble(waist, 0.4))
    post = post_below(level, HOLDING)
    found = candidate_contacts(level_of(surface), [MeshDistance(level)], cutter, post, job)
    scene = Scene(level, material, UPRIGHT_CAPSULE, post, clamping=clamping)
    return surface, contact_path(found), scene


def round_capsule() -> TSpline:
    """Closed, with both poles: a body of revolution 12 mm high with round ends."""
    return revolved(lambda share, azimuth: 4 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 4, 0)), 0.0, 12.0)


def lattice_on(capsule: TSpline) -> ContactPath:
    """Contacts all over the capsule on 30 lines from pole to pole, each turned a little on: the seam is crossed, and
    each line ends in both poles."""
    s, t = np.meshgrid(np.arange(30) / 30, np.linspace(0, 1, 41), indexing="ij")
    s = np.mod(s + 0.3 * t / 30, 1.0)
    (low, high), (bottom, top) = capsule.domain
    parameters = np.column_stack([low + s.ravel() * (high - low), bottom + t.ravel() * (top - bottom)])
    return at_parameters(capsule, parameters, np.repeat(np.arange(30), 41))
