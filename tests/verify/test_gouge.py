import numpy as np
import pytest
from controls import PAIRS
from small_parts import PATH_CAPSULE, capsule_path, path_of

from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.nc import read_program, write_program
from bonecam.verify.gouge import SLACK, measure_gouge


class ExactCapsule:
    """The signed distance to an upright capsule about Z by its formula."""

    def __init__(self, bottom: float, top: float, radius: float) -> None:
        self.bottom, self.top, self.radius = bottom, top, radius

    def signed(self, points, wanted):
        z = np.clip(points[:, 2], self.bottom, self.top)
        return np.hypot(np.hypot(points[:, 0], points[:, 1]), points[:, 2] - z) - self.radius


PART = ExactCapsule(*PATH_CAPSULE)


@pytest.fixture(params=["heidenhain", "linuxcnc"])
def pair(request):
    return PAIRS[request.param]


def motions_of(paths, pair):
    return read_program(write_program(paths, *pair, Job()).text, *pair)


def densely(part: ExactCapsule, motions, count=400) -> float:
    """The deepest gouge by brute force: every move at `count` places."""
    deepest = -np.inf
    for number, control in motions.controls.items():
        moves = np.flatnonzero((motions.tools == number) & motions.known_start)
        for fraction in np.linspace(0, 1, count):
            tips, axes = control.between(motions.words[moves - 1], motions.words[moves], fraction)
            deepest = max(deepest, float((control.radius - part.signed(tips + control.radius * axes, 0.0)).max()))
    return deepest


@pytest.mark.parametrize("count", [900, 120, 40])
def test_the_gouge_found_is_the_deepest_there_is(pair, count):
    motions = motions_of([capsule_path(count=count, turns=4.0)], pair)
    found, truth = measure_gouge(motions, PART), densely(PART, motions)
    assert found.depth <= truth + 1e-6
    assert truth <= found.depth + SLACK
    assert truth <= found.bound + 1e-9


def test_a_chord_through_a_bulge_is_found_between_its_ends(pair):
    # ends clear by 0.3 mm, the straight way between them cuts 0.2 mm into the capsule
    reach = PATH_CAPSULE[2] + 1.0
    half = np.sqrt((reach + 0.3) ** 2 - (reach - 0.2) ** 2)
    tips = np.array(
        [
            [reach - 0.2, -half - 5, 55.0],
            [reach - 0.2, -half, 55.0],
            [reach - 0.2, half, 55.0],
            [reach - 0.2, half + 5, 55.0],
        ]
    )
    tips[:, 2] -= 1.0
    motions = motions_of([path_of(tips, np.tile([0, 0, 1.0], (4, 1)))], pair)
    found = measure_gouge(motions, PART)
    assert found.depth == pytest.approx(0.2, abs=SLACK)
    assert abs(found.place[1]) < 0.3


def test_a_turn_on_the_spot_that_swings_the_ball_into_the_part_is_found():
    # the tip rests beside the capsule while the axis leans over: only the ball's centre moves
    tips = np.array([[6.1, 0, 55.0], [6.1, 0, 54.0], [6.1, 0, 54.0], [12.0, 0, 54.0]])
    lean = np.radians(-60)
    axes = np.array([[0, 0, 1.0], [0, 0, 1.0], [np.sin(lean), 0, np.cos(lean)], [np.sin(lean), 0, np.cos(lean)]])
    pair = PAIRS["heidenhain"]
    motions = motions_of([path_of(tips, axes)], pair)
    assert measure_gouge(motions, PART).depth == pytest.approx(1 - (6.1 - np.sin(np.radians(60)) - 5), abs=0.002)


def test_a_ball_within_the_part_is_a_gouge_of_more_than_its_radius(pair):
    tips = np.array([[30.0, 0, 90.0], [0, 0, 90.0], [0, 0, 55.0], [0, 0, 90.0]])
    found = measure_gouge(motions_of([path_of(tips, np.tile([0, 0, 1.0], (4, 1)))], pair), PART)
    assert found.depth > 1.0 + 4.0


def test_a_program_far_from_the_part_is_clear(pair):
    tips = np.array([[30.0, 0, 60.0], [30.0, 20, 60.0], [30.0, 20, 90.0]])
    found = measure_gouge(motions_of([path_of(tips, np.tile([0, 0, 1.0], (3, 1)))], pair), PART)
    assert found.depth < -20
    assert found.samples < 200


def test_lifting_the_path_by_a_hair_lowers_the_gouge_by_it(pair):
    depths = [
        measure_gouge(motions_of([capsule_path(count=900, offset=lift)], pair), PART).depth
        for lift in (0.0, -0.05, -0.2)
    ]
    assert np.allclose(np.diff(depths), [0.05, 0.15], atol=0.002)


def test_an_empty_program_proves_nothing(pair):
    motions = motions_of([capsule_path(count=30)], pair)
    empty = type(motions)(**{n: v[:0] if isinstance(v, np.ndarray) else v for n, v in vars(motions).items()})
    with pytest.raises(VerifyError, match="moves nothing"):
        measure_gouge(empty, PART)
