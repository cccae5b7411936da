"""The end of a program, and its optional stops: table level, park position, M1; written, read back, refused early.

The comments that tell links from cuts in a program.

The room that a program takes: every move of it counts.
"""

import math
import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from controls import KINDS, PAIRS
from machine_files import CHAINS, axis, machine_text, write_machine
from small_parts import capsule_path, path_of
from tool_paths import THREE_PATHS, TWO_PATHS

from bonecam.errors import JobError, MachineError, ProgramError, VerifyError
from bonecam.job import Job
from bonecam.machine import Machine, read_machine
from bonecam.nc import read_dialect, read_program, write_program
from bonecam.nc.requirements import job_dialect
from bonecam.tool import MoveKind, ToolPath
from bonecam.verify import Tolerances
from bonecam.verify.control import check_limits, check_spindle
from bonecam.verify.readback import compare_moves

CHAIN_KINDS = ("table-table", "head-table", "head-head", "nutating")


@pytest.fixture(scope="module", params=KINDS)
def posted(request):
    machine, dialect = PAIRS[request.param]
    return machine, dialect, write_program(TWO_PATHS, machine, dialect, Job(), comments=["Test (of) a part"])


def test_the_program_counts_what_it_holds(posted):
    machine, dialect, program = posted
    motions = read_program(program.text, machine, dialect)
    assert program.tools == (1, 2)
    assert program.moves == motions.blocks
    assert (~motions.rapid).sum() >= 300
    checked = compare_moves(motions, TWO_PATHS, dialect, Tolerances())
    assert checked.rows == sum(len(path.tips) for path in TWO_PATHS)
    assert (checked.source >= 0).sum() == checked.rows
    assert program.split_moves == (checked.source < -1).sum()


def test_an_older_control_gets_m128_from_its_machine_file(tmp_path):
    machine = read_machine(write_machine(tmp_path, CHAINS["table-table"]))
    text = write_program(TWO_PATHS, machine, read_dialect("heidenhain"), Job()).text
    assert text.count(" M128\n") == 2
    assert text.count(" M129\n") == 4
    assert "FUNCTION TCPM F" not in text


@pytest.mark.parametrize("point", ["tip", "centre"])
def test_the_ball_centre_may_be_programmed_instead_of_the_tip(point, tmp_path):
    text = 'programmed_point = "' + point + '"\n' + CHAINS["table-table"]
    machine, dialect = read_machine(write_machine(tmp_path, text)), read_dialect("heidenhain")
    program = write_program(TWO_PATHS, machine, dialect, Job())
    assert ("PROGRAMMED POINT: BALL CENTRE" in program.text) == (point == "centre")
    compare_moves(read_program(program.text, machine, dialect), TWO_PATHS, dialect, Tolerances())


@pytest.mark.parametrize(
    ("chain", "dialect_name"),
    [*product(CHAIN_KINDS, ("heidenhain", "siemens-840d", "linuxcnc")), ("table-table", "fanuc-30i")],
)
def test_every_chain_is_written_and_read_back(chain, dialect_name, tmp_path):
    machine, dialect = read_machine(write_machine(tmp_path, CHAINS[chain])), read_dialect(dialect_name)
    tilt = np.radians(np.linspace(20, 50, 40))
    axes = np.column_stack([np.sin(tilt) * np.cos(3 * tilt), np.sin(tilt) * np.sin(3 * tilt), np.cos(tilt)])
    tips = np.column_stack([10 * np.cos(3 * tilt), 10 * np.sin(3 * tilt), 50 + np.linspace(0, 5, 40)])
    path = path_of(tips, axes)
    program = write_program([path], machine, dialect, Job())
    checked = compare_moves(read_program(program.text, machine, dialect), [path], dialect, Tolerances())
    assert checked.tip_error.max() < 0.0012
    assert np.degrees(checked.axis_error.max()) < 0.0015


