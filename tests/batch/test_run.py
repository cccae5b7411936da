"""Many meshes: none stops the others, whatever happens to its process; a run that was killed goes on where it
stopped."""

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import nullcontext
from functools import partial
from importlib.resources import files as resources
from pathlib import Path

import pytest
from batch_orders import WORK, meshes

import bonecam
from bonecam.batch import Wanted, convert_many
from bonecam.batch.run import WAITING
from bonecam.errors import BonecamError, FileError, JobError
from bonecam.job import Job
from bonecam.report.tables import Outcome

pytestmark = pytest.mark.whole

ROWS = list(Outcome.__dataclass_fields__)
MAX_WAIT = 600.0
"""Longest wait, s, for what takes some seconds on an idle machine."""


def table(folder: Path) -> list[dict[str, str]]:
    with open(folder / "batch.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_each_mesh_has_its_line_whatever_happens_to_its_process(tmp_path):
    files = meshes(tmp_path, a="good", b="die", c="refuse", d="break", e="good")
    told: list[tuple[str, int]] = []
    out = tmp_path / "out"
    outcomes = convert_many(files, out, jobs=2, told=lambda outcome, left: told.append((outcome.mesh, left)), work=WORK)
    assert [outcome.state for outcome in outcomes] == ["done", "failed", "failed", "failed", "done"]
    rows = table(out)
    assert [list(row) for row in rows] == [ROWS] * 5
    assert [(row["mesh"], row["state"], row["message"]) for row in rows] == [
        (o.mesh, o.state, o.message) for o in outcomes
    ]
    assert [row["program"] for row in rows] == ["a.h", "", "", "", "e.h"]
    assert (rows[0]["levels"], rows[0]["time_min"]) == ("2", "1.5")
    assert "its process broke down (exit -9)" in rows[1]["message"]
    assert rows[2]["message"] == f'{files[2]}: is "bad", and more: mend it'
    assert "ZeroDivisionError: two lines" in rows[3]["message"]
    assert [left for _, left in told] == [4, 3, 2, 1, 0]
    assert sorted(path.name for path in out.iterdir()) == ["a.h", "a.json", "batch.csv", "e.h", "e.json"]


def test_the_real_chain_refuses_what_is_no_mesh(tmp_path):
    (outcome,) = convert_many(meshes(tmp_path, a="no mesh at all"), tmp_path / "out")
    assert outcome.state == "failed"
    assert "a.stl: is text but no STL" in outcome.message
    assert outcome.warnings == "file"
    report = json.loads((tmp_path / "out" / "a.json").read_text(encoding="utf-8"))
    assert (report["refused"]["code"], report["refused"]["stage"]) == ("file", "mesh")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.json", "batch.csv"]


@pytest.mark.usefixtures("quick")
def test_resuming_does_only_what_is_missing_or_was_done_from_something_else(tmp_path):
    files = meshes(tmp_path, same="good", changed="good", lost="good", broken="good")
    machine = tmp_path / "mill.toml"
    machine.write_bytes((Path(bonecam.__file__).parent / "machine" / "machines" / "mikron-ucp600.toml").read_bytes())
    out, job = tmp_path / "out", Job().with_values(nc={"machine": str(machine)})

    def states():
        return [outcome.state for outcome in convert_many(files, out, job, resume=True, work=WORK)]

    assert states() == ["done"] * 4
    files[1].write_text("good as well", encoding="utf-8")
    (out / "lost.h").unlink()
    (out / "broken.json").write_text("[]", encoding="utf-8")
    before = (out / "same.h").read_bytes()
    assert states() == ["kept", "done", "done", "done"]
    assert (out / "same.h").read_bytes() == before
    assert [row["state"] for row in table(out)] == ["kept", "done", "done", "done"]
    assert table(out)[0]["seconds"] == "3.75"
    machine.write_text(machine.read_text() + "# another\n", encoding="utf-8")
    assert states() == ["done"] * 4


SCRIPT = """
import signal, sys
from functools import partial
import bonecam
from bonecam.cli import main
from batch_orders import WORK
for kind in (signal.SIGINT, signal.SIGHUP):  # which begin ignored in the background of a shell, or under nohup
    signal.signal(kind, signal.SIG_DFL)
bonecam.convert_many = partial(bonecam.convert_many, work=WORK)
sys.exit(main())
"""
STOPPED = "bonecam: stopped; finished programs are kept, --resume continues from there\n"


@pytest.mark.parametrize(
    ("kind", "to_main", "code"),
    [(signal.SIGKILL, True, -9), (signal.SIGINT, True, 130), (signal.SIGHUP, True, 129), (signal.SIGHUP, False, 129)],
)
@pytest.mark.usefixtures("quick")
def test_a_run_that_is_killed_leaves_no_process_and_goes_on_where_it_stopped(kind, to_main, code, tmp_path):
    """The system may give a signal to any thread. The main one, which Python has heed it, then sleeps on, as where the
    signal comes just before it goes to sleep."""
    files = meshes(tmp_path, a="good", b="sleep", c="sleep", d="good")
    out = tmp_path / "out"
    (tmp_path / "run.py").write_text(SCRIPT, encoding="utf-8")
    call = [sys.executable, tmp_path / "run.py", "batch", *files, "-o", out, "--jobs", "2"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(call, env=environment, **streams) as run:
        try:
            until(lambda: (out / "b.began").exists() and (out / "c.began").exists())
            workers = children(run.pid)
            assert len(workers) == 2
            os.kill(run.pid if to_main else max(threads(run.pid) - {run.pid}), kind)
            _, said = run.communicate(timeout=MAX_WAIT)
        finally:
            run.kill()
    assert run.returncode == code
    assert said == ("" if kind is signal.SIGKILL else STOPPED)
    until(lambda: not any(alive(worker) for worker in workers))
    assert sorted(path.name for path in out.iterdir()) == ["a.h", "a.json", "b.began", "batch.csv", "c.began"]
    assert [row["state"] for row in table(out)] == ["done"]
    for file in files[1:3]:
        file.write_text("good", encoding="utf-8")
    assert [outcome.state for outcome in convert_many(files, out, resume=True, work=WORK)] == [
        "kept",
        "done",
        "done",
        "done",
    ]


def until(answer: Callable[[], bool]) -> None:
    """Wait until `answer()` holds; an AssertionError where it does not within MAX_WAIT."""
    end = time.monotonic() + MAX_WAIT
    while not answer():
        assert time.monotonic() < end, f"still waiting after {MAX_WAIT:g} s"
        time.sleep(0.05)


def threads(process: int) -> set[int]:
    return {int(place.name) for place in Path(f"/proc/{process}/task").iterdir()}


def children(process: int) -> list[int]:
    """Those of all its threads."""
    texts = [Path(f"/proc/{process}/task/{thread}/children").read_text() for thread in threads(process)]
    return [int(word) for text in texts for word in text.split()]


def alive(process: int) -> bool:
    """Whether a process runs still; an ended one that nobody has asked about does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize(
    ("parts", "options", "kind", "match"),
    [
        (["a/bone.stl", "b/bone.ply"], {}, JobError, "bone"),
        (["bone.stl"], {"job": Job().with_values(nc={"machine": "lathe"})}, BonecamError, "is unknown"),
        (["bone.stl"], {"job": Job().with_values(nc={"controller": "klartext"})}, BonecamError, "is unknown"),
        (["bone.stl"], {"jobs": 0}, JobError, "jobs"),
        (["bone.stl"], {"jobs": -3}, JobError, "jobs"),
        (["empty"], {}, JobError, r"empty: holds no part: give files that end in one of \.stl"),
        (["x\ud800.stl"], {}, FileError, r"x\\ud800\.stl': is no name that a file can have: choose another"),
        (
            ["a.stl", "a_probe.stl"],
            {"job": Job().with_values(nc={"probe": True})},
            FileError,
            r"a_probe\.h is the program of another part",
        ),
    ],
)
def test_what_no_batch_can_do_is_refused_before_anything_runs(parts, options, kind, match, tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(kind, match=match):
        convert_many([tmp_path / part for part in parts], tmp_path / "out", work=WORK, **options)
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("quick")
def test_a_batch_that_is_done_already_ends_at_once(tmp_path):
    files = meshes(tmp_path, a="good", b="good")
    convert_many(files, tmp_path / "out", jobs=2, work=WORK)
    assert [outcome.state for outcome in convert_many(files, tmp_path / "out", resume=True, work=WORK)] == [
        "kept",
        "kept",
    ]


@pytest.mark.usefixtures("quick")
def test_a_folder_stands_for_its_parts_and_rows_of_other_meshes_stay(tmp_path):
    scans = tmp_path / "scans"
    scans.mkdir()
    meshes(scans, b="good", a="refuse")
    meshes(scans, **{"._a": "what another system keeps of a file"})
    (scans / "notes.txt.bak").write_text("none")
    out = tmp_path / "out"
    convert_many(meshes(tmp_path, z="good"), out, work=WORK)
    outcomes = convert_many([scans], out, work=WORK)
    assert [Path(one.mesh).name for one in outcomes] == ["a.stl", "b.stl"]
    assert [Path(row["mesh"]).name for row in table(out)] == ["z.stl", "a.stl", "b.stl"]
    meshes(scans, a="good")
    convert_many([scans / "a.stl"], out, work=WORK)
    assert [row["state"] for row in table(out)] == ["done"] * 3


def test_a_foreign_table_is_refused(tmp_path):
    for text in ("name,price\nbone,3\n", "mesh\0,state", '"mesh'):
        (tmp_path / "batch.csv").write_text(text, encoding="utf-8")
        with pytest.raises(FileError, match=r"batch\.csv: .*: move it away"):
            convert_many(meshes(tmp_path, a="good"), tmp_path, work=WORK)
        assert (tmp_path / "batch.csv").read_text(encoding="utf-8") == text


def test_no_module_of_the_current_folder_is_imported(tmp_path):
    (tmp_path / "socket.py").write_text("open('imported', 'w').close()\n")
    (tmp_path / "scripts").mkdir()
    script = tmp_path / "scripts" / "run.py"
    code = "from bonecam.batch import convert_many\nif __name__ == '__main__':\n    convert_many(['none.stl'], 'out')\n"
    script.write_text(code, encoding="utf-8")
    subprocess.run([sys.executable, script], cwd=tmp_path, check=True, timeout=MAX_WAIT)
    assert [row["state"] for row in table(tmp_path / "out")] == ["failed"]
    assert not (tmp_path / "imported").exists()


@pytest.mark.usefixtures("quick")
def test_two_batches_that_write_into_one_folder_keep_each_other_s_rows(tmp_path):
    out = tmp_path / "out"
    first, second = meshes(tmp_path, a="good", b="good"), meshes(tmp_path, c="good")

    def other(outcome, left):
        if left:  # while the first batch runs
            convert_many(second, out, work=WORK)

    convert_many(first, out, jobs=1, told=other, work=WORK)
    assert {Path(row["mesh"]).stem for row in table(out)} == {"a", "b", "c"}


@pytest.mark.usefixtures("quick")
def test_a_name_that_is_not_in_utf_8_stands_in_the_table_by_its_bytes(tmp_path):
    file = tmp_path / os.fsdecode(b"bone\xe9.stl")
    file.write_text("good")
    parts = [*meshes(tmp_path, a="good"), file]
    with pytest.raises(FileError, match=r"heidenhain loads names of .*: name it bone\.h, by the name of the part"):
        convert_many(parts, tmp_path / "out", work=WORK)
    job = Job().with_values(nc={"machine": "linuxcnc-xyzbc"})  # its control takes all names
    for _ in range(2):
        convert_many(parts, tmp_path / "out", job, work=WORK)
        assert (tmp_path / "out" / "batch.csv").read_bytes().count(b"bone\xe9.stl,,done") == 1


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("kind", ["machine", "controller", "material", "stock", "second"])
def test_editing_a_file_that_a_job_names_makes_its_parts_run_again(kind, tmp_path):
    folder = Path(bonecam.__file__).parent
    places = {
        "machine": ("nc", "machine", folder / "machine" / "machines" / "mikron-ucp600.toml"),
        "controller": ("nc", "controller", folder / "nc" / "dialects" / "heidenhain.toml"),
        "material": ("material", "name", folder / "job" / "materials" / "peek.toml"),
    }
    section, name, source = places.get(kind, ("", "", None))
    file = tmp_path / f"{kind}.{'toml' if source else 'stl'}"
    file.write_bytes(source.read_bytes() if source else b"solid")
    changes = {
        "stock": {"stock": {"kind": "mesh", "mesh": str(file)}},
        "second": {"holding": {"second": str(file), "parting": True}},
    }
    job = Job().with_values(**changes.get(kind, {section: {name: str(file)}}))
    files = meshes(tmp_path, a="good")

    def state():
        return convert_many(files, tmp_path / "out", job, resume=True, work=WORK)[0].state

    assert [state(), state()] == ["done", "kept"]
    file.write_bytes(file.read_bytes() + b"\n")
    assert [state(), state()] == ["done", "kept"]


RESUME = """
import sys
from batch_orders import WORK
from bonecam.batch import convert_many
if __name__ == "__main__":
    print(*(outcome.state for outcome in convert_many(sys.argv[2:], sys.argv[1], resume=True, work=WORK)))
"""


@pytest.mark.parametrize("changed", ["bonecam/levels/job_levels.py", "bonecam_plugins/levels.py"])
def test_a_part_is_done_again_when_a_file_of_the_package_has_changed(changed, tmp_path):
    sources = {"bonecam": Path(bonecam.__file__).parent, "bonecam_plugins": Path(str(resources("bonecam_plugins")))}
    for name, source in sources.items():
        shutil.copytree(source, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    files = meshes(tmp_path, a="good")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}

    def state():
        command = [sys.executable, "-c", RESUME, tmp_path / "out", *files]
        return subprocess.check_output(command, env=environment, cwd=tmp_path, text=True, timeout=MAX_WAIT).strip()

    assert [state(), state()] == ["done", "kept"]
    with open(tmp_path / changed, "a", encoding="utf-8") as module:
        module.write("# another\n")
    assert [state(), state()] == ["done", "kept"]


@pytest.mark.usefixtures("quick")
def test_a_batch_that_moved_with_its_files_is_kept(tmp_path):
    (tmp_path / "here").mkdir()
    files = meshes(tmp_path / "here", a="good")
    (tmp_path / "here" / "bar.stl").write_text("solid")
    (tmp_path / "here" / "a.toml").write_text('[stock]\nkind = "mesh"\nmesh = "bar.stl"\n')
    convert_many(files, tmp_path / "here" / "out", work=WORK)
    (tmp_path / "here").rename(tmp_path / "there")
    there = tmp_path / "there"
    assert convert_many([there / "a.stl"], there / "out", resume=True, work=WORK)[0].state == "kept"


@pytest.mark.usefixtures("quick")
def test_what_else_is_wanted_of_each_part_is_written_and_resumed(tmp_path):
    files, out = meshes(tmp_path, a="good"), tmp_path / "out"
    wanted = Wanted(html=True, sheet=True, keep=True)
    convert_many(files, out, work=WORK)
    for state in ("done", "kept"):
        outcomes = convert_many(files, out, resume=True, wanted=wanted, work=WORK)
        assert [one.state for one in outcomes] == [state]
    names = {"a", "a.h", "a.html", "a.json", "a.sheet.html", "batch.csv"}
    assert {path.name for path in out.iterdir()} == names


@pytest.mark.usefixtures("quick")
def test_a_part_is_done_again_where_its_probing_program_is_gone(tmp_path):
    files, out = meshes(tmp_path, a="good"), tmp_path / "out"
    job = Job().with_values(nc={"probe": True})
    convert_many(files, out, job, work=WORK)  # whose stand-in writes none
    assert [one.state for one in convert_many(files, out, job, resume=True, work=WORK)] == ["done"]
    (out / "a_probe.h").touch()
    assert [one.state for one in convert_many(files, out, job, resume=True, work=WORK)] == ["kept"]


@pytest.mark.usefixtures("quick")
def test_the_table_tells_what_a_report_says(tmp_path):
    shell = tmp_path / "shell.stl"
    shell.write_text("solid")
    (tmp_path / "a.toml").write_text('[holding]\nsecond = "shell.stl"\nparting = true\n')
    convert_many(meshes(tmp_path, a="good", b="refuse"), tmp_path / "out", work=WORK)
    first, second = table(tmp_path / "out")
    assert (first["job"], first["program"], first["second"]) == (str(tmp_path / "a.toml"), "a.h", "a.second.h")
    assert (first["deviation_mm"], first["left_mm2"]) == ("0.02", "3.5")
    assert (first["stock"], first["warnings"]) == ("capsule 6.00 x 16.00 mm", "left-uncut slender")
    assert (second["job"], second["stock"], second["state"]) == ("", "", "failed")


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("pool", [ThreadPoolExecutor, partial(ProcessPoolExecutor, 2)])
def test_any_executor_does_the_same(pool, tmp_path):
    files = meshes(tmp_path, a="good", b="good", c="refuse")
    for name, executor in (("here", None), ("there", pool())):
        with executor or nullcontext():
            convert_many(files, tmp_path / name, executor=executor, work=WORK)
    here, there = table(tmp_path / "here"), table(tmp_path / "there")
    assert [{**row, "seconds": ""} for row in here] == [{**row, "seconds": ""} for row in there]
    for name in ("a.h", "b.h"):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes()


@pytest.mark.usefixtures("quick")
def test_a_part_that_an_executor_gives_up_is_told(tmp_path):
    class Losing(Executor):
        def submit(self, work, *given, **named):
            future: Future = Future()
            if given[0].name == "b":
                future.set_exception(RuntimeError("the node\nis gone"))
            elif given[0].name == "c":
                future.cancel()
                future.set_running_or_notify_cancel()
            else:
                future.set_result(work(*given, **named))
            return future

    files = meshes(tmp_path, a="good", b="good", c="good")
    outcomes = convert_many(files, tmp_path / "out", executor=Losing(), work=WORK)
    assert [one.state for one in outcomes] == ["done", "failed", "failed"]
    assert outcomes[1].message == "its worker was lost (RuntimeError: the node is gone): try it again"


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"version": "9"}, "than this run (their files differ): install the same on both"),
        ({"folder": Path("/none")}, "/none: a worker does not see this folder: give one that all computers share"),
    ],
)
def test_a_worker_of_another_version_or_without_the_folder_says_so(changed, said, tmp_path):
    class Elsewhere(ThreadPoolExecutor):
        def submit(self, work, *given, **named):
            return super().submit(partial(work, **changed), *given, **named)

    with Elsewhere() as executor:
        (one,) = convert_many(meshes(tmp_path, a="good"), tmp_path / "out", executor=executor, work=WORK)
    assert one.state == "failed"
    assert said in one.message


@pytest.mark.usefixtures("quick")
def test_shares_of_an_array_do_every_part_once(tmp_path):
    files = meshes(tmp_path, **dict.fromkeys("abcdefg", "good"))
    done = [[one.name for one in convert_many(files, tmp_path / "out", share=(k, 3), work=WORK)] for k in (1, 2, 3)]
    assert done == [["a", "d", "g"], ["b", "e"], ["c", "f"]]
    assert len(table(tmp_path / "out")) == 7


def test_the_progress_names_the_parts_that_wait_and_run(tmp_path):
    told: list[tuple[str, float, str]] = []
    convert_many(
        meshes(tmp_path, a="good", b="good"),
        tmp_path / "out",
        jobs=1,
        progress=lambda *step: told.append(step),
        work=WORK,
    )
    assert [step for step in told if step[2] == WAITING] == [("a", 0.0, WAITING), ("b", 0.0, WAITING)]
    assert [step for step in told if step[2] != WAITING] == [("a", 0.5, "levels"), ("b", 0.5, "levels")]


def test_the_array_of_the_documentation_does_every_part_once(tmp_path):
    page = Path(__file__).parents[2] / "docs" / "pages" / "using" / "batch.md"
    script = re.findall(r'```sh title="array\.sh"\n(.*?)```', page.read_text(encoding="utf-8"), re.DOTALL)[0]
    meshes(tmp_path, a="no mesh", b="none")
    (tmp_path / "parts.csv").write_text("file\na.stl\nb.stl\n", encoding="utf-8")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for task, names in ((1, ["a"]), (2, ["a", "b"])):
        told = {"SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_COUNT": "2", "PATH": path}
        ended = subprocess.run(["bash", "-c", script], cwd=tmp_path, env={**os.environ, **told}, check=False)
        assert ended.returncode == 1  # as a part of it failed
        assert [row["name"] for row in table(tmp_path / "programs")] == names
