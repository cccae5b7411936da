"""The report: figures of every stage under names that stay (`--report FILE.json`)."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from bonecam.errors import counted
from bonecam.levels.closed_morph import METHODS
from bonecam.levels.measure.level import Level, rounding_cuts
from bonecam.levels.problem.tolerances import NESTING_TOLERANCE
from bonecam.nc.program import Program
from bonecam.setup.stock import stock_text
from bonecam.surface.fitting.fit import Fit
from bonecam.toolpath.path import Kind, ToolPath
from bonecam.verify.proof import Verification

WHY = {
    "post": "at the post",
    "gouge": "ball too large for the hollow",
    "covered": "behind what a larger ball left",
    "short": "too short for a plunge",
    "collision": "no free way for the tool",
    "limits": "beyond the machine's tilt",
}
"""What each reason for leaving a contact uncut means."""


SLENDER = 15.0
"""A post that is longer than this many diameters is told of: 5 N at its top bend one of aluminium, 4 mm thick and 60
mm long, by 0.4 mm."""


def levels_report(levels: Sequence[Level]) -> list[dict[str, Any]]:
    """`levels` of the report: what was measured on each; shares of the area by depth, in even bins from 0 to
    the limit.

    `depth_full_mean_mm` is null where less than a full depth was left everywhere.
    `rounding` says whether the cut up to this level only rounds a stock with edges, exactly: it has no
    certificate.
    """
    rounding = rounding_cuts(levels)
    return [
        {
            "index": level.index,
            "limit_mm": _mm(level.limit),
            "depth_max_mm": _mm(level.depth_max),
            "depth_back_max_mm": _mm(level.measures.reverse_depth_max),
            "depth_mean_mm": _mm(level.depth_mean),
            "nesting_min_mm": _mm(level.nesting_min),
            "self_intersections": level.measures.self_intersections,
            "depth_full_mean_mm": _mm(level.measures.full_depth_mean)
            if level.measures.full_depth_area
            else None,
            "outside_stock_mm": _mm(level.outside),
            "depth_shares": [round(share, 4) for share in level.measures.depth_shares],
            "rounding": level.index in rounding,
            **_certified(level),
        }
        for level in levels
    ]


def _certified(level: Level) -> dict[str, Any]:
    """What holds everywhere on a level, also between the points measured; null where nothing is known, or
    nothing has to be."""
    found = level.certificate
    names = ("depth_certified_mm", "nesting_certified_mm", "outside_certified_mm")
    if found is None:
        return {**dict.fromkeys(names), "not_certified": None}
    values = (
        _mm(value) + 0.0 if np.isfinite(value) else None
        for value in (found.depth, found.nesting, found.outside)
    )
    return {**dict(zip(names, values)), "not_certified": list(found.shortfalls(level.limit))}


def toolpath_report(paths: Sequence[ToolPath]) -> list[dict[str, Any]]:
    """`toolpath` of the report, in machining order."""
    rows = []
    for path in paths:
        cutting = path.kinds == Kind.CUT
        steps = np.linalg.norm(np.diff(path.tips, axis=0, prepend=path.tips[:1]), axis=1)
        reasons = {reason: path.reasons.count(reason) for reason in sorted(set(path.reasons))}
        rows.append(
            {
                "level": path.level,
                "cutter_radius_mm": path.cutter.radius,
                "scallop_limit_mm": path.cutter.scallop,
                "passes": len(np.unique(path.pass_index[cutting])),
                "contacts": int((~np.isnan(path.contacts[:, 0])).sum()),
                "length_mm": round(float(steps[cutting].sum()), 1),
                "uncut_contacts": len(path.uncut),
                "uncut_reasons": reasons,
            }
        )
    return rows


def surface_report(fitted: Fit) -> dict[str, Any]:
    """`surface` of the report: control points and the deviation both ways."""
    found = fitted.deviation
    return {
        "control_points": fitted.control_points,
        "deviation_max_mm": _mm(found.max),
        "deviation_rms_mm": _mm(found.rms),
        "surface_to_mesh_max_mm": _mm(found.surface_to_mesh_max),
        "mesh_to_surface_max_mm": _mm(found.mesh_to_surface_max),
        "tolerance_mm": fitted.tolerance,
        "tolerance_reached": fitted.reached,
    }


def nc_report(program: Program, proof: Verification) -> dict[str, Any]:
    """`nc` of the report but for the file's name: what was posted and what reading it back proved."""
    return {
        "machine": program.machine,
        "controller": program.controller,
        "blocks": program.blocks,
        "moves": program.moves,
        "readback_tip_error_mm": _mm(proof.readback_tip_error_mm),
        "readback_axis_error_deg": _mm(proof.readback_axis_error_deg),
        "gouge_max_mm": _mm(max(proof.gouge.depth, 0.0)),
        "rotary_max_deg_per_block": _mm(program.rotary_max_deg_per_block),
        "time_min": round(program.time_min, 2),
        "feed_median_mm_min": round(program.feeds.median, 1),
        "feed_low_mm_min": round(program.feeds.low, 1),
        "feed_axis_limited_share": round(program.feeds.limited, 4),
        "feed_beyond_axes_share": round(program.feeds.beyond, 4),
    }


def summary_of(report: Mapping[str, Any]) -> str:
    """The report in a few lines for a person; it may end at the levels."""
    lines = [
        *_mesh_lines(report["input"]),
        _surface_line(report["surface"]),
        *_given_lines(report),
        f"stock     {stock_text(report['stock'])}",
        *_post_lines(report.get("post")),
        _levels_line(report),
        f"certified {certified_text(report['levels'], report['levels_method'])}",
        *(_program_lines(report["toolpath"], report["nc"]) if "nc" in report else ()),
        f"time      {sum(report['seconds'].values()):.1f} s",
    ]
    return "\n".join(lines)


