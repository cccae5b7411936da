"""Damaged text files of all kinds: each gives a result or one typed line, soon."""

import random
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bonecam_plugins.meshlab.meshlab_values import read_calls
from bonecam_plugins.tsplines import read_iga, read_tsm
from general_tsplines import inner_samples, random_tspline
from mutations import mutate, outcome
from small_parts import capsule_path, pebble

from bonecam.errors import BonecamError
from bonecam.job import Job, read_job, write_job
from bonecam.machine import read_machine
from bonecam.machine.machine import MACHINES
from bonecam.mesh.files.points import read_blocks
from bonecam.nc import read_dialect, read_program, write_program
from bonecam.nc.dialect import DIALECTS
from bonecam.pipeline import check_job
from bonecam.surface import TSpline, save_surface
from bonecam.surface.files.surface_input import read_part

DEFAULT = 25
"""Damaged files of each kind in the default run."""
MANY = 1000
"""And with -m fuzz."""
CHORD = 0.5
"""Chord tolerance (mm) of the tessellation of what was read."""
VALUES = [
    *(b"true", b"nan", b"-inf", b"1e999", b'"x"', b"'M128'", b"[]", b"{}", b"[1, 2]", b'[["C"]]', b"1979-05-27"),
    *(b"0", b"-1", b"1e300", b"9" * 25, b'"{text.__class__}"', b'"{text:>20000000000}"', b"[nan, inf, 1.0]"),
    *(b"[" * 3000 + b"]" * 3000, b"{a." + b"b." * 50 + b"c = 1}", b'"""\n\n"""', b'"(a+)+b"', b'"\\u0000"', b'""'),
]
"""What is written for a value of a TOML file."""
SCRIPT = b"""<!DOCTYPE FilterScript>
<FilterScript>
 <filter name="Generate Stock">
  <Param name="kind" type="RichEnum" value="0"/>
  <Param name="diameter" type="RichFloat" value="15.0" tooltip="x"/>
 </filter>
 <filter name="Generate Morph Levels"/>
</FilterScript>
"""


@pytest.fixture(scope="session")
def sound(tmp_path_factory):
    """A sound file of every kind."""
    folder = tmp_path_factory.mktemp("sound")
    surface = pebble()
    save_surface(surface, folder / "a.tspline")
    save_surface(random_tspline(1), folder / "a.iga")
    save_surface(random_tspline(2, closed=True), folder / "a.tsm")
    turn = 2 * np.pi * np.arange(16) / 16
    angles = np.linspace(0.0, np.pi, 9)
    rings = [
        np.column_stack([5 * np.sin(a) * np.cos(turn), 4 * np.sin(a) * np.sin(turn), np.full(16, -9 * np.cos(a))])
        for a in angles[1:-1]
    ]
    rows = [np.array([[0.0, 0.0, -9.0]]), *rings, np.array([[0.0, 0.0, 9.0]])]
    blocks = ["\n".join("{:.5f} {:.5f} {:.5f}".format(*point) for point in row) for row in rows]
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    files |= {"rows.xyz": "\n\n".join(blocks).encode(), "cloud.csv": "\n".join(blocks).replace(" ", ",").encode()}
    files |= {"script.mlx": SCRIPT, "job.toml": write_job(Job()).encode()}
    files |= {f"machine_{path.name}": path.read_bytes() for path in MACHINES.glob("*.toml")}
    files |= {f"dialect_{path.name}": path.read_bytes() for path in DIALECTS.glob("*.toml")}
    for name, (machine, dialect) in CONTROLS.items():
        posted = write_program([capsule_path(count=40)], read_machine(machine), read_dialect(dialect), Job())
        files[name] = posted.text.encode()
    return files


PAPER = Job().with_values(material={"name": "paper"})
"""A job whose feeds every machine makes."""
CONTROLS = {
    "program.h": ("mikron-ucp600", "heidenhain"),
    "program.ngc": ("linuxcnc-xyzbc", "linuxcnc"),
    "program.mpf": ("mikron-ucp600", "siemens-840d"),
    "program.nc": ("mikron-ucp600", "fanuc-30i"),
    "makino.nc": ("mikron-ucp600", "makino"),
    "mitsubishi.nc": ("mikron-ucp600", "mitsubishi"),
}


def named(file: Path, read: Callable[[], object]) -> None:
    """Messages of what is read from a text name no file: it is put before them."""
    try:
        read()
    except BonecamError as error:
        raise type(error)(f"{file.name}: {error}") from error


def read_as_surface(file: Path, reader: Callable[[Path], TSpline]) -> None:
    surface = reader(file)
    for values in surface.evaluate(*inner_samples(surface, 0, 20), 2):
        assert np.isfinite(values).all()
    named(file, lambda: surface.tessellate(CHORD))


def read_as_machine(file: Path) -> None:
    machine = read_machine(file)
    dialect = read_dialect("heidenhain" if machine.tool_centre_control else "linuxcnc")
    named(file, lambda: check_job(PAPER, machine, dialect))


