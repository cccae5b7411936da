"""What an oriented tool path promises, checked by a tool made of points that knows nothing of the proofs."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from small_lump import lump
from small_parts import HOLDING, ROUGHING_CUTTER, UPRIGHT_CAPSULE, grooved_pebble, level_of, mesh_of, pebble

from bonecam.arrays import angles_between, unit
from bonecam.errors import MachineError, OrientationError
from bonecam.job import NcJob, PathJob
from bonecam.job.nc_section import LINK_FEED
from bonecam.levels import RoundedLevel, StockLevel
from bonecam.levels.measure import NO_CUT
from bonecam.machine import MachineLimits
from bonecam.machine.bodies import Frustum
from bonecam.machine.limits import polar_angles
from bonecam.material import uncut_material
from bonecam.mesh import MeshDistance
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.planning import Scene, candidate_contacts, contact_path, link_space, orient
from bonecam.planning.axes.lead import (
    SINGULAR_ANGLE,
    SINGULAR_CONE,
    avoid_singularity,
    candidate_directions,
    lead_axes,
    least_polar_angles,
)
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.layers import HeightMesh
from bonecam.planning.link_space import Departure, Feeds, LinkSpace
from bonecam.planning.links import ABOVE, begins_tangentially, direct_links
from bonecam.planning.oriented_path import MAX_TURN
from bonecam.setup import ConvexStock
from bonecam.tool import ContactPath, Cutter, MoveKind, ToolPath
from bonecam.workholding import Clamping, post_below
from bonecam.workholding.post import Column

pytestmark = pytest.mark.whole

MIKRON = MachineLimits(np.radians(115.0))


def made(
    cutter: Cutter = ROUGHING_CUTTER,
    limits: MachineLimits = MIKRON,
    waist: float = 0.8,
    clamping: Clamping = Clamping(),  # noqa: B008
    **job: object,
) -> tuple[ContactPath, Scene, ToolPath]:
    """Covers a lump with a groove of depth `waist` (mm) and orients its path."""
    settings = PathJob(**{"pattern": "round", **job})  # type: ignore[arg-type]
    _, contacts, scene = lump(settings, clamping, cutter, waist)
    return contacts, scene, orient(contacts, scene, limits, settings, NcJob())


@pytest.fixture(scope="module", params=["round", "along"])
def case(request):
    return made(pattern=request.param)


def between(path: ToolPath, parts: int = 4) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tips, axes and kinds along all moves, ends included."""
    f = np.repeat(np.arange(1, parts + 1) / parts, len(path.tips) - 1)[:, None]
    tile = lambda rows: np.tile(rows, (parts, 1))  # noqa: E731
    tips = (1 - f) * tile(path.tips[:-1]) + f * tile(path.tips[1:])
    return (tips, unit((1 - f) * tile(path.axes[:-1]) + f * tile(path.axes[1:])), np.tile(path.kinds[1:], parts))


def tool_points(cutter: Cutter) -> list[tuple[str, np.ndarray]]:
    """Points on the walls of each section with the tip at the origin and the axis along +Z."""
    angle = np.arange(12) * (np.pi / 6)
    rim = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    found = []
    for section in cutter.profile:
        f = np.linspace(0, 1, 9)
        heights = section.start + f * (section.end - section.start)
        radii = section.radius + f * (section.end_radius - section.radius)
        found.append((section.name, np.vstack([r * rim + [0, 0, h] for r, h in zip(radii, heights)])))
    return found


