"""FCL and the proof by distances: what enters material, a thin post or the table is caught, complete
containment too.

Flutes that are held against an outer level stay out of the part, however near to it the level is.
"""

from dataclasses import replace

import numpy as np
import pytest
from small_parts import FINISHING_CUTTER, UPRIGHT_CAPSULE, level_of, mesh_of, pebble

from bonecam.arrays import unit
from bonecam.machine.bodies import Frustum
from bonecam.mesh import MeshDistance, TriangleMesh
from bonecam.mesh.solids import revolve
from bonecam.planning import Scene
from bonecam.planning.collision import (
    COLLIDING,
    FREE,
    SIDES,
    UNDECIDED,
    CollisionChecker,
    FclModel,
    Poses,
    build_fcl_model,
    classify_poses,
    classify_thick_tool,
    cutter_mesh,
    section_mesh,
)
from bonecam.planning.contacts import MESH_SHARE, WORD_ROUNDING, flute_slack, planned_tolerance
from bonecam.planning.scene import TANGENT_SLACK, Surroundings, held_level, part_chord
from bonecam.setup import Capsule
from bonecam.tool import Cutter
from bonecam.tool.cutter import ToolSection
from bonecam.workholding import Clamping, Post
from bonecam.workholding.post import Column

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def scene():
    level, material = mesh_of(pebble()), mesh_of(pebble(0.3))
    return Scene(level, material, UPRIGHT_CAPSULE, Post(1.0, 31.5))


@pytest.fixture(scope="module")
def model(scene):
    return build_fcl_model(scene, FINISHING_CUTTER)


def top_of(scene: Scene) -> float:
    return float(scene.level.bounds[1, 2])


def proven(finishing_cutter: Cutter, scene: Scene, tip: np.ndarray, axis: np.ndarray) -> bool:
    return bool(classify_poses(scene, finishing_cutter, Poses.at_rest(tip[None], axis[None]))[0] == FREE)


def colliding_section(model: FclModel, tip: np.ndarray, axis: np.ndarray) -> str:
    return model.colliding_sections(tip[None], axis[None])[0]


def both_free(finishing_cutter: Cutter, scene: Scene, model: FclModel, tip: np.ndarray, axis: np.ndarray) -> bool:
    assert not (proven(finishing_cutter, scene, tip, axis) and colliding_section(model, tip, axis)), (
        "the proof by distance contradicts FCL"
    )
    return proven(finishing_cutter, scene, tip, axis) and not colliding_section(model, tip, axis)


def test_a_tangent_contact_is_free(scene, model):
    assert both_free(FINISHING_CUTTER, scene, model, np.array([0.0, 0.0, top_of(scene)]), UP)


def test_a_cutter_wholly_inside_the_material_is_caught():
    big = revolve(np.full(2, 200.0), np.array([0.0, 400.0]), (0.0, 400.0), SIDES)
    scene = Scene(big, big, UPRIGHT_CAPSULE, Post(1.0, 1.0))
    tip = np.array([0.0, 0.0, 200.0])
    assert colliding_section(build_fcl_model(scene, FINISHING_CUTTER), tip, UP) == "cutter"
    wide = replace(scene, stock=replace(UPRIGHT_CAPSULE, radius=500.0))
    assert not proven(FINISHING_CUTTER, wide, tip, UP)


def test_material_wholly_inside_the_holder_is_caught(scene):
    crumb = revolve(np.full(2, 0.3), np.array([60.0, 61.0]), (60.0, 61.0), SIDES)
    inside = replace(scene, material=crumb, level=crumb, post=Post(0.2, 5.0))
    tip = np.array([2.0, 0.0, 10.0])
    assert colliding_section(build_fcl_model(inside, FINISHING_CUTTER), tip, UP) == "holder"


