"""The patterns of passes on real bones: cusps by rays, length, time, and contacts a second.

    python tests/benchmarks/bench_paths.py [MESH:UNITS ...]

Cusps: rays along the normals of 40,000 random places of a level, cut by the capsules that the ball sweeps (no side-step
formula). Columns: curves; length at the contact, beside the area over the mean exact step; seconds by the time model
at 120 deg/s; mean height beside that of full cusps on a plane, a third of the scallop; largest height; lowest where
the ball fits. Then contacts of level 0 with centre, lead axis and the exact gouge check, a second of CPU, compiled code
and the tree of the triangles being there already; where opencamlib is installed, beside the positions that its 3-axis
drop cutter finds on the same triangles, the part lying.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

import bonecam
from bonecam.kernels.rays import Capsules, ProbesByCell, cut_normal_probes, probe_cells
from bonecam.levels.measure import MachinedLevel, machined_levels
from bonecam.machine.machine import read_machine
from bonecam.mesh.distance import MeshDistance
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.planning.axes.lead import lead_axes
from bonecam.planning.contacts import candidate_contacts
from bonecam.planning.patterns import CLOSED_PATTERNS, ISO_PARAMETRIC, curve_minutes, pattern_curves
from bonecam.planning.spacing import ROUND, Curves, ball_centres, contact_frames, sample_lines, side_step
from bonecam.surface.tspline import TSpline
from bonecam.tool.cutter import Cutter
from bonecam.workholding.post import post_below

BONES = Path(__file__).resolve().parents[3] / "shared" / "meshes" / "bones"
NAMES = ("3midph", "3distph", "scaphoid", "capitate")
RAYS = 40_000
CHORD = 0.008
"""Chord tolerance of the triangles that gouges are checked against, mm: about 12,000 on the phalanx."""
CELL = 0.5
RASTER = 0.1
"""Distance of the positions at which OpenCAMLib drops its cutter, mm."""
TURN_SPEED = np.radians(120.0) * 60
FITS = 0.9
"""Rays stand where the sharpest hollow has less than this share of the ball's curvature."""


def cases() -> list[str]:
    """What to cut."""
    import bonecam_meshes

    phalanx = f"{Path(bonecam_meshes.__file__).parent / 'phalanx.ply'}:mm"
    bones = [f"{BONES / name}_m.stl:m" for name in NAMES] if BONES.is_dir() else []
    return sys.argv[1:] or [phalanx, *bones]


def rays(surface: TSpline, radius: float) -> tuple[ndarray, ndarray]:
    """Places spread evenly over the area where the ball fits by curvature, and their normals."""
    rng = np.random.default_rng(1)
    low, high = surface.domain[1]
    places = np.column_stack([rng.random(8 * RAYS), low + (high - low) * rng.random(8 * RAYS)])
    _, Ss, St = surface.derivatives(places[:, 0], places[:, 1], 1)
    area = np.linalg.norm(np.cross(Ss, St), axis=1)
    places = places[rng.random(len(area)) < area / area.max()][:RAYS]
    places = places[-surface.curvature(*places.T).k2 * radius < FITS]
    points, normals, _ = contact_frames(surface, places, ROUND)
    return points, normals


def heights(
    points: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], centres: ndarray, joined: ndarray, radius: float
) -> Float[ndarray, " n"]:
    """What the swept balls leave above each point, mm."""
    order, starts, corner = probe_cells(points, CELL)
    left = np.ones(len(points))
    owners = np.full(len(points), -1)
    begins, ends = centres[:-1][joined], centres[1:][joined]
    capsules = Capsules(begins, ends, np.full(len(begins), radius), names=np.arange(len(begins)))
    probes = ProbesByCell(points[order], normals[order], starts, corner, CELL)
    cut_normal_probes(probes, 1.1, capsules, left, owners, from_top=False)
    return left


def mean_step(surface: TSpline, cutter: Cutter) -> float:
    """The exact step across lines s = const, mean over the area, mm."""
    rng = np.random.default_rng(2)
    s, t = rng.random(20_000), np.interp(rng.random(20_000), [0, 1], surface.domain[1])
    _, Ss, St, Sss, Sst, Stt = surface.derivatives(s, t, 2)
    normal = np.cross(Ss, St)
    area = np.linalg.norm(normal, axis=1)
    shear = -(Ss * St).sum(1) / (St * St).sum(1)
    across = Ss + shear[:, None] * St
    bent = ((Sss + 2 * shear[:, None] * Sst + shear[:, None] ** 2 * Stt) * normal).sum(1) / area
    curvature = np.maximum(-bent / (across * across).sum(1), -FITS / cutter.radius)
    return float((side_step(cutter.radius, cutter.scallop, curvature) * area).sum() / area.sum())


