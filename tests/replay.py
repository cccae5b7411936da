"""Play runs on a base revision and on the working tree, and compare what they write, byte for byte.

    python tests/replay.py --base REF [--only NAME ...] [--jobs N]      or  make replay BASE=REF

The runs stand in `replay.toml`: calls of `bonecam`, with {meshes} for the meshes that ship, {small} for the phalanx at
0.45 of its size, {coarse} for a job that is soon done and {out} for a fresh folder of the run. What is printed is
compared too, and of JSON files all but seconds. The base is checked out, and its results are kept, under out/replay.
Exit 1 where something differs, or fails where the base did not.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "out" / "replay"
SECONDS = re.compile(r"^(time  |expected).*|, \d+(\.\d+)? (CPU )?s\b.*", re.MULTILINE)
"""Words of a summary that differ from run to run."""
OF_A_RUN = {"seconds", "cpu_seconds", "planning_cpu_s"}
"""Keys of a report that do."""
SIZE = 0.45
"""Of the small phalanx."""


def timeless(told: Any) -> Any:
    """JSON without what differs from run to run."""
    if isinstance(told, dict):
        return {key: timeless(value) for key, value in told.items() if key not in OF_A_RUN}
    return [timeless(value) for value in told] if isinstance(told, list) else told


def written(place: Path, tree: Path) -> dict[str, bytes]:
    """What a run of a tree wrote, by name, in a form that is compared."""
    files = {path.relative_to(place).as_posix(): path for path in place.rglob("*") if path.is_file()}
    contents = {name: path.read_bytes() for name, path in files.items()}
    for path, stands in ((place, b"OUT"), (tree / "bonecam_meshes", b"MESHES")):
        contents = {name: content.replace(str(path).encode(), stands) for name, content in contents.items()}
    for name, content in contents.items():
        if name.endswith(".json"):
            contents[name] = json.dumps(timeless(json.loads(content)), indent=0).encode()
        elif name == "printed.txt":
            contents[name] = SECONDS.sub("", content.decode()).encode()
    # pictures, and what holds paths in a form of its own: sums of files, the compressed page
    left_out = (".png", ".html", ".bonecam-files", "view.gz")
    return {name: content for name, content in contents.items() if not name.endswith(left_out)}


def play(calls: list[str], tree: Path, place: Path) -> dict[str, bytes]:
    """Play the calls of a run on a tree: what they write, with what they print and their exit codes."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    names = {"meshes": ROOT / "meshes", "small": KEPT / "small.ply", "out": place}
    coarse = f"--job {ROOT / 'tests' / 'coarse.toml'}"
    environment = {
        **os.environ,
        "PYTHONPATH": str(tree),
        "NUMBA_CACHE_DIR": str(tree / "out" / "numba"),
        "OMP_NUM_THREADS": "1",
    }
    printed = ""
    for words in calls:
        call = [sys.executable, "-m", "bonecam", *words.format(coarse=coarse, **names).split()]
        done = subprocess.run(call, cwd=place, env=environment, capture_output=True, text=True)
        printed += f"{words}\n{done.stdout}{done.stderr}exit {done.returncode}\n"
    (place / "printed.txt").write_text(printed, encoding="utf-8")
    return written(place, tree)


def checked_out(reference: str) -> Path:
    """The tree of a revision under KEPT."""
    call = ["git", "rev-parse", f"{reference}^{{commit}}"]
    revision = subprocess.run(call, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()
    tree = KEPT / revision[:12]
    if not tree.is_dir():
        tree.mkdir(parents=True)
        archive = subprocess.run(["git", "archive", revision], cwd=ROOT, capture_output=True, check=True)
        subprocess.run(["tar", "-x", "-C", str(tree)], input=archive.stdout, check=True)
        for name in ("plugins", "meshes"):  # those of the base, not the installed ones
            (tree / f"bonecam_{name}").symlink_to(name)
    return tree


def played_before(name: str, calls: list[str], tree: Path) -> dict[str, bytes]:
    """What a run writes on the base: as kept, if these calls were played before."""
    place = tree / "replayed" / name
    record = tree / "replayed" / f"{name}.txt"
    if record.exists() and record.read_text(encoding="utf-8") == "\n".join(calls):
        return written(place, tree)
    files = play(calls, tree, place)
    record.write_text("\n".join(calls), encoding="utf-8")
    return files


def first_difference(before: bytes, after: bytes) -> str:
    """The first line in which two files differ."""
    for number, (one, other) in enumerate(zip(before.splitlines(), after.splitlines()), 1):
        if one != other:
            return f"line {number}: {one[:80]!r} -> {other[:80]!r}"
    return "one is longer"


def main() -> int:
    """Play and compare: 0 if all is the same."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", required=True, metavar="REF")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    runs = tomllib.loads((ROOT / "tests" / "replay.toml").read_text(encoding="utf-8"))
    runs = {name: words for name, words in runs.items() if not options.only or name in options.only}
    tree = checked_out(options.base)
    if not (KEPT / "small.ply").exists():
        from bonecam.mesh import TriangleMesh, read_mesh, write_mesh

        mesh = read_mesh(ROOT / "meshes" / "phalanx.ply")
        write_mesh(TriangleMesh(SIZE * mesh.vertices, mesh.faces), KEPT / "small.ply")

    def both(name: str) -> tuple[dict[str, bytes], dict[str, bytes]]:
        return played_before(name, runs[name], tree), play(runs[name], ROOT, KEPT / "now" / name)

    worst = 0
    with ThreadPoolExecutor(options.jobs) as pool:
        for name, (before, after) in zip(runs, pool.map(both, runs)):
            other = [file for file in sorted({*before, *after}) if before.get(file) != after.get(file)]
            print(f"{'DIFFERS' if other else 'same':8} {name}: {len(after)} files", flush=True)
            for file in other:
                worst = 1
                sides = before.get(file), after.get(file)
                told = "on one side only" if None in sides else first_difference(*map(bytes, sides))  # type: ignore[arg-type]
                print(f"         {file}: {told}", flush=True)
    return worst


if __name__ == "__main__":
    sys.exit(main())
