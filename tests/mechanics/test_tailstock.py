"""How stiffly a tailstock holds the free end, beside formulas of beams and finite ones."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.job import HoldingJob
from bonecam.mechanics.beam import STEEL, Beam, column_sections, tailstock_support
from bonecam.workholding.post import Column

RIGID = HoldingJob(diameter=6.0, tailstock="pin", tailstock_column=200.0, tailstock_arm=200.0, tailstock_reach=120.0)
E = 70000.0


def stiffness(holding: HoldingJob, pin: Column) -> np.ndarray:
    support = tailstock_support(holding, pin, E)
    assert support is not None
    return support.stiffness


def test_a_pin_of_2_by_10_mm_of_steel_gives_495_newtons_a_millimetre() -> None:
    found = stiffness(RIGID, Column(1.0, 60.0, 50.0))
    assert np.diag(found) == pytest.approx([495.0, 495.0, 0.0], rel=0.003)


def test_an_upper_neck_is_of_the_parts_material() -> None:
    pin, neck = (stiffness(replace(RIGID, tailstock=kind), Column(1.0, 60.0, 50.0)) for kind in ("pin", "neck"))
    assert neck[0, 0] / pin[0, 0] == pytest.approx(E / STEEL, rel=0.003)


def test_a_slender_column_gives_way_as_a_cantilever_and_more_across_the_arm() -> None:
    holding = replace(RIGID, tailstock_column=10.0, tailstock_reach=80.0)
    found = stiffness(holding, Column(20.0, 100.0, 99.0))
    second = np.pi / 64 * 10.0**4
    height = 100.0 + holding.tailstock_arm / 2
    along = height**3 / (3 * STEEL * second)
    assert found[0, 0] == pytest.approx(1 / along, rel=1e-3)
    twisted = 80.0**2 * height / (81000.0 * 2 * second)
    assert found[1, 1] == pytest.approx(1 / (along + twisted), rel=1e-3)
    turned = stiffness(replace(holding, tailstock_azimuth_deg=90.0), Column(20.0, 100.0, 99.0))
    assert turned[1, 1] == pytest.approx(found[0, 0])


def test_a_bar_on_a_rigid_tailstock_is_the_propped_cantilever_of_the_books() -> None:
    length, radius = 4000.0, 2.0
    pin = Column(40.0, length + 1.0, length)
    support = tailstock_support(replace(RIGID, tailstock_column=200.0), pin, E)
    assert support is not None
    stiff = replace(support, stiffness=support.stiffness * 1e6)
    beam = Beam(column_sections(radius, 0.0, length), E, support=stiff)
    found = beam.compliance(np.array([[0.0, 0.0, length / 2]]))[0]
    assert found[0, 0] == pytest.approx(7 * length**3 / (768 * E * np.pi / 4 * radius**4), rel=1e-4)


def test_a_tailstock_stiffens_loads_less_and_rings_higher() -> None:
    sections = column_sections(3.0, 0.0, 60.0)
    pin = Column(1.5, 72.0, 60.0)
    holding = HoldingJob(diameter=6.0, tailstock="pin", tailstock_reach=100.0)
    bare = Beam(sections, E)
    held = Beam(sections, E, support=tailstock_support(holding, pin, E))
    middle, force = np.array([[0.0, 0.0, 40.0]]), np.array([[10.0, 0.0, 0.0]])
    assert held.compliance(middle)[0, 0, 0] < 0.3 * bare.compliance(middle)[0, 0, 0]
    assert held.moment_stress(force, middle)[0] < 0.6 * bare.moment_stress(force, middle)[0]
    assert held.first_frequency(2700.0) > 2 * bare.first_frequency(2700.0)


def test_without_a_pin_nothing_holds_the_free_end() -> None:
    assert tailstock_support(HoldingJob(), None, E) is None
