"""Limits of rotary axes that wind, travel, and retracts in machine coordinates."""

import re
from dataclasses import replace

import numpy as np
import pytest

from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.verify.control import check_limits

MIKRON = read_machine("mikron-ucp600")
HEIDENHAIN, SIEMENS = read_dialect("heidenhain"), read_dialect("siemens-840d")


@pytest.fixture(scope="module")
def paths(capsule_path):
    return [capsule_path(count=120, turns=3.0)]


def winding(limit_deg):
    """The machine with limits of C."""
    c, b = MIKRON.part_axes
    bounds = (-np.radians(limit_deg), np.radians(limit_deg))
    return replace(MIKRON, part_axes=(replace(c, limits=bounds), b))


@pytest.mark.parametrize("words", ["wrapped", "wound"])
def test_an_axis_that_may_wind_is_held_to_its_limits(paths, words):
    """The helix turns C three times without a break: wrapped words leave open in which turn it begins."""
    job = Job().with_values(nc={"endless_words": words})
    text = write_program(paths, MIKRON, HEIDENHAIN, job).text
    motions = read_program(text, MIKRON, HEIDENHAIN)
    turned = np.degrees(motions.words[:, 4])
    with pytest.raises(VerifyError, match=r"C goes to .* deg, its limit is -?450 deg"):
        check_limits(motions, winding(450.0))
    enough = 360.0 * np.ceil(np.ptp(turned) / 360.0) if words == "wrapped" else np.abs(turned).max() + 0.001
    check_limits(motions, winding(float(enough)))


def test_the_place_that_is_out_of_the_way_is_named_where_a_travel_is_passed(paths):
    text = write_program(paths, MIKRON, HEIDENHAIN, Job()).text
    lines = text.splitlines()
    at = [k for k, line in enumerate(lines) if re.search(r" L X.* C\S+$", line)][7]
    lines[at] = re.sub(r" X\S+", " X-2000.000", lines[at])
    motions = read_program("\n".join(lines) + "\n", MIKRON, HEIDENHAIN)
    with pytest.raises(VerifyError, match=r"runs over \d+\.\d mm in the program, its travel is \d+ mm") as caught:
        check_limits(motions, MIKRON)
    assert caught.value.evidence["line"] in (at + 1, at + 2)


@pytest.mark.parametrize(
    ("limits", "why"),
    [
        ((-900.0, -5.0), "Z goes to 0.000 mm, its limit is -5 mm"),
        ((0.0, 900.0), "the retract to Z 0 of the machine is below the spindle nose"),
    ],
)
def test_a_retract_in_machine_coordinates_stays_within_limits_and_above_all(paths, limits, why):
    motions = read_program(write_program(paths, MIKRON, SIEMENS, Job()).text, MIKRON, SIEMENS)
    x, y, z = MIKRON.linear
    low = -600.0 if limits[1] < 0 else 0.0  # the part stands so low that its cuts are within the limits
    machine = replace(
        MIKRON,
        part_zero=(0.0, 0.0, low),
        part_axes=tuple(replace(axis, pivot=(0.0, 0.0, low)) for axis in MIKRON.part_axes),
        linear=(x, y, replace(z, limits=limits)),
    )
    with pytest.raises(VerifyError, match=re.escape(why)):
        check_limits(motions, machine)
    check_limits(motions, replace(MIKRON, linear=(x, y, replace(z, limits=(-900.0, np.inf)))))
