"""What is left of the stock after a path, and what that does to the next level.

The mesh of what stands holds what rays tell.

A mesh laid on a stock with edges follows them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import KDTree
from small_parts import FINISHING_CUTTER, HOLDING, ROUGHING_CUTTER, UPRIGHT_CAPSULE, level_of, mesh_of, path_of, pebble

from bonecam.job import NcJob, PathJob
from bonecam.levels import Level, StockLevel
from bonecam.levels.measure import NO_CUT
from bonecam.machine import MachineLimits
from bonecam.material import InProcessStock, remove_material, uncut_material
from bonecam.material.dexels import uncut_rays
from bonecam.material.in_process_stock import DEVIATION, holding, hull, places_on_stock
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.planning import Scene, candidate_contacts, contact_path, orient
from bonecam.planning.contacts import DepthLimits
from bonecam.setup import Box, Capsule, Cylinder, Stock
from bonecam.tool import Cutter, MoveKind, ToolPath
from bonecam.workholding import post_below


class Skin(Capsule):
    """A stock half a millimetre outside every level; depths are measured from its places, as it is no body."""

    def closest_points(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        return np.asarray(points + 0.5 * self.normals(points))


def skin_material(levels: Sequence[Level], stock: Skin) -> InProcessStock:
    return replace(uncut_material(levels, stock), uncut=None)


STOCK = Skin(UPRIGHT_CAPSULE.start, UPRIGHT_CAPSULE.end, UPRIGHT_CAPSULE.radius)


@pytest.fixture(scope="module")
def post():
    return post_below(mesh_of(pebble()), HOLDING)


@pytest.fixture(scope="module")
def levels():
    """The part, a level 0.4 mm outside it, and the stock."""
    outermost = StockLevel(2, STOCK.mesh(0.01), 0.5, NO_CUT)
    return level_of(pebble()), level_of(pebble(0.4), 1, 0.5), outermost


@pytest.fixture(scope="module")
def path_on(post):
    def build(level, material, cutter):
        meshes = [MeshDistance(level.mesh)]
        contacts = contact_path(candidate_contacts(level, meshes, cutter, post, PathJob(pattern="round")), material)
        scene = Scene(level.mesh, material.mesh, STOCK, post, DEVIATION)
        return orient(contacts, scene, MachineLimits(2.0), PathJob(), NcJob())

    return build


@pytest.fixture(scope="module")
def machined(levels, path_on):
    material = skin_material(levels, STOCK)
    path = path_on(levels[1], material, ROUGHING_CUTTER)
    return remove_material(material, levels[1], path), path


def test_what_was_cut_lies_between_the_level_and_its_scallops(machined, levels, post):
    material, path = machined
    for points in (material.vertices, material.places):
        heights = MeshDistance(levels[1].mesh).signed(points[points[:, 2] > post.top + 4], 1.0)
        assert heights.min() > -0.02
        assert 0.5 * path.cutter.scallop < heights.max() < path.cutter.scallop + 0.005


def test_the_balls_touch_the_places_left_and_enter_none(machined):
    material, path = machined
    cut = path.kinds == 0
    centres = path.tips[cut] + path.cutter.radius * path.axes[cut]
    distance, _ = KDTree(material.places).query(centres)
    assert distance.min() > path.cutter.radius - 1e-6
    assert np.median(distance) < path.cutter.radius + 0.01


def test_no_ball_of_the_path_is_inside_the_material_left(machined, post):
    material, path = machined
    rows = np.flatnonzero(path.kinds == 0)
    centres = path.tips[rows] + path.cutter.radius * path.axes[rows]
    assert (
        MeshDistance(material.mesh).signed(centres[path.contacts[rows, 2] > post.top + 4]).min()
        > path.cutter.radius - DEVIATION
    )


def test_contacts_under_uncut_material_stay_uncut(levels, post, path_on):
    material = skin_material(levels, STOCK)
    path = path_on(levels[1], material, ROUGHING_CUTTER)
    spared = path.contacts[:, 2] > 39.0
    shortened = replace(
        path,
        **{
            name: getattr(path, name)[~spared]
            for name in ("kinds", "pass_index", "parameters", "contacts", "tips", "axes", "feed_rates")
        },
        uncut=np.vstack([path.uncut, path.contacts[spared]]),
        reasons=path.reasons + ("collision",) * int(spared.sum()),
    )
    material = remove_material(material, levels[1], shortened)
    # below, the ball of the last ring still reached in: 1.4 mm at a depth of 0.5
    out_of_reach = path.contacts[:, 2] > 39.0 + 1.5
    assert np.quantile(material.thickness(levels[0], path.contacts[out_of_reach]), 0.05) > 0.75
    below = path_on(levels[0], material, FINISHING_CUTTER)
    covered = np.array(below.reasons) == "covered"
    heights = below.uncut[covered][:, 2]
    assert (heights > 40.0).any()
    assert not ((heights > post.top + 4) & (heights < 37.5)).any()
    assert np.nanmax(below.contacts[:, 2]) < 40.0


def test_what_is_trimmed_and_what_is_cut_make_up_the_whole_passes(machined, levels, post):
    _, path = machined
    lower = replace(path, kinds=np.where(path.contacts[:, 2] < 35.0, path.kinds, MoveKind.LINK))
    material = remove_material(skin_material(levels, STOCK), levels[1], lower)
    meshes = [MeshDistance(levels[1].mesh)]
    candidates = candidate_contacts(levels[1], meshes, ROUGHING_CUTTER, post, PathJob(pattern="iso-scallop"))

    def lengths(least):
        path = contact_path(candidates, material, DepthLimits(0.5, least=least))
        at_level = path.lifts == 0
        joined = (path.pass_index[1:] == path.pass_index[:-1]) & at_level[1:] & at_level[:-1]
        steps = np.linalg.norm(np.diff(path.contacts + 2 * path.normals, axis=0), axis=1)
        return float(steps[joined].sum()), path.trimmed

    whole, none = lengths(-1.0)
    part, trimmed = lengths(0.1)
    assert none == 0
    assert 0 < part < whole
    assert ROUGHING_CUTTER.radius == 2.0
    assert trimmed == pytest.approx(whole - part, rel=0.1)


def test_a_ball_that_rises_from_its_contact_enters_nothing_anew(levels):
    material = skin_material(levels, STOCK)
    s, t = np.random.default_rng(5).uniform(0.2, 0.8, (2, 50))
    surface = levels[1].surface
    normals = surface.normals(s, t)
    contacts = surface.positions(s, t) + normals
    along = np.cross(normals, [0.0, 0.0, 1.0])
    depth, _ = material.depths(contacts, 1.0)
    assert depth.min() > 0.05
    for height in (0.02, 0.05, 0.2, 1.0):
        assert not material.entered_anew(contacts + height * normals, contacts, 1.0, 0.01).any()
    aside = contacts + along / np.linalg.norm(along, axis=1)[:, None]
    assert material.entered_anew(aside, contacts, 1.0, 0.01).all()


def test_passes_that_find_only_what_passes_before_left_are_of_no_use(levels, machined):
    path = machined[1]
    cuts = path.kinds == MoveKind.CUT
    centres = (path.tips + path.cutter.radius * path.axes)[cuts]
    passes = path.pass_index[cuts]
    count = len(centres)
    twice = np.vstack([centres, centres]), np.r_[passes, passes + passes.max() + 1]
    material = skin_material(levels, STOCK)
    useful = material.useful(levels[1], *twice, path.cutter.radius, 0.03)
    assert useful[:count].mean() > 0.9
    assert not useful[count:].any()


def test_passes_side_by_side_are_stepped_over_to_without_their_ramps(levels, post):
    level, material = levels[1], skin_material(levels, STOCK)
    job = PathJob(pattern="along")
    candidates = candidate_contacts(level, [MeshDistance(level.mesh)], ROUGHING_CUTTER, post, job)
    contacts = contact_path(candidates, material, DepthLimits(0.5))
    assert contacts.ramp.any()
    assert not contacts.ramp[np.flatnonzero(np.diff(contacts.pass_index))].any()
    scene = Scene(level.mesh, material.mesh, STOCK, post, DEVIATION)
    path = orient(contacts, scene, MachineLimits(2.0), job, NcJob(), material=material)
    passes = contacts.pass_index.max() + 1
    cut = path.kinds == MoveKind.CUT
    entries = np.flatnonzero(cut & ~np.r_[False, cut[:-1]])
    assert len(entries) < 0.6 * passes
    assert path.pass_index[cut].max() + 1 == len(entries)
    told = cut.sum() + len(path.uncut) - len(contacts.uncut)
    assert (~contacts.ramp).sum() <= told < len(contacts.ramp)
    balls, numbers = path.balls[cut], path.pass_index[cut]
    goes_on = np.flatnonzero(np.diff(numbers) == 0)
    halfway = (balls[goes_on] + balls[goes_on + 1]) / 2
    assert material.depths(halfway, ROUGHING_CUTTER.radius)[0].max() < 0.5 + 0.02


def bore(cutter: Cutter, centre: ndarray) -> ToolPath:
    """A ball that cuts at one place."""
    up = np.array([[0.0, 0.0, 1.0]])
    kinds, passes = np.array([int(MoveKind.CUT)]), np.zeros(1, dtype=int)
    return path_of(centre[None] - cutter.radius * up, up, kinds=kinds, passes=passes, tool=cutter)


def test_what_hangs_over_a_cut_stands(levels):
    material = skin_material(levels, STOCK)
    place = material.places[np.argmax(material.places[:, 0])]
    inward = -STOCK.normals(place[None])[0]
    radius = ROUGHING_CUTTER.radius
    for depth, cuts in ((radius + 1.0, False), (radius - 0.4, True)):
        after = remove_material(material, levels[1], bore(ROUGHING_CUTTER, place + depth * inward))
        moved = np.linalg.norm(after.places - material.places, axis=1)
        assert (moved.max() > 0.3) == cuts
        assert cuts or not moved.any()


def test_a_ball_whose_centre_is_in_the_material_is_deeper_than_its_radius(levels):
    material = skin_material(levels, STOCK)
    place = material.places[np.argmax(material.places[:, 0])]
    outward = STOCK.normals(place[None])[0]
    for height in (1.5, 0.5, -0.5, -1.5):
        depth, away = material.depths((place + height * outward)[None], 2.0)
        assert depth[0] == pytest.approx(2.0 - height, abs=0.01)
        assert away[0] @ outward > 0.99


def test_the_mesh_ends_behind_the_foot_of_a_cliff(machined, levels):
    """What stands between a vertex that was cut and one that was not may reach up to the cut one."""
    _, path = machined
    upper = replace(path, kinds=np.where(path.contacts[:, 2] > 35.0, path.kinds, MoveKind.LINK))
    material = remove_material(skin_material(levels, STOCK), levels[1], upper)
    floor = material.grid.R @ levels[1].control_points
    mesh = hull(material.vertices, floor, material.grid.faces)
    raw, kept = (np.linalg.norm(v - floor, axis=1) for v in (material.vertices, mesh.vertices))
    edges = material.grid.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    drop = np.ptp(raw[edges], axis=1)
    assert drop.max() > 2 * DEVIATION
    lower = edges[np.arange(len(edges)), np.argmin(raw[edges], axis=1)]
    assert (kept >= raw - 1e-9).all()
    assert (kept[lower] > raw[edges].max(axis=1) - DEVIATION - 0.01).all()
    assert kept[raw > np.quantile(raw, 0.9)] == pytest.approx(raw[raw > np.quantile(raw, 0.9)])


def test_depths_count_from_the_edges_of_a_bar_before_the_first_cut_and_after_it(levels):
    """A ball that touches a rounding of the bar's rim; an edge that no tool reaches stays."""
    bar = Cylinder(6.0, 28.0, 46.0)
    outermost = StockLevel(2, bar.mesh(0.01), 0.5, NO_CUT)
    material = uncut_material([*levels[:2], outermost], bar)
    rounding, ball = 1.0, 2.0
    out = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    contact = np.array([6.0 - rounding, 0.0, 46.0 - rounding]) + rounding * out
    centre = contact + ball * out
    depth, away = material.depths(centre[None], ball)
    assert depth[0] == pytest.approx(rounding * (np.sqrt(2) - 1))
    assert away[0] == pytest.approx(out)
    aside = np.array([[0.0, centre[0], centre[2]]])
    assert material.entered_anew(aside, centre[None], ball, 0.01).all()
    after = replace(material, uncut=None).depths(centre[None], ball)[0]
    assert after[0] == pytest.approx(rounding * (np.sqrt(2) - 1), abs=0.02)