def test_a_thin_post_in_the_holder_s_way_is_caught():
    crumb = revolve(np.full(2, 0.3), np.array([60.0, 61.0]), (60.0, 61.0), SIDES)
    scene = Scene(crumb, crumb, UPRIGHT_CAPSULE, Post(0.05, 55.0))
    tip, axis = np.array([40.0, 3.0, 40.0]), np.array([-1.0, 0.0, 0.0])
    assert colliding_section(build_fcl_model(scene, FINISHING_CUTTER), tip, axis)
    assert not proven(FINISHING_CUTTER, scene, tip, axis)


@pytest.mark.parametrize(
    ("place", "axis", "sections"),
    [
        ((0.0, 0.0, -0.1), UP, {"cutter"}),  # a ball sunk into the level
        ((0.0, 0.0, 0.0), -UP, {"cutter", "shank", "holder", "spindle"}),  # an axis through the material
        ((5.74, 0.0, -16.0), UP, {"shank", "holder"}),  # a shank in the material, not in the level
        ((10.0, 0.0, -10.0), unit(np.array([[1.0, 0.0, -0.8]]))[0], {"holder"}),  # a holder in the table
    ],
)
def test_a_tool_that_touches_is_caught_by_fcl_and_not_proven_free(scene, model, place, axis, sections):
    tip = np.array([0.0, 0.0, top_of(scene)]) + place
    assert colliding_section(model, tip, axis) in sections
    assert not proven(FINISHING_CUTTER, scene, tip, axis)


def test_the_proof_never_passes_a_tool_that_touches(scene, model):
    rng = np.random.default_rng(3)
    tips = np.array([0.0, 0.0, 37.0]) + rng.normal(size=(600, 3)) * [6, 6, 8]
    axes = unit(rng.normal(size=(600, 3)))
    free = classify_poses(scene, FINISHING_CUTTER, Poses.at_rest(tips, axes)) == FREE
    assert 60 < free.sum() < 540
    solid = {"cutter": cutter_mesh(FINISHING_CUTTER, TANGENT_SLACK).vertices}
    solid |= {section.name: section_mesh(section).vertices for section in FINISHING_CUTTER.profile[1:]}
    level, material = MeshDistance(scene.level), MeshDistance(scene.material)
    for i in np.flatnonzero(free)[:80]:
        assert not colliding_section(model, tips[i], axes[i])
        side = np.eye(3)[int(np.argmin(np.abs(axes[i])))]
        x = unit(np.cross(side, axes[i])[None])[0]
        turn = np.column_stack([x, np.cross(axes[i], x), axes[i]])
        for name, points in solid.items():
            placed = tips[i] + points @ turn.T
            assert placed[:, 2].min() > 0
            assert (level if name == "cutter" else material).signed(placed).min() > -0.011
            assert scene.post.distance(placed).min() > -0.011


def test_a_margin_that_moves_need_is_asked_for(scene):
    tips = np.array([[0.0, 0.0, top_of(scene) + 0.5], [0.0, 0.0, top_of(scene) + 0.5]])
    axes = np.array([[0.0, 0.0, 1.0], unit(np.array([[1.0, 0.0, 0.2]]))[0]])
    alone = classify_poses(scene, FINISHING_CUTTER, Poses.at_rest(tips[:1], axes[:1]))
    swung = classify_poses(scene, FINISHING_CUTTER, Poses.in_motion(tips, axes, np.array([True, False])))
    assert alone[0] == FREE
    assert swung[0] != FREE


def test_where_only_proofs_count_the_same_poses_are_free(scene):
    rng = np.random.default_rng(4)
    tips = np.array([0.0, 0.0, 37.0]) + rng.normal(size=(600, 3)) * [6, 6, 8]
    poses = Poses.at_rest(tips, unit(rng.normal(size=(600, 3)) + UP))
    whole = classify_poses(scene, FINISHING_CUTTER, poses)
    proofs = classify_poses(scene, FINISHING_CUTTER, poses, settled=UNDECIDED)
    assert {FREE, UNDECIDED, COLLIDING} <= set(whole)
    assert ((whole == FREE) == (proofs == FREE)).all()


