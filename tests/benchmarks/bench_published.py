"""The whole job beside the published method (Gan et al. 2014, section 4.3) at the same result.

    python tests/benchmarks/bench_published.py [MESH:UNITS ...]

Published: zig-zag on iso-parametric lines from pole to pole on every level, the next line at the smallest step found on
this one, each line over the whole surface. Ours: the default job, with the fastest of three patterns on each level,
lines that end where their neighbours suffice, and what would cut air left out. Part, stock, post, levels, cutters,
limits of scallop, chord and depth, tool axes, rest paths and links are planned by the same code. Each program is read
back and simulated.
"""

import sys
from pathlib import Path

import numpy as np

import bonecam
from bonecam.tool import MoveKind

PHALANX = Path(__file__).resolve().parents[2] / "meshes" / "phalanx.ply"
BONES = Path(__file__).resolve().parents[3] / "shared" / "meshes" / "bones"
NAMES = ("3midph", "capitate")
COLUMNS = ("part", "paths", "cuts mm", "min", "retracts", "left mm2", "highest mm", "mean left um")


def cases() -> list[str]:
    """What to convert."""
    bones = [f"{BONES / name}_m.stl:m" for name in NAMES] if BONES.is_dir() else []
    return sys.argv[1:] or [f"{PHALANX}:mm", *bones]


def published(mesh: str, job: bonecam.Job) -> bonecam.Result:
    """The job by the published method."""
    return bonecam.convert(mesh, job.with_values(path={"pattern": "published"}))


def row(result: bonecam.Result) -> list[str]:
    """What the table tells of a program: first the length of its cuts (mm) and its time (min)."""
    removal = result.removal
    assert removal is not None
    assert removal.left is not None
    length, retracts = 0.0, 0
    for path in result.paths:
        cuts = path.kinds[1:] == MoveKind.CUT
        length += float(np.linalg.norm(np.diff(path.tips, axis=0), axis=1)[cuts].sum())
        rapids = np.cumsum(path.kinds == MoveKind.RAPID)[path.kinds == MoveKind.CUT]
        retracts += int((np.diff(rapids) > 0).sum())
    left = result.report["removal"]["left"]
    reached = removal.left.heights[removal.left.heights < 0.02]
    return [
        *(f"{length:.0f}", f"{result.report['nc']['time_min']:.1f}", str(retracts)),
        *(f"{left['area_over_0_02_mm2']:.1f}", f"{left['max_mm']:.2f}", f"{1000 * reached.mean():.1f}"),
    ]


if __name__ == "__main__":
    print(" | ".join(COLUMNS))
    for case in cases():
        mesh, units = case.rsplit(":", 1)
        job = bonecam.Job().with_values(mesh={"units": units})
        before, after = row(published(mesh, job)), row(bonecam.convert(mesh, job))
        for name, figures in (("published", before), ("ours", after)):
            print(" | ".join([Path(mesh).stem, name, *figures]), flush=True)
        shorter, sooner = (100 * (1 - float(after[k]) / float(before[k])) for k in (0, 1))
        print(f"{Path(mesh).stem}: {shorter:.0f} % shorter, {sooner:.0f} % less time", flush=True)
