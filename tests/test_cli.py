"""The bar tells the stage, the time left, and that kernels are compiled."""

import io
import subprocess
import sys
from argparse import Namespace
from pathlib import Path

import numba
import numpy as np
import pytest

import bonecam
from bonecam.batch.run import WAITING
from bonecam.cli import main
from bonecam.cli.batch_display import BatchDisplay
from bonecam.cli.stopping import COMPILING, ProgressBar, ProgressLog
from bonecam.errors import BonecamError
from bonecam.job import Job, write_job, write_short_job
from bonecam.machine import machine_names
from bonecam.nc import dialect_names


def test_job_prints_what_is_set_often_and_all_where_it_is_asked(capsys):
    assert main(["job"]) == 0
    short = capsys.readouterr().out
    assert short == write_short_job(Job())
    assert main(["job", "--all"]) == 0
    assert capsys.readouterr().out == write_job(Job())
    assert 50 < short.count(" = ") <= 90


def test_options_override_the_job_file(tmp_path, capsys):
    file = tmp_path / "job.toml"
    file.write_text('[stock]\ndiameter = 20.0\n[mesh]\nunits = "inch"\n', encoding="utf-8")
    assert (
        main(["job", "--job", str(file), "--units", "m", "--set", "stock.length=50", "--set", "nc.coolant=false"]) == 0
    )
    wanted = Job().with_values(stock={"diameter": 20.0, "length": 50.0}, mesh={"units": "m"}, nc={"coolant": False})
    assert capsys.readouterr().out == write_short_job(wanted)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["convert", "none.stl", "-o", "out.h"], "none.stl"),
        (["convert", "text.stl", "-o", "out.h"], "text.stl"),
        (["convert", "text.stl", "-o", "nowhere/out.h"], "nowhere"),
        (["convert", "text.stl", "-o", "out.h", "--job", "none.toml"], "none.toml"),
        (["convert", "text.stl", "-o", "out.h", "--set", "stock.diameter"], "stock.diameter"),
        (["convert", "text.stl", "-o", "out.h", "--set", "stock.diameter=wide"], "wide"),
        (["convert", "text.stl", "-o", "out.h", "--set", "stok.diameter=3"], "stok"),
        (["convert", "text.stl", "-o", "out.h", "--set", "with_values.x=3"], "with_values"),
        (["convert", "text.stl", "-o", "out.h", "--set", "levels.cuts=3"], "cuts"),
        (["convert", "text.stl", "-o", "out.h", "--set", "stock.diameter=inf"], "diameter"),
        (["convert", "text.stl", "-o", ""], "empty name"),
        (["convert", "text.stl", "-o", "out.ngc"], "out.h"),
        (["convert", "text.stl", "-o", "text.stl"], "overwritten"),
        (["convert", "text.stl", "-o", "out.h", "--report", "out.h"], "two outputs"),
        (["convert", "text.stl", "-o", "out.h", "--job", "text.stl"], "correct the TOML"),
        (["convert", "text.stl", "-o", "out.h", "--keep", "text.stl/kept"], "is a file"),
        (["convert", "two\nlines.stl", "-o", "out.h"], "two lines.stl"),
        (["convert", "a\x1b[31mb\udcff.stl", "-o", "out.h"], "a\\x1b[31mb\\udcff.stl"),
        (["batch", "text.stl", "-o", "out", "--machine", "lathe"], "lathe"),
        (["convert", "text.stl", "-o", "out.h", "--machine", "lathe"], "lathe"),
        (["convert", "text.stl", "-o", "out.h", "--surface", "part.prt"], "part.prt"),
        (["convert", "text.stl", "-o", "out.h", "--surface", "nowhere/part.step"], "nowhere"),
        (["convert", "rows.csv", "-o", "out.h"], "rows.csv"),
        (["levels", "none.stl", "-o", "out"], "none.stl"),
        (["levels", "text.stl", "-o", ""], "empty name"),
        (["levels", "text.stl", "-o", "text.stl"], "name a folder"),
        (["levels", "text.stl", "-o", "out", "--report", "nowhere/out.json"], "nowhere"),
        pytest.param(["script", "none.mlx", "-i", "text.stl", "-o", "out"], "none.mlx", marks=pytest.mark.plugged),
        pytest.param(["filters", "no_such_filter"], "no_such_filter", marks=pytest.mark.plugged),
        (["batch", "text.stl", "text.stl", "-o", "out"], "text"),
        (["simulate", "none.h", "--keep", ".", "--report", "nowhere/r.json"], "its folder"),
        (["simulate", "none.h"], "no folder of its run is named: give the one of `convert --keep` (--keep)"),
    ],
)
def test_a_wrong_call_is_one_line_exit_2_and_no_file(arguments, named, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "text.stl").write_text("this is no mesh", encoding="utf-8")
    assert main(arguments) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert named in told.err
    assert told.err.count("\n") == 1
    assert [item.name for item in tmp_path.iterdir()] == ["text.stl"]


