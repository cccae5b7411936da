"""A program on a pebble as it was simulated.

A ball on surfaces of known offset, on the surface that a program leaves, and on lines of a part.

The surface that a program leaves at any place is that of the simulation's own normal probes.

Measuring programs: their points, their deviations as the control reckons them, and what is left out.

Ra and Rz of arcs in closed form, and the feed marks of a program.
"""

import re
from dataclasses import replace

import igl
import numpy as np
import pytest
from bonecam_plugins.study.probing import (
    CONTROLLERS,
    CUT_OFF,
    NODE,
    SAMPLING,
    Machined,
    PostedProgram,
    _ra_rz,
    back_of,
    measuring_program,
    probe_line,
    probe_surface,
    roughness_of,
    touching_centres,
)
from small_parts import FINISHING_CUTTER, ROUGHING_CUTTER, UPRIGHT_CAPSULE, mesh_of, path_of, pebble, revolved

from bonecam.errors import JobError, MachineError
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.mesh import MeshDistance
from bonecam.nc import read_dialect, write_program
from bonecam.tool import MoveKind
from bonecam.verify import Accuracy, simulate_removal
from bonecam.workholding import Post

PAIR = read_machine("mikron-ucp600"), read_dialect("heidenhain")


@pytest.fixture(scope="session")
def posted():
    """Rings 0.3 mm apart round the middle of a pebble, the axis along the normal but for a lean upwards."""
    part = pebble()
    tool = replace(FINISHING_CUTTER, flute_length=8.0)
    rows = []
    for t in np.linspace(0.62, 0.4, 12):
        s = np.linspace(0, 1, 121)
        points, normals = part.positions(s, np.full(121, t)), part.normals(s, np.full(121, t))
        up = np.array([0.0, 0.0, 1.0]) - normals[:, 2:] * normals
        axes = np.cos(0.5) * normals + np.sin(0.5) * up / np.linalg.norm(up, axis=1, keepdims=True)
        rows += list(zip(points + tool.radius * (normals - axes), axes, [MoveKind.CUT] * 121))
    (tip, axis, _), (last, lean, _) = rows[0], rows[-1]
    rows = [(tip + 12 * axis, axis, MoveKind.RAPID), *rows, (last + 12 * lean, lean, MoveKind.LINK)]
    tips, axes, kinds = (np.array(column) for column in zip(*rows))
    path = path_of(tips, axes, kinds=kinds.astype(np.int64), tool=tool, level=0)
    text = write_program([path], *PAIR, Job()).text
    cutters = (ROUGHING_CUTTER, tool)
    post = Post(1.0, 32.0)
    removal = simulate_removal(text, *PAIR, UPRIGHT_CAPSULE, post, cutters, part=part, accuracy=Accuracy(0.2))
    return PostedProgram(text, *PAIR, cutters, part, removal)


POST = Post(1.0, 32.0)
UM = 1e-3


@pytest.fixture(scope="module")
def offset(posted):
    """Makes in place of a program one that leaves a part by an offset, and by another where it bends, mm."""

    def build(part, cut, bent):
        class Offset(PostedProgram):
            def machined(self, places):
                s, t = part.project(places).parameters.T
                heights, moves = np.full(len(s), cut), np.zeros(len(s), dtype=np.int64)
                return Machined(part.positions(s, t), part.normals(s, t), heights, heights + bent, moves)

        return Offset(posted.text, posted.machine, posted.dialect, posted.cutters, part, posted.removal)

    return build


@pytest.fixture(scope="module")
def ball():
    return revolved(lambda share, azimuth: 6 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 2, 0)) + 0 * azimuth)


@pytest.fixture(scope="module")
def cylinder():
    return revolved(lambda share, azimuth: 4.0 + 0 * share * azimuth)


@pytest.mark.parametrize("shape", ["ball", "cylinder"])
@pytest.mark.parametrize(("cut", "bent"), [(0.02, 0.03), (-0.01, 0.0)])
def test_a_known_offset_comes_back_within_a_micrometre(request, offset, shape, cut, bent):
    part = request.getfixturevalue(shape)
    line = probe_line(part, POST, 0.5, 30, 0.3)
    smooth = np.abs(line.normals[:, 2]) < 0.95
    probed = probe_surface(offset(part, cut, bent), line)
    assert np.abs(probed.rigid - cut)[smooth].max() < UM
    assert np.abs(probed.deviation - cut - bent)[smooth].max() < UM


