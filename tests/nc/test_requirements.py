"""What a job may ask of a machine: here the time for its passes."""

from dataclasses import replace

import numpy as np
import pytest

from bonecam.errors import JobError, MachineError
from bonecam.job import Job
from bonecam.machine.bodies import Frustum, Table
from bonecam.machine.machine import UPRIGHT, Machine, read_machine
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.requirements import check_length, check_reach, check_room, least_lengths
from bonecam.setup.capsule import Capsule

CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int32)
PART = TriangleMesh(CORNERS, FACES)
"""A corner of a cube: 1000 / 6 mm^3."""


def test_the_least_length_of_the_passes_is_volume_by_depth_and_step() -> None:
    balls = (1.0, 0.01), (2.0, 0.02), (2.0, 0.05)
    fine, before, coarse = (2 * np.sqrt(h * (2 * r - h)) for r, h in balls)
    levels = {"depths": "0.1 0.2 0.5"}
    left = 700 - PART.area * (0.1 + 0.2)
    told = {"roughing": PART.area / before + left / (0.5 * coarse), "finishing": PART.area / fine}
    found = least_lengths(PART, 700 + PART.volume, Job().with_values(levels=levels))
    assert found == pytest.approx(told, rel=1e-12)
    assert set(least_lengths(PART, PART.volume - 1, Job()).values()) == {0}


def test_a_stock_that_takes_days_to_cut_is_refused_with_the_hours() -> None:
    stock = Capsule(np.zeros(3), np.array([0.0, 0.0, 30.0]), 50.0)
    shares = r"\(1699 m in roughing cuts and 3 m in finishing cuts\)"
    what = rf"\[path\] most_length = 500: .* 7\.55e\+05 mm3 .* takes 1702 m of passes or more {shares}, 12 h: give a"
    with pytest.raises(JobError, match=what):
        check_length(PART, stock, Job())
    check_length(PART, stock, Job().with_values(path={"most_length": 3000.0}))
    deep = {"levels": {"roughing_depth": 2.0}, "roughing": {"radius": 8.0, "scallop": 0.2}}
    told: list[str] = []
    check_length(PART, stock, Job().with_values(**deep), lambda share, what: told.append(what))
    assert told == ["109 m of passes or more, 0.5 h of cutting"]


def test_what_stands_on_the_table_and_reaches_into_the_stock_is_refused_before_anything_is_planned() -> None:
    machine = read_machine("mikron-ucp600")
    stock = Capsule(np.array([0.0, 0.0, 45.0]), np.array([0.0, 0.0, 60.0]), 5.0)
    job = Job().with_values(holding={"length": 40.0})
    for lengths, fits in (([40.0], True), ([30.0, 20.0], False)):
        stack = tuple(Frustum(length, 30.0, 30.0) for length in lengths)
        crowded = replace(machine, table=Table(standing=stack))
        if fits:
            check_room(stock, job, crowded)
            continue
        with pytest.raises(MachineError, match=r"reaches to z 50 mm, the stock begins at 40: give a longer post"):
            check_room(stock, job, crowded)


def test_a_table_that_sweeps_more_than_z_travels_is_refused_before_anything_is_planned() -> None:
    machine = read_machine("mikron-ucp600")
    stock = Capsule(np.array([0.0, 0.0, 45.0]), np.array([0.0, 0.0, 60.0]), 5.0)
    job = Job().with_values(holding={"length": 40.0})
    check_room(stock, job, replace(machine, table=Table(standing=(Frustum(30.0, 300.0, 300.0),))))
    huge = replace(machine, table=Table(standing=(Frustum(30.0, 90_000.0, 90_000.0),)))
    with pytest.raises(MachineError, match=r"reach 45\d\d\d mm from the pivot.*correct the machine's \[table\]"):
        check_room(stock, job, huge)


def limited(name: str = "mikron-ucp600", **limits_deg: tuple[float, float]) -> Machine:
    """A machine that ships, with other limits of some rotary axes."""
    machine = read_machine(name)
    axes = (
        replace(axis, endless=False, limits=tuple(np.radians(limits_deg[axis.letter])))
        if axis.letter in limits_deg
        else axis
        for axis in machine.part_axes
    )
    return replace(machine, part_axes=tuple(axes))


@pytest.mark.parametrize("turns", [(-360, 360), (0, 360), (-185, 185), (-450, 450), (-90, 90)])
def test_turntables_with_limits_reach_all_round(turns: tuple[float, float]) -> None:
    check_reach(Job(), limited(C=turns))
    check_reach(Job(), read_machine("linuxcnc-xyzbc"))


@pytest.mark.parametrize(
    ("limits", "job", "told"),
    [
        ({"B": (-10, 10)}, {}, "leans by 9 deg all round at most, the sides of the stock need 15: .*path.max_tilt"),
        ({"B": (-80, 80)}, {"path": {"strategy": "rotary"}}, "the sides of the stock need 90: take another machine"),
        ({"B": (-0.5, 0.5)}, {}, "leans to some sides only: give wider limits"),
        ({"C": (-80, 80), "B": (-115, 0)}, {}, "C -80 to 80 deg the tool axis leans to some sides only"),
    ],
)
def test_axes_that_do_not_lean_far_enough_all_round_are_refused_with_their_limits(
    limits: dict[str, tuple[float, float]], job: dict[str, dict[str, object]], told: str
) -> None:
    with pytest.raises(MachineError, match=told):
        check_reach(Job().with_values(**job), limited(**limits))


def test_an_endless_axis_across_the_part_is_told_without_limits() -> None:
    machine = replace(read_machine("mill-4axis"), part_frame=UPRIGHT)
    with pytest.raises(MachineError, match=r"^mill-4axis: the tool axis leans to some sides only: .* part_z"):
        check_reach(Job().with_values(nc={"machine": "mill-4axis"}), machine)


def test_a_table_that_would_turn_over_for_a_rewind_is_refused_before_anything_is_planned() -> None:
    machine = read_machine("mikron-ucp600")
    first, second = machine.part_axes
    round_x = replace(first, letter="A", direction=(1.0, 0.0, 0.0), endless=False, limits=(0.0, 2 * np.pi))
    tilted = replace(second, limits=(-np.radians(179), np.radians(179)))
    with pytest.raises(MachineError, match=r"A must be rewound by 3\d\d deg .* turns the table over") as caught:
        check_reach(Job(), replace(machine, part_axes=(round_x, tilted)))
    assert caught.value.evidence["axis"] == "A"
    middle = replace(round_x, limits=(-np.pi, np.pi))
    check_reach(Job(), replace(machine, part_axes=(middle, tilted)))
