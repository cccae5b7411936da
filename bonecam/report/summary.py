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
from bonecam.planning.scene import Scene
from bonecam.report.stage_reports import parting_text
from bonecam.report.warnings import WIDTH, cutter_lines, mechanics_lines, post_lines, warning_lines
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


MOST_LINES = 25
"""Lines of a summary at most."""
WARNING_LINES = 6
"""Lines that its warnings have at least, if they need them."""


def summary_of(report: Mapping[str, Any]) -> str:
    """What a person decides on, in MOST_LINES lines at most, the verdict first; it may end at the levels. All other
    figures stand in the report alone."""
    return _told(report, [*_part_lines(report), *_levels_lines(report)])


def second_text(second: Mapping[str, Any]) -> str:
    """The section `second` of a report in a few lines."""
    return "\n".join(_second_lines(second))


def finished_summary(report: Mapping[str, Any]) -> str:
    """The report of one surface machined alone in a few lines for a person."""
    surface = report["surface"]
    shape = f"{surface['kind']}, {surface['area_mm2']:.0f} mm2, {surface['control_points']} control points"
    return surface_summary(report, [f"surface   {shape}; {counted(surface['solids'], 'solid')} kept clear of"])


def surface_summary(report: Mapping[str, Any], shape: Sequence[str], levels: Sequence[str] = ()) -> str:
    """The verdict on a report, what a person decides on, lines on the `shape`, its post, and lines on its `levels`."""
    return _told(report, [*shape, *post_lines(report["post"]), *levels])


def _told(report: Mapping[str, Any], made: Iterable[str]) -> str:
    """The summary of a report with the lines on what was `made`."""
    warnings = [*report["warnings"], *report.get("second", {"warnings": ()})["warnings"]]
    lines = [
        *(_decision_lines(report) if "nc" in report else ()),
        *(_second_lines(report["second"]) if "second" in report else ()),
        *made,
        *(
            f"{name:9} {', '.join(f'{key} {figure}' for key, figure in of.items())}"
            for name, of in report.get("added", {}).items()
        ),
        f"time      {sum(report['seconds'].values()):.1f} s",
    ]
    first = [f"verdict   {_verdict(report, len(warnings))}"]
    first += _at_most(list(warning_lines(warnings)), max(MOST_LINES - 1 - len(lines), WARNING_LINES))
    return "\n".join(_at_most([*first, *lines], MOST_LINES))


def _at_most(lines: list[str], most: int) -> list[str]:
    """So many of the lines; the last one then tells how many stand in the report alone."""
    if len(lines) <= most:
        return lines
    return [*lines[: most - 1], f"          {len(lines) - most + 1} more lines: see report and page"]


def _verdict(report: Mapping[str, Any], warnings: int) -> str:
    """How far the run came, what is proven, and how many warnings there are."""
    how = "no program, levels only"
    if "nc" in report:
        how = f"{report['nc']['file'] or 'the program'} is proven from its text"
        how += ", not simulated" if "skipped" in report["removal"] else " and simulated"
    return f"{how}; {counted(warnings, 'warning')}"


def _decision_lines(report: Mapping[str, Any]) -> Iterator[str]:
    """Minutes, what is left, what is cut in, bending, tools, and the program."""
    toolpath, nc = report["toolpath"], report["nc"]
    yield f"minutes   {nc['time_texts'][0]}"
    if "feed" in report:
        before, after = report["feed"]["time_min"]
        yield f"          feeds by the force: {after:.1f} min, {before:.1f} with one feed a cutter"
    tip_um, gouge_um = nc["readback_tip_error_mm"] * 1000, nc["gouge_max_mm"] * 1000
    proven = [f"gouge {gouge_um:.2f} um, tip as read back {tip_um:.2f} um off", *into_given(nc)]
    yield f"cut in    {'; '.join(proven)}"
    yield from removal_lines(report["removal"])
    yield from mechanics_lines(report.get("mechanics"))
    areas = sorted(report["uncut_mm2"].items(), key=lambda item: -item[1])
    if areas:
        yield from _filled(f"uncut     {', '.join(f'{area:.1f} mm2 {WHY[reason]}' for reason, area in areas)}")
    yield from cutter_lines(report.get("cutters"), toolpath)
    if "parting" in report:
        yield f"parting   {parting_text(report['parting'])}"
    mill = f"{nc['machine']} / {nc['controller']}"
    files = f" and {counted(nc['parts'], 'file')} that it calls" if nc["parts"] else ""
    yield f"nc        {nc['file'] or 'not written'}{files}: {nc['blocks']} blocks for {mill}"
    if "probe" in nc:
        yield f"probe     {nc['probe']}: run it once after clamping, it writes the datum; its words are unproved"


