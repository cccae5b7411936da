"""Cones of real parts audited by another library than the one that certified them: open3d's distances at points all
over the true tool, for random axes in the cones, every axis of the path, and poses between contacts.

Xu et al. (2013): no axis in a cone collides. Cones that are 1.3 times as wide must be caught: else the audit is blind.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bonecam_meshes
import numpy as np
import pytest
from deepest_entry import deepest_entry

import bonecam
from bonecam.arrays import unit
from bonecam.levels.measure import machined_levels
from bonecam.machine import read_machine
from bonecam.machine.limits import polar_angles
from bonecam.nc import machine_limits
from bonecam.planning import Scene, candidate_contacts, contact_path, orient
from bonecam.planning.axes.field import level_axes
from bonecam.planning.axes.lead import table_limits
from bonecam.planning.collision import interpolate_poses, level_scene
from bonecam.planning.surface_paths import finishing_cutter
from bonecam.tool import MoveKind, ToolPath
from bonecam.workholding import clamping_of

AXES = 20_000
"""Random axes in the cones."""
STEPS = 4
"""Steps that each cutting move is divided into."""
ENTERED = 0.011
"""mm: the cutter may touch the level by a hundredth."""
BY_FCL = 0.014
"""mm: FCL's cutter has 48 sides."""
CHUNK = 200
IN_METRES = bonecam.Job().with_values(mesh={"units": "m"})
RANDOM = np.random.default_rng(11)

Entry = Callable[..., np.ndarray]


