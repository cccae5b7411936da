"""The neck between stub and part, found by stiffness together with the depths of the cuts that it bears.

Of necks of some diameters each has the shortest length with which all is reached, and, where a job leaves them open,
the fewest and deepest cuts that it bears. Of those that hold (`neck_figures.py`) the thinnest is taken with which
machining takes no more than MOST_MINUTES of the time of the quickest, since what stays uncut round a neck grows with
it; where none holds, the stiffest.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bonecam.errors import BonecamError
from bonecam.job import Job, field_error
from bonecam.job.materials.preset import read_material
from bonecam.machine.limits import MachineLimits
from bonecam.planning.estimate import LayersToCut
from bonecam.planning.holding.neck_figures import Neck, neck_figures
from bonecam.planning.holding.post_length import (
    STOCK_CHORD,
    find_post_length,
    level_lifts,
    parting_lift,
    sampled_lifts,
    shortest_post,
)
from bonecam.setup.placement import Setup
from bonecam.workholding.bar import settled_stub
from bonecam.workholding.clamping import clamping_of
from bonecam.workholding.post import NECKS, post_below
from bonecam.workholding.tailstock import settled_height

MOST_MINUTES = 1.2
"""A thinner neck may take so many times the machining time of the quickest that holds."""
WIDER = (12.0, 16.0, 20.0)
WIDE_SHARE = 0.45
"""Necks (mm) that are tried beside NECKS where they are at most this share of the stock's width: on a thinner one a
block of 50 mm swings at a third of the frequency of the teeth."""
FEWER_CONTACTS = 400
"""So many contacts are sampled for each neck: the length of the one that is taken is found with all."""
SHOWN = 3
"""Necks that are reported."""


def find_standing(setup: Setup, job: Job, limits: MachineLimits) -> tuple[Setup, Job, tuple[Neck, ...]]:
    """Setup and job with the stub, neck, length and height of a tailstock that the job leaves open; and the best of
    the necks that were tried, the one that is taken first: that of the job alone where it states one. None where
    nothing is known of how stiff its material is."""
    job = replace(job, holding=settled_stub(job.holding, setup.stock.diameter))
    necks: tuple[Neck, ...] = ()
    layers = LayersToCut.between(setup.part.mesh, setup.stock.mesh(STOCK_CHORD))
    if not job.holding.diameter:
        setup, job, necks = _standing_on_best(setup, job, limits, layers)
    else:
        if not job.holding.length:
            setup, job = find_post_length(setup, job, limits)
        if read_material(job.material.name).stiffness is not None:
            necks = (neck_figures(setup, job, limits, layers),)
    vertices = setup.stock.mesh(STOCK_CHORD).vertices
    job = replace(job, holding=settled_height(job.holding, setup.post.pin, vertices))
    return setup, job, necks


def _standing_on_best(
    setup: Setup, job: Job, limits: MachineLimits, layers: LayersToCut
) -> tuple[Setup, Job, tuple[Neck, ...]]:
    """Setup and job with the first of the best necks that holds at its length, and the best necks, that one first:
    with all contacts a neck may be longer than when it was tried, and give way. Where all do, the stiffest."""
    tried = find_necks(setup, job, limits, layers)
    stood: list[tuple[Setup, Job, Neck]] = []
    for neck in [one for one in tried if one.holds] or tried[:1]:
        holding = replace(job.holding, diameter=neck.diameter)
        on_neck = replace(setup, post=post_below(setup.part.mesh, holding)), replace(job, holding=holding)
        if not holding.length:
            on_neck = find_post_length(*on_neck, limits)
        stood.append((*on_neck, _neck(*on_neck, limits, layers)))
        if stood[-1][-1].holds:
            break
    stood.sort(key=lambda one: (not one[-1].holds, one[-1].shift_um))
    again = {neck.diameter for *_, neck in stood}
    others = ranking([neck for *_, neck in stood[1:]] + [one for one in tried if one.diameter not in again])
    taken_setup, taken_job, taken = stood[0]
    return taken_setup, taken_job, (taken, *others[: SHOWN - 1])


def find_necks(setup: Setup, job: Job, limits: MachineLimits, layers: LayersToCut) -> list[Neck]:
    """The necks that were tried, ranked; `layers` are what is to be cut. JobError where no neck is thinner than stub
    and stock or meets the part."""
    width = float(np.ptp(setup.stock.bounds[:, :2], axis=0).min())
    asked = []
    trouble = None
    for diameter in neck_diameters(width, job):
        holding = replace(job.holding, diameter=diameter)
        try:
            post = post_below(setup.part.mesh, holding)
            asked.append((replace(setup, post=post), replace(job, holding=holding)))
        except BonecamError as error:
            trouble = error
    # what gives way at its least length does so at any: its reach is asked last, if at all; two have to hold, as the
    # thicker tells whether cuts on the thinner take long
    hopeful = [shortest_neck(*one, limits, layers).holds for one in asked]
    order = sorted(range(len(asked)), key=lambda k: (not hopeful[k], k if hopeful[k] else -k))
    tried: list[Neck] = []
    for one in (asked[k] for k in order):
        if len(tried) >= SHOWN and sum(neck.holds for neck in tried) > 1:
            break
        try:
            tried.append(_neck(*one, limits, layers))
        except BonecamError as error:
            trouble = error
    if not tried and trouble is not None:
        raise trouble
    if not tried:
        bound = f"the stock is {width:.2f} mm wide, necks from {NECKS[0]:g} mm are tried: give one, or a larger stock"
        raise field_error("holding", "diameter", 0.0, bound)
    return ranking(tried)


def neck_diameters(width: float, job: Job) -> list[float]:
    """The diameters (mm) of the necks that are tried below a stock of a `width`, mm: that of the job if it has one."""
    if job.holding.diameter:
        return [job.holding.diameter]
    thickest = min(width, job.holding.stub_diameter or width)
    wider = (neck for neck in WIDER if neck <= WIDE_SHARE * width)
    return [neck for neck in (*NECKS, *wider) if neck < thickest]


def shortest_neck(setup: Setup, job: Job, limits: MachineLimits, layers: LayersToCut) -> Neck:
    """The neck of a job's diameter, of the least length that it may have, and how it holds the part of a setup."""
    holding = job.holding
    least = holding.length or shortest_post(np.zeros(0), 0.0, clamping_of(holding, limits.bodies.table))
    return _neck(setup, replace(job, holding=replace(holding, length=least)), limits, layers)