def test_a_wide_holder_close_above_the_part_is_proven_free_by_few_distances(scene, monkeypatch):
    cutter = replace(FINISHING_CUTTER, overhang=22.0, holder=(Frustum(80.0, 50.0, 50.0),))
    tip, up = np.array([[0.0, 0.0, top_of(scene) + 0.5]]), UP[None]
    assert classify_poses(scene, cutter, Poses.at_rest(tip, up))[0] == FREE
    asked = []
    bound = Surroundings.distance_bound

    def counted(self, points, *others, **named):
        asked.append(len(points))
        return bound(self, points, *others, **named)

    monkeypatch.setattr(Surroundings, "distance_bound", counted)
    assert (classify_thick_tool(scene, cutter, 0.2, tip, up) == FREE).all()
    assert sum(asked) <= 2 * (1 + len(cutter.profile))


def test_the_bound_of_distances_keeps_off_every_column(scene):
    columns = Column(2.0, 31.5), Column(40.0, -1.0, -np.inf), Column(3.0, 60.0, 10.0, 9.0, -4.0)
    points = np.random.default_rng(7).normal(size=(2000, 3)) * 20 + [0.0, 0.0, 25.0]
    wanted = np.full(len(points), np.inf)
    off_mesh = Surroundings(scene, "material", 0.0, ()).distance_bound(points, wanted)
    bound = Surroundings(scene, "material", 0.0, columns).distance_bound(points, wanted)
    expected = np.min([off_mesh, *(column.distance(points) for column in columns)], axis=0)
    assert (bound == expected).all()
    assert 200 < (expected < off_mesh).sum() < 1800
    assert (expected < 0).any()


@pytest.mark.parametrize("shank_diameter", [1.4, 3.0])
def test_what_distances_tell_of_the_thick_tool_is_what_fcl_finds(scene, shank_diameter):
    cutter = replace(FINISHING_CUTTER, flute_length=1.5, shank_diameter=shank_diameter)
    rng = np.random.default_rng(5)
    tips = scene.level.vertices[rng.integers(len(scene.level.vertices), size=1500)]
    tips = tips + rng.normal(size=tips.shape) * 0.2
    axes = unit(rng.normal(size=tips.shape) * [1, 1, 1.5] + UP)

    at_rest = classify_poses(scene, cutter, Poses.at_rest(tips, axes))
    tips, axes = tips[at_rest == UNDECIDED], axes[at_rest == UNDECIDED]
    sections = classify_thick_tool(scene, cutter, 0.2, tips, axes)
    state = sections.max(axis=1)
    model = build_fcl_model(scene, cutter, 0.2)
    hit = model.colliding_sections(tips, axes)
    assert not any(name for name, known in zip(hit, state) if known == FREE)
    assert all(name for name, known in zip(hit, state) if known == COLLIDING)
    assert (state != UNDECIDED).mean() > 0.3
    undecided = np.flatnonzero(state == UNDECIDED)
    asked = sections[undecided] == UNDECIDED
    assert 0 < asked.mean() < 1
    left = model.colliding_sections(tips[undecided], axes[undecided], asked)
    assert [bool(name) for name in left] == [bool(hit[k]) for k in undecided]


SHRINK_FIT = (Frustum(30.0, 8.0, 16.0), Frustum(20.0, 40.0, 40.0))
NOSE = (Frustum(40.0, 60.0, 60.0), Frustum(40.0, 60.0, 100.0))


def surface_points(section: ToolSection) -> np.ndarray:
    """Points on the wall and the ends of a section with the tip at the origin and the axis along +Z."""
    angle = np.arange(72) * (2 * np.pi / 72)
    rings = [(f, 1.0) for f in np.linspace(0, 1, 30)] + [(e, f) for e in (0.0, 1.0) for f in (0.25, 0.5, 0.75)]
    shares = np.array(rings)
    u = section.start + shares[:, 0] * (section.end - section.start)
    r = (section.radius + section.taper * (u - section.start)) * shares[:, 1]
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(72)])
    return (r[:, None, None] * circle + u[:, None, None] * UP).reshape(-1, 3)


