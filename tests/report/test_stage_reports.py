"""What the report says to a person.

The comparison of tool axes measures what it says: known turns, times, and collisions.

The types of a report, and what tells a report from them.
"""

from dataclasses import replace

import numpy as np
import pytest
from small_parts import path_of, pebble
from typed_values import differences

from bonecam.levels import Certificate, RoundedLevel, StockLevel
from bonecam.levels.measure import NO_CUT
from bonecam.machine import MachineLimits
from bonecam.mesh import TriangleMesh
from bonecam.nc.program import ProgramTime
from bonecam.report import AxisComparison, Report, levels_report
from bonecam.report.stage_reports import toolpath_report, uncut_areas
from bonecam.report.summary import MOST_LINES, NOT_SIMULATED, AxisChoice, certified_text, summary_of, uncut_lines
from bonecam.setup import Capsule
from bonecam.tool import FreeCones, MoveKind
from bonecam.tool.elliptic_cones import EllipticCones
from bonecam.tool.path import ConeCheck

MEASURES = replace(NO_CUT, depth_max=0.5, depth_mean=0.4)


def test_what_was_left_uncut_is_told_by_reason_apart_for_the_part():
    rows = [
        {"level": 1, "uncut_contacts": 7, "uncut_reasons": {"gouge": 5, "post": 2}, "blocked_by": {}},
        {
            "level": 0,
            "uncut_contacts": 3,
            "uncut_reasons": {"post": 1, "collision": 2},
            "blocked_by": {"shank against the material": 2},
        },
    ]
    assert uncut_lines(rows, {"post": 0.31}) == [
        "3 contacts on the part: collision 2 (no free way for the tool, 2 shank against the material), "
        "post 1, 0.3 mm2 (at the post)",
        "7 contacts on levels round it: gouge 5 (ball too large for the hollow), post 2 (at the post)",
    ]
    assert uncut_lines(rows[:1], {})[0].startswith("7 contacts on levels round it: ")
    nothing = {"level": 0, "uncut_contacts": 0, "uncut_reasons": {}, "blocked_by": {}}
    assert uncut_lines([nothing], {}) == ["nothing"]


def test_entries_along_the_cut_are_told_from_straight_ones():
    """One cut reached from behind in its own direction and left upwards, one reached from above and left in its own."""
    cut, link = int(MoveKind.CUT), int(MoveKind.LINK)
    tips = np.array([[-1.0, 0, 0.1], [0, 0, 0], [1, 0, 0], [2, 0, 3.0], [2, 0, 0], [3, 0, 0], [4, 0, 0.1]])
    path = path_of(tips, np.tile([0.0, 0, 1], (7, 1)), kinds=np.array([link, cut, cut, link, cut, cut, link]))
    row = toolpath_report([path], 0.0)[0]
    assert (row["entries"], row["entries_tangential"], row["exits_tangential"]) == (2, 1, 1)


def test_axes_near_the_normal_are_counted_and_those_that_had_no_other():
    """Leads of 0, 4, 8, 12 degrees; cones of 1, 30 and none."""
    lead = np.radians([0.0, 4, 8, 12])
    axes = np.column_stack([np.sin(lead), 0 * lead, np.cos(lead)])
    tool = path_of(np.zeros((4, 3)), axes).cutter
    balls = np.column_stack([np.arange(4.0), np.zeros(4), np.zeros(4)])
    path = path_of(balls - tool.radius * axes, axes, kinds=np.full(4, int(MoveKind.CUT)), tool=tool)
    path = replace(path, contacts=balls - [0, 0, tool.radius])
    assert toolpath_report([path], np.radians(10.0))[0]["near_normal_contacts"] is None

    shapes = EllipticCones.circular(axes[[0, 1]], np.radians([1.0, 30.0]))
    cones = FreeCones(balls[:2], shapes, np.array([0, 1, -1, 1]))
    row = toolpath_report([replace(path, cones=cones)], np.radians(10.0))[0]
    assert row["near_normal_contacts"] == 3
    assert row["near_normal_without_choice"] == 2
    assert row["cones"] == {"count": 2, "shape": "elliptic", "fcl": None}
    checked = replace(cones, check=ConeCheck(5, 1, 0), cone_of=np.full(4, -1))
    assert toolpath_report([replace(path, cones=checked)], 0.0)[0]["cones"] == {
        "count": 0,
        "shape": "elliptic",
        "fcl": {"asked": 5, "narrowed": 1, "refused": 0},
    }
    none = FreeCones(balls[:0], EllipticCones.none(0), np.full(4, -1))
    assert toolpath_report([replace(path, cones=none)], np.radians(5.0))[0]["near_normal_without_choice"] == 2


