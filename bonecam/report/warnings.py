"""What must not be quiet in a run: its warnings, each with a code, a figure, its limits and a remedy; and what a
summary tells of cutters, of what holds the part, and of force and bending.

Warnings stand in `warnings` of the report, below the summary's verdict, on the page and on the sheet; what is known
before the text is posted stands in the program's header. The section [warnings] of the job has the limits: above the
first a figure is told, above the second the job is refused.
"""

import logging
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from bonecam.errors import LimitError, knowing
from bonecam.job import Job
from bonecam.job.sections import CUTTERS
from bonecam.job.warnings_section import GUESSED_REFUSED, LEFT_REFUSED, SLENDER_REFUSED, SPINDLE_REFUSED
from bonecam.machine.machine import Machine, read_machine
from bonecam.mechanics.result import shell_text
from bonecam.text.numbers import told_apart

NOT_ASKED = {"skipped": "force and bending were not asked"}
"""The section `mechanics` of a report without them."""
NOT_KNOWN = {"skipped": "force and bending are not known without a simulation of the removal"}
"""That of a report without a simulation."""


def mechanics_lines(mechanics: Mapping[str, Any] | None) -> Iterator[str]:
    """The section `mechanics` of a report in words, a line each."""
    if not mechanics:
        return
    if "skipped" in mechanics:
        yield f"bending   {mechanics['skipped']}"
        return
    yield f"bending   {bending_text(mechanics)}"
    most = max((level["peak_max_n"] for level in mechanics["levels"]), default=0.0)
    low, up = mechanics["band"]
    authors = f"authors differ for {mechanics['material']}: {low:g} to {up:g} times this"
    yield f"          force {most:.0f} N at most; {authors}"
    if mechanics["shell"]:
        yield f"          {shell_text(mechanics['shell'])}"


def bending_text(mechanics: Mapping[str, Any]) -> str:
    """The error kept, the stress and the lowest frequency in one line."""
    kept = mechanics["error_kept_um"]
    error = ""
    if kept:
        error = f"error kept {kept['median']:.1f} um, {kept['p95']:.1f} at 95 %, {kept['p99']:.1f} at 99 %; "
    stress = f"stress at peaks {mechanics['neck_stress_p99_mpa']:.0f} of {mechanics['yield_mpa']:g} MPa"
    if mechanics["first_hz"] is None:
        return f"{error}{stress}"
    return f"{error}{stress}; lowest at {mechanics['first_hz']:.0f} Hz, edges {mechanics['tooth_hz']:.0f}"


