"""The judge and the proof by distance: what enters material, a thin post or the table is caught, complete
containment too."""

from dataclasses import replace

import bodies
import numpy as np
import pytest

from bonecam.mesh.distance import MeshDistance
from bonecam.orientation.clear import FREE, Poses, judge_by_distance
from bonecam.orientation.collision import Judge, revolved, tool_meshes
from bonecam.orientation.limits import unit
from bonecam.orientation.scene import Scene
from bonecam.setup.holding import Post

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def scene() -> Scene:
    level, material = bodies.mesh_of(bodies.pebble()), bodies.mesh_of(bodies.pebble(0.3))
    return Scene(level, material, bodies.stock(), Post(1.0, 31.5))


@pytest.fixture(scope="module")
def judge(scene: Scene) -> Judge:
    return Judge(scene, bodies.FINE)


def top_of(scene: Scene) -> float:
    return float(scene.level.bounds[1, 2])


def proven(scene: Scene, tip: np.ndarray, axis: np.ndarray) -> bool:
    return bool(judge_by_distance(scene, bodies.FINE, Poses.still(tip[None], axis[None]))[0] == FREE)


def both_free(scene: Scene, judge: Judge, tip: np.ndarray, axis: np.ndarray) -> bool:
    assert not (proven(scene, tip, axis) and judge.hits(tip, axis)), "the proof by distance contradicts FCL"
    return proven(scene, tip, axis) and not judge.hits(tip, axis)


def test_a_tangent_contact_is_free(scene: Scene, judge: Judge) -> None:
    assert both_free(scene, judge, np.array([0.0, 0.0, top_of(scene)]), UP)


def test_a_ball_sunk_into_the_level_is_caught(scene: Scene, judge: Judge) -> None:
    tip = np.array([0.0, 0.0, top_of(scene) - 0.1])
    assert judge.hits(tip, UP) == "cutter"
    assert not proven(scene, tip, UP)


def test_an_axis_through_the_material_is_caught(scene: Scene, judge: Judge) -> None:
    tip, axis = np.array([0.0, 0.0, top_of(scene)]), -UP
    assert judge.hits(tip, axis)
    assert not proven(scene, tip, axis)


def test_a_shank_that_cuts_the_material_but_not_the_level_is_caught(scene: Scene, judge: Judge) -> None:
    material = float(np.hypot(*scene.material.vertices[:, :2].T).max())
    tip = np.array([material - 0.1 + bodies.FINE.radius, 0.0, 37.0 - 10.0])
    assert judge.hits(tip, UP) in {"shank", "holder"}
    assert not proven(scene, tip, UP)


def test_a_cutter_wholly_inside_the_material_is_caught() -> None:
    big = revolved([(0.0, 200.0), (400.0, 200.0)], 0.0)
    scene = Scene(big, big, bodies.stock(), Post(1.0, 1.0))
    tip = np.array([0.0, 0.0, 200.0])
    assert Judge(scene, bodies.FINE).hits(tip, UP) == "cutter"
    wide = replace(scene, stock=replace(bodies.stock(), radius=500.0))
    assert not proven(wide, tip, UP)


def test_material_wholly_inside_the_holder_is_caught(scene: Scene) -> None:
    crumb = revolved([(60.0, 0.3), (61.0, 0.3)], 60.0)
    inside = replace(scene, material=crumb, level=crumb, post=Post(0.2, 5.0))
    tip = np.array([2.0, 0.0, 10.0])
    assert Judge(inside, bodies.FINE).hits(tip, UP) == "holder"


def test_a_thin_post_in_the_holder_s_way_is_caught() -> None:
    crumb = revolved([(60.0, 0.3), (61.0, 0.3)], 60.0)
    scene = Scene(crumb, crumb, bodies.stock(), Post(0.05, 55.0))
    tip, axis = np.array([40.0, 3.0, 40.0]), np.array([-1.0, 0.0, 0.0])
    assert Judge(scene, bodies.FINE).hits(tip, axis)
    assert not proven(scene, tip, axis)


def test_a_holder_in_the_table_is_caught(scene: Scene, judge: Judge) -> None:
    axis = unit(np.array([[1.0, 0.0, -0.8]]))[0]
    tip = np.array([10.0, 0.0, 33.0])
    assert judge.hits(tip, axis) == "holder"
    assert not proven(scene, tip, axis)


def test_the_proof_never_passes_a_tool_that_touches(scene: Scene, judge: Judge) -> None:
    rng = np.random.default_rng(3)
    tips = np.array([0.0, 0.0, 37.0]) + rng.normal(size=(600, 3)) * [6, 6, 8]
    axes = unit(rng.normal(size=(600, 3)))
    free = judge_by_distance(scene, bodies.FINE, Poses.still(tips, axes)) == FREE
    assert 60 < free.sum() < 540
    solid = {name: mesh.vertices for name, mesh in tool_meshes(bodies.FINE).items()}
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


def test_a_margin_that_moves_need_is_asked_for(scene: Scene) -> None:
    tips = np.array([[0.0, 0.0, top_of(scene) + 0.5], [0.0, 0.0, top_of(scene) + 0.5]])
    axes = np.array([[0.0, 0.0, 1.0], unit(np.array([[1.0, 0.0, 0.2]]))[0]])
    alone = judge_by_distance(scene, bodies.FINE, Poses.still(tips[:1], axes[:1]))
    swung = judge_by_distance(scene, bodies.FINE, Poses.moving(tips, axes, np.array([True, False])))
    assert alone[0] == FREE
    assert swung[0] != FREE
