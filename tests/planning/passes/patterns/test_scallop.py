"""Side step and scallop against plain circle and line sections."""

import numpy as np
import pytest

from bonecam.errors import ToolPathError
from bonecam.planning.spacing import FLAT, side_step

CASES = [
    (R, h, k)
    for R in (0.5, 1.0, 2.0, 3.0)
    for h in (0.005, 0.01, 0.05, 0.1)
    for k in (-0.9 / R, -0.2 / R, -1e-9, 0.0, 1e-7, 0.05, 0.4)
]


def scallop_of_step(radius: float, step: np.ndarray, curvature: np.ndarray) -> np.ndarray:
    """Height of the cusp (mm) that contacts `step` apart along the section leave.

    The cusp lies on both balls: with a = theta/2 and rho = 1/kappa, rho + h = (rho + R) cos a - sqrt(R^2 -
    (rho + R)^2 sin^2 a). NaN where neighbouring balls do not meet.
    """
    angle = curvature * step / 2
    across = np.where(np.abs(angle) < FLAT, step / 2, np.sin(angle) / np.where(curvature == 0, 1, curvature))
    fall = np.where(
        np.abs(angle) < FLAT,
        curvature * step**2 / 8,
        2 * np.sin(angle / 2) ** 2 / np.where(curvature == 0, 1, curvature),
    )
    with np.errstate(invalid="ignore"):
        depth = radius - np.sqrt(radius**2 - (across * (1 + curvature * radius)) ** 2)
    return depth - fall * (1 + curvature * radius)


def cusp_by_geometry(radius: float, step: float, curvature: float) -> float:
    """Height of the intersection of two neighbouring balls above the section, from coordinates alone."""
    if curvature == 0:
        return radius - np.sqrt(radius**2 - (step / 2) ** 2)
    rho = 1 / curvature
    angle = step / rho
    centre = (rho + radius) * np.array([np.sin(angle / 2), np.cos(angle / 2)])
    heights = np.linspace(-0.01 * radius, 0.5 * radius, 2_000_001)
    return float(heights[np.argmax(np.hypot(centre[0], centre[1] - (rho + heights)) <= radius)])


@pytest.mark.parametrize(("radius", "scallop", "curvature"), CASES)
def test_scallop_of_the_step_is_the_scallop(radius: float, scallop: float, curvature: float) -> None:
    step = side_step(radius, scallop, np.array([curvature]))
    assert scallop_of_step(radius, step, np.array([curvature])) == pytest.approx(scallop, rel=1e-6)


@pytest.mark.parametrize(
    ("radius", "scallop", "curvature"), [(1.0, 0.01, 0.0), (1.0, 0.01, 0.25), (2.0, 0.05, -0.3), (3.0, 0.1, 0.1)]
)
def test_two_balls_a_side_step_apart_leave_exactly_the_scallop(radius: float, scallop: float, curvature: float) -> None:
    step = float(side_step(radius, scallop, np.array([curvature]))[0])
    assert cusp_by_geometry(radius, step, curvature) == pytest.approx(scallop, abs=2e-6 * radius)


def test_textbook_step_exceeds_the_scallop() -> None:
    step = np.array([np.sqrt(8 * 0.1 * 3 / (1 + 0.1 * 3))])
    assert scallop_of_step(3.0, step, np.array([0.1]))[0] > 0.101


def test_a_section_sharper_than_the_ball_is_refused() -> None:
    with pytest.raises(ToolPathError, match="gouges") as caught:
        side_step(1.0, 0.01, np.array([0.2, -1.0]))
    assert caught.value.evidence["index"] == 1


def test_scallop_outside_the_ball_is_a_wrong_call() -> None:
    with pytest.raises(ValueError, match="scallop"):
        side_step(1.0, 0.0, np.zeros(1))
