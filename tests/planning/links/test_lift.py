"""Lifts within a path for rewinds: there and back without collision, and nothing else changes."""

from collections.abc import Callable

import numpy as np
import pytest

from bonecam.arrays import angles_between, unit
from bonecam.errors import MachineError
from bonecam.job import NcJob, PathJob
from bonecam.machine.limits import LiftPlaces, MachineLimits
from bonecam.mesh.distance import MeshDistance
from bonecam.planning import links
from bonecam.planning.oriented_path import orient
from bonecam.planning.scene import Scene
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import ContactPath, MoveKind, ToolPath
from bonecam.workholding.clamping import Clamping

Made = tuple[ToolPath, Scene, Callable[[LiftPlaces], ToolPath]]


@pytest.fixture(scope="module")
def made(lump: Callable[..., tuple[TSpline, ContactPath, Scene]], roughing_cutter: Cutter) -> Made:
    """A path over a lump, its scene, and what makes it anew with lifts."""
    job = PathJob(pattern="round")
    _, contacts, scene = lump(job, Clamping(), roughing_cutter, 0.8)

    def oriented(rows: LiftPlaces | None) -> ToolPath:
        return orient(contacts, scene, MachineLimits(np.radians(115.0), lift_places=rows), job, NcJob())

    return oriented(None), scene, oriented


def at(axes: np.ndarray, *rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows as places to lift the path from."""
    places = np.array(rows, dtype=np.float64)
    return places, axes[places.astype(np.int64)]


def cuts_in_a_row(path: ToolPath) -> np.ndarray:
    """Rows that cut, between rows that cut."""
    cut = path.kinds == MoveKind.CUT
    return np.flatnonzero(cut & np.r_[False, cut[:-1]] & np.r_[cut[1:], False])


def test_between_two_cuts_the_tool_comes_back_to_the_contact_that_it_left(made: Made) -> None:
    path, scene, oriented = made
    row = int(cuts_in_a_row(path)[40])
    lifted = oriented(lambda axes, kinds, blocked: at(axes, row - 1))
    ((first, last),) = lifted.lifts
    assert first == row
    away = slice(first, last + 1)
    assert (lifted.kinds[away] != MoveKind.CUT).all()
    assert np.isnan(lifted.contacts[away]).all()
    safe = path.tips[0]
    assert np.linalg.norm(lifted.tips[away] - safe, axis=1).min() < 1e-9
    again = last + 1
    for array in (lifted.tips, lifted.axes, lifted.contacts):
        assert np.array_equal(array[again], array[row - 1])
    assert lifted.feed_rates[again] == NcJob().plunge_feed
    assert lifted.feed_rates[again + 1] == path.feed_rates[row]
    kept = np.r_[0:first, again + 1 : len(lifted.tips)]
    assert np.array_equal(lifted.tips[kept], path.tips)
    assert np.array_equal(lifted.kinds[kept], path.kinds)
    later = path.pass_index[row:] >= 0
    assert np.array_equal(lifted.pass_index[kept][row:][later], path.pass_index[row:][later] + 1)
    material = MeshDistance(scene.material)
    rapid = lifted.kinds[away] == MoveKind.RAPID
    clear = material.signed(lifted.balls[away][rapid]) - path.cutter.radius
    assert clear.min() >= PathJob().clearance
    assert angles_between(lifted.axes[away], np.tile([0.0, 0, 1], (last + 1 - first, 1))).min() < 1e-9


def test_from_a_link_the_tool_comes_back_to_where_the_link_leads(made: Made) -> None:
    path, _, oriented = made
    cut = path.kinds == MoveKind.CUT
    row = int(np.flatnonzero((path.kinds == MoveKind.LINK) & np.r_[False, cut[:-1]])[1])
    lifted = oriented(lambda axes, kinds, blocked: at(axes, row - 1))
    ((first, last),) = lifted.lifts
    assert first == row
    kept = np.r_[0:first, last + 1 : len(lifted.tips)]
    assert np.array_equal(lifted.tips[kept], path.tips)
    assert np.array_equal(lifted.feed_rates[kept], path.feed_rates)
    assert np.array_equal(lifted.pass_index[kept], path.pass_index)


def test_several_lifts_keep_their_places(made: Made) -> None:
    path, _, oriented = made
    rows = cuts_in_a_row(path)[[10, 11, 60]]
    lifted = oriented(lambda axes, kinds, blocked: at(axes, *(rows - 1)))
    assert len(lifted.lifts) == 3
    assert (lifted.kinds == MoveKind.CUT).sum() == (path.kinds == MoveKind.CUT).sum() + 3
    before = lifted.tips[lifted.lifts[:, 0] - 1]
    assert np.array_equal(before, path.tips[rows - 1])
    assert np.array_equal(lifted.tips[lifted.lifts[:, 1] + 1], before)


def test_a_place_that_cannot_be_left_is_not_asked_for_again(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    path, _, oriented = made
    blocked, free = cuts_in_a_row(path)[[20, 30]].tolist()

    class Blocked(links.Transfers):
        """Transfers, but no lifts from one pose."""

        def find(self, pairs):  # type: ignore[no-untyped-def]
            lifts = self.traverses is links.LIFT_TRAVERSES
            ways = zip(pairs, super().find(pairs), strict=True)
            return [None if lifts and blocked - 1 in pair else way for pair, way in ways]

    monkeypatch.setattr(links, "Transfers", Blocked)

    def places(axes: np.ndarray, kinds: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return at(axes, free - 1 if blocked - 1 in left else blocked - 1)

    assert oriented(places).lifts[0, 0] == free

    def never(axes: np.ndarray, kinds: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if blocked - 1 in left:
            raise MachineError("point 7: no way", row=7)
        return at(axes, blocked - 1)

    with pytest.raises(MachineError, match=f"level {path.level}, point 7: no way") as caught:
        oriented(never)
    assert caught.value.evidence["row"] == 7


def test_between_two_rows_the_path_has_a_point_where_it_is_lifted(made: Made) -> None:
    path, _, oriented = made
    row = int(cuts_in_a_row(path)[50])
    axis = unit(path.axes[[row - 1]] + path.axes[[row]])
    lifted = oriented(lambda axes, kinds, blocked: (np.array([row - 0.5]), axis))
    ((first, last),) = lifted.lifts
    for point in (first - 1, last + 1):
        assert np.allclose(lifted.balls[point], path.balls[row - 1 : row + 1].mean(axis=0))
        assert np.array_equal(lifted.axes[point], axis[0])
        assert lifted.kinds[point] == MoveKind.CUT
    kept = np.r_[0 : first - 1, last + 2 : len(lifted.tips)]
    assert np.array_equal(lifted.tips[kept], path.tips)
    assert lifted.feed_rates[first - 1] == path.feed_rates[row]


def test_a_path_within_the_limits_stays_as_it_is(made: Made) -> None:
    path, _, oriented = made
    same = oriented(lambda axes, kinds, blocked: at(axes))
    assert np.array_equal(same.tips, path.tips)
    assert not len(same.lifts)
