"""What the paths of all levels of a job leave, by the simulation of the posted text.

Contacts at which a cut would be too deep are left out as they are planned, whatever part of the cutter cuts.
"""

from collections.abc import Callable

import numpy as np
import pytest
from numpy import ndarray
from small_parts import ROUGHING_CUTTER, UPRIGHT_CAPSULE, level_of, path_of, pebble

import bonecam
from bonecam.arrays import unit
from bonecam.levels.measure import NO_CUT, StockLevel
from bonecam.material.in_process_stock import remove_material, uncut_material
from bonecam.mesh.solids import revolve
from bonecam.planning.contacts import DepthLimits
from bonecam.planning.levels import SLACK, cut_within_depth, within_depth
from bonecam.tool.path import PARTING, ContactPath, MoveKind, ToolPath
from bonecam.verify.removal import ACCURACY

JOB = bonecam.Job().with_values(
    mechanics={"refuse": False},
    surface={"tolerance": 0.05},
    holding={"diameter": 3.0, "length": 60.0},
    levels={"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
    roughing={"preset": "ball-4", "scallop": 0.3},
    finishing={"preset": "ball-2", "scallop": 0.02},
    fine={"scallop": 0.02},
    path={"orientation": "lead", "fine_cutter": True},
)


def waisted() -> bonecam.TriangleMesh:
    """A body of revolution, 6 x 10 mm, with a groove of radius 0.5 mm at its bottom."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 81)[1:-1]
    heights = 5 + 5 * np.sin(angle)
    radii = 3 * np.cos(angle) ** 0.8 - 0.6 * np.exp(-(((heights - 6) / 0.75) ** 2))
    return revolve(radii, heights, (0.0, 10.0), 48)


@pytest.mark.whole
def test_a_fine_cutter_cuts_the_hollow_that_the_finishing_ball_does_not_enter(tmp_path):
    """Without it 13.6 mm2 stay in the groove, 0.12 mm high. The finished part is parted from its post."""
    job = JOB.with_values(holding={"parting": True})
    made = bonecam.convert(waisted(), job, program=tmp_path / "waisted.h")
    on_levels = [path for path in made.paths if path.level >= 0]
    assert [path.cutter.number for path in on_levels][-2:] == [2, 3]
    assert len({path.title for path in made.paths}) == len(made.paths)
    assert "TOOL CALL 3 " in made.program.text
    left = made.report["removal"]["left"]
    assert left["by_reason"]["gouge"] < 0.1
    assert left["max_mm"] < 0.03
    assert max(level["over_limit_mm"] or 0.0 for level in made.report["removal"]["levels"]) < 0.05
    fine = on_levels[-1]
    assert 0 < (~np.isnan(fine.contacts[:, 0])).sum() < 1500, "only the hollow and the fillet at the post"
    assert set(on_levels[-2].reasons) <= {"collision", "limits", "short", "covered"}

    parting = made.report["parting"]
    assert made.paths[-1].level == PARTING
    assert parting["steps"] == len(made.paths) - len(on_levels)
    assert parting["bridge_diameter_mm"] == pytest.approx(1.5)
    assert parting["stump_height_mm"] == pytest.approx(1.0, abs=0.05)
    assert "a bridge of 1.50 mm holds the part" in made.summary
    assert f"parting Z {parting['z_mm'] - made.program.zero_height:.2f}" in made.sheet
    assert len(made.report["toolpath"]) == len(on_levels)


@pytest.mark.slow
def test_the_part_comes_out_the_same_without_cuts_in_air(tmp_path):
    """In a stock that is near to its ends and far from its sides: outer levels have air at the ends."""
    job = JOB.with_values(
        stock={"diameter": 9.0, "length": 11.0}, levels={"roughing_depth": 0.5}, path={"fine_cutter": False}
    )
    made = [
        bonecam.convert(waisted(), job.with_values(path={"least_depth": depth}), program=tmp_path / "w.h")
        for depth in (0.03, 0.0)
    ]
    length, air = (
        [sum(row[name] for row in one.report["toolpath"]) for one in made] for name in ("length_mm", "trimmed_mm")
    )
    assert air[1] == 0
    assert air[0] > 0.05 * length[1]
    assert length[0] < length[1] - 0.5 * air[0]
    heights = [one.removal.left.heights for one in made if one.removal and one.removal.left]
    assert np.abs(heights[0] - heights[1]).max() < JOB.finishing.scallop
    areas = [one.report["removal"]["left"]["area_over_0_02_mm2"] for one in made]
    assert areas[0] == pytest.approx(areas[1], abs=0.5)


ALLOWED = DepthLimits(0.5, 0.05)
OUTWARD = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def level():
    return level_of(pebble())


@pytest.fixture(scope="module")
def material(level):
    return uncut_material([level, StockLevel(1, UPRIGHT_CAPSULE.mesh(0.01), 0.5, NO_CUT)], UPRIGHT_CAPSULE)


def contacts(depths: ndarray) -> ContactPath:
    """Makes contacts of one pass up the side of the stock, at which the ball goes so deep (mm)."""
    heights = np.linspace(UPRIGHT_CAPSULE.start[2], UPRIGHT_CAPSULE.end[2], len(depths))
    count, radius = len(depths), ROUGHING_CUTTER.radius
    surface = UPRIGHT_CAPSULE.radius - np.asarray(depths)
    places = np.column_stack([surface, np.zeros(count), heights]) + UPRIGHT_CAPSULE.start * [1.0, 1.0, 0.0]
    flat = np.zeros(count)
    return ContactPath(
        level=0,
        cutter=ROUGHING_CUTTER,
        pass_index=np.zeros(count, dtype=np.int64),
        parameters=np.column_stack([flat, flat]),
        contacts=places,
        normals=np.tile(OUTWARD, (count, 1)),
        feeds=np.tile([0.0, 0.0, 1.0], (count, 1)),
        centres=places + radius * OUTWARD,
        lifts=flat,
        ramp=np.zeros(count, dtype=bool),
        uncut=np.zeros((0, 3)),
        reasons=(),
    )


def along(axis: ndarray) -> Callable[[ContactPath], ToolPath]:
    """Makes paths over contacts with one tool axis."""

    def oriented(contacts: ContactPath) -> ToolPath:
        axes = np.tile(axis, (len(contacts.centres), 1))
        tips = contacts.centres - contacts.cutter.radius * axes
        kinds = np.full(len(tips), int(MoveKind.CUT))
        return path_of(tips, axes, kinds=kinds, passes=contacts.pass_index, tool=contacts.cutter)

    return oriented


def test_contacts_at_which_the_ball_goes_too_deep_are_found(material, level):
    depths = np.full(60, 0.3)
    depths[40] = 1.2
    tried = contacts(depths)
    path = along(OUTWARD)(tried)
    kept = within_depth(tried, path, material, remove_material(material, level, path), ALLOWED)
    assert not kept[40]
    assert kept[:20].all()
    shallow = contacts(np.full(60, 0.45))
    path = along(OUTWARD)(shallow)
    assert within_depth(shallow, path, material, remove_material(material, level, path), ALLOWED).all()


def test_less_than_what_the_proof_allows_beyond_the_depth_is_found(material, level):
    assert ALLOWED.deepest + SLACK + 0.01 < ALLOWED.limit + ALLOWED.scallop + ACCURACY.cell / 2
    depths = np.full(60, 0.45)
    depths[40:44] = ALLOWED.deepest + SLACK + 0.01
    tried = contacts(depths)
    path = along(OUTWARD)(tried)
    kept = within_depth(tried, path, material, remove_material(material, level, path), ALLOWED)
    assert not kept[40:44].all()
    assert kept[:15].all()


def test_depths_are_measured_as_near_to_one_another_as_in_the_proof(material, level):
    """A ball that dips at one contact leaves a hollow that is less than 0.4 mm wide where it is too deep."""
    found = 0
    for at in range(20, 40):
        depths = np.full(60, 0.45)
        depths[at] = ALLOWED.deepest + SLACK + 0.01
        tried = contacts(depths)
        path = along(OUTWARD)(tried)
        found += not within_depth(tried, path, material, remove_material(material, level, path), ALLOWED).all()
    assert found == 20


def test_flutes_that_cut_too_deep_above_a_shallow_ball_are_found(material, level):
    tried = contacts(np.full(30, 0.3)).take(np.arange(10))
    leaning = unit(np.array([[-0.3, 0.0, 1.0]]))[0]
    path = along(leaning)(tried)
    assert material.depths(tried.centres, tried.cutter.radius)[0].max() < 0.31
    assert not within_depth(tried, path, material, remove_material(material, level, path), ALLOWED).any()


def test_a_path_is_made_anew_without_them_and_tells_so(material, level):
    depths = np.full(60, 0.3)
    depths[40] = 1.2
    tried = contacts(depths)
    made: list[ContactPath] = []

    def oriented(contacts):
        made.append(contacts)
        return along(OUTWARD)(contacts)

    path, after = cut_within_depth(tried, material, level, ALLOWED, oriented)
    assert len(made) == 2
    last = made[-1]
    assert within_depth(last, path, material, after, ALLOWED).all()
    left_out = len(tried.centres) - len(last.centres)
    assert 0 < left_out < 25
    assert last.reasons == ("covered",) * left_out
    assert len(last.uncut) == left_out
    assert len(np.unique(last.pass_index)) == 2, "the tool does not go straight over what is left out"