def assert_nothing_is_entered(scene: Scene, path: ToolPath) -> None:
    """Along every move ball, shank, holder and spindle keep out of level, material and post, and keep the
    clearance from table, chuck, post (holder and spindle) and, in rapids, from the material."""
    tips, axes, kinds = between(path)
    level, material = MeshDistance(scene.level), MeshDistance(scene.material)
    side = np.where(np.abs(axes[:, :1]) < 0.9, np.array([[1.0, 0, 0]]), np.array([[0.0, 1, 0]]))
    x = unit(np.cross(side, axes))
    frames = np.stack([x, np.cross(axes, x), axes], axis=2)
    centres = tips + path.cutter.radius * axes
    air, kept = PathJob().clearance, scene.clamping.clearance
    assert (path.cutter.radius - level.signed(centres)).max() <= PathJob().gouge_tolerance
    assert (material.signed(centres[kinds == MoveKind.RAPID]) - path.cutter.radius).min() >= air
    for name, points in tool_points(path.cutter):
        placed = (np.einsum("nij,kj->nki", frames, points) + tips[:, None]).reshape(-1, 3)
        rapid = np.repeat(kinds == MoveKind.RAPID, len(points))
        assert placed[:, 2].min() >= kept, f"{name} near the table"
        for column in (*scene.clamping.columns, *scene.clamping.beside):
            assert column.distance(placed).min() >= kept, f"{name} near the chuck"
        from_post = kept if name in ("holder", "spindle") else 0.0
        assert scene.post.distance(placed).min() > from_post, f"{name} near the post"
        near = np.r_[0, np.flatnonzero(scene.stock.signed_distance(placed) < air + 0.1)]
        in_air = material.signed(placed[near][rapid[near]], air + 0.1)
        assert in_air.min(initial=np.inf) >= air, f"{name} in a rapid"
        solid = level if name == "cutter" else material
        assert solid.signed(placed[near], 0.1).min() > -PathJob().gouge_tolerance, f"{name} in the material"


def test_the_tool_never_enters_anything(case):
    _, scene, path = case
    assert_nothing_is_entered(scene, path)


CHUCK = Clamping((Column(12.0, 18.0),), clearance=4.0)
NOSE = (Frustum(30.0, 40.0, 40.0), Frustum(20.0, 40.0, 60.0))


def test_spindle_chuck_and_cones_are_kept_clear_of():
    """By closed forms along every move; a wider nose is held more upright, a higher chuck leaves more uncut and is
    told as what is against it, and nothing enters either."""
    slim = replace(ROUGHING_CUTTER, holder=(Frustum(40.0, 8.0, 16.0),), nose=NOSE)
    wide = replace(slim, nose=(Frustum(50.0, 70.0, 70.0),))
    high = Clamping((Column(12.0, 26.0),), clearance=4.0)
    left, steepest = [], []
    for cutter, clamping in ((slim, CHUCK), (wide, CHUCK), (slim, high)):
        _, scene, path = made(cutter, clamping=clamping)
        assert_nothing_is_entered(scene, path)
        left.append(sum(reason == "collision" for reason in path.reasons))
        steepest.append(np.degrees(polar_angles(path.axes).max()))
    assert left[0] == left[1] == 0
    assert steepest[1] < steepest[0] - 2
    assert left[2] > 0
    assert next(iter(path.blocked_by)).endswith("against the clamping")
    assert sum(path.blocked_by.values()) <= left[2]


def test_a_bracket_beside_the_part_is_never_entered_and_the_program_begins_off_it():
    """Cuts, links and the ways in and out keep the clearance from column and arm by closed form; the first and last
    place is on the side away from the column."""
    slim = replace(ROUGHING_CUTTER, holder=(Frustum(40.0, 8.0, 16.0),), nose=NOSE)
    _, scene, _ = made(slim)
    top = float(scene.level.bounds[1, 2]) + 14.0
    column = Column(6.0, top + 8.0, 0.0, 60.0, 20.0)
    arm = tuple(Column(6.0, top + 8.0, top, 6.0 * k, 2.0 * k) for k in range(10))
    _, scene, path = made(slim, clamping=Clamping(clearance=4.0, beside=(column, *arm)))
    assert_nothing_is_entered(scene, path)
    assert path.tips[[0, -1]] @ [60.0, 20.0, 0.0] == pytest.approx(path.tips[0] @ [60.0, 20.0, 0.0])
    assert path.tips[0] @ [60.0, 20.0, 0.0] < 0
    assert (path.kinds == MoveKind.CUT).sum() > 100


def test_a_part_too_low_for_a_tool_that_comes_lying_is_told():
    wide = replace(ROUGHING_CUTTER, holder=(Frustum(40.0, 8.0, 16.0),), nose=(Frustum(50.0, 200.0, 200.0),))
    with pytest.raises(OrientationError, match=r"no pass can be reached safely: .* longer post \(holding.length\)"):
        made(wide, clamping=Clamping(clearance=4.0, beside=(Column(6.0, 80.0, 0.0, 120.0, 0.0),)))