def cutter_lines(cutters: Mapping[str, Any] | None, toolpath: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """The cutters that were chosen, and what a finer ball would leave; else the radii of those of the `toolpath`."""
    if cutters is None:
        balls = " / ".join(dict.fromkeys(f"{row['cutter_radius_mm']:g}" for row in toolpath))
        yield f"tools     radius {balls} mm"
        return
    first = cutters["sets"][0]
    names = " / ".join(first[name] or "own" for name in CUTTERS if name in first)
    yield f"tools     {names}, the best of {cutters['tried']} sets"
    if "finer" in cutters:
        finer = cutters["finer"]
        less = f"{finer['left_mm']:.2f} mm in {finer['left_mm2']:.1f} mm2 of hollows"
        yield f"          fine.preset = {finer['preset']} would leave {less} for {finer['minutes']:.1f} min more"


def post_lines(post: Mapping[str, Any] | None) -> Iterator[str]:
    """The post, what it stands on, and what holds the free end, in a line."""
    if post is not None:
        size = f"{post['diameter_mm']:g} x {post.get('neck_mm', post['length_mm']):g} mm"
        held = [f"{name} of {one['diameter_mm']:g} mm" for name, one in reversed(post.get("held_by", {}).items())]
        on = f" on a {', '.join(held)}" if held else ""
        tailstock = post.get("tailstock")
        above = f", held above by a {tailstock['kind']} of {tailstock['diameter_mm']:g} mm" if tailstock else ""
        under = f"; {post['footprint_mm2']:.1f} mm2 of the part stay under it" if "footprint_mm2" in post else ""
        yield f"post      {size}{on}{above}{under}"


def neck_remedy_text(post: Mapping[str, Any]) -> str:
    """With what that neck holds, or nearly, and what is foretold with it; another one where the job states it."""
    other = ["give holding.diameter = 0, which finds one"] if post["neck_stated"] else []
    changes = [
        f"{'holds' if one['holds'] else 'at best'} with {one['change']}: "
        f"{one['shift_um']:.1f} um, {one['stress_mpa']:.0f} MPa, {one['first_hz']:.0f} Hz"
        for one in post.get("holds_with", ())
    ]
    return " or ".join([*other, *changes]) or "give shallower cuts, or a larger stock for a thicker neck"


log = logging.getLogger("bonecam")
Sections = Mapping[str, Any]
"""The report, or as much of it as there is yet."""
WIDTH = 120
"""Columns of the longest lines on a terminal."""
UM = 1000.0
"""um in a mm."""
LARGEST_KEPT = 20.0
"""An error (um) that 95 % of a finished surface may keep where no neck holds, without a warning."""
FORETOLD_STRESS = 1.3
"""The stress at the peaks that is simulated is 0.90 to 1.29 times the one foretold (23 programs of seven bones): it is
more than half of the yield strength where so many times that is foretold."""
YIELDS = 1.5 * FORETOLD_STRESS
"""A neck is refused where so many times the stress that is wanted of it, a third of the yield strength, is foretold:
half of that strength would then be simulated."""
FORETOLD_P99 = 0.7
"""The error that 99 % of a finished surface keep is nearly always more than this share of the one foretold."""


@dataclass(frozen=True)
class Warned:
    """One warning: `figure` is above `limit`, and refused above `refused_above`; None where it is no figure."""

    code: str
    text: str
    figure: float | None = None
    limit: float | None = None
    refused_above: float | None = None
    remedy: str = field(kw_only=True)

    @property
    def refused(self) -> bool:
        """Whether the figure is above its second limit."""
        return None not in (self.figure, self.refused_above) and self.figure > self.refused_above  # type: ignore[operator]


def warnings_of(report: Sections, job: Job, more: Iterable[Warned] = ()) -> list[Warned]:
    """The warnings of the sections that there are, the gravest kinds first, with `more` behind those of the shape."""
    machine = read_machine(job.nc.machine)
    warnings = [warned for kind in KINDS for warned in kind(report, job)]
    return [*warnings, *more, *_depth(report, job), *spindle_warnings(job, machine), *_nose(report, machine)]


def check_warnings(found: Iterable[Warned], job: Job, file: str = "") -> None:
    """LimitError, which names the part's `file`, where one is beyond its second limit and the job lets it refuse."""
    for warned in found:
        if warned.refused and job.warnings.refuse:
            own = "or warnings.refuse = false, which the program's header then tells"
            text = f"{warned.text} (allowed {warned.refused_above:g}): {warned.remedy}; {own}"
            raise LimitError(f"{file}: {text}" if file else text, code=warned.code, remedy=warned.remedy)


def with_warnings(report: dict[str, Any], job: Job, more: Iterable[Warned] = ()) -> dict[str, Any]:
    """The report that begins with its warnings, `more` among them; LimitError as in `check_warnings`."""
    warnings = warnings_of(report, job, more)
    told = {"warnings": [asdict(warned) for warned in warnings]}
    told |= {name: section for name, section in report.items() if name != "warnings"}
    with knowing(told):
        check_warnings(warnings, job)
    for warned in warnings:
        log.info("%s: %s", warned.text, warned.remedy)
    return told


def warning_texts(warnings: Sequence[Mapping[str, Any]]) -> list[str]:
    """`warnings` of a report, each in a sentence with its remedy."""
    return [f"{warned['text']}: {warned['remedy']}" for warned in warnings]


def warning_lines(warnings: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """`warnings` of a report as lines of a summary."""
    for text in warning_texts(warnings):
        yield from textwrap.wrap(text, WIDTH, initial_indent="warning   ", subsequent_indent=" " * 10)


def header_texts(report: Sections, job: Job, more: Iterable[Warned] = ()) -> list[str]:
    """The warnings that are known before the text is posted, `more` among them, for the program's header."""
    return [f"warning: {warned.text}" for warned in warnings_of(report, job, more)]


def simulated_text(report: Sections, bending: str) -> str:
    """What the header tells of the simulation: what bends, and its warnings."""
    texts = (each["text"] for each in report["warnings"] if each["code"] in ("left", "depth"))
    return "; ".join([bending, *(f"warning: {text}" for text in texts)])


def repair_warnings(width: float, guessed: float, job: Job, changes: Iterable[str] = ()) -> Iterator[Warned]:
    """A hole of the mesh of this width (mm) that was closed, and a share of its surface that was `guessed`, by these
    changes."""
    if guessed > job.warnings.guessed:
        share, most = told_apart(100 * guessed, 100 * job.warnings.guessed)
        text = f"{share} % of the surface is no given one (more than {most} %): {'; '.join(changes)}"
        remedy = "export the mesh again, whole and closed, or mend it in a mesh editor"
        limits = job.warnings.guessed, GUESSED_REFUSED
        yield Warned("guessed", text, guessed, *limits, remedy=remedy)
    if width > job.warnings.hole:
        text = f"a hole of the mesh {width:.2f} mm wide was closed flat, the part's shape there is a guess"
        remedy = "close it by the shape of the bone in a mesh editor, or give warnings.hole and hole_refused"
        yield Warned("hole", text, width, job.warnings.hole, job.warnings.hole_refused, remedy=remedy)


def holding_warnings(post: Sections, job: Job, kept: float | None = None) -> Iterator[Warned]:
    """The neck that is taken, where none holds: told until it is known what 95 % of the surface keep (`kept`, um), or
    if that is more than LARGEST_KEPT; one that the job states only until then. Refused where a hundredth of the
    surface would keep too large an error, or it would yield."""
    taken = next(iter(post.get("necks", ())), None)
    if taken is None or taken["holds"] or (kept is not None and kept <= LARGEST_KEPT):
        return
    if kept is not None and post["neck_stated"]:
        return  # what it keeps is told as bending
    told, most = UM * job.warnings.error, UM * job.mechanics.largest_error / FORETOLD_P99
    refused = most if kept is None and job.mechanics.refuse else None
    shift = taken["shift_p99_um"]
    # What is foretold of it, beside what is wanted of one
    wanted = post["neck_wanted"]
    error = f"{taken['shift_um']:.1f} um of error at 95 % ({wanted['shift_um']:g} at most)"
    stress = f"{taken['stress_mpa']:.0f} MPa at peaks ({wanted['stress_mpa']:.0f} at most)"
    swing = f"{taken['first_hz']:.0f} Hz ({wanted['first_hz']:.0f} at least)"
    size = f"{taken['diameter_mm']:g} x {taken['length_mm']:g} mm"
    none = "the neck does not hold" if post["neck_stated"] else "no neck holds"
    figures = f"{error}, {shift:.0f} at 99 %; {stress}; {swing}"
    remedy = neck_remedy_text(post)
    yield Warned("holding", f"{none}: foretold on that of {size} are {figures}", shift, told, refused, remedy=remedy)
    yields = YIELDS * wanted["stress_mpa"]
    if refused and taken["stress_mpa"] > yields:
        what = f"the neck of {taken['diameter_mm']:g} mm bears {taken['stress_mpa']:.0f} MPa at peaks"
        text = f"{what}, foretold, allowed {yields / FORETOLD_STRESS:.0f} (half of the yield strength)"
        yield Warned("holding", text, taken["stress_mpa"], yields, yields, remedy=remedy)


def spindle_warnings(job: Job, machine: Machine) -> Iterator[Warned]:
    """Cutters that turn slower than the spindle can."""
    lowest = machine.spindle_lowest
    for name in job.cutter_names:
        speed = job.tool(name).spindle
        if speed < lowest:
            text = f"[{name}] turns at {speed:g} 1/min, the spindle of {machine.name} at {lowest:g} at least"
            remedy = f"give {name}.spindle, or a smaller ball"
            yield Warned("spindle", text, lowest / speed, 1.0, 1 / SPINDLE_REFUSED, remedy=remedy)


def _hole(report: Sections, job: Job) -> Iterator[Warned]:
    """What was closed of the mesh, dropped or made anew."""
    given = report.get("input", {})
    changes = [step["change"] for step in given.get("repair_steps", ()) if step["guessed_mm2"]]
    yield from repair_warnings(given.get("hole_max_mm", 0.0), given.get("guessed_share", 0.0), job, changes)


def _left(report: Sections, job: Job) -> Iterator[Warned]:
    """How much of the part keeps more material than the scallop of its path: as simulated, or else as planned."""
    limits = job.warnings
    left = report.get("removal", {}).get("left")
    if left:
        scallop = job.finishing.scallop
        whole, areas = left["part_mm2"], left["areas_over_mm2"]
        height = next((each for each in areas if float(each) > scallop), list(areas)[-1])
        area, what = areas[height], f"keep more than {height} mm, {left['max_mm']:.2f} mm at most"
    else:
        areas = {reason: area for reason, area in report.get("uncut_mm2", {}).items() if reason != "post"}
        area = sum(areas.values())
        whole = report.get("input", report.get("surface", {})).get("area_mm2", 0.0)
        what = f"stay uncut ({', '.join(f'{reason} {each:.1f}' for reason, each in areas.items())})"
    share = area / whole if whole else 0.0
    if share > limits.left:
        text = f"{area:.1f} of {whole:.1f} mm2 of the part ({share:.0%}) {what}"
        remedy = "`uncut` tells why; a smaller or longer cutter, path.fine_cutter or a larger path.max_tilt_deg help"
        yield Warned("left", text, share, limits.left, LEFT_REFUSED, remedy=remedy)


def _fit(report: Sections, job: Job) -> Iterator[Warned]:
    """A surface that misses its tolerance, the widest one where the job states none."""
    fitted = report.get("surface", {})
    away, tolerance = fitted.get("deviation_max_mm", 0.0), job.surface.tolerance_for()
    if away > tolerance:
        text = f"the surface deviates by {away:.3f} mm from the mesh, more than surface.tolerance ({tolerance:g})"
        most = job.surface.max_control_points
        remedy = f"raise surface.max_control_points ({most}), or surface.tolerance if that is enough"
        yield Warned("fit", text, away, tolerance, job.surface.largest_deviation, remedy=remedy)


def _bending(report: Sections, job: Job) -> Iterator[Warned]:
    """What bends beyond what the job allows, or nearly; or that it was not asked."""
    mechanics = report.get("mechanics")
    if mechanics is None:
        return
    if "skipped" in mechanics:
        if "removal" in report and "skipped" not in report["removal"]:
            yield Warned("bending_unknown", mechanics["skipped"], remedy="leave out --no-mechanics")
        return
    kept = (mechanics["error_kept_um"] or {}).get("p99", 0.0)
    warn_above, most = UM * job.warnings.error, UM * job.mechanics.largest_error
    helps = [f"{one['what']} would keep {one['p99_um']:.1f} um" for one in mechanics["remedies"][:1]]
    helps += [neck_remedy_text(report["post"])] if report.get("post", {}).get("holds_with") else []
    remedy = (helps or ["a thicker or shorter neck, or holding.diameter = 0, which finds one"])[0]
    low, up = mechanics["band"]
    faults = [*mechanics["faults"]]
    if not faults and kept > warn_above:
        faults = [f"bending keeps errors of {kept:.1f} um on a hundredth of the part"]
    if faults:
        text = f"{'; '.join(faults)} ({low:g} to {up:g} times by author)"
        yield Warned("bending", text, kept, warn_above, None if mechanics["faults"] else most, remedy=remedy)


def _holding(report: Sections, job: Job) -> Iterator[Warned]:
    """A neck that gives way."""
    kept = ((report.get("mechanics") or {}).get("error_kept_um") or {}).get("p95")
    yield from holding_warnings(report.get("post", {}), job, kept)


def _slender(report: Sections, job: Job) -> Iterator[Warned]:
    """A post that is long beside its diameter."""
    post = report.get("post", {})
    length, diameter = post.get("neck_mm", post.get("length_mm", 0.0)), post.get("diameter_mm", 1.0)
    limits = job.warnings
    if length > limits.slender * diameter:
        text = f"the post is slender: {diameter:g} x {length:g} mm bends under the cut"
        remedy = "a thicker post, a chuck below it or a slimmer holder help"
        yield Warned("slender", text, length / diameter, limits.slender, SLENDER_REFUSED, remedy=remedy)


def _depth(report: Sections, job: Job) -> Iterator[Warned]:
    """Depths of cut above the limits of their levels and the scallops left before; the proof refuses all but layers."""
    removal = report.get("removal", {})
    if "skipped" in removal:
        text = f"{removal['skipped']}: shank and holder are not checked from the text"
        yield Warned("not_simulated", text, remedy="leave out --no-simulation")
        return
    in_layers = job.path.strategy != "morph"
    over = 0.0
    for row in removal.get("levels", ()):
        if row["over_limit_mm"]:
            scallop = job.roughing.scallop if in_layers else job.scallop(row["index"] + 1)
            over = max(over, row["over_limit_mm"] - scallop)
    if over > job.warnings.depth:
        text = f"in places a cut is up to {over:.2f} mm deeper than its level and the scallops before it allow"
        remedy = "a smaller scallop or shallower cuts help"
        yield Warned("depth", text, over, job.warnings.depth, remedy=remedy)


def _nose(report: Sections, machine: Machine) -> Iterator[Warned]:
    """A machine whose spindle nose is not known, where there is a program."""
    if not machine.nose and "nc" in report:
        text = f"the file of {machine.name} knows no spindle nose: nothing was kept clear of it"
        yield Warned("nose", text, remedy="give spindle.nose in it")


KINDS: tuple[Callable[[Sections, Job], Iterator[Warned]], ...] = (_left, _bending, _holding, _slender, _hole, _fit)
"""What is asked of a report and its job, the gravest first."""