def test_the_summary_tells_the_verdict_first_in_25_lines():
    level = {"depth_max_mm": 0.5, "depth_back_max_mm": 0.5, "not_certified": [], "rounding": False}
    report = {
        "input": {
            "faces": 993,
            "units": "mm",
            "notes": ["mirrored in X of its file"],
            "repairs": ["closed 1 hole with 33 faces, 9.66 mm across"],
            "repair_deviation_max_mm": 1.079,
        },
        "surface": {
            "control_points": 190,
            "deviation_max_mm": 0.07,
            "deviation_rms_mm": 0.02,
            "tolerance_mm": 0.08,
            "tolerance_why": "as the job states",
            "given_deviation_max_mm": 1.083,
        },
        "stock": {"kind": "capsule", "diameter_mm": 9.3, "length_mm": 22.3},
        "levels": [{**level, "depth_max_mm": 0.0, "depth_back_max_mm": 0.0, "not_certified": None}, level],
        "levels_lower_bound": 1,
        "levels_method": "qp",
        "levels_break_mm": 0.0,
        "uncut_mm2": {"short": 0.5, "post": 3.0},
        "removal": NOT_SIMULATED,
        "toolpath": [{"level": 0, "length_mm": 7.5, "cutter_radius_mm": 2.0}],
        "nc": dict.fromkeys(("blocks", "readback_tip_error_mm", "readback_axis_error_deg", "gouge_max_mm"), 1)
        | {"gouge_to_given_max_mm": 0.0567, "parts": 3}
        | ProgramTime(1.0, (1.2,), 1.2, 2.0, by_hand=1, assumed=("speeds",)).report
        | {"file": "half.h", "machine": "mill", "controller": "heidenhain"},
        "seconds": {"mesh": 1.0},
        "warnings": [],
    }
    told = summary_of(report).splitlines()
    assert told == [
        "verdict   half.h is proven from its text, not simulated; 0 warnings",
        "minutes   about 1.0 min at the feed, 1.2 as the axes move, 2.0 with changes but 1 by hand",
        "cut in    gouge 1000.00 um, tip as read back 1000.00 um off; 0.057 mm into the mesh as given at most",
        f"removal   {NOT_SIMULATED['skipped']}",
        "uncut     3.0 mm2 at the post, 0.5 mm2 too short for a plunge",
        "tools     radius 2 mm",
        "nc        half.h and 3 files that it calls: 1 blocks for mill / heidenhain",
        "mesh      993 faces, mm; 1 repair; mirrored in X of its file; closed 1 hole with 33 faces, 9.66 mm across",
        "surface   190 control points, 0.070 mm off at most, tolerance 0.08; 1.083 mm from the mesh as given",
        "stock     capsule 9.30 x 22.30 mm",
        "levels    1 cut, no schedule needs fewer than 1; depth max 0.5000 mm",
        "certified depth, nesting and stock hold everywhere on 1 of 1 cut",
        "time      1.0 s",
    ]
    broken = summary_of({**report, "levels_break_mm": 0.0042})
    assert "depth max 0.5000 mm; a limit is broken by 0.0042 mm" in broken

    # many warnings, notes and repairs keep the figures and the number of lines
    warned = {"text": "a thin place " + 20 * "long ", "remedy": "a " + 20 * "stout " + "one"}
    many = {**report, "warnings": 20 * [warned], "input": {**report["input"], "repairs": 20 * ["closed 1 hole"]}}
    most = summary_of(many).splitlines()
    assert len(most) == MOST_LINES
    assert most[0].endswith("; 20 warnings")
    assert told[1] in most
    assert told[-1] in most
    assert sum("more lines: see report and page" in line for line in most) == 1
    assert any(line.endswith("... (report)") for line in most)