def ranking(necks: Sequence[Neck]) -> list[Neck]:
    """Necks that hold, the thinnest first, but those last with which machining takes more than MOST_MINUTES times that
    of the quickest; then the others, the stiffest first."""
    minutes = [neck.machining_min for neck in necks if neck.holds and neck.machining_min is not None]
    most = MOST_MINUTES * min(minutes, default=np.inf)

    def order(neck: Neck) -> tuple[bool, bool, float]:
        if not neck.holds:
            return True, False, neck.shift_um
        return False, neck.machining_min is not None and neck.machining_min > most, neck.diameter

    return sorted(necks, key=order)


def _neck(setup: Setup, job: Job, limits: MachineLimits, layers: LayersToCut) -> Neck:
    """The neck of a job's diameter, as long as is needed, and how it holds the part of a setup."""
    height = float(setup.stock.bounds[0, 2])
    top = job.holding.length
    if not top:
        lifts = np.r_[
            sampled_lifts(setup, job, limits, FEWER_CONTACTS),
            level_lifts(setup, job, limits.bodies),
            parting_lift(setup, job, limits),
        ]
        top = shortest_post(lifts, height, clamping_of(job.holding, limits.bodies.table))
    standing = replace(job, holding=replace(job.holding, length=top))
    return neck_figures(setup.lift(top - height), standing, limits, layers)