SLANT = np.array([[np.sin(np.radians(120)), 0.0, np.cos(np.radians(120))]])
TALL = path_of(np.column_stack([np.zeros((50, 2)), np.linspace(50, 550, 50)]), np.tile([0, 0, 1.0], (50, 1)))
TILTED = path_of(np.column_stack([np.linspace(0, 1, 5), np.zeros(5), np.full(5, 60.0)]), np.repeat(SLANT, 5, axis=0))
NARROW = CHAINS["table-table"].replace("[X]\ntravel = 4000.0", "[X]\nlimits = [-50.0, 5.0]")
REFUSED = {
    "travel": ([TALL], "", {}, MachineError, r"level 0: Z runs over \d+\.\d mm, travel 450.0 mm of Mikron UCP 600"),
    "limit": (TWO_PATHS, NARROW, {}, MachineError, r"level 5, pass -?\d: X .* leaves the limit (5|-50)\.0 mm"),
    "tilt": ([TILTED], "", {}, MachineError, r"level 0, pass -1, point 0: B -120.000 deg leaves the limit -115.000"),
    "control": (TWO_PATHS, CHAINS["table-table"].replace("M128", "TRAORI"), {}, MachineError, "none of heidenhain's"),
    "name": (TWO_PATHS, "", {"name": "my bone"}, ProgramError, "use letters, digits"),
    "travels only": (TWO_PATHS, "", {"park": "0, 0"}, JobError, "states the travel of X, not its limits"),
    "wrapped": (
        TWO_PATHS,
        CHAINS["table-table"],
        {"controller": "linuxcnc", "endless_words": "wrapped"},
        MachineError,
        "linuxcnc has no blocks that switch the short way",
    ),
    "wound": (
        TWO_PATHS,
        "",
        {"controller": "fanuc-30i", "endless_words": "wound"},
        MachineError,
        "fanuc-30i has no blocks that switch the short way",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_posted_is_refused(case, tmp_path):
    paths, chain, asked, error, told = REFUSED[case]
    machine = read_machine(write_machine(tmp_path, chain)) if chain else read_machine("mikron-ucp600")
    name = {key: asked[key] for key in ("name",) if key in asked}
    job = Job().with_values(nc={key: value for key, value in asked.items() if key != "name"})
    with pytest.raises(error, match=told) as caught:
        write_program(paths, machine, job_dialect(job.nc), job, **name)
    assert case != "travel" or caught.value.evidence["axis"] == "Z"


@pytest.mark.parametrize(
    ("park", "told"),
    [("500, 0", r"X of mikron-ucp600 runs from -400 to 400 mm"), ("0, -401", r"Y of mikron-ucp600 runs from")],
)
def test_a_park_position_outside_the_limits_is_one_line(park, told, machine):
    with pytest.raises(JobError, match=rf"^\[nc\] park = '{park}': {told}"):
        text_of(THREE_PATHS[:1], machine, "heidenhain", park=park)


@pytest.mark.parametrize(("name", "start", "more"), [("heidenhain", "M140 MB MAX", 2), ("fanuc-30i", "G43.4 Z", 1)])
def test_a_rewind_leaves_the_part_before_it_turns_and_starts_anew(name, start, more, tmp_path):
    rotary = {"C": axis([0, 0, 1], [0, 0, 0], -1, -300, 300), "B": axis([0, 1, 0], [0, 0, 0], -1, -100, 0)}
    machine = read_machine(write_machine(tmp_path, machine_text(["C", "B", "XYZ"], rotary)))
    path, dialect = capsule_path(turns=1.4, count=200), read_dialect(name)
    program = write_program([path], machine, dialect, Job())
    assert program.rewinds > 0
    assert program.text.count(start) == program.rewinds + more
    motions = read_program(program.text, machine, dialect)
    compare_moves(motions, [path], dialect, Tolerances())
    assert program.moves == motions.blocks


def test_inverse_time_is_feed_over_length_in_the_part():
    machine, dialect = read_machine("linuxcnc-xyzbc"), read_dialect("linuxcnc")
    motions = read_program(write_program(TWO_PATHS[1:], machine, dialect, Job()).text, machine, dialect)
    steps = np.linalg.norm(np.diff(motions.tips, axis=0), axis=1)
    cut = ~motions.rapid[1:] & (motions.feed_rates[1:] > 0) & (steps > 0.05)
    feed = motions.feed_rates[1:][cut] * steps[cut]
    assert motions.inverse_time[1:][cut].all()
    assert (np.minimum(np.abs(feed - 900), np.abs(feed - 1500)) < 0.5).all()


PARK = {
    "heidenhain": "L X+20.000 Y-30.500 R0 FMAX M91",
    "siemens-840d": "G0 SUPA X20.000 Y-30.500 D0",
    "fanuc-30i": "G53 G00 X20.000 Y-30.500",
    "linuxcnc": "G53 G0 X20.00000 Y-30.50000",
}


@pytest.fixture(scope="module")
def machine():
    """One whose place of the part is known: its linear axes have limits."""
    mikron = read_machine("mikron-ucp600")
    x, y, z = mikron.linear
    return replace(mikron, linear=(*(replace(axis, limits=(-400.0, 400.0)) for axis in (x, y)), z))


def text_of(paths: list[ToolPath], machine: Machine, controller: str, **nc: object) -> str:
    job = Job().with_values(nc={"controller": controller, **nc})
    return write_program(paths, machine, job_dialect(job.nc), job).text


@pytest.mark.parametrize("controller", KINDS)
def test_the_program_ends_with_the_table_level_and_the_spindle_parked(controller, machine):
    text = text_of(THREE_PATHS, machine, controller, table_level=True, park="20, -30.5")
    assert text.count(PARK[controller]) == 1
    motions = read_program(text, machine, job_dialect(Job().with_values(nc={"controller": controller}).nc))
    last = motions.partial[-1]
    assert last.joints[:2] == (20.0, -30.5)
    assert np.isnan(last.joints[2])
    assert [math.remainder(angle, 360.0) for angle in last.joints[3:]] == [0.0, 0.0]
    before = text.split("\n")[last.line - 2]
    assert re.search(r"B\+?0\.0+ C(=DC\()?\+?0\.0+", before)
    check_limits(motions, machine)


@pytest.mark.parametrize("controller", KINDS)
def test_a_text_that_parks_outside_the_limits_or_beside_the_part_is_refused(controller, machine):
    dialect = job_dialect(Job().with_values(nc={"controller": controller}).nc)
    text = text_of(THREE_PATHS[:1], machine, controller, park="20, -30.5")
    beyond = text.replace(PARK[controller], PARK[controller].replace("X20.", "X420.").replace("X+20.", "X+420."))
    with pytest.raises(VerifyError, match=r"^line \d+: X goes to 420.000 mm, its limit is 400 mm"):
        check_limits(read_program(beyond, machine, dialect), machine)
    low = PARK[controller].replace("X", "Z", 1).replace("Y", "Z", 1)
    with pytest.raises(ProgramError, match=r"^line \d+: "):
        read_program(text.replace(PARK[controller], low), machine, dialect)


@pytest.mark.parametrize("controller", ["fanuc-30i", "linuxcnc"])
def test_the_program_ends_at_the_reference_point_of_x_and_y(controller):
    machine = read_machine("mikron-ucp600")
    text = text_of(THREE_PATHS[:1], machine, controller, park="home")
    assert len(re.findall(r"(?m)^(N\d+ )?G28 G91 X0\.? Y0\.?$", text)) == 1
    dialect = job_dialect(Job().with_values(nc={"controller": controller}).nc)
    motions = read_program(text, machine, dialect)
    assert np.isnan(motions.partial[-1].joints[:3]).all()
    assert not motions.partial[-1].retract
    low = re.sub(r"(?m)^((?:N\d+ )?G28 G91 X0\.?) Y0", r"\1 Y5", text)
    with pytest.raises(ProgramError, match=r"^line \d+: in machine coordinates"):
        read_program(low, machine, dialect)


def test_a_park_position_without_a_retract_before_it_is_refused(machine):
    job = Job().with_values(nc={"controller": "linuxcnc", "park": "0, 0"})
    text = write_program(THREE_PATHS[:1], machine, job_dialect(job.nc), job).text
    lines = text.split("\n")
    park = next(at for at, line in enumerate(lines) if line.startswith("G53"))
    retract = next(at for at in reversed(range(park)) if lines[at].startswith("G0 Z"))
    wrong = "\n".join([*lines[:retract], *lines[retract + 1 :]])
    with pytest.raises(ProgramError, match="before a retract"):
        read_program(wrong, machine, job_dialect(job.nc))


@pytest.mark.parametrize("park", ["here", "1", "1, 2, 3", "nan, 0", "1e9, 0"])
def test_what_is_no_park_position_is_told(park):
    with pytest.raises(JobError, match="park = "):
        Job().with_values(nc={"park": park})


def test_an_axis_that_cannot_stand_at_zero_is_not_levelled(machine):
    tilted = tuple(
        replace(axis, limits=(np.radians(-115.0), np.radians(-1.0))) if axis.letter == "B" else axis
        for axis in machine.part_axes
    )
    with pytest.raises(MachineError, match=r"B of .* cannot stand at zero \(-115 to -1 deg\)"):
        text_of(THREE_PATHS[:1], replace(machine, part_axes=tilted), "heidenhain", table_level=True)


@pytest.mark.parametrize(
    ("controller", "where", "stops"),
    [*((name, "level", 2) for name in KINDS), ("heidenhain", "none", 0), ("heidenhain", "tool", 1)],
)
def test_optional_stops_stand_where_the_job_says_and_the_spindle_starts_again(controller, where, stops):
    machine = read_machine("mikron-ucp600")
    text = text_of(THREE_PATHS, machine, controller, optional_stop=where)
    assert len(re.findall(r"(?m)^(?:N?\d+ )?M0?1$", text)) == stops
    dialect = job_dialect(Job().with_values(nc={"controller": controller}).nc)
    check_spindle(read_program(text, machine, dialect), machine, dialect)
    if controller == "heidenhain" and stops:
        first = text.index("M1\n")
        start = text.index("M3\n", first)
        unstarted = text[:start] + "M9\n" + text[start + 3 :]
        with pytest.raises(VerifyError, match="spindle"):
            check_spindle(read_program(unstarted, machine, dialect), machine, dialect)


@pytest.mark.parametrize("controller", ["fanuc-30i", "linuxcnc"])
def test_a_park_position_by_increments_is_refused(controller, machine):
    text = text_of(THREE_PATHS[:1], machine, controller, park="20, -30.5", block_numbers=False)
    dialect = job_dialect(Job().with_values(nc={"controller": controller, "block_numbers": False}).nc)
    read_program(text, machine, dialect)
    moved = re.sub(r"(?m)^(G53 G0+ X20)", r"G91 \1", text)
    assert moved != text
    with pytest.raises(ProgramError, match=r"^line \d+: machine coordinates by increments: switch to absolute"):
        read_program(moved, machine, dialect)


@pytest.mark.parametrize("name", KINDS)
def test_the_text_tells_which_moves_are_links(name):
    machine, dialect = PAIRS[name]
    path = capsule_path(level=0, radius=1.0, number=1, count=150)
    motions = read_program(write_program([path], machine, dialect, Job()).text, machine, dialect)
    source = compare_moves(motions, [path], dialect, Tolerances()).source
    # a move between two rows is of the kind of the later one
    kinds = path.kinds[np.where(source >= 0, source, -2 - source)]
    posted = (source != -1) & ~motions.rapid
    # rapids that the control may bend are written as feeds, and are links
    bent = set() if dialect.straight_rapids else {MoveKind.RAPID}
    assert set(kinds[posted]) == {MoveKind.LINK, MoveKind.CUT} | bent
    assert np.array_equal(motions.links[posted], kinds[posted] != MoveKind.CUT)
    assert not motions.links[motions.rapid].any()


def test_a_text_without_marks_has_no_links():
    machine, dialect = read_machine("linuxcnc-xyzbc"), read_dialect("linuxcnc")
    text = write_program([capsule_path(level=0, radius=1.0, number=1, count=50)], machine, dialect, Job()).text
    bare = text.replace("(LINK)\n", "").replace("(CUT)\n", "")
    with_marks, without = read_program(text, machine, dialect), read_program(bare, machine, dialect)
    assert not without.links.any()
    assert np.array_equal(without.words, with_marks.words)


@pytest.mark.parametrize("name", ["siemens-840d", "heidenhain", "fanuc-30i"])
def test_a_tool_that_starts_over_zero_beyond_a_limit_is_refused(name, tmp_path):
    """The path itself is at X 200 upright, X 0 is beyond the limit of 60."""
    tips = np.column_stack([np.linspace(200.0, 220.0, 9), np.zeros(9), np.full(9, 60.0)])
    path = path_of(tips, np.tile([0.0, 0.0, 1.0], (9, 1)))
    text = CHAINS["head-head"].replace("[X]\ntravel = 4000.0", "[X]\nlimits = [60.0, 400.0]")
    machine = read_machine(write_machine(tmp_path, text))
    with pytest.raises(MachineError, match=r"the start of its tool: X 1\.0 mm leaves the limit 60\.0 mm") as caught:
        write_program([path], machine, read_dialect(name), Job())
    assert caught.value.evidence["axis"] == "X"

    wide = read_machine(write_machine(tmp_path, text.replace("[60.0, 400.0]", "[0.9, 400.0]"), "wide"))
    assert write_program([path], wide, read_dialect(name), Job()).moves


@pytest.mark.parametrize(("name", "axis"), [("mill-4axis", [0.0, -1.0, 0.0]), ("pocket-nc", [0.0, 0.0, 1.0])])
@pytest.mark.parametrize("dialect", ["heidenhain", "siemens-840d", "fanuc-30i", "linuxcnc"])
def test_the_spindle_starts_beside_the_plane_of_a_table_that_stands_on_edge(name, axis, dialect):
    """Over the program's zero a nose of 150 mm would stand across the table: the path is 50 mm from that."""
    tips = np.column_stack([np.zeros(9), np.zeros(9), np.linspace(50.0, 54.0, 9)])
    machine, controller = read_machine(name), read_dialect(dialect)
    long = [replace(one, travel=500.0) for one in machine.linear]
    machine = replace(machine, linear=tuple(long), tool_centre_control="M128")
    text = write_program([path_of(tips, np.tile(axis, (9, 1)))], machine, controller, Job()).text
    motions = read_program(text, machine, controller)
    assert motions.tips[:, 2].min() > 49.0