def test_bent_retracts_and_approaches_stay_clear_and_slow_near_the_part(monkeypatch):
    def bent(axis):
        return [Departure(0.5, unit((axis + np.array([0.3, 0.2, 0.1]))[None])[0])]

    monkeypatch.setattr(link_space, "departures", bent)
    _, scene, path = made(pattern="along")
    assert_nothing_is_entered(scene, path)
    last_in = np.flatnonzero(
        (path.kinds[1:] == MoveKind.CUT)
        & (path.kinds[:-1] == MoveKind.LINK)
        & (path.feed_rates[:-1] == NcJob().plunge_feed)
    )
    assert len(last_in), "no pass was entered round a bend"
    tips, axes, kinds = between(path)
    air = MeshDistance(scene.material).signed(tips + path.cutter.radius * axes) - path.cutter.radius
    assert air[kinds == MoveKind.RAPID].min() > PathJob().clearance


def test_every_contact_is_cut_or_listed(case):
    contacts, _, path = case
    cut = path.kinds == MoveKind.CUT
    assert cut.sum() + len(path.uncut) == len(contacts.contacts) + len(contacts.uncut)
    assert len(path.reasons) == len(path.uncut)
    assert not {"collision", "limits"} & set(path.reasons), "every contact of this body can be reached"
    assert np.isnan(path.contacts[~cut]).all()
    assert (path.pass_index[~cut] == -1).all()


def test_tips_and_axes_belong_to_the_contacts(case):
    contacts, _, path = case
    cut = path.kinds == MoveKind.CUT
    assert np.allclose(np.linalg.norm(path.axes, axis=1), 1)
    assert np.allclose(path.contacts[cut], contacts.contacts)
    assert np.allclose(path.tips[cut] + path.cutter.radius * path.axes[cut], contacts.centres)


def test_axes_keep_limits_and_never_jump_in_a_pass(case):
    contacts, _, path = case
    assert MIKRON.allow(path.axes).all()
    cut = path.kinds == MoveKind.CUT
    assert angles_between(path.axes[cut], contacts.normals).max() <= np.radians(PathJob().max_tilt_deg) + 1e-6
    same = cut[1:] & (path.pass_index[1:] == path.pass_index[:-1])
    assert angles_between(path.axes[1:], path.axes[:-1])[same].max() <= MAX_TURN


def test_upper_contacts_take_the_lead_angle(case):
    contacts, _, path = case
    wished = lead_axes(contacts.normals, contacts.feeds, np.radians(10.0))
    cut = path.kinds == MoveKind.CUT
    high = polar_angles(wished) < np.radians(80)
    steered = avoid_singularity(wished, contacts.centres, contacts.pass_index)
    assert np.allclose(path.axes[cut][high], steered[high])
    assert np.allclose(angles_between(wished, contacts.normals), np.radians(10.0))
    assert polar_angles(path.axes[cut]).min() >= SINGULAR_CONE - 1e-9


def test_no_cut_or_link_passes_the_singularity(case):
    _, _, path = case
    turned = (path.axes[1:] != path.axes[:-1]).any(axis=1)
    assert least_polar_angles(path.axes)[turned & (path.kinds[1:] != MoveKind.RAPID)].min() > SINGULAR_ANGLE


def test_a_level_begins_and_ends_clear_above_the_stock(case):
    _, scene, path = case
    for row in (0, -1):
        assert path.kinds[row] == MoveKind.RAPID
        assert path.tips[row, 2] > scene.stock.end[2] + scene.stock.radius + PathJob().clearance
        assert np.allclose(path.axes[row], [0, 0, 1])


def entries(path: ToolPath) -> np.ndarray:
    """The rows that a pass begins with."""
    return np.flatnonzero((path.kinds == MoveKind.CUT) & (np.r_[-1, path.pass_index[:-1]] != path.pass_index))


def test_passes_are_entered_at_the_plunge_feed(case):
    _, _, path = case
    assert (path.feed_rates[entries(path)] == NcJob().plunge_feed).all()
    assert (path.feed_rates[path.kinds == MoveKind.LINK] <= LINK_FEED).all()


