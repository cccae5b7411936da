"""Refusals help: their remedies, followed to the letter one after the other, lead from a job that is wrong in many ways
to a program."""

import re
from typing import Any

import numpy as np
import pytest
from small_job import SMALL_CAPSULE

import bonecam
from bonecam.errors import BonecamError, JobError

pytestmark = pytest.mark.whole

FAULTS: dict[str, dict[str, Any]] = {
    "mesh": {"smooth_within": 0.05},
    "surface": {"tolerance": 0.05},
    "stock": {"diameter": 4.0, "length": 11.0},
    "holding": {"diameter": 2.0, "length": 60.0, "parting": True, "parting_core": 5.0},
    "mechanics": {"refuse": False},
    "levels": {
        "roughing_depth": 1.9,
        "finishing_levels": 1,
        "finishing_depth": 0.9,
        "chord_tolerance": 0.05,
        "most_cuts": 1,
    },
    "path": {"max_tilt_deg": 40.0},
    "roughing": {"scallop": 0.3, "flute_length": 1.5, "spindle": 90000.0},
    "finishing": {"scallop": 0.1, "feed": 29999.0},
}
"""A job for a capsule of 5 x 10 mm of coarse facets; all but tolerances, scallops, post and tilt is wrong. What bends
is told, not refused: its remedies are judged in tests/mechanics."""
NUMBER = r"(\d+(?:\.\d+)?)"
NAMED = re.compile(rf"([a-z]+)\.([a-z_]+) (?:\([^)]*\) )?(?:at least|to) {NUMBER}")
FIELD = re.compile(r"^\[(\w+)\] (\w+) = ")
BOUND = re.compile(rf"(?:give (?:at least|more than|at most|less than) [^;]*\(|sinks |turns at |makes |takes ){NUMBER}")
RISE = ("at least", "more than", "or more", "allow more")


def remedied(message: str) -> dict[str, dict[str, float]]:
    """The values that a refusal asks for, by section: those named with a field, or the bound of the field refused; a
    bound that is left out itself is passed by a hundredth."""
    named = NAMED.findall(message)
    if named:
        return {section: {n: float(v) for s, n, v in named if s == section} for section, _, _ in named}
    field, bound = FIELD.search(message), BOUND.search(message)
    assert field, f"no field to change: {message}"
    assert bound, f"no value to give: {message}"
    share = 1.01 if any(word in message for word in RISE) else 0.99
    value = float(bound[1]) * share
    return {field[1]: {field[2]: np.ceil(value) if field[2] == "most_cuts" else value}}


@pytest.fixture(scope="module")
def coarse():
    return SMALL_CAPSULE.mesh(0.3)


def test_remedies_followed_to_the_letter_lead_to_a_program(coarse):
    wanted = {section: dict(values) for section, values in FAULTS.items()}
    changed: list[str] = []
    result = None
    while result is None and len(changed) < 20:
        try:
            result = bonecam.convert(coarse, bonecam.Job().with_values(**wanted))
        except BonecamError as error:
            for section, values in remedied(str(error)).items():
                for name, value in values.items():
                    changed.append(f"{section}.{name} = {value}")
                    wanted.setdefault(section, {})[name] = int(value) if name == "most_cuts" else float(value)
    assert result is not None, changed
    assert result.removal is not None
    asked = {change.partition(" =")[0] for change in changed}
    assert asked >= {
        *("mesh.smooth_within", "stock.diameter", "stock.length", "holding.parting_core"),
        *("levels.roughing_depth", "levels.finishing_depth", "levels.most_cuts"),
        *("roughing.flute_length", "roughing.spindle", "finishing.feed"),
    }
    assert len(changed) == len(asked), f"a remedy had to be followed by another one of the same field: {changed}"


@pytest.mark.slow
def test_a_surface_that_misses_its_mesh_tells_the_deviation_that_would_do(coarse):
    fine = SMALL_CAPSULE.mesh(0.05)
    job = bonecam.Job().with_values(
        surface={"tolerance": 0.005, "max_control_points": 40, "largest_deviation": 0.01},
        stock={"diameter": 7.0, "length": 12.0},
        levels={"chord_tolerance": 0.05},
    )
    with pytest.raises(BonecamError, match="largest_deviation") as caught:
        bonecam.morph_levels(fine, job)
    told = remedied(str(caught.value))
    assert set(told) == {"surface"}
    assert 0.01 < told["surface"]["largest_deviation"] < 0.1
    made = bonecam.morph_levels(fine, job.with_values(**told))
    assert made.report["surface"]["deviation_max_mm"] <= told["surface"]["largest_deviation"]


def test_a_refusal_that_names_no_value_is_found_by_this_test():
    with pytest.raises(AssertionError, match="no value to give"):
        remedied(str(JobError("[stock] diameter = 4: give a larger one")))
