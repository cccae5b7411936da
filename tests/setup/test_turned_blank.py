"""A turned blank: its mesh, laid as rays, is the body of revolution of its profile."""

import numpy as np
import pytest

from bonecam.material.rays import lay_solids
from bonecam.setup.placement import TurnedBlank
from bonecam.verify.sweeping import volumes

WAISTED = np.array([[0, 0], [10, 0], [10, 3], [8, 3], [7, 6], [4, 9], [4, 12], [0, 12]], float)
RECESSED = np.array([[0, 0], [10, 0], [10, 3], [8, 3], [7, 6], [8, 11], [4, 9], [0, 9]], float)


@pytest.mark.parametrize("profile", [WAISTED, RECESSED], ids=["waisted", "recessed"])
def test_rays_hold_the_body_and_no_recess(profile: np.ndarray) -> None:
    (r, z), (R, Z) = profile[:-1].T, profile[1:].T
    volume = np.pi / 3 * ((Z - z) * (r * r + r * R + R * R)).sum()
    sets, _ = lay_solids([TurnedBlank(profile).mesh], 0.25, 200.0)
    np.testing.assert_allclose(volumes(sets), volume, rtol=4e-3)


def test_what_is_to_be_turned_is_told() -> None:
    assert TurnedBlank(WAISTED).text == ("blank: turned to the blades' tips, diameter 20.00 mm, from Z 0.00 to Z 12.00")
