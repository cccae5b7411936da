"""The error that is foretold is the share of an exponential distribution whose mean follows the compliance."""

import numpy as np
import pytest

from bonecam.mechanics.beam import Beam, column_sections
from bonecam.mesh.solids import cylinder
from bonecam.planning.neck import FORCE_SHARE, foretold_errors, normal_compliances

ALUMINIUM = 69000.0
BAR = cylinder(3.0, 0.0, 60.0, 0.01)
BEAM = Beam(column_sections(3.0, 0.0, 60.0), ALUMINIUM)


def test_on_a_rigid_part_the_errors_are_those_of_the_cutter_in_the_shares_of_the_distribution() -> None:
    rigid = Beam(BEAM.sections, 1e15)
    p50, p95, p99 = foretold_errors(rigid, BAR, 0.0012, 10.0, (0.5, 0.95, 0.99))
    assert p95 == pytest.approx(0.0012 * 10.0 * FORCE_SHARE * np.log(20), rel=1e-6)
    assert p99 / p95 == pytest.approx(np.log(100) / np.log(20))
    assert p50 / p95 == pytest.approx(np.log(2) / np.log(20))


def test_the_shares_are_those_of_errors_drawn_at_places_of_the_area() -> None:
    found, areas = normal_compliances(BEAM, BAR)
    random = np.random.default_rng(1)
    places = random.choice(len(areas), 400_000, p=areas / areas.sum())
    drawn = 8.0 * FORCE_SHARE * (found[places] + 0.001) * random.exponential(size=len(places))
    told = foretold_errors(BEAM, BAR, 0.001, 8.0, (0.95, 0.99))
    assert told == pytest.approx(np.quantile(drawn, (0.95, 0.99)), rel=0.02)


def test_a_tip_that_gives_way_counts_more_at_95_percent_than_in_the_mean() -> None:
    found, areas = normal_compliances(BEAM, BAR)
    mean = found @ areas / areas.sum() + 0.001
    assert foretold_errors(BEAM, BAR, 0.001, 8.0, (0.95,))[0] > 1.2 * 8.0 * FORCE_SHARE * np.log(20) * mean
