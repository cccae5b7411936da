"""The force at the middle of a strip, beside an edge that is summed cell by cell."""

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.job.materials.preset import CuttingForce
from bonecam.mechanics.edges import job_strip_force, lighter_cuts, strip_force

FORCE = CuttingForce((631.0, 99.0, 273.0, 13.0, 10.0, 2.8), (0.6, 1.9), "test", scaled=False)


@pytest.mark.parametrize(("radius", "depth", "scallop", "chip"), [(2.0, 0.5, 0.05, 0.1), (1.0, 0.3, 0.1, 0.04)])
def test_the_force_is_the_sum_over_the_engaged_edge(radius, depth, scallop, chip) -> None:
    """A pass beside one that is w away: the edge meets material where the ball is below the surface and outside the
    ball of the pass before."""
    half = np.sqrt(2 * radius * scallop)
    kappa = np.linspace(-np.pi / 2, np.pi / 2, 200001)
    x, z = radius * np.sin(kappa), radius * (1 - np.cos(kappa))
    engaged = (z < depth) & (x > -half)
    edge = radius * np.diff(kappa)[0]
    thick = chip * np.abs(np.sin(kappa[engaged]))
    axes = [(c * thick + e).sum() * edge for c, e in ((631.0, 13.0), (99.0, 10.0), (273.0, 2.8))]
    assert strip_force(FORCE, radius, depth, scallop, chip) == pytest.approx(axes, rel=1e-4)


def test_a_slot_without_scallops_takes_half_of_the_ball() -> None:
    """Half of the ball at a depth of its radius: chips of h R, an edge of pi R / 2."""
    cut = np.array([631.0, 99.0, 273.0]) * 0.1 * 2.0 + np.array([13.0, 10.0, 2.8]) * np.pi
    for depth in (2.0, 5.0):
        assert strip_force(FORCE, 2.0, depth, 0.0, 0.1) == pytest.approx(cut)


def test_wider_scallops_of_deep_roughing_cuts_count() -> None:
    deep = {"levels": {"depths": "0.1 1"}}
    narrow, wide = Job(**deep), Job(levels={"depths": "0.1 1", "scallop_share": 0.2})
    stated = Job(**deep, roughing={"scallop": 0.2})
    for name, ratio in (("roughing", 1.15), ("finishing", 1.0)):
        forces = [job_strip_force(FORCE, job, name) for job in (narrow, wide, stated)]
        assert forces[1] == pytest.approx(forces[2])
        assert forces[1] == pytest.approx(ratio * forces[0], rel=0.05)


def test_shallower_cuts_take_less_and_less_of_the_force_at_the_feed_that_they_have() -> None:
    job = Job(levels={"finishing_depth": 0.3}, finishing={"scallop": 0.1})
    found = lighter_cuts(FORCE, job)
    assert found[0][0].startswith("finishing cuts of 0.15 mm with scallops of 0.05 (levels.finishing_depth")
    shares = [share for _, share in found]
    assert 1 > shares[0] > shares[1] > shares[2] > 0.2
    other = Job(levels={"finishing_depth": 0.15}, finishing={"scallop": 0.05})
    tool = other.tool("finishing")
    by_hand = np.linalg.norm(strip_force(FORCE, tool.radius, 0.15, 0.05, tool.feed / (2 * tool.spindle)))
    assert shares[0] * job_strip_force(FORCE, job, "finishing") == pytest.approx(by_hand)


@pytest.mark.parametrize(
    "levels", [{"depths": "0.3 0.5 1", "finishing_depth": 0.3}, {"depths": "0.3"}, {"schedule": "fewest"}]
)
def test_shallower_cuts_are_those_onto_the_part_of_any_schedule(levels: dict) -> None:
    job = Job(levels=levels, finishing={"scallop": 0.1})
    depth = job.levels.depth_onto(0)
    numbers = Job(levels={"finishing_depth": depth}, finishing={"scallop": 0.1})
    found, wanted = lighter_cuts(FORCE, job), lighter_cuts(FORCE, numbers)
    assert [share for _, share in found] == pytest.approx([share for _, share in wanted])
    assert all("the first of levels.depths" in what for what, _ in found)
    assert found[0][0].startswith(f"finishing cuts of {depth / 2:g} mm")