def read_as_dialect(file: Path) -> None:
    dialect = read_dialect(file)
    machine = next(read_machine(machine) for machine, control in CONTROLS.values() if control in file.name)
    named(file, lambda: check_job(PAPER, machine, dialect))


def read_as_program(file: Path) -> None:
    machine, dialect = CONTROLS[file.name]
    text = file.read_bytes().decode(errors="replace")
    named(file, lambda: read_program(text, read_machine(machine), read_dialect(dialect)))


READERS: dict[str, Callable[[Path], object]] = {
    "a.tspline": lambda file: read_part(file, Job()),
    "a.tsm": lambda file: read_as_surface(file, read_tsm),
    "a.iga": lambda file: read_as_surface(file, read_iga),
    "rows.xyz": lambda file: read_part(file, Job()),
    "cloud.csv": read_blocks,
    "script.mlx": read_calls,
    "job.toml": read_job,
    "machine_mikron-ucp600.toml": read_as_machine,
    "machine_linuxcnc-xyzbc.toml": read_as_machine,
    **{f"dialect_{path.name}": read_as_dialect for path in DIALECTS.glob("*.toml")},
    **dict.fromkeys(CONTROLS, read_as_program),
}


def retype_value(rng: random.Random, data: bytes) -> bytes:
    """One value of a TOML file replaced by one of another type or size."""
    found = list(re.finditer(rb"= *([^\n]+)", data))
    if not found:
        return data
    match = rng.choice(found)
    return data[: match.start(1)] + rng.choice(VALUES) + data[match.end(1) :]


@pytest.mark.parametrize(
    "count", [pytest.param(DEFAULT, id="few"), pytest.param(MANY, id="many", marks=pytest.mark.fuzz)]
)
@pytest.mark.parametrize("name", READERS)
def test_a_damaged_text_gives_a_result_or_one_line(name, count, sound, tmp_path):
    rng = random.Random(name)
    file = tmp_path / name
    file.write_bytes(sound[name])
    READERS[name](file)  # without a limit of time: what it needs may be compiled here

    refused = 0
    for _ in range(count):
        retyped = name.endswith(".toml") and rng.random() < 0.5
        file.write_bytes((retype_value if retyped else mutate)(rng, sound[name]))
        refused += bool(outcome(READERS[name], file))
    assert refused > 0


@pytest.mark.fuzz
def test_a_damaged_model_gives_a_surface_or_one_line(shared, tmp_path):
    models = sorted(file for file in (shared / "tspline").glob("[ti]*/*.[ti]*") if file.suffix in (".tsm", ".iga"))
    assert len(models) == 11
    rng, refused = random.Random(0), 0
    for k in range(MANY):
        model = models[k % len(models)]
        file = tmp_path / f"a{model.suffix}"
        file.write_bytes(mutate(rng, model.read_bytes()))
        refused += bool(outcome(READERS[file.name], file))
    assert 0 < refused < MANY


HOSTILE = {
    "rows.xyz": "0 0 -9\n\n5 0 0\n0 5 0\n-5 0 0\n0 -5 0\n\n5 0 5\n0 5 5\n-5 0 5\n0 -5 5\n\n0 0 9\n",
    "cloud.csv": "x,y,z\n1,2,3\nnan,1,2\n",
    "script.mlx": '<!DOCTYPE a [<!ENTITY x "ha"><!ENTITY y "&x;&x;">]><FilterScript>&y;</FilterScript>',
    "a.tspline": "#bonecam-tspline 1\ndegree 3\nunits mm\nt-knots 0 1\nrow 0 1000000000000\n",
    "a.iga": "type surface\nnodeN 9000000000000\nelemN 1\n",
    "a.tsm": "#TS0200\n0g 9e18 0 0 1\n",
    "job.toml": "[mesh]\nrows = " + "[" * 9000,
    "machine_mikron-ucp600.toml": "chain = " + "[" * 9000,
    "dialect_linuxcnc.toml": "title = " + "9" * 30,
    "program.h": "0 BEGIN PGM " + "A" * 100_000 + " MM\n",
    "program.ngc": "%\n" + "G0 X1 " * 100_000 + "\n%\n",
    "program.mpf": "N10 " + "CYCLE832(" * 100 + "\nN20 C=DC(" + "9" * 200 + ")\nN30 M30\n",
    "program.nc": "%\nO" + "9" * 900 + "\nG28 G91 Z0.\n%\n",
    "dialect_makino.toml": 'like = "../machines/mikron-ucp600"\n',
    "dialect_siemens-840d.toml": 'endless_word = "{letter}={number.__class__}"',
}
"""What damage does not hit on by itself: rows of four points, entities, counts of what is not there, depth, length."""


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_text_gives_one_line(name, tmp_path):
    (tmp_path / name).write_text(HOSTILE[name])
    assert outcome(READERS[name], tmp_path / name)
