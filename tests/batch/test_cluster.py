"""A batch on a cluster ends as it does here: a worker that dies is another try, a bad part stops no other."""

import csv
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from batch_orders import WORK, meshes

from bonecam.batch import Wanted, cluster_executor, convert_many
from bonecam.cli import main
from bonecam.errors import JobError
from bonecam.job import Job
from bonecam.mesh import write_mesh
from bonecam.setup import Capsule

pytestmark = pytest.mark.whole

distributed = pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
MAX_WAIT = 300.0
"""Longest wait, s, for what takes some seconds on an idle machine."""


def until(answer: Callable[[], object]) -> None:
    """Wait until `answer()` holds; an AssertionError where it does not within MAX_WAIT."""
    end = time.monotonic() + MAX_WAIT
    while not answer():
        assert time.monotonic() < end, f"still waiting after {MAX_WAIT:g} s"
        time.sleep(0.05)


@contextmanager
def cluster(folder: Path) -> Iterator[str]:
    """The address of a scheduler with two workers, each a process of its own."""
    dask = [sys.executable, "-m", "dask"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    file = folder / "scheduler.json"
    with open(folder / "log", "w") as log:

        def start(*words: str) -> subprocess.Popen:
            return subprocess.Popen([*dask, *words], env=environment, cwd=folder, stdout=log, stderr=log)

        running = [
            start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file))
        ]
        try:
            until(file.exists)
            address = json.loads(file.read_text())["address"]
            worker = ("worker", address, "--nthreads", "1", "--no-dashboard", "--no-nanny")
            running += [start(*worker), start(*worker)]
            yield address
        finally:
            for process in reversed(running):
                process.kill()
                process.wait()


def table(folder: Path) -> list[dict[str, str]]:
    """The rows of a batch, without their times."""
    with open(folder / "batch.csv", encoding="utf-8", newline="") as file:
        return [{**row, "seconds": ""} for row in csv.DictReader(file)]


@pytest.mark.usefixtures("quick")
def test_a_batch_on_a_cluster_ends_as_here_though_a_worker_is_killed(tmp_path):
    files = meshes(tmp_path, a="good", b="wait", c="refuse")
    here, there = tmp_path / "here", tmp_path / "there"
    for folder in (here, there):
        folder.mkdir()
    (here / "go").touch()
    convert_many(files, here, work=WORK)

    def kill_and_go():
        try:
            until(lambda: list(there.glob("b.*.began")))
            (first,) = (int(path.name.split(".")[1]) for path in there.glob("b.*.began"))
            os.kill(first, signal.SIGKILL)
            until(lambda: len(list(there.glob("b.*.began"))) == 2)
        finally:
            (there / "go").touch()

    with cluster(tmp_path) as address, cluster_executor(address) as executor:
        killer = Thread(target=kill_and_go)
        killer.start()
        outcomes = convert_many(files, there, executor=executor, work=WORK)
        killer.join()
        again = convert_many(files, there, executor=executor, resume=True, work=WORK)
    assert len(list(there.glob("b.*.began"))) == 2  # on two workers
    assert [one.state for one in outcomes] == ["done", "done", "failed"]
    assert [one.state for one in again] == ["kept", "kept", "failed"]
    assert [{**row, "state": row["state"].replace("kept", "done")} for row in table(there)] == table(here)
    for name in ("a.h", "b.h"):
        assert (here / name).read_bytes() == (there / name).read_bytes()


def test_a_scheduler_that_is_not_there_is_one_line_before_the_work(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("bonecam.batch.cluster.CONNECT", 0.5)
    (part,) = meshes(tmp_path, a="good")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    for given, said in ((address, "no scheduler answers"), ("nowhere", "no scheduler answers")):
        assert main(["batch", str(part), "-o", str(tmp_path / "out"), "--scheduler", given]) == 2
        told = capsys.readouterr().err
        assert told.startswith(f"bonecam: --scheduler {given}: {said} (")
        assert told.endswith("start one with `dask scheduler` and give the address it prints, or give local\n")
        assert told.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_without_dask_one_line_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(JobError, match=r"--scheduler local: needs Dask distributed: pip install 'bonecam\[cluster\]'$"),
        cluster_executor("local"),
    ):
        pass


@pytest.mark.slow
def test_real_parts_have_the_same_programs_here_and_on_a_cluster(tmp_path):
    job = Job().with_values(
        mechanics={"refuse": False},
        surface={"tolerance": 0.2},
        stock={"diameter": 7.0, "length": 11.0},
        holding={"diameter": 3.0, "length": 60.0},
        levels={"roughing_depth": 1.0, "finishing_levels": 1, "finishing_depth": 0.3, "chord_tolerance": 0.05},
        roughing={"scallop": 0.3},
        finishing={"scallop": 0.1},
    )
    files = [tmp_path / f"{name}.ply" for name in "abc"]
    for number, file in enumerate(files):
        ends = np.array([0.0, 0, 2.5]), np.array([0.0, 0, 7.0 + number / 4])
        write_mesh(Capsule(*ends, 2.5).mesh(0.05), file)
    convert_many(files, tmp_path / "here", job)
    with cluster_executor("local", 2) as executor:
        convert_many(files, tmp_path / "there", job, executor=executor, wanted=Wanted())
    assert table(tmp_path / "here") == table(tmp_path / "there")
    for name in ("a.h", "b.h", "c.h"):
        assert (tmp_path / "here" / name).read_bytes() == (tmp_path / "there" / name).read_bytes()
