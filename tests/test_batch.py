"""Many meshes: none stops the others, whatever happens to its process; a run that was killed goes on where it
stopped."""

import csv
import inspect
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

import bonecam
from bonecam.batch import convert_many, convert_one
from bonecam.errors import BonecamError, FileError, JobError
from bonecam.job import Job
from bonecam.report.tables.batch_table import Outcome

ROWS = list(Outcome.__dataclass_fields__)
MAX_WAIT = 600.0
"""Longest wait, s, for what takes some seconds on an idle machine."""


def work(mesh: Path, folder: Path, job: Job) -> Outcome:
    """What the mesh file says: stand in for the chain, which takes a minute."""
    orders = mesh.read_text(encoding="utf-8").split()
    if "die" in orders:
        os.kill(os.getpid(), signal.SIGKILL)
    if "break" in orders:
        raise ZeroDivisionError("two\nlines")
    if "refuse" in orders:
        raise FileError(f'{mesh}: is "bad", and\nmore: mend it')
    if "sleep" in orders:
        (folder / f"{mesh.stem}.began").touch()
        time.sleep(3600)  # until it is killed, however slow the others are
    report = {
        "levels": [{}, {}, {}],
        "nc": {"time_min": 1.5, "file": ""},
        "seconds": {"mesh": 1.5, "levels": 2.25},
    }
    made = SimpleNamespace(
        program=SimpleNamespace(extension=".h", text=f"BEGIN {os.getpid()}\n"), report=report
    )
    bonecam.convert = lambda mesh, job: made  # type: ignore[attr-defined]
    return convert_one(mesh, folder, job)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes are forked, which takes no time, for tests of what is kept of their work: the others start new ones."""
    fork = multiprocessing.get_context("fork")
    monkeypatch.setattr(multiprocessing, "get_context", lambda kind: fork)


def meshes(folder: Path, **orders: str) -> list[Path]:
    files = [folder / f"{name}.stl" for name in orders]
    for file, text in zip(files, orders.values()):
        file.write_text(text, encoding="utf-8")
    return files


def table(folder: Path) -> list[dict[str, str]]:
    with open(folder / "batch.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_each_mesh_has_its_line_whatever_happens_to_its_process(tmp_path: Path) -> None:
    files = meshes(tmp_path, a="good", b="die", c="refuse", d="break", e="good")
    told: list[tuple[str, int]] = []
    out = tmp_path / "out"
    outcomes = convert_many(
        files, out, jobs=2, told=lambda outcome, left: told.append((outcome.mesh, left)), work=work
    )
    assert [outcome.state for outcome in outcomes] == ["done", "failed", "failed", "failed", "done"]
    rows = table(out)
    assert [list(row) for row in rows] == [ROWS] * 5
    assert [(row["mesh"], row["state"], row["message"]) for row in rows] == [
        (o.mesh, o.state, o.message) for o in outcomes
    ]
    assert [row["program"] for row in rows] == ["a.h", "", "", "", "e.h"]
    assert (rows[0]["levels"], rows[0]["time_min"]) == ("2", "1.5")
    assert "process died (exit -9" in rows[1]["message"]
    assert rows[2]["message"] == f'{files[2]}: is "bad", and more: mend it'
    assert "ZeroDivisionError: two lines" in rows[3]["message"]
    assert [left for _, left in told] == [4, 3, 2, 1, 0]
    assert sorted(path.name for path in out.iterdir()) == ["a.h", "a.json", "batch.csv", "e.h", "e.json"]


def test_the_real_chain_refuses_what_is_no_mesh(tmp_path: Path) -> None:
    (outcome,) = convert_many(meshes(tmp_path, a="no mesh at all"), tmp_path / "out")
    assert outcome.state == "failed"
    assert "a.stl: is text but no STL" in outcome.message
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["batch.csv"]


@pytest.mark.usefixtures("quick")
def test_resuming_does_only_what_is_missing_or_was_done_from_something_else(tmp_path: Path) -> None:
    files = meshes(tmp_path, same="good", changed="good", lost="good", broken="good")
    machine = tmp_path / "mill.toml"
    machine.write_bytes(
        (Path(bonecam.__file__).parent / "machine" / "machines" / "mikron-ucp600.toml").read_bytes()
    )
    out, job = tmp_path / "out", Job().with_values(nc={"machine": str(machine)})

    def states() -> list[str]:
        return [outcome.state for outcome in convert_many(files, out, job, resume=True, work=work)]

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


ORDERS = """
import os, signal, time
from pathlib import Path
from types import SimpleNamespace
import bonecam
from bonecam.batch import Outcome, convert_one
from bonecam.errors import FileError
from bonecam.job import Job
from bonecam.report.tables.batch_table import Outcome

