"""Ra and Rz of arcs in closed form, and the feed marks of a program."""

import numpy as np
import pytest

from bonecam.verify.probing import CUT_OFF, NODE, SAMPLING, _ra_rz, roughness_of


@pytest.mark.parametrize(("pitch", "radius"), [(0.1, 1.0), (0.08, 2.0)])
def test_arcs_have_the_roughness_of_the_closed_form(pitch, radius):
    x = np.arange(0, SAMPLING * CUT_OFF, NODE / 10)
    arcs = (np.mod(x / pitch, 1.0) - 0.5) ** 2 * pitch**2 / (2 * radius) + 0.3 * x - 2.0
    ra, rz = _ra_rz(arcs[None])[0]
    assert rz == pytest.approx(1000 * pitch**2 / (8 * radius), rel=0.02)
    assert ra == pytest.approx(1000 * pitch**2 / (18 * np.sqrt(3) * radius), rel=0.02)


def test_feed_marks_follow_from_the_feed_per_tooth(posted):
    found, more = (roughness_of(posted, flutes, 20) for flutes in (2, 4))
    tip = 900.0 / 4500.0 / 2
    assert np.median(more.marks) == pytest.approx(np.median(found.marks) / 4)
    # the contact is a ball's radius off the tip, nearer to the part: it goes at up to its share of the feed
    assert 0.3 * tip**2 / 8 < np.median(found.marks) / 1000 < 2.0 * tip**2 / 8 * (1 + 1 / 3.6)
    assert (found.along[:, 1] > 0.9 * found.marks).all()
