"""Random but plausible jobs on small parts: each ends soon, as a proved program or as one line with a remedy."""

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from bonecam_meshes import path as shipped
from mutations import within
from numpy import ndarray

import bonecam
from bonecam.errors import BonecamError, MachineError
from bonecam.job import Job
from bonecam.machine import Machine, read_machine
from bonecam.mesh import TriangleMesh, read_mesh
from bonecam.nc import dialect_names, read_dialect

pytestmark = pytest.mark.whole


SECONDS = 300.0
"""A job that takes longer than this (s) hangs."""
QUICK = (3, 4, 16)
"""Seeds of the default run: a program, and refusals of a cut's depth and of a stock."""
ALL = range(200)
"""Seeds of the long run."""
REMEDIES = re.compile(
    r"\b(give|take|keep|use|allow|raise|make|leave|smooth|bring|limit|split|close|choose|correct|tilt)\b"
)
"""A message names something to do by one of these words."""
INNER = re.compile(r"lift the path|Traceback|nan mm|\bNone\b")
"""What no message for a user holds."""


def tube(centre: Callable[[ndarray], ndarray], radii: Callable[[ndarray], ndarray]) -> TriangleMesh:
    """The closed mesh round a curve `centre(t)` (n, 3), t in 0 .. 1, of elliptic sections with half axes
    `radii(t)` (n, 2) along X and Y, which shrink to points at both ends."""
    around, along = 40, 48
    angle = np.arange(around) * 2 * np.pi / around
    t = (1 - np.cos(np.linspace(0, np.pi, along + 2)[1:-1])) / 2
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    rings = np.repeat(centre(t)[:, None], around, axis=1)
    rings[:, :, :2] += radii(t)[:, None] * circle
    points = np.vstack([rings.reshape(-1, 3), centre(np.array([0.0, 1.0]))])

    index = np.arange(along * around).reshape(along, around)
    following = np.roll(index, -1, axis=1)
    a, b, c, d = (v.ravel() for v in (index[:-1], following[:-1], following[1:], index[1:]))
    low = np.column_stack([np.full(around, len(points) - 2), following[0], index[0]])
    high = np.column_stack([np.full(around, len(points) - 1), index[-1], following[-1]])
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d]), low, high])
    return TriangleMesh(points, faces.astype(np.int32))


def straight(length: float, bow: float = 0.0) -> Callable[[ndarray], ndarray]:
    """A curve of `length` (mm) up the Z axis that bows by `bow` (mm) towards +X in its middle."""
    return lambda t: np.column_stack([4 * bow * t * (1 - t), 0 * t, length * t])


def ellipsoid(width: float, depth: float, length: float) -> TriangleMesh:
    return tube(straight(length), lambda t: np.outer(np.sqrt(t - t * t), [width, depth]))


def stick(radius: float, length: float, bow: float = 0.0, waist: float = 0.0) -> TriangleMesh:
    """A rod with round ends, thinner by `waist` (share of its radius) in its middle."""

    def radii(t: ndarray) -> ndarray:
        to_end = np.clip(np.minimum(t, 1 - t) * length / radius, 0, 1)
        round_ = radius * np.sqrt(to_end * (2 - to_end)) * (1 - waist * np.sin(np.pi * t) ** 2)
        return np.outer(round_, [1.0, 1.0])

    return tube(straight(length, bow), radii)


def cone(radius: float, length: float, power: float) -> TriangleMesh:
    """A body with a round foot that narrows to its upper end: a cone's tip at power 1, rounder below that."""
    return tube(
        straight(length), lambda t: np.outer(radius * np.minimum(1.0, 4 * np.sqrt(t)) * (1 - t) ** power, [1.0, 1.0])
    )


def small_phalanx() -> TriangleMesh:
    mesh = read_mesh(shipped("phalanx"))
    return TriangleMesh(0.6 * mesh.vertices, mesh.faces)


PARTS: dict[str, Callable[[], TriangleMesh]] = {
    "ellipsoid": lambda: ellipsoid(8.0, 7.0, 10.0),
    "flat ellipsoid": lambda: ellipsoid(10.0, 4.0, 13.0),
    "ball": lambda: ellipsoid(6.0, 6.0, 6.2),
    "rod": lambda: stick(3.0, 14.0),
    "thin rod": lambda: stick(1.6, 16.0),
    "bent rod": lambda: stick(2.5, 18.0, bow=2.5),
    "waisted rod": lambda: stick(3.5, 16.0, waist=0.35),
    "blunt cone": lambda: cone(4.0, 14.0, 0.5),
    "sharp cone": lambda: cone(4.0, 14.0, 1.0),
    "small phalanx": small_phalanx,
}


def pick(random: np.random.Generator, values: Any) -> Any:
    """One of `values`, as Python has it."""
    return values[int(random.integers(len(values)))]


def controllers_of(machine: Machine) -> Iterator[str]:
    """The dialects in which programs for a machine can be written."""
    for name in dialect_names():
        with suppress(MachineError):
            read_dialect(name).tool_centre_switch(machine)
            yield name


DRAWN = ("mikron-ucp600", "linuxcnc-xyzbc")
"""Machines of the jobs."""
CONTROLLERS = {name: tuple(controllers_of(read_machine(name))) for name in DRAWN}


def random_stock(random: np.random.Generator, mesh: TriangleMesh) -> dict[str, Any]:
    kind = pick(random, ("capsule", "capsule", "cylinder", "box"))
    stock = {"kind": kind, "allowance": pick(random, (0.2, 0.5, 0.5, 1.0, 3.0))}
    if random.random() < 0.35:
        size = np.ptp(mesh.vertices, axis=0)
        width = round(float(max(size[:2])) * random.uniform(1.0, 2.2), 1)
        length = round(float(size[2]) * random.uniform(1.0, 2.0), 1)
        sides = {"width": width, "depth": width} if kind == "box" else {"diameter": width}
        stock |= sides | {"length": length}
    if random.random() < 0.2:
        stock |= {"offset_x": round(random.uniform(-1, 1), 2), "tilt_x_deg": round(random.uniform(-20, 20), 1)}
    return stock