def test_no_command_prints_the_help(capsys):
    assert main([]) == 0
    text = capsys.readouterr().out
    assert "convert" in text
    for call in (["help", "view"], ["help"]):
        with pytest.raises(SystemExit) as caught:
            main(call)
        assert caught.value.code == 0
        assert ("--output" in (told := capsys.readouterr().out)) == ("view" in call)
    assert told == text


def test_all_wrong_settings_are_told_at_once(capsys):
    settings = ["stock.diameter=abc", "nc.coolant=maybe", "stock.length=-5", "stock", "stok.x=1"]
    assert main(["job", *(word for text in settings for word in ("--set", text))]) == 2
    told = capsys.readouterr().err.removeprefix("bonecam: ").split("; ")
    assert told[:4] == [
        "--set stock: write SECTION.NAME=VALUE, like stock.diameter=15",
        "[stock] diameter = 'abc': give a number",
        "[stock] length = -5.0: keep it within 0 .. 2000 mm",
        "[nc] coolant = 'maybe': give true or false",
    ]
    assert told[4].startswith("[stok] is no section of a job (did you mean 'stock'?): use one of ")


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (["job", "--\x1b]0;x\x07"], "unrecognized arguments: --\\x1b]0;x\\x07"),
        (["conver"], "'conver' is unknown (did you mean 'convert'?)"),
        (["job", "--unit", "mm", "--machin3", "x"], "--machin3 x (did you mean '--machine'?)"),
        pytest.param(
            ["filters", "generate_morph_level"], "(did you mean 'generate_morph_levels'?)", marks=pytest.mark.plugged
        ),
        pytest.param(
            ["filters", "Generate Levels"], "(did you mean 'generate_morph_levels'?)", marks=pytest.mark.plugged
        ),
        (["help", "conver"], "'conver' is unknown (did you mean 'convert'?)"),
        (["melt"], "'melt' is unknown"),
        (
            ["batch", "bone.stl", "-o", "programs", "-w"],
            "bonecam batch: unrecognized arguments: -w: see bonecam batch --help",
        ),
        *((["batch", "bone.stl", "-o", "out", "--share", share], "--share") for share in ("0/3", "4/3", "3", "a/b")),
    ],
)
def test_a_misspelt_word_is_told_with_the_nearest(call, told, capsys):
    try:
        code = main(call)
    except SystemExit as stop:
        code = int(stop.code or 0)
    assert code == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


@pytest.mark.plugged
def test_a_script_may_make_its_mesh_and_stdout_holds_file_names_only(tmp_path, capfd):
    (tmp_path / "cube.mlx").write_text(
        '<FilterScript><filter name="create_cube"/><filter name="get_geometric_measures"/></FilterScript>'
    )
    assert main(["script", str(tmp_path / "cube.mlx"), "-o", str(tmp_path / "out")]) == 0
    printed = capfd.readouterr().out.splitlines()
    assert [Path(line).parent for line in printed] == [tmp_path / "out"]
    assert Path(printed[0]).is_file()


def test_help_and_pages_name_every_machine_and_controller(capsys):
    with pytest.raises(SystemExit):
        main(["convert", "--help"])
    pages = Path(__file__).parents[1] / "docs/pages"
    rows = (pages / "using/command-line.md").read_text() + (pages / "tutorials/own-machine.md").read_text()
    told = capsys.readouterr().out
    for name in (*dialect_names(), *machine_names()):
        assert name in told
        assert f"`{name}`" in rows
    assert "the machine's own (default)" in " ".join(told.split())
    assert "mikron-ucp600 (default)" in told


def test_verbose_tells_each_step_once_as_a_line(capsys):
    lines = ProgressLog()
    for fraction, message in ((0.0, "level 1"), (0.1, "level 1"), (0.2, "level 2")):
        lines(fraction, message)
    assert [line.split("%  ")[1] for line in capsys.readouterr().err.splitlines()] == ["level 1", "level 2"]


def test_a_failed_part_of_a_batch_is_named_once(monkeypatch, capsys):
    def one_fails(meshes, *_, told, **__):
        failed = bonecam.Outcome("none", meshes[0], "", "failed", message=f"{meshes[0]}: cannot be read: give a mesh")
        told(failed, 0)
        return [failed]

    monkeypatch.setattr(bonecam, "convert_many", one_fails)
    assert main(["batch", "none.stl", "-o", "out"]) == 1
    assert capsys.readouterr().out == "failed none.stl  cannot be read: give a mesh  (0 left)\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is full")
@pytest.mark.parametrize(
    "arguments",
    [
        *(["job"], ["machines"], ["machines", "dmu-45"]),
        *([], ["help"], ["--help"], ["--version"], ["convert", "--help"], ["help", "batch"]),
    ],
)
def test_what_cannot_be_printed_is_one_line(arguments, capsys, monkeypatch):
    with open("/dev/full", "w", encoding="utf-8") as full:
        monkeypatch.setattr("sys.stdout", full)
        assert main(arguments) == 2
    told = capsys.readouterr().err
    assert told == "bonecam: standard output: No space left on device: write it elsewhere\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is full")
