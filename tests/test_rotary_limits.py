"""A part on machines whose turntable has limits: from its levels, made once, to a simulated program."""

from dataclasses import replace

import numpy as np
import pytest

import bonecam
from bonecam import pipeline
from bonecam.job import Job
from bonecam.machine import read_machine
from bonecam.machine.machine import MACHINES
from bonecam.nc import read_dialect, read_program
from bonecam.setup import Capsule

pytestmark = pytest.mark.whole

SMALL = Job().with_values(
    mechanics={"refuse": False},
    surface={"tolerance": 0.2},
    stock={"diameter": 7.0, "length": 11.0},
    holding={"diameter": 3.0, "length": 60.0, "chuck_diameter": 12.0, "chuck_height": 6.0},
    levels={"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
    roughing={"preset": "ball-4", "scallop": 0.3},
    finishing={"preset": "ball-2", "scallop": 0.1},
    path={"pattern": "round", "chord_tolerance": 0.02},
)


@pytest.fixture(scope="module")
def levels():
    return bonecam.morph_levels(Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 7.5]), 2.5).mesh(0.05), SMALL)


@pytest.mark.parametrize(("low", "high", "orientation"), [(-360, 360, "lead"), (0, 360, "lead"), (-185, 185, "cones")])
def test_a_turntable_with_limits_gets_a_program_that_keeps_them(low, high, orientation, levels, tmp_path, monkeypatch):
    text = (MACHINES / "mikron-ucp600.toml").read_text(encoding="utf-8")
    file = tmp_path / "limited.toml"
    file.write_text(text.replace("endless = true", f"limits_deg = [{low}.0, {high}.0]"), encoding="utf-8")
    job = SMALL.with_values(nc={"machine": str(file)}, path={"orientation": orientation})
    monkeypatch.setattr(pipeline, "morph_part", lambda mesh, job, *_, **__: replace(levels, job=job))
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