def test_a_rest_path_of_the_next_level_makes_no_ball_deeper(machined, levels):
    """Beside the post places stand that the ball has passed: how deep it is there is known from where it was."""
    material, path = machined
    rows = np.flatnonzero(path.kinds == MoveKind.CUT)
    centres = (path.tips + path.cutter.radius * path.axes)[rows]
    rest = replace(bore(ROUGHING_CUTTER, centres[np.argmax(centres[:, 2])]), level=0, rest=1)
    before, _ = material.depths(centres, ROUGHING_CUTTER.radius)
    assert before.max() < 1e-9
    after, _ = remove_material(material, levels[0], rest).depths(centres, ROUGHING_CUTTER.radius)
    assert after.max() < 1e-9


BAR = Cylinder(5.0, 10.0, 30.0)


def beyond(mesh: TriangleMesh, ends: np.ndarray) -> np.ndarray:
    """How far what lies outside a mesh is from it, mm."""
    surface = MeshDistance(mesh)
    return np.maximum(surface.signed(ends), 0.0)


def test_a_mesh_that_cuts_an_edge_off_is_moved_out_to_it():
    mesh, ends = BAR.mesh(0.01), uncut_rays(BAR).balls.ends
    assert beyond(mesh, ends).max() < 0.02
    away = np.linalg.norm(mesh.vertices - [5.0, 0.0, 30.0], axis=1)
    cut_off = mesh.vertices - np.clip(1.5 - away, 0, None)[:, None] * np.array([0.7, 0.0, 0.7])
    cut = TriangleMesh(cut_off, mesh.faces)
    assert beyond(cut, ends).max() > 0.5
    held = holding(cut, ends)
    assert beyond(held, ends).max() <= DEVIATION + 0.01
    far = away > 4.0
    assert np.array_equal(held.vertices[far], mesh.vertices[far])


