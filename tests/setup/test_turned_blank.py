"""A turned blank laid as rays: its slices and recesses are the body of revolution of its profile."""

import numpy as np
import pytest

from bonecam.material.cut_out import cut_out
from bonecam.material.rays import lay_grid, lay_rays
from bonecam.setup.turned_blank import TurnedBlank
from bonecam.verify.removal.sweeping import volumes

WAISTED = np.array([[0, 0], [10, 0], [10, 3], [8, 3], [7, 6], [4, 9], [4, 12], [0, 12]], float)
RECESSED = np.array([[0, 0], [10, 0], [10, 3], [8, 3], [7, 6], [8, 11], [4, 9], [0, 9]], float)


@pytest.mark.parametrize("profile", [WAISTED, RECESSED], ids=["waisted", "recessed"])
def test_slices_without_recesses_are_the_body(profile: np.ndarray) -> None:
    blank = TurnedBlank(profile)
    grid = lay_grid(blank.slices, 0.25)
    sets = lay_rays(blank.slices, grid, 200.0)
    cut = [cut_out(rays, blank.recesses, grid, k) for k, rays in enumerate(sets)]
    np.testing.assert_allclose(volumes(cut), blank.mesh.volume, rtol=1e-3)
    if blank.recesses:
        assert min(volumes(sets)) > 1.02 * blank.mesh.volume
    for rays in cut:
        used = np.arange(rays.spans.shape[2] // 2) < rays.counts[:, :, None]
        assert (rays.spans[:, :, 1::2] - rays.spans[:, :, ::2])[used].min() > 0


def test_what_is_to_be_turned_is_told() -> None:
    assert TurnedBlank(WAISTED).text == (
        "blank: turned to the blades' tips, diameter 20.00 mm, from Z 0.00 to Z 12.00"
    )
