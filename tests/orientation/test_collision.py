"""The judge and the proof by distance: what enters material, a thin post or the table is caught, complete
containment too."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.orientation.clear import FREE, Poses, judge_by_distance
from bonecam.orientation.collision import Judge, revolved, tool_meshes
from bonecam.orientation.limits import unit
from bonecam.orientation.scene import Scene
from bonecam.setup.holding import Post
from bonecam.setup.stock import Capsule
from bonecam.surface.tspline import TSpline
from bonecam.toolpath.cutter import Cutter

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def scene(
    mesh_of: Callable[..., TriangleMesh], pebble: Callable[..., TSpline], upright_capsule: Capsule
) -> Scene:
    level, material = mesh_of(pebble()), mesh_of(pebble(0.3))
    return Scene(level, material, upright_capsule, Post(1.0, 31.5))


@pytest.fixture(scope="module")
def judge(finishing_cutter: Cutter, scene: Scene) -> Judge:
    return Judge(scene, finishing_cutter)


def top_of(scene: Scene) -> float:
    return float(scene.level.bounds[1, 2])


def proven(finishing_cutter: Cutter, scene: Scene, tip: np.ndarray, axis: np.ndarray) -> bool:
    return bool(judge_by_distance(scene, finishing_cutter, Poses.still(tip[None], axis[None]))[0] == FREE)


def both_free(
    finishing_cutter: Cutter, scene: Scene, judge: Judge, tip: np.ndarray, axis: np.ndarray
) -> bool:
    assert not (proven(finishing_cutter, scene, tip, axis) and judge.hits(tip, axis)), (
        "the proof by distance contradicts FCL"
    )
    return proven(finishing_cutter, scene, tip, axis) and not judge.hits(tip, axis)


def test_a_tangent_contact_is_free(finishing_cutter: Cutter, scene: Scene, judge: Judge) -> None:
    assert both_free(finishing_cutter, scene, judge, np.array([0.0, 0.0, top_of(scene)]), UP)


def test_a_ball_sunk_into_the_level_is_caught(finishing_cutter: Cutter, scene: Scene, judge: Judge) -> None:
    tip = np.array([0.0, 0.0, top_of(scene) - 0.1])
    assert judge.hits(tip, UP) == "cutter"
    assert not proven(finishing_cutter, scene, tip, UP)


def test_an_axis_through_the_material_is_caught(finishing_cutter: Cutter, scene: Scene, judge: Judge) -> None:
    tip, axis = np.array([0.0, 0.0, top_of(scene)]), -UP
    assert judge.hits(tip, axis)
    assert not proven(finishing_cutter, scene, tip, axis)


def test_a_shank_that_cuts_the_material_but_not_the_level_is_caught(
    finishing_cutter: Cutter, scene: Scene, judge: Judge
) -> None:
    material = float(np.hypot(*scene.material.vertices[:, :2].T).max())
    tip = np.array([material - 0.1 + finishing_cutter.radius, 0.0, 37.0 - 10.0])
    assert judge.hits(tip, UP) in {"shank", "holder"}
    assert not proven(finishing_cutter, scene, tip, UP)


def test_a_cutter_wholly_inside_the_material_is_caught(
    upright_capsule: Capsule, finishing_cutter: Cutter
) -> None:
    big = revolved([(0.0, 200.0), (400.0, 200.0)], 0.0)
    scene = Scene(big, big, upright_capsule, Post(1.0, 1.0))
    tip = np.array([0.0, 0.0, 200.0])
    assert Judge(scene, finishing_cutter).hits(tip, UP) == "cutter"
    wide = replace(scene, stock=replace(upright_capsule, radius=500.0))
    assert not proven(finishing_cutter, wide, tip, UP)


def test_material_wholly_inside_the_holder_is_caught(finishing_cutter: Cutter, scene: Scene) -> None:
    crumb = revolved([(60.0, 0.3), (61.0, 0.3)], 60.0)
    inside = replace(scene, material=crumb, level=crumb, post=Post(0.2, 5.0))
    tip = np.array([2.0, 0.0, 10.0])
    assert Judge(inside, finishing_cutter).hits(tip, UP) == "holder"


def test_a_thin_post_in_the_holder_s_way_is_caught(
    upright_capsule: Capsule, finishing_cutter: Cutter
) -> None:
    crumb = revolved([(60.0, 0.3), (61.0, 0.3)], 60.0)
    scene = Scene(crumb, crumb, upright_capsule, Post(0.05, 55.0))
    tip, axis = np.array([40.0, 3.0, 40.0]), np.array([-1.0, 0.0, 0.0])
    assert Judge(scene, finishing_cutter).hits(tip, axis)
    assert not proven(finishing_cutter, scene, tip, axis)


def test_a_holder_in_the_table_is_caught(finishing_cutter: Cutter, scene: Scene, judge: Judge) -> None:
    axis = unit(np.array([[1.0, 0.0, -0.8]]))[0]
    tip = np.array([10.0, 0.0, 33.0])
    assert judge.hits(tip, axis) == "holder"
    assert not proven(finishing_cutter, scene, tip, axis)


def test_the_proof_never_passes_a_tool_that_touches(
    finishing_cutter: Cutter, scene: Scene, judge: Judge
) -> None:
    rng = np.random.default_rng(3)
    tips = np.array([0.0, 0.0, 37.0]) + rng.normal(size=(600, 3)) * [6, 6, 8]
    axes = unit(rng.normal(size=(600, 3)))
    free = judge_by_distance(scene, finishing_cutter, Poses.still(tips, axes)) == FREE
    assert 60 < free.sum() < 540
    solid = {name: mesh.vertices for name, mesh in tool_meshes(finishing_cutter).items()}
    level, material = MeshDistance(scene.level), MeshDistance(scene.material)
    for i in np.flatnonzero(free)[:80]:
        assert not judge.hits(tips[i], axes[i])
        side = np.eye(3)[int(np.argmin(np.abs(axes[i])))]
        x = unit(np.cross(side, axes[i])[None])[0]
        turn = np.column_stack([x, np.cross(axes[i], x), axes[i]])
        for name, points in solid.items():
            placed = tips[i] + points @ turn.T
            assert placed[:, 2].min() > 0
            assert (level if name == "cutter" else material).signed(placed).min() > -0.011
            assert scene.post.distance(placed).min() > -0.011


def test_a_margin_that_moves_need_is_asked_for(finishing_cutter: Cutter, scene: Scene) -> None:
    tips = np.array([[0.0, 0.0, top_of(scene) + 0.5], [0.0, 0.0, top_of(scene) + 0.5]])
    axes = np.array([[0.0, 0.0, 1.0], unit(np.array([[1.0, 0.0, 0.2]]))[0]])
    alone = judge_by_distance(scene, finishing_cutter, Poses.still(tips[:1], axes[:1]))
    swung = judge_by_distance(scene, finishing_cutter, Poses.moving(tips, axes, np.array([True, False])))
    assert alone[0] == FREE
    assert swung[0] != FREE
