"""Stand-ins for parts and for the work on one, which takes a minute: a part's file says what becomes of it."""

import json
import os
import signal
import time
from pathlib import Path
from types import SimpleNamespace

import bonecam
from bonecam.batch import BatchPart, Wanted
from bonecam.batch.run import convert_part
from bonecam.errors import FileError
from bonecam.job import Job
from bonecam.progress import Progress
from bonecam.report.tables import Outcome

WORK = "batch_orders:work"
REPORT = {
    "levels": [{}, {}, {}],
    "nc": {"time_min": 1.5, "file": ""},
    "seconds": {"mesh": 1.5, "levels": 2.25},
    "surface": {"deviation_max_mm": 0.02},
    "stock": {"kind": "capsule", "diameter_mm": 6.0, "length_mm": 16.0},
    "removal": {"left": {"area_over_0_02_mm2": 3.5}},
    "warnings": [{"code": "left-uncut"}, {"code": "slender"}],
}


def work(part: BatchPart, folder: Path, wanted: Wanted, progress: Progress) -> Outcome:
    """What the part's file says: die, break, refuse, sleep, wait for a file `go`, or else a program of its words."""
    orders = part.file.read_text(encoding="utf-8").split()
    progress(0.5, "levels")
    if "die" in orders:
        os.kill(os.getpid(), signal.SIGKILL)
    if "break" in orders:
        raise ZeroDivisionError("two\nlines")
    if "refuse" in orders:
        raise FileError(f'{part.file}: is "bad", and\nmore: mend it')
    if "sleep" in orders:
        (folder / f"{part.name}.began").touch()
        time.sleep(3600)  # until it is killed, however slow the others are
    if "wait" in orders:
        (folder / f"{part.name}.{os.getppid()}.began").touch()
        while not (folder / "go").exists():
            time.sleep(0.02)
    bonecam.convert = converted  # type: ignore[attr-defined]
    return convert_part(part, folder, wanted, progress)


def converted(file: Path, job: Job, *, program: Path, progress: Progress, **more: Path) -> SimpleNamespace:
    """A run whose program has the words of the part's file and some of its job."""
    text = f"{file.read_text(encoding='utf-8')} {job.material.name} {job.stock.kind} {job.mesh.units}\n"
    for name, path in {"program": program, **more}.items():
        if name == "keep":
            path.mkdir(exist_ok=True)
        else:
            path.write_text(text, encoding="utf-8")
    report = json.loads(json.dumps(REPORT))
    report["nc"]["file"] = program.name
    if job.holding.second:
        second = program.with_name(f"{program.stem}.second{program.suffix}")
        second.write_text(text, encoding="utf-8")
        report["second"] = {"file": second.name}
    return SimpleNamespace(report=report)


def meshes(folder: Path, **orders: str) -> list[Path]:
    """A file of each name with its orders."""
    files = [folder / f"{name}.stl" for name in orders]
    for file, text in zip(files, orders.values()):
        file.write_text(text, encoding="utf-8")
    return files
