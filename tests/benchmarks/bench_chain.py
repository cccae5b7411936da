"""The whole chain on real bones, each in a process of its own, beside the limits it is held to: 120 s, 2 GB,
K_min + 2 cuts, 0.01 mm.

    python tests/benchmarks/bench_chain.py [MESH:UNITS[:DIAMETER:LENGTH] ...]

Without arguments the bones of genus 0 below 70 mm of the shared data, or else the shipped phalanx.
"""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

BONES = Path(__file__).resolve().parents[3] / "shared" / "meshes" / "bones"
NAMES = ("3midph", "2midph", "3distph", "3proxph", "1mc", "3mc", "scaphoid", "capitate", "metatarsal1_rv")
SIZES = {"3midph": ":15:37"}
COLUMNS = (
    "mesh",
    "points",
    "max",
    "rms",
    "K",
    "K_min",
    "contacts",
    "uncut",
    "gouge um",
    "tip um",
    "seconds",
    "CPU s",
    "MB",
)
ONE = """
import json, resource, sys, time
import bonecam
mesh, units, diameter, length = sys.argv[1:]
job = bonecam.Job().with_values(mesh={"units": units}, stock={"diameter": float(diameter), "length": float(length)})
began, cpu = time.perf_counter(), time.process_time()
try:
    result = bonecam.convert(mesh, job)
    answer = {"report": result.report}
except bonecam.BonecamError as error:
    answer = {"error": str(error)}
seconds = time.perf_counter() - began
cpu = time.process_time() - cpu
most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({**answer, "seconds": seconds, "cpu": cpu, "MB": most}))
"""


def cases() -> list[str]:
    """What to convert."""
    if sys.argv[1:]:
        return sys.argv[1:]
    if BONES.is_dir():
        return [f"{BONES / name}_m.stl:m{SIZES.get(name, '')}" for name in NAMES]
    import bonecam_meshes

    return [f"{Path(bonecam_meshes.__file__).parent / 'phalanx.ply'}:mm"]


def row(case: str) -> list[str]:
    """One line of the table."""
    mesh, units, *size = case.split(":")
    run = subprocess.run(
        [sys.executable, "-c", ONE, mesh, units, *(size or ["0", "0"])], stdout=subprocess.PIPE, text=True, check=True
    )
    found = json.loads(run.stdout)
    name, cost = Path(mesh).stem, [f"{found[key]:.0f}" for key in ("seconds", "cpu", "MB")]
    if "error" in found:
        return [name, found["error"], *cost]
    report = found["report"]
    surface, nc, paths = report["surface"], report["nc"], report["toolpath"]
    reasons = sum((Counter(path["uncut_reasons"]) for path in paths), Counter())
    return [
        name,
        f"{surface['control_points']}",
        f"{surface['deviation_max_mm']:.3f}",
        f"{surface['deviation_rms_mm']:.3f}",
        f"{len(report['levels']) - 1}",
        f"{report['levels_lower_bound']}",
        f"{sum(path['contacts'] for path in paths)}",
        " ".join(f"{reason} {count}" for reason, count in sorted(reasons.items())),
        f"{1000 * nc['gouge_max_mm']:.1f}",
        f"{1000 * nc['readback_tip_error_mm']:.2f}",
        *cost,
    ]


if __name__ == "__main__":
    print(" | ".join(COLUMNS))
    for case in cases():
        print(" | ".join(row(case)), flush=True)