def test_passes_are_entered_on_arcs_at_their_feed_where_the_material_is_known():
    """Nothing is entered by arcs and links either. Entries are straight where heights of what stands are known
    alone."""
    surface, contacts, scene = lump(PathJob(pattern="along"), Clamping(), ROUGHING_CUTTER, 0.0)
    stock = ConvexStock(convex_hull(scene.level.vertices), proven=True)
    known = uncut_material([level_of(surface), StockLevel(1, stock.mesh(0.01), 0.5, NO_CUT)], stock)
    path = orient(contacts, scene, MIKRON, PathJob(pattern="along"), NcJob(), material=known)
    first = entries(path)
    along = np.array([begins_tangentially(path.balls[k - 1], path.balls[k : k + 2]) for k in first])
    assert along.any()
    assert (path.feed_rates[first[along]] == path.cutter.feed).all()
    assert_nothing_is_entered(scene, path)
    job = PathJob(pattern="along")
    without = orient(contacts, scene, MIKRON, job, NcJob(), material=HeightMesh(scene.level))
    assert not any(begins_tangentially(without.balls[k - 1], without.balls[k : k + 2]) for k in entries(without))


def test_passes_that_begin_in_air_are_entered_at_the_feed_of_their_cuts(monkeypatch):
    """The runs whose first contact is above the middle count as begun in air."""
    middle = made(pattern="along")[1].level.bounds[:, 2].mean()
    monkeypatch.setattr(LinkSpace, "known_in_air", lambda _, centres: centres[:, 2] > middle)
    _, _, path = made(pattern="along")
    first = entries(path)
    high = path.balls[first, 2] > middle
    assert high.any()
    assert not high.all()
    assert (path.feed_rates[first][high] == path.cutter.feed).all()
    assert (path.feed_rates[first][~high] == NcJob().plunge_feed).all()


def test_narrow_limits_turn_axes_up_and_list_the_rest():
    contacts, _, path = made(limits=MachineLimits(np.radians(60.0)), max_tilt_deg=50.0)
    assert polar_angles(path.axes).max() <= np.radians(60.0) + 1e-6
    listed = path.uncut[[reason == "limits" for reason in path.reasons]]
    assert len(listed)
    down = polar_angles(contacts.normals) > np.radians(111.0)
    assert len(listed) >= down.sum()


def test_a_stubby_tool_leaves_what_its_holder_cannot_reach():
    stubby = replace(ROUGHING_CUTTER, overhang=12.0, holder=(Frustum(50.0, 16.0, 16.0),))
    _, scene, path = made(stubby)
    material = MeshDistance(scene.material)
    tips, axes, _ = between(path)
    for h in (0.0, 20.0, 50.0):
        assert material.signed(tips + (12.0 + h) * axes).min() > 0
    assert set(path.reasons) <= {"post", "gouge", "collision", "limits"}


@pytest.fixture
def grooved():
    """A pebble with a groove, and what links over it are planned in: 0.4 mm of material stand on it."""
    surface, material = grooved_pebble(0.8), mesh_of(grooved_pebble(0.8, 0.4))
    level = mesh_of(surface)
    scene = Scene(level, material, UPRIGHT_CAPSULE, post_below(level, HOLDING))
    checker, job = CollisionChecker(scene, ROUGHING_CUTTER), PathJob()
    feeds = Feeds(500.0, 200.0, 5000.0)
    return surface, LinkSpace(checker, MIKRON, feeds, job.clearance, job.gouge_tolerance)


def test_a_direct_link_between_opposite_axes_is_refused(grooved):
    """There is no turn between them to be proven free."""
    _, space = grooved
    place, x = np.array([[0.0, 0.0, 60.0]]), np.array([[1.0, 0.0, 0.0]])
    assert direct_links(space, (place, x, x), (place + 0.1, x, -x), 1.0) == [None]


