"""Even levels: as many as before, the outermost no sliver."""

from collections.abc import Callable
from unittest.mock import Mock

import numpy as np
import pytest

from bonecam.levels import closed_morph, edge_rounding, equal_depths
from bonecam.levels.edge_rounding import BegunLevels, levels_in
from bonecam.levels.equal_depths import even_levels
from bonecam.levels.measure.level import RoundedLevel
from bonecam.setup.capsule import Capsule
from bonecam.setup.schedule import Schedule
from bonecam.setup.stocks.cylinder import Cylinder
from bonecam.surface.tspline import TSpline

SCHEDULE = Schedule((0.2,), 1.0)


def test_the_outermost_cut_is_as_deep_as_the_others_and_there_are_as_many(
    capsule: Capsule, waisted: Callable[..., TSpline]
) -> None:
    plain, even = (
        make(waisted(), capsule, SCHEDULE, chord_tolerance=0.05) for make in (levels_in, even_levels)
    )
    assert plain.levels[-1].depth_max < 0.75
    assert even.cuts == plain.cuts
    assert even.lower_bound == plain.lower_bound
    depths = [level.depth_max for level in even.levels[2:]]
    assert min(depths) > 0.85 * max(depths)
    assert max(depths) < 0.99


def test_a_bar_keeps_its_rounding_levels(waisted: Callable[..., TSpline]) -> None:
    bar = Cylinder(4.5, 0.0, 20.0)
    even = even_levels(waisted(), bar, SCHEDULE, chord_tolerance=0.05)
    assert sum(isinstance(level, RoundedLevel) for level in even.levels) >= 2
    assert np.abs(bar.signed_distance(even.levels[-1].mesh.vertices)).max() < 1e-9


def test_only_the_levels_that_are_kept_are_measured(
    capsule: Capsule, waisted: Callable[..., TSpline], monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = []

    def counted(*given: object, **options: object) -> BegunLevels:
        begun.append(edge_rounding.begin_levels(*given, **options))
        return begun[-1]

    measured = Mock(side_effect=closed_morph.inspect)
    monkeypatch.setattr(equal_depths, "begin_levels", counted)
    monkeypatch.setattr(closed_morph, "inspect", measured)
    even_levels(waisted(), capsule, SCHEDULE, chord_tolerance=0.05)
    assert len(begun) > 1
    assert measured.call_count == 1