def random_levels(random: np.random.Generator) -> dict[str, Any]:
    if random.random() < 0.15:
        return {"depths": pick(random, ("0.1 0.2 0.4", "0.3", "0.05 0.05 0.5 1.0"))}
    return {
        "finishing_depth": pick(random, (0.05, 0.1, 0.2, 0.4)),
        "finishing_levels": pick(random, (0, 1, 2, 4)),
        "roughing_depth": pick(random, (0.3, 0.5, 0.8, 1.2)),
        "schedule": pick(random, ("numbers", "numbers", "fewest")),
        "even": pick(random, (False, True)),
    }


def random_tool(random: np.random.Generator, radii: tuple[float, ...], scallops: tuple[float, ...]) -> dict[str, Any]:
    radius = pick(random, radii)
    flutes = round(radius * random.uniform(1.5, 5.0), 2)
    return {
        "radius": radius,
        "flute_length": flutes,
        "shank_diameter": round(2 * radius * pick(random, (0.7, 0.9, 1.0, 1.0, 1.5)), 2),
        "overhang": round(flutes + random.uniform(5.0, 60.0), 1),
        "holder_diameter": pick(random, (10.0, 20.0, 32.0, 50.0)),
        "holder_length": pick(random, (30.0, 50.0, 80.0)),
        "scallop": pick(random, scallops),
    }


def random_job(seed: int) -> tuple[str, Job | BonecamError]:
    """The name of a part and a job for it, or the error with which the job is refused."""
    random = np.random.default_rng(seed)
    part = pick(random, tuple(PARTS))
    machine = pick(random, ("mikron-ucp600", "linuxcnc-xyzbc", "mikron-ucp600"))
    controller = pick(np.random.default_rng([seed, 1]), CONTROLLERS[machine])
    lead = pick(random, (-10.0, 0.0, 5.0, 10.0, 20.0))
    sections = {
        "stock": random_stock(random, PARTS[part]()),
        "levels": random_levels(random),
        "roughing": random_tool(random, (1.0, 1.5, 2.0, 3.0), (0.05, 0.1, 0.2)),
        "finishing": random_tool(random, (0.5, 1.0, 1.5), (0.02, 0.05)),
        "holding": {
            "diameter": pick(random, (1.0, 2.0, 3.0, 4.0, 6.0)),
            "length": pick(random, (10.0, 25.0, 40.0, 80.0)),
        },
        "path": {
            "pattern": pick(random, ("round", "round", "along")),
            "lead_deg": lead,
            "max_tilt_deg": pick(random, (30.0, 60.0, 75.0, 85.0)),
            "clearance": pick(random, (0.5, 2.0, 5.0)),
            "gouge_tolerance": pick(random, (0.005, 0.01, 0.02)),
        },
        "nc": {"machine": machine, "controller": controller},
    }
    if random.random() < 0.15:
        tool = sections[pick(random, ("roughing", "finishing"))]
        tool["flute_length"] = tool["radius"]
    try:
        return part, Job().with_values(**sections)
    except BonecamError as error:
        return part, error


def run(seed: int) -> tuple[str, str]:
    """What becomes of a job: 'program' and its number of blocks, or the kind of error and its message."""
    part, job = random_job(seed)
    if isinstance(job, BonecamError):
        return type(job).__name__, str(job)
    try:
        result = bonecam.convert(PARTS[part](), job)
    except BonecamError as error:
        return type(error).__name__, str(error)
    return "program", str(result.program.text.count("\n"))


def check_ending(seed: int) -> None:
    """A program, or one line that says what to do, within SECONDS."""
    with within(SECONDS):
        kind, what = run(seed)
    if kind == "program":
        assert int(what) > 100, f"job {seed}: a program of {what} blocks"
        return
    assert "\n" not in what, f"job {seed}: {what}"
    assert REMEDIES.search(what), f"job {seed} names no remedy: {what}"
    assert not INNER.search(what), f"job {seed}: {what}"


@pytest.mark.parametrize("seed", QUICK)
def test_a_plausible_job_ends_with_a_program_or_a_remedy(seed):
    check_ending(seed)


def test_jobs_are_drawn_for_all_dialects_on_all_machines():
    assert set(CONTROLLERS["mikron-ucp600"]) == set(dialect_names())
    jobs = (random_job(seed)[1] for seed in ALL)
    drawn = {(job.nc.machine, job.nc.controller) for job in jobs if isinstance(job, Job)}
    assert drawn == {(machine, name) for machine, names in CONTROLLERS.items() for name in names}


@pytest.mark.fuzz
@pytest.mark.parametrize("seed", ALL)
def test_every_random_job_ends_with_a_program_or_a_remedy(seed):
    check_ending(seed)


@pytest.mark.fuzz
def test_links_below_the_stock_keep_the_flutes_out_of_it():
    """A stock hardly longer than the part: links pass below it, where the ball is in air beside the flutes."""
    assert run(6015)[0] == "program"


@pytest.mark.fuzz
def test_a_needle_ends_as_a_proved_program():
    """The balls on both sides of a tip of 0.01 mm graze one another's surface, which is no gouge of 1.6 mm."""
    assert bonecam.convert(cone(4.0, 14.0, 1.5)).report["nc"]["gouge_max_mm"] < Job().path.gouge_tolerance
