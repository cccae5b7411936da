"""The whole chain from every kind of stock to a posted program that was read back."""

import pytest
from bonecam_meshes import path as shipped

import bonecam
from bonecam.job import Job
from bonecam.mesh import write_mesh
from bonecam.setup import Cylinder

COARSE = Job().with_values(
    mechanics={"refuse": False},
    surface={"tolerance": 0.2},
    levels={"roughing_depth": 1.5, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.02},
    roughing={"preset": "ball-4", "scallop": 0.3},
    finishing={"preset": "ball-2", "scallop": 0.2},
)
STOCKS = {
    "cylinder": {"kind": "cylinder", "diameter": 15.0, "length": 37.0},
    "cylinder, aside": {
        "kind": "cylinder",
        "diameter": 18.0,
        "length": 40.0,
        "offset_x": 1.0,
        "offset_z": -1.0,
        "tilt_x_deg": 5.0,
    },
    "smallest box": {"kind": "box"},
    "prism": {"kind": "mesh", "mesh": "bar.stl", "scale": 0.0},
}


@pytest.mark.slow
@pytest.mark.parametrize("stock", STOCKS.values(), ids=STOCKS)
def test_every_stock_leads_to_a_program_without_gouges(stock, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_mesh(Cylinder(9.0, 0.0, 40.0).mesh(10.0), "bar.stl")  # a prism of twelve sides
    result = bonecam.convert(shipped("phalanx"), COARSE.with_values(stock=stock), program="bone.h")
    report = result.report
    assert report["stock"]["kind"] == stock["kind"]
    assert report["nc"]["gouge_max_mm"] <= 0.01
    assert report["nc"]["readback_tip_error_mm"] <= 0.002
    assert [row["rounding"] for row in report["levels"]].count(True) >= 2
    for row in report["levels"][1:]:
        assert row["depth_max_mm"] <= row["limit_mm"] + 0.002
    cut = [row for row in report["toolpath"] if row["contacts"]]
    assert len(cut) == len(report["levels"]) - 1
    assert (tmp_path / "bone.h").stat().st_size > 10_000