def report_level(name: str, level: MachinedLevel, cutter: Cutter) -> None:
    """One line a pattern."""
    surface, radius = level.surface, cutter.radius
    points, normals = rays(surface, radius)
    least = surface.area / mean_step(surface, cutter)
    print(f"{name} level {level.index}, R {radius:g}, {cutter.scallop:g} mm: area / mean step {least:.0f} mm")
    for pattern in ISO_PARAMETRIC + CLOSED_PATTERNS:
        began = time.process_time()
        curves: Curves = pattern_curves(surface, pattern, cutter, TURN_SPEED)
        seconds = time.process_time() - began
        lines = sample_lines(surface, curves, radius, 0.0005, 0.5)
        joined = lines.line[1:] == lines.line[:-1]
        contacts = contact_frames(surface, lines.parameters, ROUND)[0]
        length = np.linalg.norm(np.diff(contacts, axis=0), axis=1)[joined].sum()
        left = heights(points, normals, ball_centres(surface, lines, radius), joined, radius)
        touched = left[left > -0.001]
        print(
            f"  {pattern:12} {len(curves.group):4} curves {length:6.0f} mm {length / least:5.3f}"
            f" {60 * curve_minutes(surface, curves, cutter, TURN_SPEED):5.0f} s"
            f" mean {3 * touched.mean() / cutter.scallop:4.2f} max {1000 * left.max():5.1f} um"
            f" gouged {(left < -0.001).mean():6.2%} made in {seconds:.2f} s",
            flush=True,
        )


def report_speed(level: MachinedLevel, cutter: Cutter, job: bonecam.Job) -> None:
    """Contacts a second of CPU with axes, and lifts by the exact distance, of two patterns."""
    mesh = level.surface.tessellate(CHORD)
    distance = MeshDistance(mesh)
    post = post_below(mesh, job.holding)
    for pattern in ("along", "iso-scallop"):
        path = replace(job.path, pattern=pattern)
        for _ in range(2):
            began = time.process_time()
            found = candidate_contacts(level, [distance], cutter, post, path, turn_speed=TURN_SPEED)
            lead_axes(found.normals, found.feeds, np.radians(path.lead_deg))
            seconds = time.process_time() - began
        rate = len(found.line) / seconds
        print(f"  {pattern}: {len(found.line)} contacts on {len(mesh.faces)} triangles: {rate:.0f} a second of CPU")
    report_drop_cutter(mesh, cutter.radius)


def report_drop_cutter(mesh: TriangleMesh, radius: float) -> None:
    """Positions a second of CPU of OpenCAMLib's drop cutter on a raster over the lying part, one thread."""
    try:
        from opencamlib import ocl
    except ImportError:
        print("  opencamlib is not installed: pip install opencamlib")
        return
    corners = mesh.vertices[:, [2, 0, 1]][mesh.faces]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    surface = ocl.STLSurf()
    for triangle in corners.tolist():
        surface.addTriangle(ocl.Triangle(*(ocl.Point(*corner) for corner in triangle)))
    operation = ocl.BatchDropCutter()
    operation.setSTL(surface)
    operation.setThreads(1)
    operation.setCutter(ocl.BallCutter(2 * radius, 20.0))
    raster = [(x, y) for y in np.arange(low[1], high[1], RASTER) for x in np.arange(low[0], high[0], RASTER)]
    for x, y in raster:
        operation.appendPoint(ocl.CLPoint(float(x), float(y), float(low[2]) - 1.0))
    began = time.process_time()
    operation.run()
    rate = len(raster) / (time.process_time() - began)
    print(f"  opencamlib: {len(raster)} positions on {len(corners)} triangles: {rate:.0f} a second of CPU")


if __name__ == "__main__":
    for case in cases():
        mesh, units = case.rsplit(":", 1)
        job = bonecam.Job().with_values(mesh={"units": units}, holding={"diameter": 4.0})
        levels = machined_levels(bonecam.morph_levels(mesh, job).levels.levels)
        nose = read_machine(job.nc.machine).bodies.nose
        finishing = Cutter.from_job(2, "finishing", job.tool("finishing"), nose)
        roughing = Cutter.from_job(1, "roughing", job.tool("roughing"), nose)
        report_level(Path(mesh).stem, levels[0], finishing)
        report_level(Path(mesh).stem, levels[6], roughing)
        report_speed(levels[0], finishing, job)