def test_a_help_that_cannot_be_printed_ends_the_process_with_2():
    with open("/dev/full", "w", encoding="utf-8") as full:
        call = [sys.executable, "-m", "bonecam", "--help"]
        done = subprocess.run(call, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    told = "bonecam: standard output: No space left on device: write it elsewhere\n"
    assert (done.returncode, done.stderr) == (2, told)


@pytest.mark.parametrize(
    ("arguments", "closed", "printed"),
    [("job", ">&-", ""), ("machines none", ">&- 2>&-", ""), ("machines", "<&- 2>&-", "dmu-45")],
)
def test_a_closed_stream_is_as_one_that_leads_nowhere(arguments, closed, printed, tmp_path):
    call = f"exec '{sys.executable}' -m bonecam {arguments} {closed}"
    done = subprocess.run(["sh", "-c", call], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (2 if "none" in arguments else 0, "")
    assert printed in done.stdout if printed else not done.stdout


def test_a_batch_shows_what_runs_what_is_done_and_the_time_left(monkeypatch, capsys):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    shown = BatchDisplay(Namespace(quiet=False, verbose=False))
    shown.began -= 300.0  # seconds ago
    for name in "abcd":
        shown.progress(name, 0.0, WAITING)
    shown.progress("a", 0.9, "links")
    shown.progress("b", 0.5, "level 2")
    shown.told(bonecam.Outcome("a", "a.stl", "", "done", "a.h", warnings="slender"), 3)
    told = capsys.readouterr()
    assert told.out == "done   a.stl  a.h  warnings: slender  (3 left, about 8 min)\n"
    assert "3 left, about 8 min: b 50% level 2" in told.err
    shown.told(bonecam.Outcome("c", "c.stl", "", "failed", message="c.stl: is empty: write it anew"), 2)
    assert "2 left, 1 failed" in capsys.readouterr().err


def test_a_verbose_batch_names_the_part_of_each_step(capsys):
    shown = BatchDisplay(Namespace(quiet=True, verbose=True))
    shown.progress("a", 0.0, WAITING)
    shown.progress("a", 0.25, "level 1")
    assert capsys.readouterr().err.endswith("25%  a: level 1\n")


@pytest.mark.parametrize("named", [True, False])
def test_the_job_of_the_kept_folder_is_taken_and_told(named, tmp_path, monkeypatch, capsys):
    """It is that of --keep, or of the folder that the program lies in; --job and --set change it."""
    keep = tmp_path / "look"
    keep.mkdir()
    kept = Job().with_values(nc={"controller": "siemens-840d"}, roughing={"overhang": 31.0})
    (keep / "job.toml").write_text(write_job(kept))
    (keep / "surface.tspline").write_text("")
    taken = []

    def stop(*, job, keep, **_):
        taken.append((job, keep))
        raise BonecamError("stopped")

    monkeypatch.setattr(bonecam, "simulate", stop)
    program = (tmp_path if named else keep) / "program.mpf"
    wanted = ["simulate", str(program), *(["--keep", str(keep)] if named else [])]
    assert main(wanted) == 2
    assert capsys.readouterr().out == f"job       {keep / 'job.toml'}\n"
    assert main([*wanted, "--set", "roughing.overhang=33", "-q"]) == 2
    assert main([*wanted, "--job", "paper"]) == 2
    assert capsys.readouterr().out == ""
    jobs = [job for job, _ in taken]
    assert [job.nc.controller for job in jobs] == ["siemens-840d", "siemens-840d", "heidenhain"]
    assert [job.roughing.overhang for job in jobs[:2]] == [31.0, 33.0]
    assert all(str(given) == str(keep) for _, given in taken)


def test_it_tells_share_stage_and_time_left_and_goes_away():
    stream = io.StringIO()
    with ProgressBar(stream) as bar:
        bar(0.25, "level 3: passes")
        assert " 25%" in stream.getvalue()
        assert "<" in stream.getvalue()
        assert "level 3: passes" in stream.getvalue()
    assert stream.getvalue().endswith("\r")


def test_it_tells_a_compilation_while_it_lasts():
    stream = io.StringIO()

    @numba.njit
    def doubled(values):
        return values * 2

    with ProgressBar(stream) as bar:
        bar(0.1, "first")
        listened = numba.core.event.Listener

        class During(listened):  # looks at the bar while numba compiles
            def on_start(self, event):
                bar(0.2, "second")

            def on_end(self, event):
                pass

        numba.core.event.register("numba:compile", During())
        doubled(np.ones(3))
        bar(0.3, "third")
    told = stream.getvalue()
    assert f"{COMPILING}second" in told
    assert f"{COMPILING}third" not in told


def test_it_is_a_public_name():
    assert bonecam.ProgressBar is ProgressBar
