import re

import numpy as np
import pytest

from bonecam.errors import MachineError, ProgramError
from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import dialect_names, read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program
from bonecam.nc.words import plain_text
from bonecam.verify.readback import Tolerances, compare_moves

MACHINE_OF = dict.fromkeys(dialect_names(), "mikron-ucp600") | {"linuxcnc": "linuxcnc-xyzbc"}
CHAIN_KINDS = ("table-table", "head-table", "head-head", "nutating")


@pytest.fixture(params=dialect_names())
def posted(paths, request):
    machine, dialect = read_machine(MACHINE_OF[request.param]), read_dialect(request.param)
    return machine, dialect, write_program(paths, machine, dialect, Job(), comments=["Test (of) a part"])


def test_two_writes_give_the_same_bytes(paths, posted):
    machine, dialect, program = posted
    again = write_program(paths, machine, dialect, Job(), comments=["Test (of) a part"])
    assert again.text.encode() == program.text.encode()


def test_the_text_is_plain_ascii_without_exponents_or_negative_zeros(posted):
    text = posted[2].text
    assert text.isascii()
    assert text.endswith("\n")
    assert "\r" not in text
    assert not re.search(r"\d[eE][-+]?\d|-0\.0+\b|nan|inf", re.sub(r"[(;].*", "", text))


def test_the_program_counts_what_it_holds(paths, posted):
    machine, dialect, program = posted
    motions = read_program(program.text, machine, dialect)
    assert program.tools == (1, 2)
    assert program.moves == motions.blocks
    assert (~motions.rapid).sum() >= 300
    checked = compare_moves(motions, paths, dialect, Tolerances())
    assert checked.rows == sum(len(path.tips) for path in paths)
    assert (checked.source >= 0).sum() == checked.rows
    assert program.split_moves == (checked.source < -1).sum()


def test_the_header_says_which_point_is_programmed_and_what_the_tools_are(posted):
    _, dialect, program = posted
    head = program.text
    assert plain_text("Programmed point: tool tip", dialect.comment_characters) in head
    assert "TOOL 1 BALL RADIUS 2.0000 LENGTH 75.0000" in head
    assert plain_text("Test (of) a part", dialect.comment_characters) in head


def test_heidenhain_blocks_are_numbered_from_zero_without_gaps(paths):
    machine, dialect = read_machine("mikron-ucp600"), read_dialect("heidenhain")
    program = write_program(paths, machine, dialect, Job())
    lines = program.text.splitlines()
    numbers = [int(line.split()[0]) for line in lines if not line.startswith("  Q339")]
    assert numbers == list(range(program.blocks))
    assert lines[0] == "0 BEGIN PGM BONE MM"
    assert lines[-1] == f"{program.blocks - 1} END PGM BONE MM"
    text = program.text
    assert len(re.findall(r"TOOL CALL \d Z S12000", text)) == 2
    assert text.count("FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS") == 2
    assert text.count("FUNCTION RESET TCPM") == 4
    assert "CYCL DEF 32.1 T+0.005" in text
    assert "CYCL DEF 32.1 T+0.020" in text
    assert "CYCL DEF 32.2 HSC-MODE:1 TA0.572" in text
    assert "CYCL DEF 32.2 HSC-MODE:0 TA0.229" in text
    moves = [line for line in lines if re.match(r"\d+ L [XB]", line)]
    assert all(re.fullmatch(r"\d+ L( [XYZBC][+-]\d+\.\d{3})+( R0)?( FMAX| F\d+)?", line) for line in moves)


def test_an_older_control_gets_m128_from_its_machine_file(write_machine, chains, paths, tmp_path):
    machine = read_machine(write_machine(tmp_path, chains["table-table"]))
    text = write_program(paths, machine, read_dialect("heidenhain"), Job()).text
    assert text.count(" M128\n") == 2
    assert text.count(" M129\n") == 4
    assert "FUNCTION TCPM F" not in text


def test_a_machine_must_name_a_tool_centre_control_of_the_dialect(chains, paths, write_machine, tmp_path):
    text = chains["table-table"].replace("M128", "TRAORI")
    with pytest.raises(MachineError, match="'TRAORI' is none of heidenhain's"):
        write_program(paths, read_machine(write_machine(tmp_path, text)), read_dialect("heidenhain"), Job())


@pytest.mark.parametrize("point", ["tip", "centre"])
def test_the_ball_centre_may_be_programmed_instead_of_the_tip(chains, write_machine, paths, point, tmp_path):
    text = 'programmed_point = "' + point + '"\n' + chains["table-table"]
    machine, dialect = read_machine(write_machine(tmp_path, text)), read_dialect("heidenhain")
    program = write_program(paths, machine, dialect, Job())
    assert ("PROGRAMMED POINT: BALL CENTRE" in program.text) == (point == "centre")
    compare_moves(read_program(program.text, machine, dialect), paths, dialect, Tolerances())


