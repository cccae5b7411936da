"""The report in a few lines for a person, and a comparison of tool axes.

Smooth tool axes stand beside the surface's normals and axes that lean by a lead angle, at the same contacts (Xu et al.
2013, Fig. 10 and section 7.3). Turning is that of the axis along a pass, a length of way of the ball's centre;
travels, speeds and time are those of the machine's rotary axes, tilt (polar angle) and turn (azimuth), without
accelerations.
"""

import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from bonecam.arrays import angles_between, dots, lengths, unit
from bonecam.errors import counted
from bonecam.job import PathJob
from bonecam.levels.closed_morph import method_of
from bonecam.levels.problem import NESTING_TOLERANCE
from bonecam.machine.limits import MachineLimits, rotary_turns
from bonecam.planning.axes.lead import lead_axes
from bonecam.planning.axes.tool_axes import choose_axes
from bonecam.planning.collision import CollisionChecker
from bonecam.planning.estimate import estimate_lines
from bonecam.planning.scene import Scene
from bonecam.report.stage_reports import parting_text
from bonecam.report.warnings import WIDTH, cutter_lines, feed_lines, mechanics_lines, post_lines, warning_lines
from bonecam.setup.stock import stock_text
from bonecam.tool.path import ContactPath, MoveKind, ToolPath
from bonecam.verify.findings import given_lines, into_given

FEEDS = (900, 1200, 3000)
"""Feeds at which the time is told beside that at the cutter's own, mm/min: the paper's before and after, and more."""
HIGH = 90
"""Percentile of the moves whose axis speeds are told."""


@dataclass(frozen=True, eq=False)
class AxisChoice:
    """Unit tool `axes` at the contacts of a path, and at which of them the tool is `free` of collision and the machine
    can take the axis (`reached`)."""

    name: str
    axes: Float[ndarray, "n 3"]
    free: Bool[ndarray, " n"]
    reached: Bool[ndarray, " n"]


