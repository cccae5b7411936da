"""A bull nose whose heel digs into the part is refused by the simulation, as deep as its profile tells."""

import numpy as np
import pytest

from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting.write import write_program
from bonecam.tool.cutter import Cutter
from bonecam.tool.mill import Mill
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.tool.profiles import bull
from bonecam.verify.removal.result import Removal
from bonecam.verify.removal.simulate import simulate_removal
from bonecam.verify.removal.sweeping import Accuracy
from bonecam.verify.removal.verdicts import check_removal
from bonecam.workholding.post import Post

pytestmark = pytest.mark.whole

PAIR = read_machine("mikron-ucp600"), read_dialect("heidenhain")
JOB = Job().with_values(roughing={"shape": "bull", "lead_deg": 30.0, "flute_length": 12.0, "overhang": 40.0})
CUTTER = Cutter.from_job(1, "roughing", JOB.tool("roughing"))
FLAT = CUTTER.radius - CUTTER.corner_radius


@pytest.fixture(scope="module")
def ring(path_of, pebble):
    """Makes a ring about the pebble's middle that a corner of the bull nose follows, on the side to which the tool
    leans from the normal (1), or on the other, where its heel is the lowest (-1)."""

    def build(side: int) -> ToolPath:
        part, count = pebble(), 120
        s, t = np.linspace(0, 1, count, endpoint=False), np.full(count, 0.5)
        contacts, normals = part.positions(s, t), part.normals(s, t)
        up = np.array([0.0, 0.0, 1.0]) - normals[:, 2:] * normals
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        axes = np.cos(CUTTER.lead) * normals + np.sin(CUTTER.lead) * up
        across = side * (np.cos(CUTTER.lead) * up - np.sin(CUTTER.lead) * normals)
        tips = contacts + CUTTER.corner_radius * (normals - axes) - FLAT * across
        ends = tips[[0, -1]] + 15 * axes[[0, -1]]
        kinds = [MoveKind.RAPID, *[MoveKind.CUT] * count, MoveKind.LINK]
        return path_of(
            np.vstack([ends[:1], tips, ends[1:]]),
            np.vstack([axes[:1], axes, axes[-1:]]),
            kinds=np.array(kinds, dtype=np.int64),
            tool=CUTTER,
        )

    return build


@pytest.fixture(scope="module")
def simulated(ring, pebble, upright_capsule):
    def run(side: int) -> Removal:
        text = write_program([ring(side)], *PAIR, JOB).text
        given = (upright_capsule, Post(1.0, 32.0), [CUTTER])
        return simulate_removal(text, *PAIR, *given, part=pebble(), accuracy=Accuracy(0.1))

    return run


def deepest_by_profile(path: ToolPath, part) -> float:
    """How deep the profile of the cutter goes into the part at most, along its normals, mm."""
    mill = Mill(bull(CUTTER.radius, CUTTER.corner_radius), CUTTER.flute_length, CUTTER.shank_diameter, 40.0)
    s, t = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 60), np.linspace(0.2, 0.8, 121)))
    points, normals = part.positions(s, t), part.normals(s, t)
    depths = np.linspace(0.0, 3.0, 301)
    deepest = 0.0
    for tip, axis in list(zip(path.tips, path.axes))[1:-1:10]:
        touched = mill.distances(points, tip, axis) < 0
        along = points[touched, None] - depths[:, None] * normals[touched, None]
        inside = mill.distances(along.reshape(-1, 3), tip, axis).reshape(along.shape[:2]) < 0
        # only what is cut from the surface on counts
        deepest = max(deepest, float(depths[np.cumprod(inside, axis=1).sum(axis=1) - 1].max(initial=0.0)))
    return deepest


def test_a_corner_that_leads_cuts_down_to_the_part_and_no_deeper(simulated) -> None:
    found = simulated(1)
    assert found.left.deepest_gouge.value < 0.01
    check_removal(found)
    assert found.levels[0].removed > 50.0


def test_a_heel_that_digs_in_is_refused_as_deep_as_the_profile_tells(simulated, ring, pebble) -> None:
    found = simulated(-1)
    deepest = found.left.deepest_gouge
    expected = deepest_by_profile(ring(-1), pebble())
    assert expected > 0.3
    assert deepest.value == pytest.approx(expected, rel=0.05)
    with pytest.raises(VerifyError, match=rf"line {deepest.line}: .* mm into the part"):
        check_removal(found)
