"""A ball on surfaces of known offset, on the surface that a program leaves, and on lines of a part."""

import igl
import numpy as np
import pytest

from bonecam.errors import JobError
from bonecam.mesh.distance import MeshDistance
from bonecam.verify.probing import Machined, PostedProgram, back_of, probe_line, probe_surface, touching_centres
from bonecam.workholding.post import Post

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
def ball(revolved):
    return revolved(lambda share, azimuth: 6 * np.sqrt(np.maximum(1 - (2 * share - 1) ** 2, 0)) + 0 * azimuth)


@pytest.fixture(scope="module")
def cylinder(revolved):
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
def test_the_distance_of_the_ball_agrees_with_another_library(offset, pebble, flat):
    part = pebble()
    probed = probe_surface(offset(part, 0.02 * flat, 0.0), probe_line(part, POST, 0.5, 25))
    patches = probed.patches
    squared, *_ = igl.point_mesh_squared_distance(
        probed.centres, np.array(patches.vertices), patches.faces.astype(np.int64)
    )
    assert np.abs(np.sqrt(squared) - probed.radius).max() < 2 * UM


def test_a_ball_stops_at_the_first_thing_on_its_way(mesh_of, pebble):
    mesh = mesh_of(pebble())
    above = np.array([[0.0, 0.0, 37.0], [30.0, 0.0, 37.0]])
    along = np.tile([0.0, 0.0, 1.0], (2, 1))
    centres = touching_centres(MeshDistance(mesh), above, along, 0.5, np.full(2, 20.0), -20.0)
    top = mesh.vertices[:, 2].max()
    assert centres[0, 2] == pytest.approx(top + 0.5, abs=UM)
    assert np.isnan(centres[1]).all(), "it goes past the part"


def test_the_back_is_the_least_hollow_side(revolved):
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


def test_points_are_evenly_spaced_and_clear_of_the_post(pebble):
    line = probe_line(pebble(), POST, 0.5, 50)
    assert np.ptp(np.diff(line.along)) < 1e-9
    assert POST.distance(line.places + 0.5 * line.normals).min() > 0.5


@pytest.mark.parametrize("s", [-0.1, 1.2])
def test_a_line_off_the_part_is_refused_in_a_line(pebble, s):
    with pytest.raises(JobError, match=rf"^line {s} is off the part: give a parameter s from 0 to 1$"):
        probe_line(pebble(), POST, 0.5, 10, s)


def test_too_few_points_and_too_large_a_ball_are_refused_in_a_line(offset, pebble):
    with pytest.raises(JobError, match=r"^1 points make no line: give 2 or more$"):
        probe_line(pebble(), POST, 0.5, 1)
    with pytest.raises(JobError, match=r"^a ball of radius 5 mm: give more than 0 and at most 3$"):
        probe_surface(offset(pebble(), 0.0, 0.0), probe_line(pebble(), POST, 0.5, 5), 5.0)
