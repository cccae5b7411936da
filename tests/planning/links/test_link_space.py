"""What links may remove: the whole cutter counts, flutes too."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bonecam.job import HoldingJob
from bonecam.levels.measure.cut_measures import NO_CUT
from bonecam.levels.measure.level import MachinedLevel, StockLevel
from bonecam.machine.limits import MachineLimits
from bonecam.material.cut_dexels import uncut_rays
from bonecam.material.in_process_stock import remove_material, uncut_material
from bonecam.planning.collision.checker import CollisionChecker
from bonecam.planning.collision.scene import Scene
from bonecam.planning.layers.height_mesh import HeightMesh
from bonecam.planning.links.link_space import LinkSpace
from bonecam.planning.links.moves import Feeds
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
    assert space.cuts_little([below, lower], [nowhere, nowhere]).tolist() == [False, True]


def test_a_link_of_a_layer_is_held_against_what_stands_on_rays(
    space: LinkSpace, below: Poses, upright_capsule: Capsule
) -> None:
    mesh, nowhere = upright_capsule.mesh(0.1), upright(np.zeros((0, 3)))
    lines = [below, upright(below[0] - 5.0 * UP)]
    standing = HeightMesh(mesh, rays=uncut_rays(upright_capsule))
    assert replace(space, material=standing).cuts_little(lines, [nowhere] * 2).tolist() == [False, True]
    side = upright_capsule.radius + space.ball_radius + np.array([0.05, 0.5])
    rapids = [
        upright(np.array([[x, 0.0, 36.0], [x, 0.0, 38.0]])) for x in side + float(upright_capsule.start[0])
    ]
    assert replace(space, material=standing).rapids_cut_nothing(rapids).tolist() == [False, True]


def test_a_ball_is_known_to_be_in_air_outside_the_material_only(
    space: LinkSpace, upright_capsule: Capsule
) -> None:
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
    assert cut.cuts_little([below], [upright(np.zeros((0, 3)))]).all()
