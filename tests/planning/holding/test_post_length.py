"""The shortest post of contacts that are reached, and of none."""

import numpy as np
import pytest

from bonecam.errors import OrientationError
from bonecam.planning.post_length import shortest_post
from bonecam.workholding.clamping import Clamping

NOTHING = Clamping((), closed=True, clearance=1.0)


def test_contacts_that_no_post_helps_are_left_out_of_its_length() -> None:
    assert shortest_post(np.array([3.2, np.inf, -1.0]), 10.0, NOTHING) == 14.0


def test_no_contact_that_is_reached_is_an_error_and_not_the_shortest_post() -> None:
    with pytest.raises(OrientationError, match="no contact has a free tool axis, however long the post is"):
        shortest_post(np.array([np.inf, np.inf, -np.inf]), 10.0, NOTHING)