def test_a_mesh_that_holds_all_stays_as_it_is():
    mesh = BAR.mesh(0.01)
    assert holding(mesh, uncut_rays(BAR).balls.ends) is mesh


BARS = {"cylinder": Cylinder(4.0, 10.0, 30.0), "box": Box(np.array([-5.0, -4.0, 10.0]), np.array([5.0, 4.0, 30.0]))}


def missed(bar: Stock, points: np.ndarray, faces: np.ndarray) -> float:
    """How far the bar reaches out of a mesh laid on it, mm."""
    stands = bar.mesh(0.01)
    corners = stands.vertices[stands.faces]
    shares = np.random.default_rng(0).dirichlet([1, 1, 1], (len(corners), 40))
    inside = (shares[..., None] * corners[:, None]).sum(axis=2).reshape(-1, 3)
    everywhere = np.vstack([stands.vertices, inside])
    return float(MeshDistance(TriangleMesh(points, faces)).signed(everywhere, 5.0).max())


@pytest.mark.parametrize("kind", BARS)
def test_a_mesh_laid_on_a_bar_follows_its_edges(kind):
    bar = BARS[kind]
    rounded = bar.round_edges(1.5).mesh(0.005)
    laid = places_on_stock(bar, rounded.vertices, rounded.faces)
    assert np.abs(bar.signed_distance(laid)).max() < 1e-9
    assert missed(bar, bar.closest_points(rounded.vertices), rounded.faces) > 0.2
    assert missed(bar, laid, rounded.faces) < 0.02


def test_on_a_stock_without_edges_places_are_the_nearest():
    capsule = Capsule(np.array([0.0, 0.0, 14.0]), np.array([0.0, 0.0, 26.0]), 4.0)
    inner = capsule.offset(-0.5).mesh(0.005)
    laid = places_on_stock(capsule, inner.vertices, inner.faces)
    assert np.array_equal(laid, capsule.closest_points(inner.vertices))
