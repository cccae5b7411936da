"""A part on machines whose turntable has limits: from its levels, made once, to a simulated program."""

from dataclasses import replace

import numpy as np
import pytest
from small_job import SMALL, SMALL_CAPSULE

import bonecam
from bonecam import pipeline
from bonecam.machine import read_machine
from bonecam.machine.machine import MACHINES
from bonecam.nc import read_dialect, read_program

pytestmark = pytest.mark.whole


JOB = SMALL.with_values(path={"pattern": "round", "chord_tolerance": 0.02})


@pytest.fixture(scope="module")
def levels():
    return bonecam.morph_levels(SMALL_CAPSULE.mesh(0.05), JOB)


@pytest.mark.parametrize(("low", "high", "orientation"), [(-360, 360, "lead"), (0, 360, "lead"), (-185, 185, "cones")])
def test_a_turntable_with_limits_gets_a_program_that_keeps_them(low, high, orientation, levels, tmp_path, monkeypatch):
    text = (MACHINES / "mikron-ucp600.toml").read_text(encoding="utf-8")
    file = tmp_path / "limited.toml"
    file.write_text(text.replace("endless = true", f"limits_deg = [{low}.0, {high}.0]"), encoding="utf-8")
    job = JOB.with_values(nc={"machine": str(file)}, path={"orientation": orientation})
    monkeypatch.setattr(pipeline, "morph_standing", lambda standing, *_: replace(levels, job=standing.job))
    made = bonecam.convert(levels.part.given, job, program=tmp_path / "bone.h")
    machine, dialect = read_machine(file), read_dialect("heidenhain")
    motions = read_program((tmp_path / "bone.h").read_text(encoding="utf-8"), machine, dialect)
    turned = np.degrees(motions.words[:, 3 + [axis.letter for axis in machine.rotary].index("C")])
    assert turned.min() >= low - 0.001
    assert turned.max() <= high + 0.001
    nc = made.report["nc"]
    assert nc["rewinds"] >= nc["rewinds_lifted"] > 0
    assert made.removal is not None
    assert made.removal.rapid_contact is None
    assert made.program.text.count("; LIFTED TO REWIND") == nc["rewinds_lifted"]
