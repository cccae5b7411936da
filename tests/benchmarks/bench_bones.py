"""Sixty bones from mesh to proof: how many end in a program, and how the others end.

    python tests/benchmarks/bench_bones.py FOLDER [NAME ...] [--some N] [--limit SECONDS] [--again]

The bones are anatomical models of hand and foot as the wheel of `myo-sim` has them (Apache-2.0), and copies of
them: coarsened by quadric edge collapse, with noise along the normals, through voxels, mirrored and scaled; a foot
bone comes from `../shared`. Those whose mesh is absent are left out, and the reason is printed. Each is converted by
a process of its own, one at a time, which is ended after the time limit; FOLDER/bones.csv gets its row at once, so
that a run that was stopped goes on where it stood. `--some N` takes N of them, spread over the kinds; `--again`
does those in the table once more. Meshes, reports and what `--keep` writes stay in FOLDER/NAME.

Columns: deviation of the fit from the part, mm; cuts K; machining minutes; mm2 away from the post that keep more than
0.02 mm; wall and CPU seconds of the whole run, CPU seconds of planning and proof; minutes and CPU seconds that were
estimated of these before planning; the end: "program", or the refusal's text. FOLDER/bones.md is the same in Markdown.
"""

import argparse
import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from importlib.util import find_spec
from pathlib import Path

import igl
import numpy as np
import pymeshlab
from numpy import ndarray

from bonecam.mesh.files.mesh_files import read_mesh, write_mesh
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.estimate import STAGES

SHARED = Path(__file__).resolve().parents[3] / "shared" / "meshes" / "bones"
SEED = 41
JOB = """[surface]
tolerance = 0.2
[levels]
roughing_depth = 1.0
finishing_levels = 1
finishing_depth = 0.3
chord_tolerance = 0.02
[roughing]
scallop = 0.3
[finishing]
scallop = 0.1
"""
WHOLE = "2distph 2mc 2proxph 4distph 4mc 4midph 4proxph 5mc 5midph 5proxph thumbdist thumbprox hamate lunate "
WHOLE += "trapezium trapezoid triquetrum l_talus l_patella 1mc 2midph 3distph 3mc 3midph 3proxph capitate scaphoid"
COARSE = "lunate:132 3proxph:200 3mc:176 hamate:414 2midph:150 5midph:170 2distph:250 4proxph:182 5mc:134 scaphoid:300 "
COARSE += "capitate:400 3midph:100 trapezium:200 trapezoid:160 triquetrum:140 thumbprox:220 1mc:350 3distph:700"
COPIES = {
    "coarse": COARSE,
    "noisy": "3midph:0.06 scaphoid:0.04 2midph:0.1 lunate:0.05",
    "voxels": "3distph:0.5 4midph:0.4 capitate:0.6 5proxph:0.5",
    "mirrored": "3proxph:1 hamate:1",
    "scaled": "5midph:0.7 lunate:1.5 3mc:1.2 thumbdist:0.8",
}
"""Copies by kind, each with its amount: faces, deviation of the noise in mm, pitch of the voxels in mm, factor."""


@dataclass(frozen=True)
class Row:
    """A bone of the table; figures are empty where a run did not come to them."""

    bone: str
    kind: str
    faces: int
    deviation: float | None = None
    cuts: int | None = None
    minutes: float | None = None
    left: float | None = None
    seconds: float = 0.0
    cpu: float = 0.0
    planned: float | None = None
    foretold_minutes: float | None = None
    foretold_seconds: float | None = None
    end: str = ""


@dataclass(frozen=True)
class Bone:
    """A bone by the name of its mesh, and what is done to it (`kind`, by an `amount`)."""

    mesh: str
    kind: str
    amount: float = 0.0

    @property
    def name(self) -> str:
        """Name of the row and of the folder."""
        return self.mesh if self.kind == "whole" else f"{self.mesh}_{self.kind}_{self.amount:g}"


def bones() -> list[Bone]:
    """All of them."""
    whole = [Bone(mesh, "whole") for mesh in WHOLE.split()]
    copies = [
        Bone(mesh, kind, float(amount))
        for kind, words in COPIES.items()
        for mesh, _, amount in (word.partition(":") for word in words.split())
    ]
    return [*whole, *copies, Bone("metatarsal1_rv", "whole")]


