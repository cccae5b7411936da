"""A small part with a waist or a groove, its stock, and the program of its first level."""

import pytest
from level_parts import CAPSULE, HALF_MILLIMETRE, STEP_PARAMETERS, waisted

from bonecam.levels.problem import ATTRACTIONS, discretise, remaining, whole
from bonecam.levels.program import Given, program_of


@pytest.fixture(scope="session")
def discretisation():
    """The bone with a waist in the stock, as the programs of its levels see it."""
    return discretise(waisted(), CAPSULE, ATTRACTIONS["stock"])


@pytest.fixture(scope="session")
def given(discretisation):
    """All an energy of the first level's program is computed from."""
    part = discretisation.surface
    rest = remaining(discretisation, part.control_points, whole(CAPSULE))
    return Given(discretisation, part, rest, HALF_MILLIMETRE, STEP_PARAMETERS)


@pytest.fixture
def first_program(given):
    """Sets up the program of the first level; energies and limits are those listed when it is called."""

    def set_up():
        return program_of(given.discretisation, given.before.control_points, given.rest, given.cut, given.parameters)

    return set_up
