"""Measuring programs: their points, their deviations as the control reckons them, and what is left out."""

import re

import numpy as np
import pytest

from bonecam.errors import MachineError
from bonecam.mesh.distance import MeshDistance
from bonecam.verify.probing import CONTROLLERS, measuring_program, probe_line, probe_surface
from bonecam.workholding.post import Post


@pytest.fixture(scope="module")
def part(mesh_of, pebble):
    return MeshDistance(mesh_of(pebble()))


@pytest.fixture(scope="module")
def probed(posted):
    return probe_surface(posted, probe_line(posted.part, Post(1.0, 32.0), 0.5, 20, 0.1))


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_it_says_that_it_is_unproved_and_leaves_out_what_the_stem_meets(probed, part, controller):
    text = measuring_program(probed.line, probed.radius, part, controller)
    assert "UNPROVED" in text
    told = re.search(r"(\d+) OF 20 POINTS", text)
    below = probed.line.normals[:, 2] < -0.3
    assert 5 < int(told[1]) <= 20 - below.sum()
    touches = re.findall(r"TCH PROBE 4\.0|MEAS=1|G31 ", text)
    assert len(touches) == int(told[1])


def test_the_control_reckons_the_deviation_that_the_simulation_tells(probed, part):
    text = measuring_program(probed.line, probed.radius, part, "heidenhain")
    formulas = re.findall(r"Q(\d+) = (.*)", text)
    assert formulas
    for number, formula in formulas:
        k = int(number) - 1600
        for name, value in zip(("Q1", "Q2", "Q3"), probed.centres[k], strict=True):
            formula = re.sub(rf"\b{name}\b", f"({value:.9f})", formula)
        along = (probed.centres[k] - probed.line.places[k]) @ probed.line.normals[k] - probed.radius
        assert eval(formula) == pytest.approx(along, abs=1e-4)
        assert along == pytest.approx(probed.deviation[k], abs=2e-3)


@pytest.mark.parametrize("controller", ["siemens-840d", "fanuc-30i"])
def test_an_approach_goes_along_the_normal_through_the_nominal_point(probed, part, controller):
    text = measuring_program(probed.line, probed.radius, part, controller)
    word = "MEAS=1 G1" if controller == "siemens-840d" else "G31"
    ends = [[float(v) for v in row] for row in re.findall(rf"{word} X(\S+) Y(\S+) Z(\S+) F", text)]
    beyond = np.array(ends)[:, None] - probed.line.places
    along = (beyond * probed.line.normals).sum(2)
    off = np.linalg.norm(beyond - along[..., None] * probed.line.normals, axis=2)
    assert off.min(axis=1).max() < 2e-3
    assert np.take_along_axis(along, off.argmin(axis=1)[:, None], 1) == pytest.approx(-0.5, abs=2e-3)


def test_a_controller_without_probe_words_is_refused(probed, part):
    with pytest.raises(MachineError, match="no measuring program is known for linuxcnc: take one of heidenhain"):
        measuring_program(probed.line, probed.radius, part, "linuxcnc")