def placed(points: np.ndarray, tip: np.ndarray, axis: np.ndarray) -> np.ndarray:
    x = unit(np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)[None])[0]
    return tip + points @ np.column_stack([x, np.cross(axis, x), axis]).T


@pytest.mark.parametrize("air", [None, 2.0])
def test_what_is_proven_free_keeps_off_pin_arm_and_column(scene, air):
    """What holds the free end is not on the Z axis: spheres and FCL agree about it, and closed forms hold."""
    top = top_of(scene)
    pin = Column(0.8, top + 12.0, top - 0.5, 1.0, -0.5)
    bracket = (
        Column(6.0, top + 20.0, 0.0, 30.0, 8.0),
        *(Column(5.0, top + 20.0, top + 12.0, 1.0 + x, -0.5 + x / 4) for x in (0.0, 7.0, 14.0, 21.0)),
    )
    post = replace(scene.post, pin=pin)
    here = replace(scene, post=post, clamping=Clamping(closed=False, clearance=2.0, beside=bracket))
    cutter = replace(FINISHING_CUTTER, holder=SHRINK_FIT, nose=NOSE)
    rng = np.random.default_rng(11)
    tips = np.array([0.0, 0.0, top]) + rng.normal(size=(3000, 3)) * [9, 9, 5]
    axes = unit(rng.normal(size=tips.shape) * [1, 1, 0.6])
    free = classify_poses(here, cutter, Poses.at_rest(tips, axes), air=air) == FREE
    bare = classify_poses(replace(scene, clamping=Clamping(closed=False)), cutter, Poses.at_rest(tips, axes))
    assert 20 < free.sum() < (bare == FREE).sum()
    for i in np.flatnonzero(free)[:120]:
        for section in cutter.profile:
            points = placed(surface_points(section), tips[i], axes[i])
            assert min(column.distance(points).min() for column in bracket) > 2.0 - 1e-6
            assert pin.distance(points).min() > (2.0 if section.name in ("holder", "spindle") else 0.0)
    if air is None:
        # FCL holds prisms for columns, which reach out of them by less than 0.1 mm
        wider = replace(here, clamping=replace(here.clamping, clearance=2.1))
        roomy = np.flatnonzero(classify_poses(wider, cutter, Poses.at_rest(tips, axes)) == FREE)[:150]
        model = build_fcl_model(here, cutter)
        assert not any(model.colliding_sections(tips[roomy], axes[roomy]))
        for column in (pin, *bracket):
            within = np.array([[column.x, column.y, (column.top + max(column.bottom, top)) / 2]])
            assert colliding_section(model, within[0] - cutter.radius * UP, UP)


@pytest.mark.parametrize("air", [None, 2.0])
@pytest.mark.parametrize("closed", [True, False])
def test_what_is_proven_free_keeps_every_clearance_by_closed_form(scene, closed, air):
    """Cones, spindle nose, chuck, an open and a closed table; spheres and the thick tool."""
    chuck, stand, disc = Column(9.0, 22.0), Column(30.0, 6.0), Column(60.0, 0.0, -np.inf)
    columns = (chuck, stand) if closed else (chuck, stand, disc)
    here = replace(scene, clamping=Clamping(columns, closed, 3.0))
    cutter = replace(FINISHING_CUTTER, holder=SHRINK_FIT, nose=NOSE)
    rng = np.random.default_rng(7)
    tips = np.array([0.0, 0.0, 37.0]) + rng.normal(size=(4000, 3)) * [9, 9, 9]
    axes = unit(rng.normal(size=tips.shape) * [1, 1, 0.6])
    spheres = classify_poses(here, cutter, Poses.at_rest(tips, axes), air=air) == FREE
    thick = (classify_thick_tool(here, cutter, 0.0, tips, axes, air=air) == FREE).all(axis=1)
    assert spheres.sum() > 40
    material = MeshDistance(here.material)
    below = 0
    for i in np.flatnonzero(spheres | (thick & (not closed)))[:150]:
        for section in cutter.profile:
            points = placed(surface_points(section), tips[i], axes[i])
            assert min(column.distance(points).min() for column in columns) > 3.0 - 1e-6
            below += points[:, 2].min() < 0
            if closed:
                assert points[:, 2].min() > 3.0 - 1e-6
            if section.name in ("holder", "spindle"):
                assert here.post.distance(points).min() > 3.0 - 1e-6
            if section.name != "cutter":
                assert here.post.distance(points).min() > 0
            if air is not None or section.name != "cutter":
                kept = air or 0.0
                assert material.signed(points, kept + 0.1).min() > kept - 1e-3
    assert bool(below) != closed