@dataclass(frozen=True, eq=False)
class AxisComparison:
    """Choices of axes at the contacts that a path cuts: its own last. `balls` are the ball's centres, mm; `feed` is the
    cutter's, mm/min."""

    contacts: Float[ndarray, "n 3"]
    balls: Float[ndarray, "n 3"]
    passes: Int[ndarray, " n"]
    feed: float
    limits: MachineLimits
    choices: tuple[AxisChoice, ...]

    @cached_property
    def steps(self) -> Float[ndarray, " m"]:
        """Lengths of the moves between contacts of one pass, mm."""
        return lengths(np.diff(self.balls, axis=0))[self.joined]

    @cached_property
    def joined(self) -> Bool[ndarray, " m"]:
        """Which contacts but the last are followed by one of the same pass, in another place."""
        apart = lengths(np.diff(self.balls, axis=0)) > np.finfo(float).eps
        return (np.diff(self.passes) == 0) & apart

    def figures(self, choice: AxisChoice) -> dict[str, Any]:
        """What is measured of a choice, as in the table."""
        minutes = self.steps / self.feed
        turn, tilt = np.abs(rotary_turns(choice.axes)[self.joined]).T
        slowest = self.limits.turning_minutes(choice.axes)[self.joined]
        driven = np.maximum(minutes, slowest)
        rate = np.degrees(angles_between(choice.axes[1:], choice.axes[:-1]))[self.joined] / self.steps
        # its change a mm, from one move to the next of the same pass
        follows = np.diff(np.flatnonzero(self.joined)) == 1
        between = (self.steps[1:] + self.steps[:-1]) / 2
        return {
            "axes": choice.name,
            "collide": int((~choice.free).sum()),
            "beyond_limits": int((~choice.reached).sum()),
            "turning_rms_deg_mm": _rms(rate),
            "turning_change_rms_deg_mm2": _rms((np.diff(rate) / between)[follows]),
            "tilt_travel_deg": float(np.degrees(tilt.sum())),
            "turn_travel_deg": float(np.degrees(turn.sum())),
            "tilt_speed_deg_s": _high(np.degrees(tilt) / (60 * minutes)),
            "turn_speed_deg_s": _high(np.degrees(turn) / (60 * minutes)),
            "limited_share": float((driven > minutes).mean()),
            "seconds": 60 * float(driven.sum()),
            "feed_mean_mm_min": float(self.steps.sum() / driven.sum()),
            **{f"seconds_at_{feed}": 60 * float(np.maximum(self.steps / feed, slowest).sum()) for feed in FEEDS},
        }

    @property
    def report(self) -> list[dict[str, Any]]:
        """The figures of each choice."""
        return [
            {name: round(value, 4) if isinstance(value, float) else value for name, value in row.items()}
            for row in map(self.figures, self.choices)
        ]

    @property
    def table(self) -> str:
        """The figures in Markdown, a column for each choice."""
        rows = list(map(self.figures, self.choices))
        alone = f"{60 * float(self.steps.sum()) / self.feed:.0f} by the feed alone"
        reported = {
            f"collide, of {len(self.contacts)}": "{collide}",
            "beyond the machine's limits": "{beyond_limits}",
            "turning, rms (deg/mm)": "{turning_rms_deg_mm:.2f}",
            "its change, rms (deg/mm²)": "{turning_change_rms_deg_mm2:.2f}",
            "tilt / turn in all (deg)": "{tilt_travel_deg:.0f} / {turn_travel_deg:.0f}",
            f"tilt / turn, {HIGH} % below (deg/s)": "{tilt_speed_deg_s:.0f} / {turn_speed_deg_s:.0f}",
            "moves that an axis limits": "{limited_share:.1%}",
            f"time (s; {alone})": "{seconds:.0f}",
            f"mean feed (mm/min; {self.feed:.0f} asked)": "{feed_mean_mm_min:.0f}",
            f"time at {_listed(FEEDS)} mm/min (s)": _listed(f"{{seconds_at_{feed}:.0f}}" for feed in FEEDS),
        }
        lines = [["", *(row["axes"] for row in rows)], ["---"] * (len(rows) + 1)]
        lines += [[name, *(text.format(**row) for row in rows)] for name, text in reported.items()]
        return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def compare_axes(path: ToolPath, scene: Scene, limits: MachineLimits, job: PathJob) -> AxisComparison:
    """The axes of a path beside its normals, axes that lean forward by the job's lead, and these turned to the nearest
    free ones, at the same contacts, in the scene and for the machine of the path."""
    cuts = path.kinds == MoveKind.CUT
    balls, passes = path.balls[cuts], path.pass_index[cuts]
    normals = unit(balls - path.contacts[cuts])

    # The direction of the feed at each contact: to the next one of the pass, at its end from the one before
    steps = np.diff(balls, axis=0)
    same = (np.diff(passes) == 0)[:, None]
    ahead = np.vstack([np.where(same, steps, 0), np.zeros((1, 3))])
    behind = np.vstack([np.zeros((1, 3)), np.where(same, steps, 0)])
    ways = np.where((ahead != 0).any(axis=1, keepdims=True), ahead, behind)

    along = unit(ways - dots(ways, normals)[:, None] * normals)
    contacts = ContactPath(
        level=path.level,
        cutter=path.cutter,
        pass_index=passes,
        parameters=path.parameters[cuts],
        contacts=path.contacts[cuts],
        normals=normals,
        feeds=along,
        centres=balls,
        lifts=np.zeros(len(balls)),
        ramp=np.zeros(len(balls), dtype=bool),
        uncut=np.zeros((0, 3)),
        reasons=(),
    )
    checker = CollisionChecker(scene, path.cutter)
    lead = f"lead {job.lead_deg:g} deg"
    named = {
        "surface normal": normals,
        lead: lead_axes(normals, along, np.radians(job.lead_deg)),
        f"{lead}, turned free": choose_axes(contacts, checker, limits, job).axes,
        "this path": path.axes[cuts],
    }
    choices = [AxisChoice(name, axes, checker.free(balls, axes), limits.allow(axes)) for name, axes in named.items()]
    return AxisComparison(
        path.contacts[cuts], balls, passes=passes, feed=path.cutter.feed, limits=limits, choices=tuple(choices)
    )