def test_a_cut_that_is_not_certified_is_told_with_its_place_although_it_measures_well():
    mesh, place = TriangleMesh(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32)), np.array([1.0, 2.0, 3.0])
    good, deep, unknown = (
        Certificate(depth, gap, -0.01, place, place, place, np.empty((0, 2)), 9)
        for depth, gap in ((0.5, 0.0), (0.5035, 0.0), (0.5, -np.inf))
    )
    levels = [StockLevel(k, mesh, 0.5, MEASURES, found) for k, found in enumerate((None, good, deep, unknown))]
    rows = levels_report(levels)
    assert [row["not_certified"] for row in rows[:2]] == [None, []]
    assert {row["depth_full_mean_mm"] for row in rows} == {None}
    assert rows[2]["depth_certified_mm"] == 0.5035
    assert rows[3]["nesting_certified_mm"] is None
    told = certified_text(rows)
    assert told.startswith(
        "depth, nesting and stock hold everywhere on 1 of 3 cuts; cut 2 may be 0.5035 mm deep, more than "
        "0.5 mm, at (1.00, 2.00"
    )
    assert "cut 3 is not proven to hold the level before at (1.00" in told


def test_why_cuts_have_no_certificate_is_told_as_it_is():
    body = Capsule(np.array([0.0, 0.0, 10.0]), np.array([0.0, 0.0, 20.0]), 5.0)
    surface, mesh, place = pebble(), body.mesh(0.1), np.zeros(3)
    sure = Certificate(0.5, 0.0, -0.01, place, place, place, np.empty((0, 2)), 9)
    made = [
        RoundedLevel(k, surface, mesh, 0.5, MEASURES, body, surface.control_points)
        if k in (2, 3)
        else StockLevel(k, mesh, 0.5, MEASURES)
        for k in range(5)
    ]
    levels = [made[0], *(replace(level, certificate=sure) for level in made[1:3]), *made[3:]]
    rows = levels_report(levels)
    assert [row["rounding"] for row in rows] == [False, False, False, True, True]
    told = (
        "depth, nesting and stock hold everywhere on 2 of 2 cuts; 2 more cuts only to round the stock, "
        "exact by construction"
    )
    assert certified_text(rows) == told
    assert (
        certified_text(levels_report(made[:2]))
        == "nothing on 1 cut: the surface is not polynomial (it has weights other than one)"
    )


def test_the_area_left_uncut_is_that_round_the_contacts_left_out():
    """Of a flat square of 4 x 4 mm a row of contacts at one edge is left out."""
    x, y = (v.ravel() for v in np.meshgrid(*2 * [np.linspace(-2, 2, 41)], indexing="ij"))
    index = np.arange(41**2).reshape(41, 41)
    a, b, c, d = (v.ravel() for v in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]).astype(np.int32)
    part = TriangleMesh(np.column_stack([x, y, 0 * x]), faces)
    places = np.array([[u, v, 0.0] for u in (-1.5, -0.5, 0.5, 1.5) for v in np.linspace(-1.75, 1.75, 8)])
    cut = places[8:]
    path = path_of(cut, np.tile([0.0, 0.0, 1.0], (len(cut), 1)), kinds=np.full(len(cut), int(MoveKind.CUT)))
    path = replace(path, contacts=cut, uncut=places[:8], reasons=("post",) * 6 + ("gouge",) * 2)
    areas = uncut_areas([path], part)
    assert areas == {"gouge": pytest.approx(1.0, abs=0.05), "post": pytest.approx(3.0, abs=0.05)}


STEP = 0.5
TURN = np.radians(3.0)
FEED = 600.0