@pytest.mark.parametrize("name", ["shank", "holder", "spindle"])
def test_a_chuck_in_the_way_of_any_section_is_caught(scene, name):
    """The chuck reaches just up to the section, and the clearance too much."""
    cutter = replace(FINISHING_CUTTER, nose=NOSE)
    section = next(s for s in cutter.profile if s.name == name)
    tip, axis = np.array([-(section.start + section.end) / 2, 0.0, 70.0]), np.array([1.0, 0.0, 0.0])
    lowest = 70.0 - min(section.radius, section.end_radius)
    bare = replace(scene, stock=Capsule(UP * 500, UP * 510, 2.0), material=crumb(), level=crumb())
    for top, free in ((lowest - 3.5, True), (lowest - 2.5, False), (lowest + 0.5, False)):
        chuck = replace(bare, post=Post(0.1, 5.0), clamping=Clamping((Column(0.5, top),), clearance=3.0))
        centre = tip + cutter.radius * axis
        assert CollisionChecker(chuck, cutter).free(centre[None], axis[None])[0] == free
        found = colliding_section(build_fcl_model(chuck, cutter), tip, axis)
        assert found == ("" if free else name)


def test_the_shank_above_a_neck_is_caught_where_the_neck_is_free(scene):
    """A level tool over a chuck whose clearance the neck keeps, and the shank above it does not."""
    slim = replace(FINISHING_CUTTER, neck_diameter=1.0, neck_length=12.0, shank_diameter=4.0, overhang=20.0)
    axis = np.array([1.0, 0.0, 0.0])
    bare = replace(scene, stock=Capsule(UP * 500, UP * 510, 2.0), material=crumb(), level=crumb())
    here = replace(bare, post=Post(0.1, 5.0), clamping=Clamping((Column(0.5, 66.0),), clearance=3.0))
    for middle, free in ((8.0, True), (16.0, False)):
        tip = np.array([-middle, 0.0, 70.0])
        centre = tip + slim.radius * axis
        assert CollisionChecker(here, slim).free(centre[None], axis[None])[0] == free
        assert colliding_section(build_fcl_model(here, slim), tip, axis) == ("" if free else "shank")
    straight = replace(slim, neck_diameter=0.0, neck_length=0.0)
    tip = np.array([-8.0, 0.0, 70.0])
    assert not CollisionChecker(here, straight).free((tip + slim.radius * axis)[None], axis[None])[0]


def crumb() -> TriangleMesh:
    return revolve(np.full(2, 0.3), np.array([500.0, 501.0]), (500.0, 501.0), SIDES)


def test_a_nose_that_is_lowered_is_caught(scene):
    """A horizontal tool whose nose would be below the clearance over the table."""
    tip, axis = np.array([8.0, 0.0, 37.0]), np.array([1.0, 0.0, 0.0])
    for diameter, free in ((60.0, True), (70.0, False)):
        cutter = replace(FINISHING_CUTTER, nose=(Frustum(50.0, diameter, diameter),))
        assert proven(cutter, scene, tip, axis) == free
        found = colliding_section(build_fcl_model(scene, cutter), tip, axis)
        assert found == ("" if free else "spindle")


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> TriangleMesh:
    """A box between two corners."""
    corners = revolve(np.full(2, np.sqrt(0.5)), np.array([0.0, 1.0]), (0.0, 1.0), 4)
    turned = corners.vertices @ np.array([[1, 1, 0], [-1, 1, 0], [0, 0, np.sqrt(2)]]) / np.sqrt(2)
    unit_box = TriangleMesh(turned + np.array([0.5, 0.5, 0.0]), corners.faces)
    return TriangleMesh(np.array(low) + unit_box.vertices * np.subtract(high, low), unit_box.faces)


