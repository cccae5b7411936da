"""The report: figures of every stage under names that stay (`--report FILE.json`)."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from bonecam.arrays import unit
from bonecam.errors import counted
from bonecam.levels.measure import Level, rounding_cuts
from bonecam.mesh.smooth_surface import nearest_areas
from bonecam.mesh.triangle_mesh import TriangleMesh
from bonecam.nc.parts import part_count
from bonecam.nc.program import Program
from bonecam.planning.links import begins_tangentially
from bonecam.planning.stump import cut_groove
from bonecam.surface.growth import Fit
from bonecam.tool.path import PARTING, MoveKind, ToolPath
from bonecam.verify.gouge import Gouge
from bonecam.verify.proof import Verification


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
            "depth_full_mean_mm": _mm(level.measures.full_depth_mean) if level.measures.full_depth_area else None,
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
    certificate = level.certificate
    names = ("depth_certified_mm", "nesting_certified_mm", "outside_certified_mm")
    if certificate is None:
        return {**dict.fromkeys(names), "not_certified": None}
    values = (
        _mm(value) + 0.0 if np.isfinite(value) else None
        for value in (certificate.depth, certificate.nesting, certificate.outside)
    )
    return {**dict(zip(names, values)), "not_certified": list(certificate.shortfalls(level.limit))}


def toolpath_report(paths: Sequence[ToolPath], least_lead: float) -> list[dict[str, Any]]:
    """`toolpath` of the report, in machining order; axes in cones are to keep off the normal by `least_lead`, radians,
    for the tip of a ball does not cut. `cones` and what is told of them are null where axes are not chosen in cones."""
    rows = []
    for path in paths:
        cutting = path.kinds == MoveKind.CUT
        steps = np.linalg.norm(np.diff(path.tips, axis=0, prepend=path.tips[:1]), axis=1)
        reasons = {reason: path.reasons.count(reason) for reason in sorted(set(path.reasons))}
        cones: dict[str, Any] | None = None
        if path.cones is not None:
            cones = {
                "count": len(np.unique(path.cones.cone_of[path.cones.cone_of >= 0])),
                "shape": "circular" if path.cones.circular else "elliptic",
                # FCL's word on all cones that were made for the path, where it was asked
                "fcl": asdict(path.cones.check) if path.cones.check else None,
            }
        rows.append(
            {
                "level": path.level,
                "cutter_radius_mm": path.cutter.radius,
                "scallop_limit_mm": path.cutter.scallop,
                "passes": len(np.unique(path.pass_index[cutting])),
                "contacts": int((~np.isnan(path.contacts[:, 0])).sum()),
                **_entries(path),
                "length_mm": round(float(steps[cutting].sum()), 1),
                "trimmed_mm": round(path.trimmed, 1),
                "trimmed_min": round(path.trimmed / path.cutter.feed, 3),
                "uncut_contacts": len(path.uncut),
                "uncut_reasons": reasons,
                "blocked_by": dict(path.blocked_by),
                "cones": cones,
                "poses": asdict(path.poses) if path.poses else None,
                **_near_normal(path, least_lead),
            }
        )
    return rows


def _entries(path: ToolPath) -> dict[str, int]:
    """How often the tool comes to a cut from a link or a rapid, and how often it comes and goes along the cut's own
    direction."""
    cutting = path.kinds == MoveKind.CUT
    first = np.flatnonzero(cutting & np.r_[True, ~cutting[:-1]]).tolist()
    ends = (np.flatnonzero(cutting & np.r_[~cutting[1:], True]) + 1).tolist()
    balls = path.balls
    cuts = list(zip(first, ends, strict=True))
    come = sum(begins_tangentially(balls[max(a - 1, 0)], balls[a:b]) for a, b in cuts)
    # a cut run backwards begins where it ends
    go = sum(begins_tangentially(balls[min(b, len(balls) - 1)], balls[a:b][::-1]) for a, b in cuts)
    return {"entries": len(first), "entries_tangential": come, "exits_tangential": go}


def uncut_areas(paths: Sequence[ToolPath], part: TriangleMesh) -> dict[str, float]:
    """`uncut_mm2` of the report: the area of the part whose nearest contact on its `paths` was left out, by reason."""
    paths = [path for path in paths if path.level == 0]
    reasons = np.array([reason for path in paths for reason in path.reasons])
    cut = [path.contacts[~np.isnan(path.contacts[:, 0])] for path in paths]
    areas = nearest_areas(part, np.vstack([*(path.uncut for path in paths), *cut]))[: len(reasons)]
    return {str(reason): round(float(areas[reasons == reason].sum()), 2) for reason in np.unique(reasons)}


def parting_report(paths: Sequence[ToolPath], part: TriangleMesh) -> dict[str, dict[str, Any]]:
    """`parting` of the report, if the paths part the `part` from its post: the groove, and the stump that stays above
    it."""
    groove = cut_groove(paths)
    if groove is None:
        return {}
    steps = [path for path in paths if path.level == PARTING]
    return {
        "parting": {
            "tool": steps[0].cutter.number,
            "steps": len(steps),
            "z_mm": _mm(groove.middle),
            "width_mm": 2 * groove.radius,
            "bridge_diameter_mm": _mm(2 * groove.bridge),
            "stump_height_mm": _mm(float(part.bounds[0, 2]) - groove.middle - groove.radius),
        }
    }


def parting_text(parting: Mapping[str, Any]) -> str:
    """The parting groove and what stays above it."""
    groove = f"groove of {parting['width_mm']:g} mm round the post at z {parting['z_mm']:.2f}"
    bridge = f"a bridge of {parting['bridge_diameter_mm']:.2f} mm holds the part"
    return f"{groove}, {counted(parting['steps'], 'step')}; {bridge}; stump {parting['stump_height_mm']:.2f} mm high"


def _near_normal(path: ToolPath, least_lead: float) -> dict[str, int | None]:
    """Contacts whose axis is nearer to the normal than the least lead, and those of them whose cone holds no axis that
    is not, or who have no cone; null where axes are not chosen in cones."""
    names = ("near_normal_contacts", "near_normal_without_choice")
    if path.cones is None:
        return dict.fromkeys(names)
    near = np.flatnonzero(path.leads < least_lead)
    held = near[path.cones.cone_of[near] >= 0]
    cone = path.cones.cone_of[held]
    normals = unit(path.balls[held] - path.contacts[held])
    farthest = path.cones.shapes.take(cone).largest_angles(normals)
    forced = len(near) - int((farthest >= least_lead).sum())
    return dict(zip(names, (len(near), forced)))


def surface_report(fitted: Fit) -> dict[str, Any]:
    """`surface` of the report: control points and the deviation both ways."""
    deviation = fitted.deviation
    return {
        "control_points": fitted.control_points,
        "deviation_max_mm": _mm(deviation.max),
        "deviation_rms_mm": _mm(deviation.rms),
        "surface_to_mesh_max_mm": _mm(deviation.surface_to_mesh_max),
        "mesh_to_surface_max_mm": _mm(deviation.mesh_to_surface_max),
        "tolerance_mm": fitted.tolerance,
        "tolerance_reached": fitted.reached,
    }


def nc_report(program: Program, proof: Verification) -> dict[str, Any]:
    """`nc` of the report but for the file's name: what was posted and what reading it back proved."""
    return {
        "machine": program.machine,
        "controller": program.controller,
        "parts": part_count(program.text),
        "blocks": program.blocks,
        "moves": program.moves,
        "readback_tip_error_mm": _mm(proof.readback_tip_error_mm),
        "readback_axis_error_deg": _mm(proof.readback_axis_error_deg),
        "gouge_max_mm": _mm(max(proof.gouge.depth, 0.0)),
        **gouge_to_given(proof.given),
        "rewinds": program.rewinds,
        "rewinds_lifted": program.lifts,
        "rotary_max_deg_per_block": _mm(program.rotary_max_deg_per_block),
        **program.time.report,
        "feed_median_mm_min": round(program.feeds.median, 1),
        "feed_low_mm_min": round(program.feeds.low, 1),
        "feed_axis_limited_share": round(program.feeds.limited, 4),
        "feed_beyond_axes_share": round(program.feeds.beyond, 4),
        "feed_under_half_blocks": program.feeds.under_half,
    }


def gouge_to_given(gouge: Gouge | None) -> dict[str, Any]:
    """In `nc` of the report: how deep the ball goes into the mesh as given, with line and place; nothing where that was
    not measured."""
    if gouge is None:
        return {}
    return {
        "gouge_to_given_max_mm": _mm(max(gouge.depth, 0.0)),
        "gouge_to_given_line": gouge.line,
        "gouge_to_given_place": [round(value, 3) for value in gouge.place],
    }


def _mm(value: float) -> float:
    return round(float(value), 6)
