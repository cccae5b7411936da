"""The loop of all sequences ends below the stock, and where it does not get there with the level and the place."""

from dataclasses import dataclass

import numpy as np
import pytest

from bonecam.errors import LevelError
from bonecam.levels.sequences import Stop, levels_to_stock
from bonecam.progress import silent
from bonecam.setup.stock import Schedule

SCHEDULE = Schedule((0.1, 0.1), 0.5)
STOP = Stop("mend it", max_stalled=2, most=20)


@dataclass(frozen=True)
class Rest:
    """A level is a height here, below a stock 2 mm high."""

    left: float
    place: np.ndarray


def rest_above(level: float, k: int = 0, before: Rest | None = None) -> Rest:
    return Rest(2.0 - level, np.array([0.0, 0.0, level]))


def climb(share: float, stop: Stop = STOP, least: int = 0) -> list[float]:
    """Heights of levels that use this share of their depth."""
    return levels_to_stock(
        [0.0],
        rest_above(0.0),
        SCHEDULE,
        lambda height, k, rest: height + min(share * SCHEDULE.limit(k), rest.left),
        rest_above,
        stop,
        silent,
        lower_bound=6,
        least=least,
    )


def test_levels_are_made_until_less_than_one_depth_is_left() -> None:
    assert climb(1.0) == pytest.approx([0.0, 0.1, 0.2, 0.7, 1.2, 1.7])
    assert len(climb(0.5)) > 6


def test_more_levels_are_made_where_so_many_are_asked_for() -> None:
    assert len(climb(1.0, least=7)) == 7


def test_levels_that_stall_in_turn_are_an_error_with_level_and_place() -> None:
    with pytest.raises(
        LevelError, match=r"^level 3 gets no nearer to the stock than 1\.930 mm at \(.*\): mend it$"
    ) as error:
        climb(0.1)
    assert error.value.evidence["level"] == 3
    assert error.value.evidence["place"][2] == pytest.approx(0.07)


def test_more_levels_than_allowed_are_an_error() -> None:
    with pytest.raises(LevelError, match=r"^level 4 gets no nearer"):
        climb(0.5, Stop("mend it", most=4))


@pytest.mark.parametrize("evidence", [{}, {"level": 1}])
def test_the_error_of_a_level_that_cannot_be_made_has_its_number(evidence: dict[str, int]) -> None:
    def fail(height: float, k: int, rest: Rest) -> float:
        raise LevelError("no answer", **evidence)

    with pytest.raises(LevelError, match="no answer") as error:
        levels_to_stock([0.0], rest_above(0.0), SCHEDULE, fail, rest_above, STOP, silent, lower_bound=6)
    assert error.value.evidence["level"] == 1
    assert str(error.value).startswith("level 1: ") == (not evidence)