@pytest.mark.parametrize(("depth", "free"), [(0.004, True), (0.008, False)])
def test_flutes_go_into_the_part_by_less_than_the_gouge_that_is_allowed(depth, free):
    """Beside a wall that only the flutes reach, as on the far side of a hollow; the default tolerance is 0.01 mm."""
    radius = FINISHING_CUTTER.radius
    wall = block((radius - depth, -2.0, 36.0), (radius + 2.0, 2.0, 37.5))
    np.testing.assert_allclose(wall.bounds, [[radius - depth, -2.0, 36.0], [radius + 2.0, 2.0, 37.5]])
    assert wall.volume == pytest.approx((2.0 + depth) * 4.0 * 1.5)
    away = block((-5.0, -5.0, 36.0), (-4.5, -4.5, 36.5))
    centre, axis = np.array([[0.0, 0.0, 35.0]]), UP[None]
    scene = Scene(wall, away, UPRIGHT_CAPSULE, Post(1.0, 31.5), tangent_slack=flute_slack(0.01))
    assert CollisionChecker(scene, FINISHING_CUTTER).free(centre, axis)[0] == free
    outer = replace(scene, tangent_slack=TANGENT_SLACK)
    assert CollisionChecker(outer, FINISHING_CUTTER).free(centre, axis)[0]


def test_what_flutes_ball_mesh_and_control_use_up_is_no_more_than_the_gouge_tolerance():
    for allowed in (0.002, 0.005, 0.01, 0.05):
        rest = MESH_SHARE * planned_tolerance(allowed) + WORD_ROUNDING
        assert flute_slack(allowed) + rest <= allowed


@pytest.mark.parametrize("share", [0.8, 1.0, 1.4])
def test_a_nose_about_as_wide_as_the_tool_is_long_is_proven_free_above_the_part(scene, share):
    wide = share * FINISHING_CUTTER.length
    cutter = replace(FINISHING_CUTTER, nose=(Frustum(150.0, 2 * wide, 2 * wide),))
    tip = np.array([0.0, 0.0, top_of(scene)])
    open_ = replace(scene, clamping=Clamping((), closed=False, clearance=1.0))
    assert proven(cutter, open_, tip, UP)
    # laid over, its rim is in the part
    sunk = np.array([0.0, 0.0, top_of(scene) - cutter.length])
    assert not proven(cutter, open_, sunk, UP)


@pytest.mark.parametrize("allowed", [0.004, 0.05])
@pytest.mark.parametrize("apart", [0.0, 0.007, 0.05])
def test_flutes_go_into_the_part_no_deeper_than_the_gouge_tolerance_leaves_them(allowed, apart):
    part = MeshDistance(pebble().tessellate(part_chord(allowed)))
    held, slack = held_level(level_of(pebble(apart), 1), part, allowed)
    deepest = slack - part.signed(held.mesh.vertices).min()
    assert deepest <= flute_slack(allowed) + 2 * part_chord(allowed) < allowed + 1e-12


def test_a_level_far_from_the_part_keeps_its_coarse_mesh_and_the_part_its_own():
    part = MeshDistance(pebble().tessellate(0.002))
    held, slack = held_level(level_of(pebble(0.1), 1), part, 0.01)
    assert len(held.mesh.faces) < len(part.mesh.faces)
    assert slack == TANGENT_SLACK
    near, less = held_level(level_of(pebble(0.005), 1), part, 0.01)
    assert len(near.mesh.faces) > 2 * len(held.mesh.faces)
    assert less == flute_slack(0.01)
    assert held_level(level_of(pebble(), 0), part, 0.01) == (part, flute_slack(0.01))