def _mesh_lines(mesh: Mapping[str, Any]) -> Iterator[str]:
    """The mesh and its repairs."""
    yield f"mesh      {mesh['faces']} faces, {mesh['units']}; {counted(len(mesh['repairs']), 'repair')}"
    for told in mesh["repairs"]:
        yield f"repair    {told}"


def _surface_line(surface: Mapping[str, Any]) -> str:
    """Size and deviation of the surface."""
    deviation = f"max {surface['deviation_max_mm']:.3f} rms {surface['deviation_rms_mm']:.3f} mm"
    return f"surface   {surface['control_points']} control points, deviation {deviation}"


def _given_lines(report: Mapping[str, Any]) -> Iterator[str]:
    """Where the mesh was repaired, how far the surface is from it as it was given."""
    if report["input"]["repairs"]:
        given = f"{report['surface']['given_deviation_max_mm']:.3f} mm to the mesh as given"
        moved = f"{report['input']['repair_deviation_max_mm']:.3f} mm of repair and filling"
        yield f"as given  max {given}, with {moved}"


def _post_lines(post: Mapping[str, Any] | None) -> Iterator[str]:
    """The post, and a warning where it is so slender that it bends like a spring."""
    if post is not None:
        slender = post["length_mm"] > SLENDER * post["diameter_mm"]
        warning = (
            "; slender: a thicker post, a chuck below it or a slimmer holder and spindle help"
            if slender
            else ""
        )
        yield f"post      {post['diameter_mm']:g} x {post['length_mm']:g} mm{warning}"


def _levels_line(report: Mapping[str, Any]) -> str:
    """Cuts, their lower bound, and depths."""
    levels, breaks = report["levels"], report["levels_break_mm"]
    deepest = max(row[depth] for row in levels for depth in ("depth_max_mm", "depth_back_max_mm"))
    bound = f"no schedule needs fewer than {report['levels_lower_bound']}"
    broken = f"; a limit is broken by {breaks:.4f} mm" if breaks else ""
    return f"levels    {counted(len(levels) - 1, 'cut')}, {bound}; depth max {deepest:.4f} mm{broken}"


def _program_lines(toolpath: Sequence[Mapping[str, Any]], nc: Mapping[str, Any]) -> Iterator[str]:
    """Paths, program and proof."""
    yield f"toolpath  {sum(row['contacts'] for row in toolpath)} contacts"
    yield f"uncut     {uncut_text(toolpath)}"
    file = nc["file"] or "not written"
    machine = f"{nc['machine']} / {nc['controller']}"
    yield f"nc        {file}: {nc['blocks']} blocks for {machine}, about {nc['time_min']:.0f} min"
    median, low = nc["feed_median_mm_min"], nc["feed_low_mm_min"]
    share = f"an axis limits {nc['feed_axis_limited_share']:.0%} of the cutting blocks"
    yield f"feed      median {median:.0f}, a tenth below {low:.0f} mm/min; {share}"
    tip_um, gouge_um = nc["readback_tip_error_mm"] * 1000, nc["gouge_max_mm"] * 1000
    axis_deg = nc["readback_axis_error_deg"]
    yield f"proof     tip {tip_um:.2f} um, axis {axis_deg:.4f} deg, gouge {gouge_um:.2f} um"


def certified_text(levels: Sequence[Mapping[str, Any]], method: str = "qp") -> str:
    """What holds between the points measured, in one line; `levels` as in the report, made by `method`."""
    known = [row for row in levels if row["not_certified"] is not None]
    rounding = sum(row["rounding"] for row in levels)
    exact = []
    if rounding:
        exact = [f"{counted(rounding, 'more cut')} only to round the stock, exact by construction"]
    if not known:
        without = counted(len(levels) - 1 - rounding, "cut")
        return "; ".join([f"nothing on {without}: {_why_uncertified(method)}", *exact])

    doubts = [f"cut {row['index']} {doubt}" for row in known for doubt in row["not_certified"]]
    kept = sum(not row["not_certified"] for row in known)
    all_known = counted(len(known), "cut")
    return "; ".join([f"depth, nesting and stock hold everywhere on {kept} of {all_known}", *exact, *doubts])


def _why_uncertified(method: str) -> str:
    """Why levels made by `method` have no certificate."""
    behind = METHODS[method][0]
    if behind <= NESTING_TOLERANCE:
        return "the surface is not polynomial (it has weights other than one)"
    return (
        f"levels by {method} may fall {behind:g} mm behind one another, "
        f"more than the {NESTING_TOLERANCE:g} mm of a certificate"
    )


def uncut_text(toolpath: Sequence[Mapping[str, Any]]) -> str:
    """Which contacts were left uncut and why, a line for the part and one for the levels round it; `toolpath`
    as in the report."""
    told = []
    for where, outer in (("on the part", False), ("on levels round it", True)):
        reasons: Counter[str] = sum(
            (Counter(row["uncut_reasons"]) for row in toolpath if bool(row["level"]) == outer), Counter()
        )
        if reasons:
            each = ", ".join(f"{reason} {count} ({WHY[reason]})" for reason, count in reasons.most_common())
            told.append(f"{counted(reasons.total(), 'contact')} {where}: {each}")
    return f"\n{' ' * 10}".join(told) or "nothing"


def _mm(value: float) -> float:
    return round(float(value), 6)
