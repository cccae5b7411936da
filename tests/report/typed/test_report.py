"""The types of a report, and what tells a report from them."""

from typed_values import differences

from bonecam.report.typed import Report

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


def test_a_name_too_many_one_too_few_and_a_wrong_type_are_found() -> None:
    assert differences({"surface": SURFACE, "strategy": "morph"}, Report) == []
    assert differences({"surface": SURFACE | {"more": 1}}, Report) == [".surface.more: has no name"]
    fewer = {name: value for name, value in SURFACE.items() if name != "tolerance_mm"}
    assert differences({"surface": fewer}, Report) == [".surface.tolerance_mm: missing"]
    assert differences({"surface": SURFACE | {"tolerance_mm": None}}, Report) == [".surface.tolerance_mm: None"]
    assert differences({"removal": {"skipped": "not asked", "given": {"skipped": 1}}}, Report) == [
        ".removal.given.skipped: 1"
    ]