@dataclass(frozen=True, eq=False)
class Machined:
    """A path and the scene in which it is cut."""

    name: str
    path: ToolPath
    scene: Scene

    def entries(self, deepest_entry: Entry, centres: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """How deep the tool is in anything at each of these poses above the table, mm."""
        clearance = self.scene.clamping.clearance if self.scene.clamping.closed else -np.inf
        highest = table_limits(centres, self.path.cutter, clearance) if clearance > -np.inf else np.pi
        above = polar_angles(axes) <= highest
        places, axes = centres[above], axes[above]
        parts = range(0, len(places), CHUNK)
        return np.concatenate(
            [deepest_entry(self.scene, self.path.cutter, places[k : k + CHUNK], axes[k : k + CHUNK]) for k in parts]
        )


def blade(shared: Callable[[], Path]) -> Machined:
    files = [bonecam_meshes.path(f"impeller_{name}") for name in ("hub", "blades")]
    return finished(bonecam.finish(bonecam_meshes.path("impeller_blade"), files[0], files[1:], wheel_job()))


def hecc(shared: Callable[[], Path]) -> Machined:
    wheels = getattr(bonecam, "wheels", None)
    if wheels is None:
        pytest.skip("the plugin for wheels reads the tables of HECC: it is not installed")
    folder = shared() / "meshes" / "blades" / "sections" / "hecc"
    files = sorted(folder.glob("*main_blade_section*"))
    surface = wheels.read_sections(files, columns="x r*theta r", axis="-x", scale=10.0).skin(0.01)
    flow = [wheels.read_flow_path(next(folder.glob(f"*{end}.txt")), axis="-x", scale=10.0) for end in ("hub", "shroud")]
    wheel = wheels.impeller(surface, *flow, 15)
    larger = {"radius": 2.0, "shank_diameter": 3.4, "overhang": 80.0}
    job = wheel_job().with_values(finishing=larger, holding={"diameter": 40.0})
    return finished(bonecam.finish(surface, wheel.hub, wheel.blades[1:], job))


def wheel_job() -> bonecam.Job:
    tool = {"radius": 1.5, "flute_length": 4.0, "shank_diameter": 2.4, "overhang": 42.0, "holder_diameter": 16.0}
    return bonecam.Job().with_values(
        holding={"diameter": 20.0}, finishing={**tool, "scallop": 0.1, "feed": 1200.0}, path={"max_tilt_deg": 85.0}
    )


def finished(made: bonecam.Finished) -> Machined:
    table = read_machine(made.job.nc.machine).table
    return Machined("blade", made.path, made.workpiece.scene(made.job, clamping_of(made.job.holding, table)))


def phalanx(shared: Callable[[], Path]) -> Machined:
    return bone(bonecam_meshes.path("phalanx"), bonecam.Job())


def middle_phalanx(shared: Callable[[], Path]) -> Machined:
    return bone(shared() / "meshes" / "bones" / "2midph_m.stl", IN_METRES)


def distal_phalanx(shared: Callable[[], Path]) -> Machined:
    return bone(shared() / "meshes" / "bones" / "3distph_m.stl", IN_METRES)


def bone(file: Path, job: bonecam.Job) -> Machined:
    """A bone's own level, with the level round it as the material."""
    machine = read_machine(job.nc.machine)
    limits = machine_limits(machine)
    made = bonecam.morph_levels(file, job)
    job = made.job
    levels = made.levels.levels
    scene = level_scene(levels, 0, made.stock, job, machine.bodies)
    level = machined_levels(levels)[0]
    cutter = finishing_cutter(job, machine.bodies)
    found = candidate_contacts(
        level, [scene.level_distance], cutter, scene.post, job.path, turn_speed=limits.turn_speed
    )
    contacts = contact_path(found)
    smooth = level_axes(contacts, level, scene, limits, job.path, None)
    assert smooth is not None
    return Machined("bone", orient(contacts, scene, limits, job.path, job.nc, smooth.wanted), scene)


PARTS = {
    "impeller": blade,
    "hecc": hecc,
    "phalanx": phalanx,
    "middle phalanx": middle_phalanx,
    "distal phalanx": distal_phalanx,
}


@pytest.fixture(scope="module", params=PARTS)
def machined(request):
    return PARTS[request.param](lambda: request.getfixturevalue("shared"))


def random_poses(path: ToolPath, scale: float, rim: bool) -> tuple[np.ndarray, np.ndarray]:
    """Ball centres and axes in the cones of random contacts, `scale` times as wide; half of them, or all, at the
    rim."""
    assert path.cones is not None
    rows = RANDOM.choice(np.flatnonzero(path.cones.cone_of >= 0), AXES)
    cone = path.cones.cone_of[rows]
    share = np.sqrt(RANDOM.random(AXES))
    share[:: 1 if rim else 2] = 1.0
    shapes = path.cones.shapes.take(cone).scaled(scale * share)
    return path.balls[rows], shapes.rims(RANDOM.uniform(0, 2 * np.pi, AXES))


@pytest.mark.slow
def test_no_axis_in_a_cone_collides_and_wider_cones_are_caught(machined):
    entered = machined.entries(deepest_entry, *random_poses(machined.path, 1.0, rim=False))
    wider = machined.entries(deepest_entry, *random_poses(machined.path, 1.3, rim=True)) > ENTERED
    print(f"{machined.name}: {len(entered)} axes, deepest {entered.max():.4f} mm; x 1.3: {wider.mean():.1%} caught")
    assert len(entered) > 0.6 * AXES
    assert (entered > ENTERED).sum() == 0
    assert wider.mean() > 0.005


@pytest.mark.slow
def test_no_axis_of_the_path_collides_nor_a_pose_between_contacts(machined):
    path = machined.path
    cuts = np.flatnonzero(path.kinds == MoveKind.CUT)
    entered = machined.entries(deepest_entry, path.balls[cuts], path.axes[cuts])
    first = cuts[:-1][(np.diff(cuts) == 1) & (path.pass_index[cuts[1:]] == path.pass_index[cuts[:-1]])]
    tips, axes = interpolate_poses(
        path.tips[first], path.tips[first + 1], path.axes[first], path.axes[first + 1], STEPS
    )
    between = np.arange(len(tips)) % (STEPS + 1) % STEPS > 0
    tips, axes = tips[between], axes[between]
    moved = machined.entries(deepest_entry, tips + path.cutter.radius * axes, axes)
    print(
        f"{machined.name}: {len(entered)} axes, deepest {entered.max():.4f} mm; "
        f"{len(moved)} poses between, deepest {moved.max():.4f} mm"
    )
    assert len(entered) == len(cuts)
    assert (entered > BY_FCL).sum() == 0
    assert (moved > BY_FCL).sum() == 0


@pytest.mark.slow
def test_normals_of_a_blade_collide_at_most_contacts(machined):
    """Else the scene is too easy (a bone's are: 20 %)."""
    if machined.name == "bone":
        pytest.skip("a bone is open to most sides")
    path = machined.path
    cuts = np.flatnonzero(path.kinds == MoveKind.CUT)
    normals = unit(path.balls[cuts] - path.contacts[cuts])
    entered = deepest_entry(machined.scene, path.cutter, path.balls[cuts][::10], normals[::10]) > ENTERED
    assert entered.mean() > 0.6
