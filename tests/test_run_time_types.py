"""What is wrong in type or shape is found while tests run, at any call of a checked function."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray
from run_time_types import checked

from bonecam.arrays import unit
from bonecam.mesh import vertex_normals

Points = Float[ndarray, "n 3"]


@checked
def sums(points: Points, factors: Float[ndarray, " n"], wrong: bool = False) -> Float[ndarray, " n"]:
    return (points.sum(axis=1) * factors)[int(wrong) :]


@checked
def rows(points: Points) -> Iterator[ndarray]:
    yield from points


@checked
@dataclass(frozen=True)
class Cloud:
    points: Points
    names: list[str] = field(default_factory=list)

    @checked
    def joined(self, other: "Cloud") -> "Cloud":
        return Cloud(np.vstack([self.points, other.points]))


POINTS, ONES = np.zeros((4, 3)), np.ones(4)


@pytest.mark.parametrize(
    "call",
    [
        lambda: sums(POINTS, np.ones(5)),
        lambda: sums(POINTS, factors=ONES.astype(int)),
        lambda: sums(POINTS[:, :2], ONES),
        lambda: sums(POINTS, ONES, "no"),
        lambda: sums(POINTS, ONES, wrong=True),
        lambda: sums(POINTS),
        lambda: rows(ONES),
        lambda: Cloud(ONES),
        lambda: Cloud(POINTS, names="abc"),
        lambda: vertex_normals(POINTS, "faces"),  # type: ignore[call-arg]
    ],
    ids=range(10),
)
def test_what_does_not_fit_is_refused_at_the_first_call_and_at_later_ones(call: Any) -> None:
    for _ in range(2):
        with pytest.raises(TypeError):
            call()
        assert len(sums(POINTS, ONES)) == len(list(rows(POINTS))) == len(Cloud(POINTS).points)


@checked
def scaled(names: list[str], *points: Points, **factors: float) -> Float[ndarray, "m 3"]:
    return np.vstack(points) * sum(factors.values()) if names else np.vstack(points)[:, 0]


@checked
def chosen(side: Literal["left"]) -> str:
    return side


def test_results_of_another_kind_and_contents_are_looked_at_after_calls_that_fit() -> None:
    for _ in range(2):
        assert len(scaled(["a"], POINTS, POINTS, by=2.0)) == 8
        for call in (lambda: scaled([], POINTS, by=2.0), lambda: scaled([1], POINTS, by=2.0)):  # type: ignore[list-item]
            with pytest.raises(TypeError):
                call()
        with pytest.raises(TypeError):
            scaled(["a"], POINTS, by="2")  # type: ignore[arg-type]
        with pytest.raises(TypeError):
            chosen("right")  # type: ignore[arg-type]
        assert chosen("left") == "left"


def test_sizes_are_those_of_one_call() -> None:
    assert [len(sums(np.zeros((n, 3)), np.ones(n))) for n in (1, 7)] == [1, 7]
    assert len(Cloud(POINTS).joined(Cloud(POINTS)).points) == 8


def test_the_stages_are_checked() -> None:
    """By the decorator of this folder, which the hook puts before each of their functions."""
    assert vertex_normals.__code__.co_name == "call"
    assert unit.__code__.co_name == "unit", "what is called by all has no checks"


def test_functions_of_one_piece_of_code_are_each_called_and_checked() -> None:
    def scaling(factor: Any) -> Any:
        @checked
        def scaled(points: Points) -> Points:
            return points * factor

        return scaled

    twice, thrice, crossed = scaling(2), scaling(3), scaling(np.ones((2, 1, 3)))
    for _ in range(2):
        assert twice(POINTS + 1).max() == 2
        assert thrice(POINTS + 1).max() == 3
        for wrong in (lambda: thrice(ONES), lambda: crossed(POINTS), lambda: crossed(POINTS[:2])):
            with pytest.raises(TypeError):
                wrong()


def test_dataclasses_with_fields_of_the_same_names_are_checked_by_their_own_types() -> None:
    @checked
    @dataclass(frozen=True)
    class Counted:
        value: int

    @checked
    @dataclass(frozen=True)
    class Named:
        value: str

    for _ in range(2):
        assert Counted(1).value == 1
        assert Named("one").value == "one"
        with pytest.raises(TypeError):
            Named(1)  # type: ignore[arg-type]