def source(mesh: str) -> Path | None:
    """The file (in metres) of a mesh, None where it is absent."""
    wheel = find_spec("myo_sim")
    folders = [Path(wheel.origin).parent / "models" / "meshes"] if wheel and wheel.origin else []
    files = [*(folder / f"{mesh}.stl" for folder in folders), SHARED / f"{mesh}_m.stl"]
    return next((file for file in files if file.is_file()), None)


def made(bone: Bone, file: Path) -> TriangleMesh:
    """The mesh of a bone, mm."""
    whole = read_mesh(file)
    mesh = TriangleMesh(1000 * whole.vertices, whole.faces)
    if bone.kind == "coarse":
        return coarsened(mesh, int(bone.amount))
    if bone.kind == "noisy":
        noise = bone.amount * np.random.default_rng(SEED).standard_normal(len(mesh.vertices))
        return TriangleMesh(mesh.vertices + noise[:, None] * _normals(mesh), mesh.faces)
    if bone.kind == "voxels":
        return voxels(mesh, bone.amount)
    if bone.kind == "mirrored":
        return TriangleMesh(mesh.vertices * [-1.0, 1.0, 1.0], mesh.faces[:, ::-1])
    return TriangleMesh(mesh.vertices * (bone.amount or 1.0), mesh.faces)


def coarsened(mesh: TriangleMesh, faces: int) -> TriangleMesh:
    """The mesh with so many faces."""
    layers = pymeshlab.MeshSet()
    layers.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    layers.meshing_decimation_quadric_edge_collapse(targetfacenum=faces, preservetopology=True, preservenormal=True)
    now = layers.current_mesh()
    return TriangleMesh(now.vertex_matrix(), now.face_matrix().astype(np.int32))