"""
SCRIPT = """
import signal, sys
from pathlib import Path
from bonecam.batch import convert_many
from orders import work
if __name__ == "__main__":
    # a shell starts what runs in its background with SIGINT ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        convert_many(sys.argv[2:], sys.argv[1], jobs=2, resume=True, work=work)
    except KeyboardInterrupt:
        sys.exit(130)
"""


@pytest.mark.parametrize(("kind", "code"), [(signal.SIGKILL, -9), (signal.SIGINT, 130)])
@pytest.mark.usefixtures("quick")
def test_a_run_that_is_killed_leaves_no_process_and_goes_on_where_it_stopped(
    kind: signal.Signals, code: int, tmp_path: Path
) -> None:
    files = meshes(tmp_path, a="good", b="sleep", c="sleep", d="good")
    out = tmp_path / "out"
    (tmp_path / "orders.py").write_text(ORDERS + inspect.getsource(work), encoding="utf-8")
    (tmp_path / "run.py").write_text(SCRIPT, encoding="utf-8")
    with subprocess.Popen([sys.executable, tmp_path / "run.py", out, *files]) as run:
        try:
            until(lambda: (out / "b.began").exists() and (out / "c.began").exists())
            workers = children(run.pid)
            run.send_signal(kind)
            assert run.wait(MAX_WAIT) == code
        finally:
            run.kill()
    until(lambda: not any(alive(worker) for worker in workers))
    assert sorted(path.name for path in out.iterdir()) == ["a.h", "a.json", "b.began", "batch.csv", "c.began"]
    assert [row["state"] for row in table(out)] == ["done"]
    for file in files[1:3]:
        file.write_text("good", encoding="utf-8")
    assert [outcome.state for outcome in convert_many(files, out, resume=True, work=work)] == [
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


def children(process: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{process}/task/{process}/children").read_text().split()]


def alive(process: int) -> bool:
    """Whether a process runs still; an ended one that nobody has asked about does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_two_meshes_of_one_name_are_refused_before_anything_runs(tmp_path: Path) -> None:
    with pytest.raises(JobError, match="bone"):
        convert_many([tmp_path / "a" / "bone.stl", tmp_path / "b" / "bone.ply"], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("values", [{"machine": "lathe"}, {"controller": "klartext"}])
def test_a_machine_that_is_not_known_is_refused_before_anything_runs(
    values: dict[str, str], tmp_path: Path
) -> None:
    with pytest.raises(BonecamError, match="is unknown"):
        convert_many([tmp_path / "bone.stl"], tmp_path / "out", Job().with_values(nc=values))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("jobs", [0, -3])
def test_no_process_at_all_is_refused(tmp_path: Path, jobs: int) -> None:
    with pytest.raises(JobError, match="jobs"):
        convert_many([tmp_path / "bone.stl"], tmp_path / "out", jobs=jobs)


@pytest.mark.usefixtures("quick")
def test_a_batch_that_is_done_already_ends_at_once(tmp_path: Path) -> None:
    files = meshes(tmp_path, a="good", b="good")
    convert_many(files, tmp_path / "out", jobs=2, work=work)
    assert [outcome.state for outcome in convert_many(files, tmp_path / "out", resume=True, work=work)] == [
        "kept",
        "kept",
    ]


@pytest.mark.usefixtures("quick")
def test_a_folder_stands_for_its_parts_and_rows_of_other_meshes_stay(tmp_path: Path) -> None:
    scans = tmp_path / "scans"
    scans.mkdir()
    meshes(scans, b="good", a="refuse")
    meshes(scans, **{"._a": "what another system keeps of a file"})
    (scans / "notes.txt.bak").write_text("none")
    out = tmp_path / "out"
    convert_many(meshes(tmp_path, z="good"), out, work=work)
    outcomes = convert_many([scans], out, work=work)
    assert [Path(one.mesh).name for one in outcomes] == ["a.stl", "b.stl"]
    assert [Path(row["mesh"]).name for row in table(out)] == ["z.stl", "a.stl", "b.stl"]
    meshes(scans, a="good")
    convert_many([scans / "a.stl"], out, work=work)
    assert [row["state"] for row in table(out)] == ["done"] * 3


def test_a_folder_without_parts_and_a_foreign_table_are_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(JobError, match=r"empty: holds no part: give files that end in one of \.stl"):
        convert_many([tmp_path / "empty"], tmp_path / "out", work=work)
    for text in ("name,price\nbone,3\n", "mesh\0,state", '"mesh'):
        (tmp_path / "batch.csv").write_text(text, encoding="utf-8")
        with pytest.raises(FileError, match=r"batch\.csv: .*: move it away"):
            convert_many(meshes(tmp_path, a="good"), tmp_path, work=work)
        assert (tmp_path / "batch.csv").read_text(encoding="utf-8") == text


def test_no_module_of_the_current_folder_is_imported(tmp_path: Path) -> None:
    (tmp_path / "socket.py").write_text("open('imported', 'w').close()\n")
    (tmp_path / "scripts").mkdir()
    script = tmp_path / "scripts" / "run.py"
    code = "from bonecam.batch import convert_many\nif __name__ == '__main__':\n    convert_many(['none.stl'], 'out')\n"
    script.write_text(code, encoding="utf-8")
    subprocess.run([sys.executable, script], cwd=tmp_path, check=True, timeout=MAX_WAIT)
    assert [row["state"] for row in table(tmp_path / "out")] == ["failed"]
    assert not (tmp_path / "imported").exists()


@pytest.mark.usefixtures("quick")
def test_two_batches_that_write_into_one_folder_keep_each_other_s_rows(tmp_path: Path) -> None:
    out = tmp_path / "out"
    first, second = meshes(tmp_path, a="good", b="good"), meshes(tmp_path, c="good")

    def other(outcome: Outcome, left: int) -> None:
        if left:  # while the first batch runs
            convert_many(second, out, work=work)

    convert_many(first, out, jobs=1, told=other, work=work)
    assert {Path(row["mesh"]).stem for row in table(out)} == {"a", "b", "c"}


@pytest.mark.usefixtures("quick")
def test_a_name_that_is_not_in_utf_8_stands_in_the_table_by_its_bytes(tmp_path: Path) -> None:
    file = tmp_path / os.fsdecode(b"bone\xe9.stl")
    file.write_text("good")
    for _ in range(2):
        convert_many([*meshes(tmp_path, a="good"), file], tmp_path / "out", work=work)
        assert (tmp_path / "out" / "batch.csv").read_bytes().count(b"bone\xe9.stl,done") == 1


def test_a_name_that_no_file_can_have_is_refused_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"x\\ud800\.stl': is no name that a file can have: choose another"):
        convert_many([*meshes(tmp_path, a="good"), tmp_path / "x\ud800.stl"], tmp_path / "out", work=work)
    assert not (tmp_path / "out").exists()
