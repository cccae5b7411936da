"""The banded normal equations against dense ones."""

import numpy as np
import pytest
import scipy.sparse as sp

from bonecam.surface.fitting import Form, Term


def random_term(seed: int, size: int, width: int) -> Term:
    rng = np.random.default_rng(seed)
    first = rng.integers(0, size - width, 400)
    dense = np.zeros((400, size))
    dense[np.arange(400)[:, None], first[:, None] + np.arange(width + 1)] = rng.normal(size=(400, width + 1))
    half = rng.normal(size=(400, 3, 3))
    return Term(sp.csr_array(dense), half @ half.transpose(0, 2, 1), rng.normal(size=(400, 3)))


@pytest.mark.parametrize("widths", [(5, 5), (7, 3)])
def test_the_gradient_vanishes_at_the_least(widths: tuple[int, int]) -> None:
    one, two = (random_term(seed, 30, width) for seed, width in enumerate(widths))
    found = Form.of([one], 30).plus([two]).least()
    gradient = sum(
        term.matrix.T @ np.einsum("mab,mb->ma", term.metric, term.matrix @ found - term.targets) for term in (one, two)
    )
    assert np.abs(gradient).max() < 1e-9


def test_a_form_that_leaves_a_control_point_free_is_refused() -> None:
    term = random_term(1, 10, 3)
    with pytest.raises(np.linalg.LinAlgError):
        Form.of([term], 12).least()
