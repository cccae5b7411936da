"""What links may remove: the whole cutter counts, flutes too."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bonecam.job import HoldingJob
from bonecam.levels.measure import NO_CUT, MachinedLevel, StockLevel
from bonecam.machine.limits import MachineLimits
from bonecam.material.dexels import uncut_rays
from bonecam.material.in_process_stock import remove_material, uncut_material
from bonecam.planning import links
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.layers import HeightMesh
from bonecam.planning.link_space import ARC_ALLOWED, CUT_ALLOWED, Feeds, LinkSpace
from bonecam.planning.links import direct_links
from bonecam.planning.scene import Scene
from bonecam.setup.capsule import Capsule
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.workholding.post import post_below

UP = np.array([0.0, 0.0, 1.0])
Poses = tuple[np.ndarray, np.ndarray]


def upright(centres: np.ndarray) -> Poses:
    return centres, np.tile(UP, (len(centres), 1))


@pytest.fixture(scope="module")
def space(
    level_of: Callable[..., MachinedLevel],
    pebble: Callable[..., TSpline],
    upright_capsule: Capsule,
    roughing_cutter: Cutter,
    holding: HoldingJob,
) -> LinkSpace:
    """The uncut stock, and a tool whose flutes reach 4 mm above its ball's centre."""
    part = level_of(pebble())
    levels = [part, StockLevel(1, upright_capsule.mesh(0.01), 0.5, NO_CUT)]
    post = post_below(part.mesh, holding)
    scene = Scene(part.mesh, upright_capsule.mesh(0.01), upright_capsule, post)
    long = replace(roughing_cutter, flute_length=roughing_cutter.radius + 4.0)
    limits, feeds = MachineLimits(np.radians(115.0)), Feeds(1500.0, 300.0, 10000.0)
    material = uncut_material(levels, upright_capsule)
    return LinkSpace(CollisionChecker(scene, long, 2.0), limits, feeds, 2.0, 0.01, material)


@pytest.fixture(scope="module")
def below(space: LinkSpace, upright_capsule: Capsule) -> Poses:
    """Moves of the ball under the stock, in air, on which its flutes stand up into it."""
    low = float(upright_capsule.bounds[0, 2])
    across = np.linspace(-3.0, 3.0, 7)
    return upright(np.column_stack([across, 0 * across, np.full(7, low - space.ball_radius - 0.5)]))


def test_a_link_whose_flutes_cut_where_its_ball_is_in_air_is_refused(space: LinkSpace, below: Poses) -> None:
    nowhere = upright(np.zeros((0, 3)))
    assert space.in_air(below[0][None]).all()
    lower = upright(below[0] - 5.0 * UP)
    assert space.cuts_little([below, lower], [nowhere, nowhere], np.full(2, CUT_ALLOWED)).tolist() == [False, True]


def test_a_link_of_a_layer_is_held_against_what_stands_on_rays(
    space: LinkSpace, below: Poses, upright_capsule: Capsule
) -> None:
    mesh, nowhere = upright_capsule.mesh(0.1), upright(np.zeros((0, 3)))
    lines = [below, upright(below[0] - 5.0 * UP)]
    standing = HeightMesh(mesh, rays=uncut_rays(upright_capsule))
    assert replace(space, material=standing).cuts_little(lines, [nowhere] * 2, np.full(2, CUT_ALLOWED)).tolist() == [
        False,
        True,
    ]
    side = upright_capsule.radius + space.ball_radius + np.array([0.05, 0.5])
    rapids = [upright(np.array([[x, 0.0, 36.0], [x, 0.0, 38.0]])) for x in side + float(upright_capsule.start[0])]
    assert replace(space, material=standing).rapids_cut_nothing(rapids).tolist() == [False, True]


def test_a_ball_is_known_to_be_in_air_outside_the_material_only(space: LinkSpace, upright_capsule: Capsule) -> None:
    side = upright_capsule.radius + space.ball_radius + np.array([0.3, 0.0, -0.1])
    height = upright_capsule.bounds[:, 2].mean()
    centres = np.column_stack([side, 0 * side, np.full(3, height)]) + upright_capsule.start * [1.0, 1.0, 0.0]
    assert space.known_in_air(centres).tolist() == [True, True, False]
    assert not replace(space, material=None).known_in_air(centres).any()