def _listed(items: Iterable[object]) -> str:
    return " / ".join(map(str, items))


def _rms(values: Float[ndarray, " k"]) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _high(values: Float[ndarray, " k"]) -> float:
    return float(np.percentile(values, HIGH)) if len(values) else 0.0


def _cone_lines(toolpath: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Which shape cones have, if not all are elliptic, and what FCL says of them and of poses outside of them, where it
    was asked."""
    shapes = {row["level"]: row["cones"]["shape"] for row in toolpath if row["cones"]}
    circular = list(shapes.values()).count("circular")
    if circular:
        where = f"{circular} of {counted(len(shapes), 'level')}"
        yield f"cones     circular on {where}, where axes turn sooner or less in these"
    checks = {row["level"]: row["cones"]["fcl"] for row in toolpath if row["cones"]}  # all paths of a level share one
    of_names = ([check[name] for check in checks.values() if check] for name in ("asked", "narrowed", "refused"))
    asked, narrowed, refused = map(sum, of_names)
    if asked:
        yield f"cones     {asked} checked by planes, else by FCL: {narrowed} narrowed, {refused} refused"
    poses = [row["poses"] for row in toolpath if row["poses"]]
    asked, refused = (sum(pose[name] for pose in poses) for name in ("asked", "refused"))
    if asked:
        yield f"poses     {asked} outside of such cones put before FCL one by one: {refused} refused"


NOT_SIMULATED = {"skipped": "the removal of material was not simulated"}
"""The section `removal` of a report without a simulation."""
WHY = {
    "post": "at the post",
    "gouge": "ball too large for the hollow",
    "covered": "behind what a larger ball left",
    "short": "too short for a plunge",
    "collision": "no free way for the tool",
    "limits": "beyond the machine's tilt",
    "hidden": "out of reach of the strategy's tool axes",
}
"""What each reason for leaving a contact uncut means."""


def summary_of(report: Mapping[str, Any]) -> str:
    """The report in a few lines for a person; it may end at the levels."""
    lines = [
        *warning_lines([*report["warnings"], *report.get("second", {"warnings": ()})["warnings"]]),
        *_part_lines(report["input"], report["surface"]),
        f"stock     {stock_text(report['stock'])}",
        *cutter_lines(report.get("cutters")),
        *post_lines(report.get("post")),
        *_levels_lines(report),
        *(program_lines(report) if "nc" in report else ()),
        *estimate_lines(report),
        *(removal_lines(report["removal"]) if "removal" in report else ()),
        *mechanics_lines(report.get("mechanics")),
        *feed_lines(report.get("feed")),
        *(_second_lines(report["second"]) if "second" in report else ()),
        *(
            f"{name:9} {', '.join(f'{key} {figure}' for key, figure in of.items())}"
            for name, of in report.get("added", {}).items()
        ),
        f"time      {sum(report['seconds'].values()):.1f} s",
    ]
    return "\n".join(lines)


def second_text(second: Mapping[str, Any]) -> str:
    """The section `second` of a report in a few lines."""
    return "\n".join(_second_lines(second))


def _second_lines(second: Mapping[str, Any]) -> Iterator[str]:
    """The program of the second clamping, and what it leaves where the post stood."""
    yield f"second    {second['file'] or 'not written'}: {second['blocks']} blocks"
    yield from (f"          {text}" for text in second["time_texts"])
    spaces = second["removal"]["clearance_mm"]
    clear = ", ".join(f"{part} {_clearance_text(value)}" for part, value in spaces.items())
    yield f"          gouge {1000 * second['gouge_max_mm']:.2f} um, rapids cut nothing; {clear}"
    before, after = second["at_post_before_mm2"], second["at_post_after_mm2"]
    most = f"{second['at_post_after_max_mm']:.2f} mm at most"
    yield from mechanics_lines(second["mechanics"])
    yield f"          {after:.1f} of {before:.1f} mm2 at the post still keep more than 0.02 mm, {most}"
    if second.get("at_tailstock_mm2"):
        yield f"          {second['at_tailstock_mm2']:.1f} mm2 at the tailstock stay, to be cut by hand"
    yield from into_given(second)
    yield from (f"          {line}" for line in given_lines(second["removal"].get("given")))


def finished_summary(report: Mapping[str, Any]) -> str:
    """The report of one surface machined alone in a few lines for a person."""
    surface = report["surface"]
    shape = f"{surface['kind']}, {surface['area_mm2']:.0f} mm2, {surface['control_points']} control points"
    return surface_summary(report, [f"surface   {shape}; {counted(surface['solids'], 'solid')} kept clear of"])


def surface_summary(report: Mapping[str, Any], shape: Sequence[str], levels: Sequence[str] = ()) -> str:
    """The warnings of a report, lines on the `shape`, its post, lines on its `levels`, and its program."""
    lines = [
        *warning_lines(report["warnings"]),
        *shape,
        *post_lines(report["post"]),
        *levels,
        *program_lines(report),
        *removal_lines(report["removal"]),
        *mechanics_lines(report.get("mechanics")),
        f"time      {sum(report['seconds'].values()):.1f} s",
    ]
    return "\n".join(lines)


def _part_lines(mesh: Mapping[str, Any], surface: Mapping[str, Any]) -> Iterator[str]:
    """The mesh, what is to be known of it, its repairs; size and deviation of the surface, its tolerance and where that
    comes from; and where the mesh was repaired, how far the surface is from it as it was given."""
    yield f"mesh      {mesh['faces']} faces, {mesh['units']}; {counted(len(mesh['repairs']), 'repair')}"
    for kind, sentences in (("note      ", mesh["notes"]), ("repair    ", mesh["repairs"])):
        yield from (kind + sentence for sentence in sentences)
    deviation = f"max {surface['deviation_max_mm']:.3f} rms {surface['deviation_rms_mm']:.3f} mm"
    yield f"surface   {surface['control_points']} control points, deviation {deviation}"
    yield f"          tolerance {surface['tolerance_mm']:g} mm: {surface['tolerance_why']}"
    if mesh["repairs"]:
        given = f"{surface['given_deviation_max_mm']:.3f} mm to the mesh as given"
        moved = f"{mesh['repair_deviation_max_mm']:.3f} mm of repair, smoothing and filling"
        yield f"as given  max {given}, with {moved}"


def _levels_lines(report: Mapping[str, Any]) -> Iterator[str]:
    """Cuts, their lower bound, depths, and what is certified; or the layers of a strategy that does not morph."""
    if report.get("strategy", "morph") != "morph":
        layers = counted(len(report["toolpath"]), "layer")
        length = sum(row["length_mm"] for row in report["toolpath"])
        yield f"layers    {layers} by {report['strategy']} milling, {length / 1000:.1f} m of cuts"
        return
    breaks = report["levels_break_mm"]
    broken = f"; a limit is broken by {breaks:.4f} mm" if breaks else ""
    yield f"levels    {cuts_text(report)}{broken}"
    yield f"certified {certified_text(report['levels'], report['levels_method'])}"


def cuts_text(report: Mapping[str, Any]) -> str:
    """Cuts, their lower bound and depths."""
    levels = report["levels"]
    deepest = max(row[depth] for row in levels for depth in ("depth_max_mm", "depth_back_max_mm"))
    bound = f"no schedule needs fewer than {report['levels_lower_bound']}"
    return f"{counted(len(levels) - 1, 'cut')}, {bound}; depth max {deepest:.4f} mm"


def program_lines(report: Mapping[str, Any]) -> Iterator[str]:
    """Paths, program and proof."""
    toolpath, nc = report["toolpath"], report["nc"]
    length, trimmed = (sum(row[name] for row in toolpath) for name in ("length_mm", "trimmed_mm"))
    contacts = sum(row["contacts"] for row in toolpath)
    yield f"toolpath  {contacts} contacts, {length:.0f} mm of passes; {trimmed:.0f} mm through air left out"
    total, along = (sum(row[name] for row in toolpath) for name in ("entries", "entries_tangential"))
    if total:
        yield f"entries   {along} of {counted(total, 'cut')} begin tangentially, on arcs; {total - along} straight"
    for number, line in enumerate(uncut_lines(toolpath, report["uncut_mm2"])):
        label = "" if number else "uncut"
        yield textwrap.fill(line, WIDTH, initial_indent=f"{label:10}", subsequent_indent=" " * 12)
    yield from _cone_lines(toolpath)
    # where smooth axes come nearer to the normal than they should
    near = [row for row in toolpath if row["near_normal_contacts"]]
    if near:
        tipped, forced = (sum(row[f"near_normal_{name}"] for row in near) for name in ("contacts", "without_choice"))
        most = max(near, key=lambda row: row["near_normal_contacts"])
        where = f"{most['near_normal_contacts']} of them on level {most['level']}"
        choice = f"{forced} have no other in their cones"
        share = f"{tipped / contacts:.1%} of the contacts"
        yield f"lead      {share} are cut nearer to the ball's tip than path.least_lead_deg"
        yield f"          {tipped} contacts, {where}; {choice}"
    if "parting" in report:
        yield f"parting   {parting_text(report['parting'])}"
    mill = f"{nc['machine']} / {nc['controller']}"
    files = f" and {counted(nc['parts'], 'file')} that it calls" if nc["parts"] else ""
    yield f"nc        {nc['file'] or 'not written'}{files}: {nc['blocks']} blocks for {mill}"
    yield from (f"          {text}" for text in nc["time_texts"])
    if nc["rewinds"]:
        lifted = f", {nc['rewinds_lifted']} of them lifted from a cut or a link and set down again"
        reported = lifted if nc["rewinds_lifted"] else ""
        yield f"rewinds   {counted(nc['rewinds'], 'rewind')} of the rotary axes off the part{reported}"
    median, low = nc["feed_median_mm_min"], nc["feed_low_mm_min"]
    share = f"an axis limits {nc['feed_axis_limited_share']:.0%} of the cutting blocks"
    yield f"feed      median {median:.0f}, a tenth below {low:.0f} mm/min; {share}"
    if nc["feed_under_half_blocks"]:
        slow = counted(nc["feed_under_half_blocks"], "cutting block")
        yield f"          {slow} under half of the cutter's feed: axes or plunges"
    tip_um, gouge_um = nc["readback_tip_error_mm"] * 1000, nc["gouge_max_mm"] * 1000
    yield f"proof     tip {tip_um:.2f} um, axis {nc['readback_axis_error_deg']:.4f} deg, gouge {gouge_um:.2f} um"
    yield from into_given(nc)


def removal_lines(removal: Mapping[str, Any]) -> Iterator[str]:
    """What the simulation of the posted text found."""
    if "skipped" in removal:
        yield f"removal   {removal['skipped']}"
        return
    over = max(level["over_limit_mm"] or 0.0 for level in removal["levels"])
    left, cell = removal["left"], removal["cell_mm"]
    deepest = f"depth at most {over:.2f} mm over its limit"
    links = removal["links"]
    linked = f"no link cuts over {links['allowed_mm3']:g} mm3"
    if links["most_mm3"] is not None:
        where = f"{links['depth_max_mm']:.2f} mm deep in line {links['depth_max_line']}"
        linked = f"links {links['removed_mm3']:.2f} mm3, {where}"
    yield f"removal   rapids cut nothing, {linked}; {deepest} (cells of {cell:g} mm)"
    spaces = (f"{part} {_clearance_text(value)}" for part, value in removal["clearance_mm"].items())
    yield f"clear     {', '.join(spaces)}"
    away = f"{left['area_over_0_02_mm2']:.1f} mm2 keep more than 0.02 mm, {left['max_mm']:.2f} mm at most"
    reasons = left["by_reason"]
    why = f"{reasons['gouge']:.1f} in hollows, {reasons['reachable']:.1f} where the ball fits"
    if reasons.get("limits"):
        why += f", {reasons['limits']:.1f} beyond the machine's tool axes"
    yield f"left      {away} ({why}); at the post {reasons['post']:.1f} mm2"
    if reasons.get("tailstock"):
        yield f"          at the tailstock {reasons['tailstock']:.1f} mm2"
    yield from (f"as given  {line}" for line in given_lines(removal.get("given")))
    if removal.get("bridge_diameter_mm") is not None:
        yield f"          {removal['bridge_diameter_mm']:.2f} mm of the post hold the parted part"


def _clearance_text(value: float | None) -> str:
    """A clearance; None where it is larger than is looked at."""
    return "far" if value is None else f"{value:.2f} mm"


def certified_text(levels: Sequence[Mapping[str, Any]], method: str = "qp") -> str:
    """What holds between the points measured, in one line; `levels` as in the report, made by `method`."""
    known = [row for row in levels if row["not_certified"] is not None]
    rounding = sum(row["rounding"] for row in levels)
    exact = []
    if rounding:
        exact = [f"{counted(rounding, 'more cut')} only to round the stock, exact by construction"]
    if not known:
        without = counted(len(levels) - 1 - rounding, "cut")
        why = "the surface is not polynomial (it has weights other than one)"
        behind = method_of(method).nesting
        if behind > NESTING_TOLERANCE:
            most = f"more than the {NESTING_TOLERANCE:g} mm of a certificate"
            why = f"levels by {method} may fall {behind:g} mm behind one another, {most}"
        return "; ".join([f"nothing on {without}: {why}", *exact])

    doubts = [f"cut {row['index']} {doubt}" for row in known for doubt in row["not_certified"]]
    kept = sum(not row["not_certified"] for row in known)
    all_known = counted(len(known), "cut")
    return "; ".join([f"depth, nesting and stock hold everywhere on {kept} of {all_known}", *exact, *doubts])


def uncut_lines(toolpath: Sequence[Mapping[str, Any]], areas: Mapping[str, float]) -> list[str]:
    """Which contacts were left uncut and why, a line for the part with their `areas` (mm^2, by reason) and one for the
    levels round it; `toolpath` as in the report."""
    reported = []
    for where, outer in (("on the part", False), ("on levels round it", True)):
        rows = [row for row in toolpath if bool(row["level"]) == outer]
        reasons: Counter[str] = sum((Counter(row["uncut_reasons"]) for row in rows), Counter())
        blocked: Counter[str] = sum((Counter(row["blocked_by"]) for row in rows), Counter())
        why = WHY | {"collision": ", ".join([WHY["collision"], *(f"{n} {by}" for by, n in blocked.most_common(2))])}
        if reasons:
            known = {} if outer else {reason: f", {area:.1f} mm2" for reason, area in areas.items()}
            each = ", ".join(
                f"{reason} {count}{known.get(reason, '')} ({why[reason]})" for reason, count in reasons.most_common()
            )
            reported.append(f"{counted(reasons.total(), 'contact')} {where}: {each}")
    return reported or ["nothing"]
