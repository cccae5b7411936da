"""Feeds by the force: a program round a bar that lies off its axis is posted again, and its peaks are lower.

A part that stands on a neck has depths of cuts that this bears, or is refused before it is planned.
"""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from small_parts import capsule_path

from bonecam.errors import BonecamError, JobError, VerifyError
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.machining import check_force_asked, check_one_feed, feed_report, paths_by_force, stand_part
from bonecam.mechanics.loads import Workpiece, mechanics_of_job
from bonecam.nc import drivable_paths, read_dialect, read_program, write_program
from bonecam.nc.feeds import fastest_cut
from bonecam.progress import silent
from bonecam.runtime.timing import StageTimes
from bonecam.setup import Capsule
from bonecam.tool import MoveKind
from bonecam.verify import Accuracy, simulate_removal
from bonecam.verify.control import check_feeds_of_job
from bonecam.workholding import Post

MACHINE, DIALECT = read_machine("mikron-ucp600"), read_dialect("heidenhain")
JOB = Job(path={"feed": "force"}, nc={"plunge_feed": 100.0})
POST = Post(2.0, 43.0)
FEED = 150.0
OFF = np.array([0.35, 0.0, 0.0])


def simulated(paths):
    """The text of paths, and what it removes of a bar 0.4 mm thicker than the part and off its axis."""
    text = write_program(paths, MACHINE, DIALECT, JOB).text
    stock = Capsule(np.array([0.0, 0, 45.0]) + OFF, np.array([0.0, 0, 65.0]) + OFF, 5.4)
    work = Workpiece("test", *mechanics_of_job(JOB), POST, 0.0)
    cutters = [path.cutter for path in paths]
    removal = simulate_removal(text, MACHINE, DIALECT, stock, POST, cutters, accuracy=Accuracy(0.15), workpiece=work)
    return text, removal


@pytest.fixture(scope="module")
def posted():
    """The program at one feed, the one by the force, and what both remove."""
    constant = replace(JOB, path=replace(JOB.path, feed="constant"))
    slow = capsule_path(radius=2.0, turns=8.0, count=400)
    # below what the axes can, so that all that changes is the force
    cutter = replace(slow.cutter, spindle=1500.0, feed=FEED)
    cuts = slow.kinds == MoveKind.CUT
    planned = [replace(slow, cutter=cutter, feed_rates=np.where(cuts, FEED, slow.feed_rates))]
    paths = drivable_paths(planned, MACHINE, DIALECT, constant)
    text, before = simulated(paths)
    scheduled, schedule = paths_by_force(paths, text, before, MACHINE, DIALECT, JOB)
    made = drivable_paths(scheduled, MACHINE, DIALECT, JOB)
    again, after = simulated(made)
    told = feed_report(schedule, before, 1.0, after, 2.0)
    return SimpleNamespace(paths=paths, scheduled=scheduled[0], made=made, text=again, told=told)


def test_the_highest_peaks_are_lower_and_most_of_the_time_is_at_the_target(posted):
    (cutter,) = posted.told["cutters"]
    (before, after), target = cutter["peak_p95_n"], cutter["target_n"]
    assert before > 1.15 * target
    assert after == pytest.approx(target, rel=0.08)


def test_no_feed_rubs_or_takes_a_larger_chip_and_they_are_few(posted):
    (one,), (path,) = posted.made, posted.paths
    cuts = path.kinds == MoveKind.CUT
    feeds = one.feed_rates[cuts]
    assert feeds.max() > 1.2 * FEED
    assert feeds.max() <= fastest_cut(one.cutter, JOB) + 1
    assert 0.5 * FEED <= feeds.min() < 0.9 * FEED
    changed = posted.scheduled.feed_rates != path.feed_rates
    assert changed[cuts].mean() > 0.5
    assert len(np.unique(posted.scheduled.feed_rates[changed])) <= 8
    assert np.array_equal(one.feed_rates[~cuts], path.feed_rates[~cuts])


def test_the_control_takes_them_and_refuses_them_where_the_job_has_one_feed(posted):
    motions = read_program(posted.text, MACHINE, DIALECT)
    cutters = {1: posted.made[0].cutter}
    check_feeds_of_job(motions, DIALECT, JOB, cutters)
    with pytest.raises(VerifyError, match="the job allows 150 for ball"):
        check_feeds_of_job(motions, DIALECT, Job(nc={"plunge_feed": 100.0}), cutters)


def test_a_force_that_is_not_asked_gives_no_feeds():
    with pytest.raises(JobError, match=r"\[path\] feed = 'force'.*leave out --no-simulation"):
        check_force_asked(JOB, asked=False)
    check_force_asked(Job(), asked=False)
    with pytest.raises(JobError, match="has one feed: leave it out"):
        check_one_feed(JOB, "a surface that is finished alone has one feed")


PHALANX = Path(__file__).parents[1] / "meshes/phalanx.ply"
HELD = {
    "diameter": 6.0,
    "length": 118.0,
    "chuck_diameter": 28.0,
    "chuck_height": 100.0,
    "stub_diameter": 13.0,
    "stub_length": 15.0,
}


@pytest.mark.whole
@pytest.mark.parametrize(
    ("job", "found"),
    [
        (Job(), True),
        (Job(levels={"finishing_levels": 2}), False),
        (Job(holding=HELD), True),
        (Job(holding=HELD, levels={"depths": "found"}), True),
    ],
)
def test_depths_are_found_where_they_are_left_open_whoever_chose_the_neck(job, found):
    standing = stand_part(PHALANX, job, read_machine(job.nc.machine), StageTimes(), silent)
    assert ("depths_found" in standing.post) == found
    levels = standing.job.levels
    if found:
        assert list(levels.listed) == standing.post["depths_found"] == sorted(levels.listed)
        assert levels.listed[0] == job.levels.finishing_depth < levels.listed[-1]
        assert levels.scallop_share > 0
    else:
        assert levels == job.levels


@pytest.mark.whole
def test_a_neck_that_breaks_is_refused_with_one_that_is_found_for_a_remedy():
    thin = Job(holding=HELD | {"diameter": 2.0})
    with pytest.raises(BonecamError, match=r"the neck does not hold.*2 x 3 mm.*holding\.diameter = 0"):
        stand_part(PHALANX, thin, read_machine(thin.nc.machine), StageTimes(), silent)