def test_a_longer_link_runs_over_the_material_like_a_taut_string(grooved):
    """Over a groove it neither dips into it nor leaves the material by more than it must."""
    surface, space = grooved
    t = np.array([0.35, 0.65])
    normals = surface.normals(np.full(2, 0.1), t)
    centres = surface.positions(np.full(2, 0.1), t) + space.ball_radius * normals
    first, last = ((centres[k : k + 1], normals[k : k + 1], normals[k : k + 1]) for k in (0, 1))
    (link,) = direct_links(space, first, last, 1.0)
    assert link is not None
    assert set(link.kinds) == {MoveKind.LINK}
    dense = np.vstack([np.linspace(a, b, 9) for a, b in pairwise(link.centres)])
    above = space.checker.scene.material_distance.signed(dense) - space.ball_radius
    assert above.min() > 0
    assert above[[0, -1]].max() < 2 * ABOVE
    length = np.linalg.norm(np.diff(link.centres, axis=0), axis=1).sum()
    assert length < 1.1 * np.linalg.norm(centres[1] - centres[0])


def test_a_link_whose_turn_leaves_the_limits_between_its_ends_is_refused(grooved):
    """The shortest turn between two axes below the horizon passes lower than both."""
    surface, space = grooved
    s, t = np.array([0.1, 0.2]), np.full(2, 0.35)
    normals = surface.normals(s, t)
    centres = surface.positions(s, t) + space.ball_radius * normals
    first, last = ((centres[k : k + 1], normals[k : k + 1], normals[k : k + 1]) for k in (0, 1))
    (link,) = direct_links(space, first, last, 1.0)
    assert link is not None
    ends = float(polar_angles(normals).max())
    assert polar_angles(link.axes).max() > ends > np.pi / 2
    assert direct_links(replace(space, limits=MachineLimits(ends)), first, last, 1.0) == [None]


def test_a_level_that_rounds_no_material_is_passed_over():
    """A body that rounds the edges of a stock may lie outside the stock all round."""
    surface = pebble(0.5)
    mesh, stock = mesh_of(surface), replace(UPRIGHT_CAPSULE, radius=1.0)
    level = RoundedLevel(2, surface, mesh, 0.5, level_of(surface).measures, stock, surface.control_points)
    post = post_below(mesh, HOLDING)
    contacts = contact_path(
        candidate_contacts(level, [MeshDistance(mesh)], ROUGHING_CUTTER, post, PathJob(pattern="round"))
    )
    assert not len(contacts.contacts)
    assert not len(contacts.uncut)
    path = orient(contacts, Scene(mesh, mesh, UPRIGHT_CAPSULE, post), MIKRON, PathJob(), NcJob())
    assert path.kinds.tolist() == [MoveKind.RAPID]
    assert UPRIGHT_CAPSULE.signed_distance(path.tips)[0] > 0


def test_a_link_keeps_out_of_the_part_too():
    """Where a level touches the part, its coarser mesh lies inside the part."""
    level, part = mesh_of(pebble(), 24, 30), mesh_of(pebble(0.05))
    scene = Scene(level, mesh_of(pebble(1.0)), UPRIGHT_CAPSULE, post_below(level, HOLDING))
    feeds = Feeds(500.0, 200.0, 5000.0)
    height = level.bounds[1, 2] + ROUGHING_CUTTER.radius + 0.01
    start, end = np.array([[-0.1, 0.0, height]]), np.array([[0.1, 0.0, height]])
    for known, free in ((None, True), (MeshDistance(part), False)):
        checker = CollisionChecker(replace(scene, part_distance=known), ROUGHING_CUTTER)
        space = LinkSpace(checker, MIKRON, feeds, 2.0, 0.01)
        assert space.ball_free(start, end).tolist() == [free]


def test_no_reach_at_all_is_an_error():
    with pytest.raises(OrientationError, match="level 0"):
        made(limits=MachineLimits(np.pi, np.radians(178.0)))


def test_the_candidate_directions_cover_the_sphere_evenly():
    directions = candidate_directions()
    assert directions.shape == (647, 3)
    probe = unit(np.random.default_rng(0).normal(size=(2000, 3)))
    assert np.degrees(np.arccos(np.clip((probe @ directions.T).max(axis=1), -1, 1))).max() < 6.0


def test_senseless_limits_are_refused():
    with pytest.raises(MachineError, match="limits"):
        MachineLimits(0.2, 0.3)
