"""A bull nose or flat end whose heel digs into the part is refused by the simulation, as deep as its profile tells."""

import numpy as np
import pytest
from mill import Mill, bull, flat

from bonecam.errors import VerifyError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting import write_program
from bonecam.tool.cutter import Cutter
from bonecam.tool.path import MoveKind, ToolPath
from bonecam.verify.findings import Removal
from bonecam.verify.removal import check_removal, simulate_removal
from bonecam.verify.sweeping import Accuracy
from bonecam.workholding.post import Post

pytestmark = pytest.mark.whole

PAIR = read_machine("mikron-ucp600"), read_dialect("heidenhain")
LONG = {"lead_deg": 30.0, "flute_length": 12.0, "overhang": 40.0}
PROFILES = {"bull": bull(2.0, 0.5), "flat": flat(2.0)}


@pytest.fixture(scope="module", params=PROFILES)
def job(request) -> Job:
    return Job().with_values(roughing={"shape": request.param, **LONG})


@pytest.fixture(scope="module")
def cutter(job) -> Cutter:
    return Cutter.from_job(1, "roughing", job.tool("roughing"))


@pytest.fixture(scope="module")
def ring(path_of, pebble, cutter):
    """Makes a ring about the pebble's middle that the corner of the cutter follows, on the side to which the tool
    leans from the normal (1), or on the other, where its heel is the lowest (-1)."""

    def build(side: int) -> ToolPath:
        part, count = pebble(), 120
        s, t = np.linspace(0, 1, count, endpoint=False), np.full(count, 0.5)
        contacts, normals = part.positions(s, t), part.normals(s, t)
        up = np.array([0.0, 0.0, 1.0]) - normals[:, 2:] * normals
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        axes = np.cos(cutter.lead) * normals + np.sin(cutter.lead) * up
        across = side * (np.cos(cutter.lead) * up - np.sin(cutter.lead) * normals)
        tips = contacts + cutter.corner * (normals - axes) - (cutter.radius - cutter.corner) * across
        ends = tips[[0, -1]] + 15 * axes[[0, -1]]
        kinds = [MoveKind.RAPID, *[MoveKind.CUT] * count, MoveKind.LINK]
        return path_of(
            np.vstack([ends[:1], tips, ends[1:]]),
            np.vstack([axes[:1], axes, axes[-1:]]),
            kinds=np.array(kinds, dtype=np.int64),
            tool=cutter,
        )

    return build


@pytest.fixture(scope="module")
def simulated(ring, pebble, upright_capsule, job, cutter):
    def run(side: int) -> Removal:
        text = write_program([ring(side)], *PAIR, job).text
        given = (upright_capsule, Post(1.0, 32.0), [cutter])
        return simulate_removal(text, *PAIR, *given, part=pebble(), accuracy=Accuracy(0.1))

    return run


def deepest_by_profile(path: ToolPath, part, shape: str) -> float:
    """How deep a place of the part lies in the cutter at most, mm."""
    mill = Mill(PROFILES[shape], path.cutter.flute_length, path.cutter.shank_diameter, 40.0)
    s, t = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 120), np.linspace(0.2, 0.8, 241)))
    points = part.positions(s, t)
    poses = list(zip(path.tips, path.axes))[1:-1:10]
    return -min(float(mill.distances(points, tip, axis).min()) for tip, axis in poses)


def test_a_corner_that_leads_cuts_down_to_the_part_and_no_deeper(simulated) -> None:
    found = simulated(1)
    assert found.left.deepest_gouge.value < 0.01
    check_removal(found)
    assert found.levels[0].removed > 50.0


def test_a_heel_that_digs_in_is_refused_as_deep_as_the_profile_tells(simulated, ring, pebble, job) -> None:
    found = simulated(-1)
    deepest = found.left.deepest_gouge
    expected = deepest_by_profile(ring(-1), pebble(), job.roughing.shape)
    assert expected > 0.3
    assert deepest.value == pytest.approx(expected, rel=0.05)
    with pytest.raises(VerifyError, match=rf"line {deepest.line}: .* mm into the part"):
        check_removal(found)