def test_what_flutes_removed_on_a_pass_may_be_passed_again(
    space: LinkSpace, below: Poses, path_of: Callable[..., ToolPath], level_of, pebble
) -> None:
    centres, axes = below
    cutter = space.checker.cutter
    kinds, passes = np.full(len(centres), int(MoveKind.CUT)), np.zeros(len(centres), dtype=np.int64)
    path = path_of(centres - cutter.radius * axes, axes, kinds=kinds, passes=passes, tool=cutter)
    cut = replace(space, material=remove_material(space.material, level_of(pebble()), path))  # type: ignore[arg-type]
    assert cut.cuts_little([below], [upright(np.zeros((0, 3)))], np.array([CUT_ALLOWED])).all()


def beside_the_stock(space: LinkSpace, depth: float, *y: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ball centres, normals and axes at some y, all in air, where the flutes above stand `depth` (mm) in the stock's
    cylinder over y = 0."""
    stock = space.checker.scene.stock
    x = float(stock.radius) + space.ball_radius - depth
    axis = np.array([0.0, np.sin(0.1), np.cos(0.1)])
    centres = np.array([[x, place, float(stock.start[2]) + 1.0] for place in y]) - 3.0 * axis
    return centres, np.tile([1.0, 0.0, 0.0], (len(y), 1)), np.tile(axis, (len(y), 1))


def volume(space: LinkSpace, depth: float, *y: float, gone: int | None = None) -> float:
    """What flutes remove on the way through these y, mm3, behind the tool at the place `gone` of them."""
    line = beside_the_stock(space, depth, *y)[::2]
    removed = tuple(part[:0] if gone is None else part[[gone]] for part in line)
    (cut,) = space.material.rays.cutters.removed_by([line], [removed], 2.0, 4.0)  # type: ignore[union-attr]
    return float(cut)


def runs_straight(space: LinkSpace, depth: float, y: tuple[float, float], arcs: list[bool]) -> bool:
    """Whether there is a link from the one y to the other on the straight line; only rays tell against it."""
    first, last = (beside_the_stock(space, depth, place) for place in y)
    (link,) = direct_links(space, first, last, 3.0, (0.0,), np.array([arcs]))
    return link is not None and bool(link.centres[:, 0].max() < first[0][0, 0] + 0.1)


@pytest.fixture
def told_by_rays(space: LinkSpace, monkeypatch: pytest.MonkeyPatch) -> LinkSpace:
    monkeypatch.setattr(links, "_proven_free", lambda _, centres, axes: np.ones(len(centres), dtype=bool))
    return space


def test_a_link_and_the_arcs_at_its_ends_share_what_may_be_removed_between_two_cuts(told_by_rays: LinkSpace) -> None:
    space, depth = told_by_rays, 0.007
    assert CUT_ALLOWED - 2 * ARC_ALLOWED < volume(space, depth, -1.0, 1.0) < CUT_ALLOWED - ARC_ALLOWED
    line, nowhere = beside_the_stock(space, depth, -1.0, 1.0)[::2], upright(np.zeros((0, 3)))
    allowed = np.r_[CUT_ALLOWED - ARC_ALLOWED * np.arange(3), ARC_ALLOWED]
    assert space.cuts_little([line] * 4, [nowhere] * 4, allowed).tolist() == [True, True, False, False]
    assert runs_straight(space, depth, (-1.0, 1.0), [True, False])
    assert not runs_straight(space, depth, (-1.0, 1.0), [True, True])


def test_what_a_link_removes_of_the_cut_that_it_leads_to_counts(told_by_rays: LinkSpace) -> None:
    """The simulation runs the link before that cut."""
    space, depth = told_by_rays, 0.012
    beside_it, whole = (volume(space, depth, -1.0, 0.0, gone=gone) for gone in (1, None))
    assert beside_it < CUT_ALLOWED - ARC_ALLOWED < whole
    assert not runs_straight(space, depth, (-1.0, 0.0), [False, True])
    assert runs_straight(space, depth / 2, (-1.0, 0.0), [False, True])
