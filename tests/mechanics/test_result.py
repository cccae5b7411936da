"""What would help a part that bends, beside formulas of beams."""

import numpy as np
import pytest

from bonecam.job import HoldingJob
from bonecam.job.materials.preset import CuttingForce, StiffnessTable
from bonecam.material.rays import lay_grid, lay_rays
from bonecam.mechanics import column_sections
from bonecam.mechanics.loads import Finished, KeptErrors, Standing, Workpiece
from bonecam.mechanics.result import Remedy, best_text, remedies, thickened
from bonecam.mesh.solids import cylinder
from bonecam.setup import Cylinder
from bonecam.workholding import Post

ALUMINIUM = StiffnessTable(elasticity=70000.0, density=2700.0, yield_strength=250.0, source="test")
FORCE = CuttingForce((631.0, 99.0, 273.0, 13.0, 10.0, 2.8), (0.6, 1.9), "test", scaled=False)
RADIUS, NECK, TOP, AT = 2.0, 20.0, 50.0, 45.0


def found(
    neck: float,
    tool: float,
    width: float = np.inf,
    passing: float = 5.0,
    tooth_hz: float = 150.0,
    force: float = 5.0,
    holding: HoldingJob | None = None,
) -> tuple[dict[str, float], float]:
    """The errors with each remedy, mm, and the one without, of a bar on a `neck` as long as this and as thick, under
    5 N across it; the cutter, that stands upright, gives way by `tool` mm/N."""
    body = Cylinder(RADIUS, 0.0, TOP)
    grid = lay_grid([body], 0.1)
    standing = Standing(lay_rays([body], grid, 500.0), grid, TOP, width)
    held = {"lighter": (("lighter cuts", 0.4),), "holding": holding}
    work = Workpiece("test", ALUMINIUM, FORCE, Post(RADIUS, neck), 0.0, **held)  # type: ignore[arg-type]
    points = np.array([[0.0, 0.0, AT]] * 3)
    mesh = cylinder(RADIUS, neck, TOP, 0.05)
    kept = KeptErrors(Finished(mesh, points, np.tile([1.0, 0, 0], (3, 1)), np.ones(3), np.zeros(3, dtype=np.int64)))
    kept.passing[:], kept.mean[:] = [-passing, 0.0, 0.0], [-force, 0.0, 0.0]
    kept.axes[:] = [0.0, 0.0, 1.0]
    kept.tool[:] = tool
    here = np.arange(3)
    kept.errors[:] = kept.errors_with(work.beam(standing), here, follows=False)
    told = remedies(work, standing, kept, np.ones(3), tooth_hz, 135.0)
    assert [one.p99 for one in told] == sorted(one.p99 for one in told)
    assert all(
        one.stress == (pytest.approx(40.0) if "neck of" in one.what else 135.0) for one in told if "pin" not in one.what
    )
    assert all(one.stress < 135.0 for one in told if "pin" in one.what)
    return {one.what: one.p99 for one in told}, float(kept.errors[0])


def test_a_thicker_neck_helps_by_the_share_of_the_neck():
    told, before = found(NECK, 1e-6)
    assert before == pytest.approx(5 * AT**3 / (3 * 70000 * np.pi / 4 * RADIUS**4), rel=0.03)
    share = (AT - NECK) ** 3 / AT**3
    thicker = before * (share + (1 - share) / 1.5**4)
    assert told["a neck of 6 mm (holding.diameter)"] == pytest.approx(thicker, rel=0.03)


def test_a_pin_at_the_free_end_is_offered_to_a_part_without_one():
    """A bar of 4 x 50 mm, loaded 5 mm below its pin: the pin, 3 x 12 mm of steel, takes nearly all."""
    told, before = found(NECK, 1e-6, holding=HoldingJob(diameter=2 * RADIUS))
    pinned = told['a pin of 3 mm at the free end (holding.tailstock = "pin")']
    assert 0.01 * before < pinned < 0.1 * before
    assert not any("pin" in what for what in found(NECK, 1e-6)[0])
    left = HoldingJob(diameter=2 * RADIUS, length=NECK, tailstock_x=30.0, tailstock_height=NECK + 1.0)
    forgotten = " and holding.tailstock_x = 0 and holding.tailstock_height = 0)"
    as_new = {what.replace(forgotten, ")"): error for what, error in found(NECK, 1e-6, holding=left)[0].items()}
    assert as_new == pytest.approx(told)
    has_one = HoldingJob(diameter=2 * RADIUS, tailstock="pin", tailstock_reach=100.0)
    assert not any("pin of" in what for what in found(NECK, 1e-6, holding=has_one)[0])


