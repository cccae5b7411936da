"""What is left of the stock after a path, and what that does to the next level."""

from dataclasses import replace

import bodies
import numpy as np
import pytest
from jaxtyping import Float
from numpy import ndarray

from bonecam.job import NcJob, PathJob
from bonecam.levels.measure.level import Level
from bonecam.mesh.distance import MeshDistance
from bonecam.orientation.limits import AxisLimits
from bonecam.orientation.oriented_path import orient
from bonecam.orientation.scene import Scene
from bonecam.setup.holding import post_below
from bonecam.setup.stock import Capsule
from bonecam.toolpath.cutter import Cutter
from bonecam.toolpath.material import DEVIATION, Material, remove_material, uncut_material
from bonecam.toolpath.path import ToolPath
from bonecam.toolpath.zigzag import candidate_contacts, contact_path

POST = post_below(bodies.mesh_of(bodies.pebble()), bodies.HOLDING)


class Skin(Capsule):
    """A stock half a millimetre outside every level."""

    def nearest(self, points: Float[ndarray, "n 3"]) -> Float[ndarray, "n 3"]:
        return np.asarray(points + 0.5 * self.outward(points))


STOCK = Skin(bodies.stock().start, bodies.stock().end, bodies.stock().radius)


def levels_of() -> tuple[Level, Level, Level]:
    """The part, a level 0.4 mm outside it, and the stock."""
    stock = Level(2, None, STOCK.mesh(0.01), 0.5, 0.0, 0.0, 0.0, 0)
    return bodies.level_of(bodies.pebble()), bodies.level_of(bodies.pebble(0.4), 1, 0.5), stock


def path_on(level: Level, material: Material, cutter: Cutter = bodies.ROUGH) -> ToolPath:
    contacts = contact_path(
        candidate_contacts(level, [MeshDistance(level.mesh)], cutter, POST, PathJob()), material
    )
    return orient(
        contacts,
        Scene(level.mesh, material.mesh, STOCK, POST, DEVIATION),
        AxisLimits(2.0),
        PathJob(),
        NcJob(),
    )


@pytest.fixture(scope="module")
def machined() -> tuple[Material, ToolPath]:
    levels = levels_of()
    material = uncut_material(levels, STOCK)
    path = path_on(levels[1], material)
    return remove_material(material, levels[1], path), path


def test_what_was_cut_lies_on_the_level(machined: tuple[Material, ToolPath]) -> None:
    material, _ = machined
    inside = np.asarray(material.mesh.vertices)[material.mesh.vertices[:, 2] > POST.top + 4]
    assert np.abs(MeshDistance(levels_of()[1].mesh).unsigned(inside)).max() < 0.02


def test_no_ball_of_the_path_is_inside_the_material_left(machined: tuple[Material, ToolPath]) -> None:
    material, path = machined
    rows = np.flatnonzero(path.kinds == 0)
    centres = path.tips[rows] + path.cutter.radius * path.axes[rows]
    assert (
        MeshDistance(material.mesh).signed(centres[path.contacts[rows, 2] > POST.top + 4]).min()
        > path.cutter.radius - DEVIATION
    )


def test_contacts_under_uncut_material_stay_uncut() -> None:
    levels = levels_of()
    material = uncut_material(levels, STOCK)
    path = path_on(levels[1], material)
    spared = path.contacts[:, 2] > 39.0
    shortened = replace(
        path,
        **{
            name: getattr(path, name)[~spared]
            for name in ("kinds", "pass_index", "parameters", "contacts", "tips", "axes", "feed_rates")
        },
        uncut=np.vstack([path.uncut, path.contacts[spared]]),
        reasons=path.reasons + ("collision",) * int(spared.sum()),
    )
    material = remove_material(material, levels[1], shortened)
    assert np.quantile(material.thickness(levels[0], path.contacts[spared]), 0.05) > 0.75
    below = path_on(levels[0], material, bodies.FINE)
    covered = np.array(below.reasons) == "covered"
    heights = below.uncut[covered][:, 2]
    assert (heights > 40.0).any()
    assert not ((heights > POST.top + 4) & (heights < 37.5)).any()
    assert np.nanmax(below.contacts[:, 2]) < 40.0