@pytest.mark.parametrize("flat", [0.0, 1.0])
def test_the_distance_of_the_ball_agrees_with_another_library(offset, flat):
    part = pebble()
    probed = probe_surface(offset(part, 0.02 * flat, 0.0), probe_line(part, POST, 0.5, 25))
    patches = probed.patches
    squared, *_ = igl.point_mesh_squared_distance(
        probed.centres, np.array(patches.vertices), patches.faces.astype(np.int64)
    )
    assert np.abs(np.sqrt(squared) - probed.radius).max() < 2 * UM


def test_a_ball_stops_at_the_first_thing_on_its_way():
    mesh = mesh_of(pebble())
    above = np.array([[0.0, 0.0, 37.0], [30.0, 0.0, 37.0]])
    along = np.tile([0.0, 0.0, 1.0], (2, 1))
    centres = touching_centres(MeshDistance(mesh), above, along, 0.5, np.full(2, 20.0), -20.0)
    top = mesh.vertices[:, 2].max()
    assert centres[0, 2] == pytest.approx(top + 0.5, abs=UM)
    assert np.isnan(centres[1]).all(), "it goes past the part"


def test_the_back_is_the_least_hollow_side():
    hollow = 0.25
    part = revolved(
        lambda share, azimuth: (
            3.0
            + np.sin(np.pi * share)
            - 1.5 * np.exp(-(((share - 0.5) / 0.15) ** 2)) * np.maximum(np.cos(azimuth - 2 * np.pi * hollow), 0)
        ),
        rows=20,
    )
    away = abs((back_of(part) - hollow + 0.5) % 1.0 - 0.5)
    assert away > 0.2


def test_points_are_evenly_spaced_and_clear_of_the_post():
    line = probe_line(pebble(), POST, 0.5, 50)
    assert np.ptp(np.diff(line.along)) < 1e-9
    assert POST.distance(line.places + 0.5 * line.normals).min() > 0.5


@pytest.mark.parametrize("s", [-0.1, 1.2])
def test_a_line_off_the_part_is_refused_in_a_line(s):
    with pytest.raises(JobError, match=rf"^line {s} is off the part: give a parameter s from 0 to 1$"):
        probe_line(pebble(), POST, 0.5, 10, s)


def test_too_few_points_and_too_large_a_ball_are_refused_in_a_line(offset):
    with pytest.raises(JobError, match=r"^1 points make no line: give 2 or more$"):
        probe_line(pebble(), POST, 0.5, 1)
    with pytest.raises(JobError, match=r"^a ball of radius 5 mm: give more than 0 and at most 3$"):
        probe_surface(offset(pebble(), 0.0, 0.0), probe_line(pebble(), POST, 0.5, 5), 5.0)


def test_places_of_the_simulation_come_out_as_it_tells_them(posted):
    probes = posted.removal.remaining.normal_probes
    some = np.flatnonzero(probes.owners >= 0)[::40]
    found = posted.machined(probes.points[some])
    assert np.abs(found.points - probes.points[some]).max() < 1e-6
    assert np.abs(found.cut - probes.heights[some]).max() < 1e-5
    assert (found.owners == probes.owners[some]).mean() > 0.95, "two moves that cut as deep may change places"
    assert (found.kept == found.cut).all(), "bending was not asked"


def test_what_no_ball_came_near_stands_as_the_rays_tell(posted):
    top = posted.part.positions(np.zeros(1), np.array([0.97]))
    found = posted.machined(top)
    assert found.owners[0] < 0
    assert found.cut[0] > 0.3


@pytest.fixture(scope="module")
def part():
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


@pytest.mark.parametrize(("pitch", "radius"), [(0.1, 1.0), (0.08, 2.0)])
def test_arcs_have_the_roughness_of_the_closed_form(pitch, radius):
    x = np.arange(0, SAMPLING * CUT_OFF, NODE / 10)
    arcs = (np.mod(x / pitch, 1.0) - 0.5) ** 2 * pitch**2 / (2 * radius) + 0.3 * x - 2.0
    ra, rz = _ra_rz(arcs[None])[0]
    assert rz == pytest.approx(1000 * pitch**2 / (8 * radius), rel=0.02)
    assert ra == pytest.approx(1000 * pitch**2 / (18 * np.sqrt(3) * radius), rel=0.02)


def test_feed_marks_follow_from_the_feed_per_tooth(posted):
    found, more = (roughness_of(posted, flutes, 20) for flutes in (2, 4))
    tip = 900.0 / 4500.0 / 2
    assert np.median(more.marks) == pytest.approx(np.median(found.marks) / 4)
    # the contact is a ball's radius off the tip, nearer to the part: it goes at up to its share of the feed
    assert 0.3 * tip**2 / 8 < np.median(found.marks) / 1000 < 2.0 * tip**2 / 8 * (1 + 1 / 3.6)
    assert (found.along[:, 1] > 0.9 * found.marks).all()
