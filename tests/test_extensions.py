"""What users add by name is taken like what ships; the code is that of the page `extend.md`."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from bonecam_plugins.meshlab.slicer import main as slicer
from small_parts import revolved

import bonecam
from bonecam.cli import main
from bonecam.cli.catalogues import CATALOGUES
from bonecam.cli.schemas import file_schema, job_schema
from bonecam.errors import JobError, MachineError
from bonecam.machine import read_machine
from bonecam.nc import dialect_names, read_dialect
from bonecam.planning.patterns import pattern_curves
from bonecam.tool import Cutter

pytestmark = pytest.mark.whole

PAGE = Path(__file__).parents[1] / "docs" / "pages" / "using" / "extend.md"
FENCE = re.compile(r'^```\w+ title="(?P<title>[^"]+)"\n(?P<text>.*?)^```$', re.MULTILINE | re.DOTALL)
USE = """
import numpy as np
import bonecam
from bonecam.job import StockJob
from bonecam.planning.patterns import pattern_curves
from bonecam.setup import Capsule, place
from bonecam.mesh import prepare_part
from bonecam.surface import skin
from bonecam.tool.cutter import Cutter
job = bonecam.Job(stock={"kind": "hexagon"}, path={"pattern": "rings"}, holding={"diameter": 3.0, "length": 60.0})
mesh = Capsule(np.array([0.0, 0, 2.5]), np.array([0.0, 0, 7.5]), 2.5).mesh(0.05)
setup = place(prepare_part(mesh, job.mesh), job)
turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
ring = lambda r, z: np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(24, z)])
surface = bonecam.surface.fit(setup.part.mesh, tolerance=0.2).surface
cutter = Cutter.from_job(2, "finishing", job.tool("finishing"))
curves = pattern_curves(surface, "rings", cutter)
print(setup.stock.kind, len(setup.stock.surface.faces), int(curves.line.max()))
"""


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """The user's folder of the page."""
    for found in FENCE.finditer(PAGE.read_text(encoding="utf-8")):
        file = tmp_path / found["title"]
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(found["text"], encoding="utf-8")
    monkeypatch.setenv("BONECAM_HOME", str(tmp_path / "mine"))
    return tmp_path / "mine"


def test_a_cutter_of_the_user_is_a_preset(mine):
    job = bonecam.Job(finishing={"preset": "ball-3", "scallop": 0.05})
    assert (job.finishing.radius, job.finishing.scallop, job.finishing.neck_length) == (1.5, 0.05, 0.0)
    assert bonecam.read_job(_written(mine, job)) == job
    with pytest.raises(JobError, match=r"\[finishing\] preset = 'ball-33' \(did you mean 'ball-3'\?\): use one of"):
        bonecam.Job(finishing={"preset": "ball-33"})


def _written(folder: Path, job: bonecam.Job) -> Path:
    file = folder / "job.toml"
    file.write_text(bonecam.write_job(job), encoding="utf-8")
    return file


def test_shipped_presets_are_the_default_cutters():
    job = bonecam.Job()
    for name, section in (("ball-4", "roughing"), ("ball-2", "finishing"), ("ball-1", "fine")):
        made = getattr(bonecam.Job(**{section: {"preset": name}}), section)
        assert repr(made).replace(f"preset={name!r}", "preset='auto'") == repr(getattr(job, section))


def test_a_dialect_of_the_user_is_like_one_that_ships(mine):
    assert "our-heidenhain" in dialect_names()
    assert read_dialect("our-heidenhain").needs == ["option 9 and the cycle 32 of our builder"]


def test_what_ships_cannot_be_replaced(mine):
    (mine / "machines").mkdir()
    (mine / "machines" / "mikron-ucp600.toml").write_text("title = 'mine'\n", encoding="utf-8")
    assert read_machine("mikron-ucp600").title == "Mikron UCP 600 Vario"
    with pytest.raises(MachineError, match=r"machine 'haas' is unknown \(did you mean 'haas-umc750'\?\)"):
        read_machine("haas")


def test_stock_and_pattern_of_the_page_are_used(mine):
    there = {**os.environ, "BONECAM_HOME": str(mine)}
    done = subprocess.run([sys.executable, "-c", USE], env=there, capture_output=True, text=True, check=True)
    kind, faces, lines = done.stdout.split()
    assert (kind, faces) == ("mesh", "20")
    assert int(lines) > 20


def test_a_pattern_that_cannot_be_loaded_is_one_line(mine):
    (mine / "stocks" / "hexagon.py").write_text("KIND = 1 / 0\n", encoding="utf-8")
    there = {**os.environ, "BONECAM_HOME": str(mine)}
    command = [sys.executable, "-m", "bonecam", "demo", "-o", str(mine / "p.h"), "--set", "stock.kind=hexagon"]
    done = subprocess.run(command, env=there, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "hexagon.py: line 1: cannot be loaded: ZeroDivisionError" in done.stderr


def _told(mine: Path, *settings: str) -> str:
    """The one line with which a run with these settings is refused, in a process of its own."""
    words = [word for setting in settings for word in ("--set", setting)]
    command = [sys.executable, "-m", "bonecam", "demo", "-q", "-o", str(mine / "p.h"), *words]
    there = {**os.environ, "BONECAM_HOME": str(mine)}
    done = subprocess.run(command, env=there, capture_output=True, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    return done.stderr


def test_a_broken_file_that_no_job_names_stops_no_run(mine):
    (mine / "stocks" / "broken.py").write_text("syntax error(\n", encoding="utf-8")
    told = _told(mine, "stock.width=9")
    assert "[stock] width = 9: a capsule has none" in told
    assert "broken" not in told
    assert "broken.py: cannot be loaded: SyntaxError" in _told(mine, "stock.kind=broken")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("KIND = StockKind((), lambda job, part, schedule: None, 'nothing')", "makes None: let `make` return"),
        ("KIND = StockKind((), lambda job, part, schedule: job.size, 'it')", "line 2: fails: AttributeError"),
        ("KIND = StockKind(('diametre',), None, 'it')", r"'diametre', which is no field of \[stock\]"),
    ],
)
def test_a_stock_that_makes_none_is_one_line(text, why, mine):
    source = f"from bonecam.setup import StockKind\n{text}\n"
    (mine / "stocks" / "mine.py").write_text(source, encoding="utf-8")
    assert re.search(why, _told(mine, "stock.kind=mine"))