def comparison(axes: np.ndarray, limits: MachineLimits, passes: np.ndarray | None = None) -> AxisComparison:
    """Contacts along X, STEP apart, on a plane below the balls."""
    count = len(axes)
    balls = np.column_stack([STEP * np.arange(count), np.zeros(count), np.ones(count)])
    free = np.ones(count, dtype=bool)
    choice = AxisChoice("turning", axes, free, limits.allow(axes))
    passes = np.zeros(count, dtype=int) if passes is None else passes
    return AxisComparison(balls - [0, 0, 1.0], balls, passes, FEED, limits, (choice,))


def turning(count: int = 21, polar: float = np.radians(40.0)) -> np.ndarray:
    """Axes whose azimuth goes on by TURN from one to the next, across the seam of -pi and pi too."""
    azimuth = np.pi - 10 * TURN + TURN * np.arange(count)
    return np.column_stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.full(count, np.cos(polar))]
    )


def test_an_even_turn_has_its_rate_no_change_of_it_and_the_time_of_the_axis():
    slow = MachineLimits(np.pi / 2, turn_speed=TURN * FEED / STEP / 2)
    made = comparison(turning(), slow)
    row = made.figures(made.choices[0])
    assert row["turn_travel_deg"] == pytest.approx(60.0)
    assert row["tilt_travel_deg"] == pytest.approx(0.0, abs=1e-9)
    chord = 2 * np.degrees(np.arcsin(np.sin(np.radians(40)) * np.sin(TURN / 2)))
    assert row["turning_rms_deg_mm"] == pytest.approx(chord / STEP)
    assert row["turning_change_rms_deg_mm2"] == pytest.approx(0.0, abs=1e-9)
    assert row["turn_speed_deg_s"] == pytest.approx(np.degrees(TURN) / (60 * STEP / FEED))
    assert row["limited_share"] == 1.0
    assert row["seconds"] == pytest.approx(2 * 60 * 20 * STEP / FEED)
    assert row["feed_mean_mm_min"] == pytest.approx(FEED / 2)


def test_what_lies_between_passes_counts_nothing():
    passes = np.repeat([0, 1, 2], 7)
    axes = np.repeat(turning()[[0, 10, 20]], 7, axis=0)
    row = comparison(axes, MachineLimits(np.pi / 2), passes)
    figures = row.figures(row.choices[0])
    assert figures["turn_travel_deg"] == 0
    assert figures["seconds"] == pytest.approx(60 * 18 * STEP / FEED)


def test_axes_beyond_the_limits_are_counted():
    made = comparison(turning(), MachineLimits(np.radians(39)))
    assert made.figures(made.choices[0])["beyond_limits"] == 21


def test_the_table_has_a_column_for_each_choice_and_tells_the_feed_alone():
    made = comparison(turning(), MachineLimits(np.pi / 2))
    lines = made.table.strip().split("\n")
    assert {line.count("|") for line in lines} == {3}
    assert lines[0] == "|  | turning |"
    assert "| collide, of 21 | 0 |" in lines
    assert "| time (s; 1 by the feed alone) | 1 |" in lines


SURFACE = {
    "control_points": 80,
    "deviation_max_mm": 0.17,
    "deviation_rms_mm": 0.04,
    "surface_to_mesh_max_mm": 0.16,
    "mesh_to_surface_max_mm": 0.17,
    "tolerance_mm": 0.2,
    "tolerance_why": "as the job states",
    "tolerance_reached": True,
    "given_deviation_max_mm": 0.58,
    "surface_to_given_max_mm": 0.47,
    "given_to_surface_max_mm": 0.58,
}


def test_a_name_too_many_one_too_few_and_a_wrong_type_are_found():
    assert differences({"surface": SURFACE, "strategy": "morph"}, Report) == []
    assert differences({"surface": SURFACE | {"more": 1}}, Report) == [".surface.more: has no name"]
    fewer = {name: value for name, value in SURFACE.items() if name != "tolerance_mm"}
    assert differences({"surface": fewer}, Report) == [".surface.tolerance_mm: missing"]
    assert differences({"surface": SURFACE | {"tolerance_mm": None}}, Report) == [".surface.tolerance_mm: None"]
    assert differences({"removal": {"skipped": "not asked", "given": {"skipped": 1}}}, Report) == [
        ".removal.given.skipped: 1"
    ]