@pytest.mark.parametrize("dialect_name", dialect_names())
@pytest.mark.parametrize("chain", CHAIN_KINDS)
def test_every_chain_is_written_and_read_back(write_machine, chains, path_of, chain, dialect_name, tmp_path):
    machine, dialect = read_machine(write_machine(tmp_path, chains[chain])), read_dialect(dialect_name)
    tilt = np.radians(np.linspace(20, 50, 40))
    axes = np.column_stack([np.sin(tilt) * np.cos(3 * tilt), np.sin(tilt) * np.sin(3 * tilt), np.cos(tilt)])
    tips = np.column_stack([10 * np.cos(3 * tilt), 10 * np.sin(3 * tilt), 50 + np.linspace(0, 5, 40)])
    path = path_of(tips, axes)
    program = write_program([path], machine, dialect, Job())
    checked = compare_moves(read_program(program.text, machine, dialect), [path], dialect, Tolerances())
    assert checked.tip_error.max() < 0.0012
    assert np.degrees(checked.axis_error.max()) < 0.0015


def test_a_part_longer_than_the_travel_is_refused_with_axis_value_and_limit(path_of):
    machine, dialect = read_machine("mikron-ucp600"), read_dialect("heidenhain")
    tips = np.column_stack([np.zeros((50, 2)), np.linspace(50, 550, 50)])
    with pytest.raises(
        MachineError, match=r"level 0: Z runs over \d+\.\d mm, travel 450.0 mm of Mikron UCP 600 Vario"
    ) as caught:
        write_program([path_of(tips, np.tile([0, 0, 1.0], (50, 1)))], machine, dialect, Job())
    assert caught.value.evidence["axis"] == "Z"


def test_a_known_limit_of_the_spindle_nose_is_kept(chains, paths, write_machine, tmp_path):
    text = chains["table-table"].replace("[X]\ntravel = 4000.0", "[X]\nlimits = [-50.0, 5.0]")
    with pytest.raises(MachineError, match=r"level 5, pass -?\d: X .* leaves the limit (5|-50)\.0 mm"):
        write_program(paths, read_machine(write_machine(tmp_path, text)), read_dialect("heidenhain"), Job())


def test_a_tilt_beyond_the_machine_names_level_and_pass(path_of):
    axes = np.tile([np.sin(np.radians(120)), 0, np.cos(np.radians(120))], (5, 1))
    tips = np.column_stack([np.linspace(0, 1, 5), np.zeros(5), np.full(5, 60.0)])
    with pytest.raises(MachineError, match=r"level 0, pass -1, point 0: B -120.000 deg leaves the limit -115.000 deg"):
        write_program([path_of(tips, axes)], read_machine("mikron-ucp600"), read_dialect("heidenhain"), Job())


def test_a_rewind_leaves_the_part_before_it_turns(axis, write_machine, machine_text, capsule_path, tmp_path):
    rotary = {"C": axis([0, 0, 1], [0, 0, 0], -1, -300, 300), "B": axis([0, 1, 0], [0, 0, 0], -1, -100, 0)}
    machine = read_machine(write_machine(tmp_path, machine_text(["C", "B", "XYZ"], rotary)))
    path = capsule_path(turns=1.4, count=200)
    dialect = read_dialect("heidenhain")
    program = write_program([path], machine, dialect, Job())
    assert program.rewinds > 0
    assert program.text.count("M140 MB MAX") == program.rewinds + 2
    compare_moves(read_program(program.text, machine, dialect), [path], dialect, Tolerances())


def test_a_program_name_the_control_cannot_take_is_refused(paths):
    with pytest.raises(ProgramError, match="use letters, digits"):
        write_program(paths, read_machine("mikron-ucp600"), read_dialect("heidenhain"), Job(), name="my bone")


def test_inverse_time_is_feed_over_length_in_the_part(paths):
    machine, dialect = read_machine("linuxcnc-xyzbc"), read_dialect("linuxcnc")
    motions = read_program(write_program(paths[1:], machine, dialect, Job()).text, machine, dialect)
    steps = np.linalg.norm(np.diff(motions.tips, axis=0), axis=1)
    cut = ~motions.rapid[1:] & (motions.feed_rates[1:] > 0) & (steps > 0.05)
    feed = motions.feed_rates[1:][cut] * steps[cut]
    assert motions.inverse_time[1:][cut].all()
    assert (np.minimum(np.abs(feed - 900), np.abs(feed - 1500)) < 0.5).all()