def test_a_pattern_without_lines_is_told_before_any_work(mine):
    (mine / "patterns" / "rings.py").write_text("def line(surface, radius, scallop): ...\n", encoding="utf-8")
    assert "rings.py: cannot be loaded: AttributeError" in _told(mine, "path.pattern=rings", "stock.diameter=1")


@pytest.mark.parametrize(
    ("lines", "why"),
    [
        ("[]", "gives no lines"),
        ("1 / 0", "line 1: fails: ZeroDivisionError: division by zero"),
        ("[[[0.1, 0.5], [0.2, 9.0]]]", r"leaves the surface at s = 0.2, t = 9: give s from 0 to 1 and t from 0 to 1"),
        ("[[[0.1, 0.5], [0.2, float('nan')]]]", "leaves the surface at s = 0.2, t = nan"),
    ],
)
def test_lines_that_a_pattern_may_not_draw_are_one_line(lines, why, mine, monkeypatch):
    source = f"def lines(surface, radius, scallop): return {lines}\n"
    (mine / "patterns" / "rings.py").write_text(source, encoding="utf-8")
    cutter = Cutter.from_job(1, "finishing", bonecam.Job().tool("finishing"))
    with pytest.raises(JobError, match=why):
        pattern_curves(revolved(lambda share, azimuth: 3.0 + 0 * azimuth), "rings", cutter)


def test_a_machine_whose_body_is_not_there_is_not_told_to_be_as_it_should_be(tmp_path, capsys):
    file = tmp_path / "mine.toml"
    body = '\n[[bodies]]\nname = "cradle"\nlink = "bed"\nstl = "none.stl"\n'
    file.write_text(CATALOGUES["machines"][0]()["dmu-45"].read_text(encoding="utf-8") + body, encoding="utf-8")
    assert main(["machines", "check", str(file)]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert "none.stl" in told.err


@pytest.mark.parametrize("kind", [kind for kind in CATALOGUES if kind != "tools"])
def test_each_catalogue_lists_shows_and_checks_what_ships(kind, tmp_path, capsys):
    for name, path in CATALOGUES[kind][0]().items():
        assert main([kind, name]) == 0
        assert capsys.readouterr().out == path.read_text(encoding="utf-8")
        assert main([kind, "check", str(path)]) == 0
        assert "as it should be" in capsys.readouterr().out
        assert main([kind]) == 0
        assert f"{name} " in capsys.readouterr().out
    (tmp_path / "wrong.toml").write_text("titel = 'x'\n", encoding="utf-8")
    for words in (["check", str(tmp_path / "wrong.toml")], ["check"], ["no-such"]):
        assert main([kind, *words]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_a_machine_is_drawn_as_it_is_checked(tmp_path, capsys):
    file, picture = str(CATALOGUES["machines"][0]()["pocket-nc"]), tmp_path / "machine.png"
    assert main(["machines", "check", file, "--picture", str(picture)]) == 0
    assert capsys.readouterr().out.endswith(f"drawn in {picture}\n")
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_schemas_take_what_the_readers_take_and_refuse_what_they_refuse():
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    import tomllib

    schema = job_schema()
    jsonschema.validate(tomllib.loads(bonecam.write_job(bonecam.Job())), schema)
    for wrong in ({"stock": {"kind": "ball"}}, {"stock": {"diameter": -1.0}}, {"stok": {}}, {"path": {"x": 1}}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, schema)
    for kind in ("machines", "materials", "tools"):
        for path in CATALOGUES[kind][0]().values():
            jsonschema.validate(tomllib.loads(path.read_text(encoding="utf-8")), file_schema(kind))


def test_the_slicer_module_has_every_parameter_and_takes_its_own_defaults(capsys, tmp_path):
    assert slicer(["--xml"]) == 0
    root = ElementTree.fromstring(capsys.readouterr().out)
    flags = {
        node.findtext("longflag"): node.findtext("default") for node in root.iter() if node.find("longflag") is not None
    }
    schema = job_schema()["properties"]
    assert set(flags) == {f"{name}.{key}" for name in schema for key in schema[name]["properties"]}
    words = [word for flag, default in flags.items() for word in (f"--{flag}", str(default))]
    assert slicer([*words, str(tmp_path / "none.stl"), str(tmp_path / "p.h")]) == 2
    assert "none.stl: " in capsys.readouterr().err, "the job of the defaults is taken, the mesh is missing"


def test_completion_and_schema_are_printed(capsys):
    assert main(["completion", "bash"]) == 0
    assert "complete" in capsys.readouterr().out
    assert main(["job", "--schema"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "bonecam job"
