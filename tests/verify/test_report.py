"""What the report says to a person."""

import numpy as np

from bonecam.levels.certificate import Certificate
from bonecam.levels.level import Level
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.verify.report import certified_text, levels_report, uncut_text


def test_what_was_left_uncut_is_told_by_reason_in_one_line() -> None:
    rows = [
        {"level": 1, "uncut_contacts": 7, "uncut_reasons": {"gouge": 5, "post": 2}},
        {"level": 0, "uncut_contacts": 3, "uncut_reasons": {"post": 1, "collision": 2}},
    ]
    text = uncut_text(rows)
    assert text.startswith("10 contacts, 3 of them on the part: gouge 5 (ball too large for the hollow), post 3 (at the post)")
    assert "collision 2" in text
    assert "\n" not in text
    assert uncut_text([{"level": 0, "uncut_contacts": 0, "uncut_reasons": {}}]) == "nothing"


def test_a_cut_that_is_not_certified_is_told_with_its_place_although_it_measures_well() -> None:
    mesh, place = TriangleMesh(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32)), np.array([1.0, 2.0, 3.0])
    good, deep, unknown = (
        Certificate(depth, gap, -0.01, place, place, place, np.empty((0, 2)), 9)
        for depth, gap in ((0.5, 0.0), (0.5035, 0.0), (0.5, -np.inf))
    )
    levels = [Level(k, None, mesh, 0.5, 0.5, 0.4, 0.0, 0, certificate=found) for k, found in enumerate((None, good, deep, unknown))]
    rows = levels_report(levels)
    assert [row["not_certified"] for row in rows[:2]] == [None, []]
    assert rows[2]["depth_certified_mm"] == 0.5035
    assert rows[3]["nesting_certified_mm"] is None
    told = certified_text(rows)
    assert told.startswith(
        "depth, nesting and stock hold everywhere on 1 of 3 cuts; cut 2 may be 0.5035 mm deep, more than 0.5 mm, at (1.00, 2.00"
    )
    assert "cut 3 may fall behind the level before farther than is known at (1.00" in told
    assert certified_text(rows[:1]).startswith("nothing")
