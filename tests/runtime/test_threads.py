"""Work in pieces: all of it, in order, and one empty piece of nothing; matrices on one thread."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from bonecam.runtime.threads import cores, in_pieces, on_one_blas_thread


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 100])
def test_pieces_hold_everything_in_order(count):
    items = np.arange(count)
    pieces = in_pieces(lambda some: items[some], count, 8)
    assert len(pieces) == max(1, -(-count // 8))
    assert np.array_equal(np.concatenate(pieces), items)


def test_what_a_piece_raises_comes_out():
    def work(some):
        if some.start == 8:
            raise ValueError("the second")
        return some.start

    with pytest.raises(ValueError, match="the second"):
        in_pieces(work, 24, 8)
    assert cores() >= 1


def test_matrices_are_worked_on_by_one_thread():
    def threads():
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    before = threads()
    assert on_one_blas_thread(threads)() == {1}
    assert threads() == before
