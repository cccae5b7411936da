"""The three strategies on the same parts: morphing, iso-height milling from two sides, sectional rotary milling; each
planned, posted, read back and simulated.

    python tests/benchmarks/bench_strategies.py [MESH:UNITS ...]

Without arguments the shipped phalanx and, where the shared data are, four bones.
"""

import sys
from pathlib import Path

import numpy as np

import bonecam
from bonecam.tool import MoveKind

BONES = Path(__file__).resolve().parents[3] / "shared" / "meshes" / "bones"
NAMES = ("3midph", "3distph")
PHALANX = Path(__file__).resolve().parents[2] / "meshes" / "phalanx.ply"
STRATEGIES = ("morph", "iso-height", "rotary")
COLUMNS = (
    *("part", "strategy", "layers", "min", "cuts m", "air %", "feed mm/min"),
    *("roughing mean / 99 % / max mm", "finishing", "left mm2", "highest mm", "mean left um"),
)


def cases() -> list[str]:
    """What to convert."""
    bones = [f"{BONES / name}_m.stl:m" for name in NAMES] if BONES.is_dir() else []
    return sys.argv[1:] or [f"{PHALANX}:mm", *bones]


def row(case: str, strategy: str) -> list[str]:
    """One line of the table: depths as simulated, over all layers of a cutter weighted by what each removes."""
    mesh, units = case.split(":")
    job = bonecam.Job().with_values(mesh={"units": units}, path={"strategy": strategy})
    try:
        result = bonecam.convert(mesh, job)
    except bonecam.BonecamError as error:
        return [Path(mesh).stem, strategy, str(error)]
    removal = result.removal
    assert removal is not None
    assert removal.left is not None
    lengths = [
        np.linalg.norm(np.diff(path.tips, axis=0), axis=1)[path.kinds[1:] == MoveKind.CUT].sum()
        for path in result.paths
    ]
    air = np.average([level.air_time_share for level in removal.levels], weights=lengths)
    nc, left = result.report["nc"], result.report["removal"]["left"]
    depths = []
    for tool in (1, 2):
        some = [level for level in removal.levels if level.tool == tool and level.deepest is not None]
        removed = [level.removed for level in some]
        mean = np.average([level.depth_mean for level in some], weights=removed)
        high = np.average([level.depth_p99 for level in some], weights=removed)
        most = max(level.deepest.value for level in some if level.deepest)
        depths.append(f"{mean:.2f} / {high:.2f} / {most:.2f}")
    reached = removal.left.heights[removal.left.heights < 0.02]
    return [
        *(Path(mesh).stem, strategy, str(len(result.paths))),
        *(f"{nc['time_min']:.1f}", f"{sum(lengths) / 1000:.1f}", f"{100 * air:.0f}"),
        *(f"{nc['feed_median_mm_min']:.0f}", *depths),
        *(f"{left['area_over_0_02_mm2']:.1f}", f"{left['max_mm']:.2f}", f"{1000 * reached.mean():.1f}"),
    ]


if __name__ == "__main__":
    print(" | ".join(COLUMNS))
    for case in cases():
        for strategy in STRATEGIES:
            print(" | ".join(row(case, strategy)), flush=True)
