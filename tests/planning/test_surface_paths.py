"""The axes of one surface: round a blade they turn with its normals, or swing and come back, whichever is sooner."""

import numpy as np

import bonecam
from bonecam.machine import read_machine
from bonecam.nc import machine_limits
from bonecam.planning.axes.field import machine_minutes
from bonecam.planning.surface_paths import Workpiece, finishing_cutter, surface_contacts, wanted_axes
from bonecam.surface import blade_solid, skin
from bonecam.workholding import clamping_of

JOB = bonecam.Job().with_values(
    holding={"length": 60.0, "diameter": 4.0},
    finishing={
        "radius": 2.0,
        "flute_length": 6.0,
        "shank_diameter": 3.6,
        "overhang": 45.0,
        "scallop": 0.5,
        "feed": 2400.0,
    },
    path={"orientation": "cones", "max_tilt_deg": 85.0, "pattern": "round"},
)


def test_round_a_blade_that_stands_out_sideways_the_axis_swings_and_comes_back():
    """Sooner than an azimuth that turns with the normals could turn alone."""
    angle = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    ellipse = np.column_stack([np.zeros(36), 6 * np.cos(angle), 1.5 * np.sin(angle)])
    blade = skin([ellipse + np.array([x, 0.0, 0.0]) for x in np.linspace(0, 8, 5)], 0.02)
    machine = read_machine(JOB.nc.machine)
    limits = machine_limits(machine)
    workpiece = Workpiece(blade, blade_solid(blade, 0.01), 0.0).stand(JOB.holding.length)
    scene = workpiece.scene(JOB, clamping_of(JOB.holding, machine.bodies.table))
    contacts = surface_contacts(workpiece, scene, JOB, finishing_cutter(JOB, machine.bodies))
    wanted = wanted_axes(workpiece, contacts, scene, limits, JOB.path)
    assert wanted is not None
    assert wanted.cones is not None
    assert wanted.cones.check is not None  # FCL is asked without being told
    assert wanted.cones.check.asked > 100
    s, passes = contacts.parameters[:, 0], contacts.pass_index
    turns = sum(np.abs(np.diff(np.unwrap(s[passes == n], period=1.0))).sum() for n in np.unique(passes))
    assert turns > 2
    assert machine_minutes(contacts, wanted.axes, limits) < turns * 2 * np.pi / limits.turn_speed