def test_lighter_cuts_help_by_their_share_of_the_force():
    told, before = found(NECK, 1e-3)
    assert told["lighter cuts"] == pytest.approx(0.4**0.7 * before)


def test_what_no_single_change_holds_is_told_with_two():
    assert not any(" with lighter cuts" in what for what in found(NECK, 1e-6, passing=0.05, force=0.05)[0])
    told, _ = found(NECK, 1e-6, passing=5.0, force=400.0)
    clamp = "a chuck or collet 6 mm below the part"
    assert told[f"{clamp} with lighter cuts"] == pytest.approx(0.4**0.7 * told[clamp])


def test_a_clamp_nearer_to_the_part_helps_by_the_third_power_of_what_stands_free():
    told, before = found(NECK, 1e-6)
    assert told["a chuck or collet 6 mm below the part"] == pytest.approx(
        before * ((AT - NECK + 6) / AT) ** 3, rel=0.03
    )
    short, _ = found(5.0, 1e-6)
    assert not any("collet" in what for what in short)


def test_where_the_cutter_bends_most_a_stiffer_one_is_told_first():
    told, before = found(NECK, 1.0)
    best = min(told, key=lambda what: told[what])
    assert best == "at best a stiffer cutter than the one of 1e+03 um/N (overhang, neck_length)"
    assert told[best] == pytest.approx(before - 5, rel=1e-6)


def test_no_neck_as_thick_as_the_stock_is_advised():
    assert any("a neck of" in what for what in found(NECK, 1e-6)[0])
    assert not any("a neck of" in what for what in found(NECK, 1e-6, width=5.9)[0])


def test_a_part_that_a_clamp_makes_stiff_is_asked_while_an_edge_passes():
    """The bar swings at 1,600 Hz, and 6 mm below the part at more than twice as much."""
    told, _ = found(NECK, 1e-6, passing=50.0, tooth_hz=700.0)
    mean, _ = found(NECK, 1e-6, tooth_hz=700.0)
    held = "a chuck or collet 6 mm below the part"
    assert told[held] == pytest.approx(10 * mean[held], rel=1e-6)


def test_only_what_is_between_the_heights_is_made_thicker():
    plain = column_sections(2.0, 0.0, 10.0)
    thick = thickened(plain, 2.0, 5.0, 1.5)
    inside = (plain.low >= 2.0) & (plain.high <= 5.0)
    assert thick.area[inside] == pytest.approx(2.25 * plain.area[inside])
    assert thick.second[inside] == pytest.approx(1.5**4 * plain.second[inside])
    assert (thick.second[~inside] == plain.second[~inside]).all()


def test_without_a_place_the_remedies_are_named_without_figures():
    assert best_text((), 0.05, 125.0).startswith("give a thicker neck")


def test_all_remedies_that_do_are_told_or_the_one_that_helps_most():
    found = (Remedy("a chuck", 0.02, 90.0), Remedy("a neck", 0.04, 40.0), Remedy("a cutter", 0.06, 90.0))
    both = "a chuck would keep 20.0 um at 90 MPa or a neck would keep 40.0 um at 40 MPa"
    assert best_text(found, 0.05, 125.0) == both
    assert best_text(found, 0.01, 125.0) == "a chuck would keep 20.0 um at 90 MPa"
    assert best_text(found, 0.05, 50.0) == "a neck would keep 40.0 um at 40 MPa"
    weak = "a chuck would keep 20.0 um at 90 MPa, shallower levels (levels.roughing_depth) load it less"
    assert best_text(found, 0.05, 30.0) == weak