def voxels(mesh: TriangleMesh, pitch: float) -> TriangleMesh:
    """The steps between voxels inside and outside the mesh, by marching cubes."""
    low, high = mesh.bounds
    lines = [np.arange(low[k] - 2 * pitch, high[k] + 2 * pitch, pitch) for k in range(3)]
    z, y, x = np.meshgrid(lines[2], lines[1], lines[0], indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    inside = igl.fast_winding_number(mesh.vertices, mesh.faces.astype(np.int64), places) > 0.5
    counts = (len(line) for line in lines)
    vertices, faces = igl.marching_cubes(inside.astype(np.float64), places, *counts, 0.5)[:2]
    found = TriangleMesh(vertices, faces.astype(np.int32))
    return found if found.volume > 0 else TriangleMesh(vertices, found.faces[:, ::-1])


def _normals(mesh: TriangleMesh) -> ndarray:
    """Unit normals of the vertices, weighted by the areas of their faces."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    found = np.zeros_like(mesh.vertices)
    for k in range(3):
        np.add.at(found, mesh.faces[:, k], np.cross(b - a, c - a))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def run(bone: Bone, file: Path, folder: Path, limit: float) -> Row:
    """Convert a bone in a process of its own, which is ended after `limit` seconds."""
    folder.mkdir(parents=True, exist_ok=True)
    mesh = made(bone, file)
    write_mesh(mesh, folder / "mesh.stl")
    (folder / "job.toml").write_text(JOB)
    report = folder / "report.json"
    report.unlink(missing_ok=True)
    words = [
        "convert",
        "mesh.stl",
        "-o",
        "program.h",
        "--job",
        "job.toml",
        "--report",
        report.name,
        "--keep",
        "kept",
        "-v",
    ]
    began, before = time.perf_counter(), os.times()
    log = folder / "log.txt"
    with open(log, "w") as text:
        process = subprocess.Popen(
            [sys.executable, "-m", "bonecam", *words], cwd=folder, stdout=text, stderr=text, start_new_session=True
        )
        try:
            process.wait(limit)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    row = Row(bone.name, bone.kind, len(mesh.faces), seconds=round(time.perf_counter() - began, 1), cpu=round(spent, 1))
    return _ended(row, process.returncode, log.read_text(), report)


def _ended(row: Row, code: int, log: str, report: Path) -> Row:
    """The row with what the run reported."""
    figures = asdict(row)
    if code == 0:
        told = json.loads(report.read_text())
        left = told["removal"]["left"]
        foretold = told.get("estimate", {})
        figures |= {
            "deviation": round(told["surface"]["deviation_max_mm"], 3),
            "cuts": len(told["levels"]) - 1,
            "minutes": told["nc"]["time_min"],
            "left": left["area_over_0_02_mm2"],
            "planned": round(sum(told["cpu_seconds"].get(stage, 0.0) for stage in STAGES), 1),
            "foretold_minutes": foretold.get("machining_min"),
            "foretold_seconds": foretold.get("planning_cpu_s"),
            "end": "program",
        }
    else:
        lines = log.strip().splitlines() or ["no word"]
        figures["end"] = "time limit" if code == -signal.SIGKILL else lines[-1].removeprefix("bonecam: ")
    return Row(**figures)


def rows_of(table: Path) -> dict[str, dict[str, str]]:
    """The rows of an earlier run, by bone."""
    if not table.is_file():
        return {}
    with open(table, newline="") as file:
        return {row["bone"]: row for row in csv.DictReader(file)}


def markdown(rows: Iterable[Mapping[str, str]]) -> str:
    """The rows as a table, expected beside came, each figure as short as a reader needs it."""
    lines = [
        "| bone | faces | deviation mm | K | minutes | left mm2 | planning CPU s | run CPU s | end |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = [
            row["bone"].replace("_", ", "),
            f"{int(row['faces']):,}",
            row["deviation"],
            row["cuts"],
            f"{_rounded(row['foretold_minutes'], 1)} / {_rounded(row['minutes'], 1)}",
            _rounded(row["left"], 0),
            f"{_rounded(row['foretold_seconds'], 0)} / {_rounded(row['planned'], 0)}",
            _rounded(row["cpu"], 0),
            row["end"],
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _rounded(figure: str, places: int) -> str:
    """A figure of a row with so many decimals, empty where the run did not come to it."""
    return f"{float(figure):.{places}f}" if figure else ""


def chosen(names: Sequence[str], some: int | None) -> Iterator[tuple[Bone, Path]]:
    """The bones of these names (all without), `some` of them spread over the list; what is absent is told."""
    picked = [bone for bone in bones() if not names or bone.name in names]
    if unknown := set(names) - {bone.name for bone in picked}:
        raise SystemExit(f"no bone {', '.join(sorted(unknown))}: known are {' '.join(bone.name for bone in bones())}")
    if some is not None:
        picked = [picked[k] for k in np.unique(np.linspace(0, len(picked) - 1, some).round().astype(int))]
    for bone in picked:
        file = source(bone.mesh)
        if file is None:
            print(f"{bone.name}: skipped, its mesh is neither in myo-sim's wheel (not installed?) nor in ../shared")
        else:
            yield bone, file


def main() -> None:
    """Convert, and print the table row by row."""
    options = argparse.ArgumentParser()
    options.add_argument("folder", type=Path)
    options.add_argument("names", nargs="*")
    options.add_argument("--some", type=int)
    options.add_argument("--limit", type=float, default=900.0)
    options.add_argument("--again", action="store_true")
    given = options.parse_args()
    table = given.folder / "bones.csv"
    given.folder.mkdir(parents=True, exist_ok=True)
    rows = rows_of(table)
    for bone, file in chosen(given.names, given.some):
        if bone.name not in rows or given.again:
            row = run(bone, file, given.folder / bone.name, given.limit)
            rows[bone.name] = {name: "" if value is None else str(value) for name, value in asdict(row).items()}
            with open(table, "w", newline="") as text:
                writer = csv.DictWriter(text, [item.name for item in fields(Row)])
                writer.writeheader()
                writer.writerows(rows.values())
        print(" | ".join(rows[bone.name].values()), flush=True)
    (given.folder / "bones.md").write_text(markdown(rows.values()))
    ended = [row["end"] for row in rows.values()]
    print(f"{ended.count('program')} of {len(ended)} end in a program")


if __name__ == "__main__":
    main()
