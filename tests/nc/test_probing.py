"""The probing program: its words, what it touches, what it refuses; LinuxCNC's interpreter runs it on a bar."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from small_parts import capsule_path

from bonecam.errors import JobError, MachineError
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.nc import write_program
from bonecam.nc.probing import CLEAR, SHORTEST, check_probing, probed_bar, write_probing
from bonecam.nc.requirements import job_dialect
from bonecam.setup import Capsule
from bonecam.setup.stocks.box import Box

GOLDEN = Path(__file__).parents[1] / "golden"
CASES = {
    "heidenhain-mikron": ("mikron-ucp600", "heidenhain"),
    "siemens-mikron": ("mikron-ucp600", "siemens-840d"),
    "fanuc-mikron": ("mikron-ucp600", "fanuc-30i"),
    "makino-mikron": ("mikron-ucp600", "makino"),
    "mitsubishi-mikron": ("mikron-ucp600", "mitsubishi"),
    "linuxcnc-xyzbc": ("linuxcnc-xyzbc", "linuxcnc"),
}
STOCK = Capsule(np.array([0.0, 0.0, 124.0]), np.array([0.0, 0.0, 150.0]), 6.25)
TURNED = {"diameter": 6.0, "length": 117.75, "stub_diameter": 13.0, "stub_length": 15.0}
TURNED |= {"chuck_diameter": 40.0, "chuck_height": 100.0}
JOB = Job().with_values(holding={**TURNED, "neck": "milled"}, nc={"probe": True})


def posted(case, job=JOB):
    machine, controller = CASES[case]
    job = job.with_values(nc={"machine": machine, "controller": controller})
    at, dialect = read_machine(machine), job_dialect(job.nc)
    path = capsule_path(level=5, radius=2.0, offset=1.5, count=60)
    program = write_program([path], at, dialect, job, name="BONE", stock=STOCK)
    return write_probing(program, STOCK, job, at, dialect), dialect


@pytest.mark.parametrize("case", CASES)
def test_the_golden_probing_program_is_still_written(case):
    probing, dialect = posted(case)
    assert probing.name == "BONE_PROBE"
    assert probing.text == (GOLDEN / case / f"probe{dialect.extension}").read_text()


def test_it_writes_the_datum_that_the_program_calls():
    job = JOB.with_values(nc={"work_offset": 3})
    heidenhain, _ = posted("heidenhain-mikron", job)
    assert set(re.findall(r"Q305=(\d+)", heidenhain.text)) == set(re.findall(r"Q339=(\d+)", heidenhain.text)) == {"3"}
    assert "WRITE IN ROW 3 OF" in heidenhain.text
    fanuc, _ = posted("fanuc-mikron", job)
    assert re.findall(r" S(\d)", fanuc.text) == ["3", "3", "3"]
    assert "G56" in fanuc.text
    assert "G54" not in fanuc.text
    siemens, _ = posted("siemens-mikron", job)
    assert re.findall(r"_KNUM=(\d)", siemens.text) == ["3", "3", "3", "0"]
    linuxcnc, _ = posted("linuxcnc-xyzbc", job)
    assert "G10 L2 P3 X0.00000 Y0.00000 Z157.25000 R0\nG56\n" in linuxcnc.text


def test_a_probe_is_put_in_by_hand_where_the_job_says_so():
    by_hand = JOB.with_values(nc={"tool_change": "stop"})
    for case, halt in (("heidenhain-mikron", "TOOL CALL 99 Z S50\n30 M0\n"), ("linuxcnc-xyzbc", "T99 M6\nM0\n")):
        assert halt in posted(case, by_hand)[0].text
        assert halt not in posted(case)[0].text


@pytest.mark.parametrize("neck", ["milled", "turned"])
@pytest.mark.parametrize(("radius", "length"), [(0.5, 30.0), (3.0, 50.0), (3.0, 200.0)])
@pytest.mark.parametrize("chuck", [40.0, 100.0])
def test_the_ball_stays_off_what_clamps_the_bar_and_the_body_off_its_end(neck, radius, length, chuck):
    job = JOB.with_values(
        holding={"neck": neck, "chuck_height": chuck, "stub_length": 115.0 - chuck},
        nc={"probe_radius": radius, "probe_length": length},
    )
    bar = probed_bar(STOCK, job)
    assert bar.lower - radius >= chuck + job.holding.clearance - 1e-9
    assert bar.lower + length >= bar.end + job.holding.clearance - 1e-9
    assert bar.upper - bar.lower >= SHORTEST
    assert bar.upper + radius <= bar.end
    assert bar.radius == (6.5 if neck == "milled" else 6.25)
    # a straight axis that is off by `lean` between the heights is off by the run-out at the lower end of the stock
    down = bar.upper - STOCK.bounds[0, 2]
    assert bar.lean * max(down / (bar.upper - bar.lower), 1.0) == pytest.approx(job.path.gouge_tolerance)


LYING = Box(np.array([-5.0, -5.0, 118.0]), np.array([5.0, 5.0, 150.0]))


@pytest.mark.parametrize(
    ("stock", "values", "why"),
    [
        (STOCK, {"nc": {"part_zero": "table"}}, r"\[nc\] probe = True: .*give nc.part_zero = \"bar\""),
        (STOCK, {"holding": {"neck": "turned", "tailstock": "pin"}}, r"probe = True: the bracket .* leave it out"),
        (LYING, {"holding": {"neck": "turned"}}, r"probe = True: the side of a box is not round: .*'capsule'"),
        (STOCK, {"nc": {"probe_tool": 2}}, r"probe_tool = 2: tools 1 to 2 are cutters: give more"),
        (
            STOCK,
            {"nc": {"probe_length": 12.0}},
            r"probe_length = 12: the side can be touched from 150.2.*longer stylus",
        ),
        (STOCK, {"holding": {"clearance": 45.0}}, r"probe_length = 50: .*from 152.2 to 152.2 .*stands out farther"),
    ],
)
def test_a_bar_that_is_not_probed_is_refused_before_planning_with_the_remedy(stock, values, why):
    job = JOB.with_values(**values)
    with pytest.raises(JobError, match=why):
        check_probing(stock, job, read_machine("mikron-ucp600"))
    check_probing(stock, job.with_values(nc={"probe": False}), read_machine("mikron-ucp600"))


def test_a_machine_on_which_no_bar_stands_upright_at_zero_is_refused():
    with pytest.raises(MachineError, match=r"does not stand along Z of mill-4axis .*leave nc.probe out"):
        check_probing(STOCK, JOB, read_machine("mill-4axis"))


RADIUS = 6.5 + 3.0
"""From the axis of the bar to the middle of the ball that touches it, mm."""


def touched(folder, x=0.0, lean=0.0, end=0.0):
    """What LinuxCNC's interpreter prints where the probe touches a bar whose axis is at `x` at its end and goes off by
    `lean` (mm a mm of height), and which ends `end` mm above where it should."""
    if not shutil.which("rs274"):
        pytest.skip("rs274 (package linuxcnc-uspace) is absent")
    probing, _ = posted("linuxcnc-xyzbc")
    touch = "G38.2 X[0.00000 + #1 * 4.50000] Y[0.00000 + #2 * 4.50000]"
    here = f"G38.2 X[#1 * {RADIUS} + {x} - {lean} * #3] Y[#2 * {RADIUS}]"
    text = probing.text
    assert touch in text
    text = text.replace(touch, here).replace("G38.2 Z-5.00000", f"G38.2 Z{end}")
    (folder / "probe.ngc").write_text(text)
    (folder / "tool.tbl").write_text("T99 P99 Z3.0 D0.1\n")
    call = ["rs274", "-g", "-t", "tool.tbl", "probe.ngc"]
    return subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


def test_linuxcnc_runs_it_on_a_bar_that_stands_right(tmp_path):
    done = touched(tmp_path, x=0.005, lean=1e-4, end=1.0)
    assert done.returncode == 0, done.stderr
    assert "PROGRAM_END()" in done.stdout
    assert "SET_G5X_OFFSET(1, 0.0000, 0.0000, 157.2500" in done.stdout
    assert len(re.findall("STRAIGHT_PROBE", done.stdout)) == 1 + 2 * 4
    (told,) = re.findall(r"LEAN ([\d.]+) OFF ([\d.]+) END ([\d.]+)", done.stdout)
    assert [float(value) for value in told] == pytest.approx([40 * 1e-4, 0.005 + 8e-4, 1.0], abs=1e-6)


@pytest.mark.parametrize(
    ("bar", "why"),
    [
        ({"lean": 3e-4}, "THE BAR LEANS BY 0.012"),
        ({"x": -0.02}, "THE AXIS OF THE BAR IS OFF BY 0.02"),
        ({"end": 6.0}, "THE END OF THE BAR IS OFF BY 6"),
    ],
)
def test_linuxcnc_stops_at_a_bar_that_leans_or_stands_elsewhere(bar, why, tmp_path):
    done = touched(tmp_path, **bar)
    assert why in done.stderr
    assert "PROGRAM_END()" not in done.stdout


def test_below_the_clearance_height_the_probe_goes_down_and_up_beside_the_bar_alone(tmp_path):
    done = touched(tmp_path)
    moves = re.findall(r"STRAIGHT_(TRAVERSE|FEED|PROBE)\(([^)]*)\)", done.stdout)
    at = np.array([[float(value) for value in words.split(",")[:3]] for _, words in moves])
    low = np.minimum(at[1:, 2], at[:-1, 2]) < CLEAR - 1e-6
    moved = np.hypot(*np.diff(at[:, :2], axis=0).T) > 1e-6
    rapid = np.array([kind == "TRAVERSE" for kind, _ in moves[1:]])
    probes = np.array([kind == "PROBE" for kind, _ in moves[1:]])
    assert not (low & moved & rapid).any()
    # down and up beside the bar, 5 mm off, but for the touch of its end
    beside = low & ~moved
    distance = np.hypot(at[1:, 0], at[1:, 1])[beside] - RADIUS
    assert np.sort(distance)[:2] == pytest.approx([-RADIUS, -RADIUS])
    assert np.sort(distance)[2:].min() >= 5.0 - 1e-6
    assert probes.sum() == 9
    clamped = 100.0 - 157.25
    assert at[:, 2].min() >= clamped + JOB.holding.clearance
