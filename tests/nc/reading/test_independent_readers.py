"""Other people's readers read what we post: the positions are those that our reader finds.

nc-gcode-interpreter (Sinumerik) does not know DC(): those words are given to it as plain ones, which it drives as
they are. ncplot7py (Fanuc) keeps C within a turn. So C is compared but for whole turns.
"""

import re

import numpy as np
import pytest

from bonecam.job import Job
from bonecam.machine.machine import read_machine
from bonecam.nc.dialect import read_dialect
from bonecam.nc.posting import write_program
from bonecam.nc.reading import read_program

MIKRON = read_machine("mikron-ucp600")
ROUNDING = 0.0005
"""Half of the last decimal of the words, mm and degrees: nc-gcode-interpreter holds numbers of seven digits."""


@pytest.fixture(scope="module")
def posted(capsule_path):
    """A program of two tools in a dialect, and the lines and words (mm, degrees) that our reader finds."""

    def post(name):
        dialect = read_dialect(name)
        paths = (
            capsule_path(level=5, radius=2.0, offset=1.5, number=1, count=150),
            capsule_path(level=0, radius=1.0, number=2, count=150),
        )
        text = write_program(paths, MIKRON, dialect, Job()).text
        motions = read_program(text, MIKRON, dialect)
        words = np.column_stack([motions.words[:, :3], np.degrees(motions.words[:, 3:])])
        return text, motions, words

    return post


def differences(theirs, words):
    """By how much words (mm, degrees) differ, of C but for whole turns."""
    off = theirs - words
    off[:, 4] = (off[:, 4] + 180.0) % 360.0 - 180.0
    return off


def test_nc_gcode_interpreter_finds_the_positions_and_feeds_of_siemens(posted):
    interpreter = pytest.importorskip("nc_gcode_interpreter", reason="pip install nc-gcode-interpreter")
    text, motions, words = posted("siemens-840d")
    assert "C=DC(" in text
    plain = re.sub(r"C=DC\(([\d.]+)\)", r"C\1", text)
    table, _ = interpreter.nc_to_dataframe(plain, extra_axes=["B", "C"])
    row_of = {number: row for row, number in enumerate(table["N"].to_list())}
    lines = text.splitlines()
    rows = [row_of[int(lines[line - 1].split(" ")[0][1:])] for line in motions.lines]

    theirs = table.select(["X", "Y", "Z", "B", "C"]).to_numpy()[rows]
    assert np.abs(differences(theirs, words)).max() < ROUNDING
    feeds = table["F"].to_numpy()[rows]
    assert np.array_equal(feeds[~motions.rapid], motions.feed_rates[~motions.rapid])
    assert np.array_equal(table["gg01_motion"].to_numpy()[rows] == "G0", motions.rapid)
    assert set(table["S"].to_numpy()[rows]) == set(motions.spindle)


@pytest.mark.parametrize("name", ["fanuc-30i", "makino", "mitsubishi"])
def test_ncplot7py_finds_the_positions_of_fanuc(posted, name):
    pytest.importorskip("ncplot7py", reason="pip install ncplot7py")
    from ncplot7py.application.nc_execution import NCExecutionEngine
    from ncplot7py.domain.cnc_state import CNCState
    from ncplot7py.domain.machines import get_machine_config
    from ncplot7py.infrastructure.machines.base_stateful_control import UniversalConfigDrivenControl

    text, motions, words = posted(name)
    state = CNCState(machine_config=get_machine_config("FANUC_MILL"))
    control = UniversalConfigDrivenControl(1, ["C1"], [state])
    engine = NCExecutionEngine(control)
    engine.get_Syncro_plot([text], False)
    assert engine.errors == []

    axes_of = {node.nc_code_line_nr: node._motion_context["endAxes"] for node in control.get_exected_nodes(1)}
    theirs = np.array([[axes_of[line][letter] for letter in "XYZBC"] for line in motions.lines.tolist()])
    assert np.abs(differences(theirs, words)).max() < ROUNDING