def _filled(line: str) -> list[str]:
    """A line with its label in two of the terminal's at most; what goes beyond stands in the report."""
    return textwrap.wrap(line, WIDTH, subsequent_indent=" " * 10, max_lines=2, placeholder=" ... (report)")


def _second_lines(second: Mapping[str, Any]) -> Iterator[str]:
    """The program of the second clamping, and what it leaves where the post stood."""
    yield f"second    {second['file'] or 'not written'}: {second['blocks']} blocks, {second['time_texts'][0]}"
    before, after = second["at_post_before_mm2"], second["at_post_after_mm2"]
    most = f"{second['at_post_after_max_mm']:.2f} mm at most"
    tailstock = second.get("at_tailstock_mm2")
    by_hand = f"; {tailstock:.1f} mm2 at the tailstock are cut by hand" if tailstock else ""
    yield f"          {after:.1f} of {before:.1f} mm2 at the post still keep more than 0.02 mm, {most}{by_hand}"
    given = *into_given(second), *given_lines(second["removal"].get("given"))
    yield from (f"          {line}" for line in given)
    yield from mechanics_lines(second["mechanics"])


def _part_lines(report: Mapping[str, Any]) -> Iterator[str]:
    """The mesh, what is to be known of it, its repairs; size and deviation of the surface, from the mesh as it was
    given too where that was repaired; stock and post."""
    mesh, surface = report["input"], report["surface"]
    about = [*mesh["notes"], *mesh["repairs"]]
    repairs = counted(len(mesh["repairs"]), "repair")
    yield from _filled("; ".join([f"mesh      {mesh['faces']} faces, {mesh['units']}", repairs, *about]))
    given = f"; {surface['given_deviation_max_mm']:.3f} mm from the mesh as given" if mesh["repairs"] else ""
    deviation = f"{surface['deviation_max_mm']:.3f} mm off at most, tolerance {surface['tolerance_mm']:g}{given}"
    yield f"surface   {surface['control_points']} control points, {deviation}"
    yield f"stock     {stock_text(report['stock'])}"
    yield from post_lines(report.get("post"))


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
    yield from _filled(f"certified {certified_text(report['levels'], report['levels_method'])}")


def cuts_text(report: Mapping[str, Any]) -> str:
    """Cuts, their lower bound and depths."""
    levels = report["levels"]
    deepest = max(row[depth] for row in levels for depth in ("depth_max_mm", "depth_back_max_mm"))
    bound = f"no schedule needs fewer than {report['levels_lower_bound']}"
    return f"{counted(len(levels) - 1, 'cut')}, {bound}; depth max {deepest:.4f} mm"


def removal_lines(removal: Mapping[str, Any]) -> Iterator[str]:
    """What the simulation of the posted text found: what is left, also beside the mesh as given, and what the tool
    meets."""
    if "skipped" in removal:
        yield f"removal   {removal['skipped']}"
        return
    left, links = removal["left"], removal["links"]
    reasons = left["by_reason"]
    why = f"{reasons['gouge']:.1f} in hollows, {reasons['reachable']:.1f} where the ball fits"
    if reasons.get("limits"):
        why += f", {reasons['limits']:.1f} beyond the machine's tool axes"
    beside = f"{reasons['post']:.1f} at the post"
    if reasons.get("tailstock"):
        beside += f", {reasons['tailstock']:.1f} at the tailstock"
    yield from _filled(f"left      {left_text(left)}: {why}; and {beside}")
    yield from (f"as given  {line}" for line in given_lines(removal.get("given")))
    linked = f"no link over {links['allowed_mm3']:g} mm3"
    if links["most_mm3"] is not None:
        where = f"{links['depth_max_mm']:.2f} mm deep in line {links['depth_max_line']}"
        linked = f"links {links['removed_mm3']:.2f} mm3, {where}"
    over = max(level["over_limit_mm"] or 0.0 for level in removal["levels"])
    yield f"removal   rapids cut nothing, {linked}; depth at most {over:.2f} mm over its limit"
    near = removal.get("clearance_near", {})
    spaces = ", ".join(
        f"{part} far"
        if value is None
        else f"{part} {value:.2f} mm" + (f" ({near[part]})" if " to " in near.get(part, "") else "")
        for part, value in removal["clearance_mm"].items()
    )
    yield from _filled(f"clear     {spaces}")


def left_text(left: Mapping[str, Any]) -> str:
    """What stays on the part away from its post."""
    return f"{left['area_over_0_02_mm2']:.1f} mm2 keep more than 0.02 mm, {left['max_mm']:.2f} mm at most"


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
