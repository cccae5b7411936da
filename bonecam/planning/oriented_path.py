"""From the contacts of a level to its tool path: an axis for every contact, and the links that join the
passes."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.arrays import angles_between
from bonecam.errors import OrientationError
from bonecam.job import NcJob, PathJob
from bonecam.job.nc_section import LINK_FEED
from bonecam.machine.limits import MachineLimits
from bonecam.material.in_process_stock import InProcessStock
from bonecam.mesh.smooth_surface import nearest_areas
from bonecam.planning.axes.free_axes import blocked_by
from bonecam.planning.axes.lead import SINGULAR_ANGLE, least_polar_angles
from bonecam.planning.axes.tool_axes import ToolAxes, WantedAxes, choose_axes, eased_axes, fixed_axes, judged_axes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.contacts import planned_tolerance
from bonecam.planning.layers import HeightMesh
from bonecam.planning.link_space import Feeds, LinkSpace, join_moves, moves_of
from bonecam.planning.links import (
    LinkedRuns,
    Run,
    begins_tangentially,
    find_leads,
    from_there,
    lift_for_rewinds,
    link_runs,
    near_links,
)
from bonecam.planning.scene import Scene
from bonecam.tool.path import ContactPath, FreeCones, MoveKind, ToolPath

MAX_TURN = np.radians(30.0)
"""A cutting move turns the tool axis by no more, radians: else the tool retracts and comes back."""
LEAD_RADII = 0.5
"""Radius of the arcs on which cuts begin and end, in radii of the ball; a half and a quarter of it are tried too."""


def orient(
    path: ContactPath,
    scene: Scene,
    limits: MachineLimits,
    job: PathJob,
    nc: NcJob,
    wanted: WantedAxes | None = None,
    *,
    fixed: Float[ndarray, "n 3"] | None = None,
    material: InProcessStock | HeightMesh | None = None,
    explained: bool = True,
    before: ToolPath | None = None,
) -> ToolPath:
    """Tool axes for the contacts of one level, and safe moves before, between and behind its passes.

    `wanted` are the axes to start from, eased where they would hold the cut up; without them they lean by the lead
    angle. `fixed` axes are taken as they are, or the contact is left out. Links close to the level remove nothing of
    the `material` that stands before it is cut, where that is known; of an in-process stock cuts begin and end on arcs.
    Contacts without an admissible axis, and passes that cannot be reached, are left out and listed in `uncut`
    (`limits`, `collision`); by what (`blocked_by`) where that is to be `explained`. A path without contacts only visits
    the safe point. The path is lifted where the machine's rotary axes must be rewound. It goes on from where the path
    `before` it left the stock, if that is of its level and cutter and the program is in one piece. Raises
    OrientationError where none of the contacts can be reached.
    """
    checker = CollisionChecker(scene, path.cutter, job.clearance)
    feeds = Feeds(LINK_FEED, nc.plunge_feed, nc.rapid_feed)
    tolerance = planned_tolerance(job.gouge_tolerance)
    # an arc sweeps what lies beside the cut: how much that is must be known
    lead = LEAD_RADII * path.cutter.radius if isinstance(material, InProcessStock) else 0.0
    space = LinkSpace(checker, limits, feeds, job.clearance, tolerance, material=material, lead_radius=lead)
    if not len(path.contacts):
        return _idle_path(path, space)
    judged = None
    if fixed is not None:
        chosen = fixed_axes(path, checker, fixed, limits)
    else:
        chosen = choose_axes(path, checker, limits, job, wanted)
        if wanted is not None:
            chosen = eased_axes(path, chosen, wanted, checker, limits, job=job)
            if job.certify != "distances":
                chosen, judged = judged_axes(path, chosen, wanted, checker)
    # What is against the contacts that have no axis but by collisions, where it is to be `explained`; OrientationError
    # where none has an axis.
    colliding = np.flatnonzero(np.array(chosen.reasons) == "collision")
    blocked = {}
    if explained and len(colliding):
        blocked = blocked_by(path.take(colliding), scene, limits, float(np.radians(job.max_tilt_deg)))
    if not chosen.found.any():
        why = f" ({next(iter(blocked))})" if blocked else ""
        remedy = "use a longer overhang, a longer post (holding.length) or a slimmer holder"
        everywhere = nearest_areas(scene.level, np.vstack([path.contacts, path.uncut]))
        area = float(everywhere[: len(path.contacts)].sum())
        what = f"no contact has a free tool axis{why}, {area:.1f} mm2 stay uncut"
        raise OrientationError(f"level {path.level}: {what}: {remedy}", level=path.level, area_mm2=area)

    runs, near = near_links(space, path, chosen.axes, _runs(path, chosen, checker))
    poses = list(zip(path.centres, chosen.axes))
    leads = find_leads(space, (path.centres, path.normals, chosen.axes), runs, near)
    linked = link_runs(space, poses, runs, near, leads)
    if linked.home is None:
        remedy = "raise path.clearance or the tool's overhang"
        if scene.clamping.beside:
            remedy = "beside a tailstock the tool comes lying: give a longer post (holding.length) or overhang"
        raise OrientationError(f"level {path.level}: no pass can be reached safely: {remedy}", level=path.level)
    oriented = _tool_path(path, chosen, space, runs, linked, cones=wanted.cones if wanted else None)
    oriented = lift_for_rewinds(replace(oriented, blocked_by=blocked, poses=judged), space)
    return from_there(before, oriented, space) if nc.one_piece else oriented


def _idle_path(path: ContactPath, space: LinkSpace) -> ToolPath:
    """The tool path of a level that is left as it is: the tool stands at the safe point."""
    centre, axis = space.safe_pose
    nan = np.full((1, 3), np.nan)
    return ToolPath(
        level=path.level,
        cutter=path.cutter,
        kinds=np.array([int(MoveKind.RAPID)]),
        pass_index=np.array([-1]),
        parameters=nan[:, :2],
        contacts=nan,
        tips=path.cutter.tips_of(centre, axis)[None],
        axes=axis[None],
        feed_rates=np.array([space.feeds.rapid]),
        uncut=path.uncut,
        reasons=path.reasons,
        trimmed=path.trimmed,
        rest=path.rest,
    )


def _runs(path: ContactPath, chosen: ToolAxes, checker: CollisionChecker) -> list[Run]:
    """The contacts that have an axis, split wherever the tool cannot cut straight from one to the next."""
    index = np.flatnonzero(chosen.found)

    # Whether the tool cuts straight from each contact of `index` to the next: neighbours on one pass, no turn or a
    # small one off the singularity, proven free
    passes, axes = path.pass_index[index], chosen.axes[index]
    neighbours = (passes[1:] == passes[:-1]) & (np.diff(index) == 1)
    small_turn = angles_between(axes[1:], axes[:-1]) <= MAX_TURN
    off_singularity = (least_polar_angles(axes) > SINGULAR_ANGLE) | (axes[1:] == axes[:-1]).all(axis=1)
    joined = np.r_[neighbours & small_turn & off_singularity, False]
    tips = path.cutter.tips_of(path.centres[index], axes)
    joined = checker.moves_free(tips, axes, joined, chosen.free_in_motion[index])

    return np.split(index, np.flatnonzero(~joined[:-1]) + 1)


def _tool_path(
    path: ContactPath,
    chosen: ToolAxes,
    space: LinkSpace,
    runs: Sequence[Run],
    linked: LinkedRuns,
    cones: FreeCones | None,
) -> ToolPath:
    """The tool path: from the safe point through the runs that are reached and back home; `cones` are those of the
    contacts."""
    assert linked.home is not None
    centre, axis = space.safe_pose
    moves = [moves_of(MoveKind.RAPID, centre[None], axis[None], space.feeds.rapid)]
    contacts: list[ndarray] = [np.full(1, -1)]
    passes: list[ndarray] = [np.full(1, -1)]
    number = -1
    in_air = space.known_in_air(path.centres[[run[0] for run in linked.runs]])
    for k, link in linked.links:
        number += len(link) > 0
        run = linked.runs[k]
        straight = len(link) and not begins_tangentially(link.centres[-1], path.centres[run])
        cutting = moves_of(MoveKind.CUT, path.centres[run], chosen.axes[run], path.cutter.feed)
        if straight and not in_air[k]:
            cutting.feeds[0] = min(space.feeds.plunge, path.cutter.feed)
        moves += [link, cutting]
        contacts += [np.full(len(link), -1), run]
        passes += [np.full(len(link), -1), np.full(len(run), number)]
    away = np.full(len(linked.home), -1)
    joined = join_moves([*moves, linked.home])
    contact = np.concatenate([*contacts, away])

    is_cut = (contact >= 0)[:, None]

    # The contacts left out and why: those of the path, those without an axis, and those of `runs` that are not
    # reached
    cut = [linked.runs[k] for k, _ in linked.links]
    unreached = np.setdiff1d(np.concatenate(runs), np.concatenate(cut))
    without_axis = np.flatnonzero(~chosen.found)
    uncut = np.vstack([path.uncut, path.contacts[without_axis], path.contacts[unreached]])
    reasons = [chosen.reasons[i] for i in without_axis] + ["collision"] * len(unreached)

    return ToolPath(
        level=path.level,
        cutter=path.cutter,
        kinds=joined.kinds,
        pass_index=np.concatenate([*passes, away]),
        parameters=np.where(is_cut, path.parameters[contact], np.nan),
        contacts=np.where(is_cut, path.contacts[contact], np.nan),
        tips=path.cutter.tips_of(joined.centres, joined.axes),
        axes=joined.axes,
        feed_rates=joined.feeds,
        uncut=uncut,
        reasons=path.reasons + tuple(reasons),
        trimmed=path.trimmed,
        rest=path.rest,
        cones=cones.at(contact) if cones else None,
    )
