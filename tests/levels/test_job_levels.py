"""Where the surface of the usual rows is refused, or has no levels, the fit starts again."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from level_parts import CAPSULE, waisted

from bonecam.errors import LevelError, SurfaceError
from bonecam.job import Job
from bonecam.levels import Morph, RoundedLevel, closed_morph, job_levels, levels_in, surface_and_levels
from bonecam.levels.job_levels import even_levels, fit_choices
from bonecam.mesh import Rows, prepare_part
from bonecam.mesh.rows import MOST_CHOICES
from bonecam.runtime.timing import StageTimes
from bonecam.setup import Capsule, Cylinder, Schedule, place
from bonecam.surface import Fit
from bonecam.surface.part_surface import fit_surface

pytestmark = pytest.mark.whole

JOB = Job().with_values(holding={"diameter": 2.0, "length": 60.0}, mesh={"rows": 8}, surface={"tolerance": 0.08})


@pytest.fixture(scope="module")
def setup():
    mesh = Capsule(np.array([0.0, 0, 3]), np.array([0.0, 0, 9]), 3.0).mesh(0.05)
    return place(prepare_part(mesh, JOB.mesh), JOB)


@pytest.mark.parametrize(("fails", "error"), [("fit_surface", SurfaceError), ("make_levels", LevelError)])
def test_other_rows_are_tried_where_the_first_fail(setup, monkeypatch, fails, error):
    used: list[Rows] = []
    fits = [object.__new__(Fit), object.__new__(Fit)]
    morph = object.__new__(Morph)
    for fit in fits:
        object.__setattr__(fit, "surface", None)

    def fitted(part, job, progress, given, rows, tolerance):
        used.append(rows)
        return fits[len(used) - 1]

    def failing_first(*given):
        result = fitted(*given) if fails == "fit_surface" else morph
        if len(used) < 2:
            raise error("folds")
        return result

    monkeypatch.setattr(job_levels, "fit_surface", fitted)
    monkeypatch.setattr(job_levels, "make_levels", lambda *_, **__: morph)
    monkeypatch.setattr(job_levels, "smoother_fit", lambda *given: None)
    monkeypatch.setattr(job_levels, fails, failing_first)
    told: list[str] = []
    found, levels = surface_and_levels(setup, JOB, StageTimes(), lambda fraction, message: told.append(message))
    assert found is fits[1]
    assert levels is morph
    assert not np.allclose(used[0].points, used[1].points)
    assert "folds; the fit starts again" in told


@pytest.mark.parametrize("smooth_enough", [True, False])
def test_sharp_bends_are_smoothed_before_other_rows_are_tried(setup, monkeypatch, smooth_enough):
    morph = object.__new__(Morph)
    fits: dict[str, Fit] = {}
    for name in ("sharp", "smooth", "other"):
        fits[name] = object.__new__(Fit)
        object.__setattr__(fits[name], "surface", name)
    rows = iter(["sharp", "other"])
    tried: list[str] = []

    def levels_of(surface, *given):
        tried.append(surface)
        if surface == "sharp" or (surface == "smooth" and not smooth_enough):
            raise LevelError(f"{surface} folds")
        return morph

    monkeypatch.setattr(job_levels, "fit_surface", lambda *given: fits[next(rows)])
    monkeypatch.setattr(job_levels, "smoother_fit", lambda found, *given: fits["smooth"])
    monkeypatch.setattr(job_levels, "make_levels", levels_of)
    told: list[str] = []
    found, _ = surface_and_levels(setup, JOB, StageTimes(), lambda fraction, message: told.append(message))
    assert found is fits["smooth" if smooth_enough else "other"]
    assert tried == (["sharp", "smooth"] if smooth_enough else ["sharp", "smooth", "other"])
    assert "sharp folds; sharp bends are smoothed" in told


def test_the_first_failure_is_told_where_all_rows_fail(setup, monkeypatch):
    tries: list[int] = []

    def failing(*given):
        tries.append(1)
        raise SurfaceError(f"try {len(tries)}")

    monkeypatch.setattr(job_levels, "fit_surface", failing)
    with pytest.raises(SurfaceError, match=r"^try 1$"):
        surface_and_levels(setup, JOB, StageTimes())
    assert len(tries) == MOST_CHOICES + 1


def test_a_fit_that_fails_starts_again_within_the_widest_tolerance_and_last_with_fewer_points(setup):
    found = JOB.with_values(surface={"tolerance": 0.0})
    part = replace(setup.part, coarseness=replace(setup.part.coarseness, sagitta=0.02))
    choices = list(fit_choices(part, found))
    assert [tolerance for _, tolerance in choices] == [0.04, 0.08, 0.08, 0.08, 0.16]
    usual, wider, *others, last = [rows for rows, _ in choices]
    assert usual is wider is last
    assert all(rows is not usual for rows in others)
    stated = [tolerance for _, tolerance in fit_choices(part, JOB.with_values(surface={"tolerance": 0.03}))]
    assert stated == [0.03, 0.03, 0.03, 0.06]
    wide = JOB.with_values(surface={"tolerance": 0.4, "largest_deviation": 0.5})
    assert [tolerance for _, tolerance in fit_choices(part, wide)] == [0.4, 0.4, 0.4, 0.5]


def test_a_fit_within_a_wider_tolerance_is_judged_by_that_of_the_job(setup):
    fitted = fit_surface(setup.part, JOB.with_values(surface={"tolerance": 0.001}), tolerance=0.3)
    assert 0.001 < fitted.deviation.max < 0.3
    assert fitted.tolerance == 0.001
    assert not fitted.reached


SCHEDULE = Schedule((0.2,), 1.0)


def test_the_outermost_cut_is_as_deep_as_the_others_and_there_are_as_many():
    plain, even = (make(waisted(), CAPSULE, SCHEDULE, chord_tolerance=0.05) for make in (levels_in, even_levels))
    assert plain.levels[-1].depth_max < 0.75
    assert even.cuts == plain.cuts
    assert even.lower_bound == plain.lower_bound
    depths = [level.depth_max for level in even.levels[2:]]
    assert min(depths) > 0.85 * max(depths)
    assert max(depths) < 0.99


def test_a_bar_keeps_its_rounding_levels():
    bar = Cylinder(4.5, 0.0, 20.0)
    even = even_levels(waisted(), bar, SCHEDULE, chord_tolerance=0.05)
    assert sum(isinstance(level, RoundedLevel) for level in even.levels) >= 2
    assert np.abs(bar.signed_distance(even.levels[-1].mesh.vertices)).max() < 1e-9


def test_only_the_levels_that_are_kept_are_measured(monkeypatch):
    begun = []
    begin_levels = job_levels.begin_levels

    def counted(*given, **options):
        begun.append(begin_levels(*given, **options))
        return begun[-1]

    measured = Mock(side_effect=closed_morph.inspect)
    monkeypatch.setattr(job_levels, "begin_levels", counted)
    monkeypatch.setattr(closed_morph, "inspect", measured)
    even_levels(waisted(), CAPSULE, SCHEDULE, chord_tolerance=0.05)
    assert len(begun) > 1
    assert measured.call_count == 1
