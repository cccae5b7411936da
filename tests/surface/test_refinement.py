"""Refinement leaves rows what they are: closed and open, rational, with knots apart by rounding."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tsplines import assert_unchanged_by_refinement, bone_like, open_rows, own_surfaces, rows_apart_by_rounding

from bonecam.surface import OpenRowTMesh

seeds = st.integers(0, 10_000)


@settings(max_examples=10)
@given(seeds, st.integers(6, 12), st.integers(4, 9), st.sampled_from(["s", "t", "st"]), st.booleans())
def test_rows_stay_what_they_are(seed, rows, around, directions, poles):
    surface = bone_like(rows, around, seed, poles=poles)
    s, t = np.random.default_rng(seed).random((2, 3))
    finer = surface.refine(s, t, directions)
    assert type(finer.tmesh) is type(surface.tmesh)
    assert finer.tmesh.size > surface.tmesh.size
    s, t = np.random.default_rng(seed + 1).random((2, 500))
    np.testing.assert_allclose(finer.evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 28)


def test_a_wrong_call_is_refused():
    surface = open_rows(1)
    with pytest.raises(ValueError, match="directions"):
        surface.refine(np.zeros(1), np.zeros(1), "x")
    with pytest.raises(ValueError, match="s must be in"):
        surface.refine(np.array([-1.0]), np.zeros(1))


@settings(max_examples=10)
@given(seeds, st.sampled_from(["s", "t", "st"]))
def test_open_rows_stay_what_they_are(seed, directions):
    surface = open_rows(seed)
    finer = surface.refine(*np.random.default_rng(seed).random((2, 3)), directions)
    assert isinstance(finer.tmesh, OpenRowTMesh)
    assert finer.tmesh.size > surface.tmesh.size
    s, t = np.concatenate([np.random.default_rng(seed + 1).random((2, 500)), [[0, 1, 0.5], [1, 1, 0]]], axis=1)
    np.testing.assert_allclose(finer.evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 5)


def test_knots_of_rows_that_differ_by_rounding_are_one():
    surface = rows_apart_by_rounding()
    s, t = np.random.default_rng(1).random((2, 500))
    finer = surface.refine(s[:3], t[:3], "t").refine(s[:2], t[:2])
    np.testing.assert_allclose(finer.evaluate(s, t), surface.evaluate(s, t), atol=1e-13 * 28)


def test_every_surface_made_here_is_refined_without_change():
    for name, surface in own_surfaces().items():
        assert_unchanged_by_refinement(name, surface, lambda finer: finer.tmesh.size)
