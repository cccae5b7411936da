"""The table of a comparison with a strategy a column, as text and in Markdown, as CSV with a strategy a row; its
claims.

A probe of the program that `convert --keep` wrote: simulated from its text, touched along a line.

One part by several strategies (Gan et al. 2014, section 5.3): each planned, posted, read back, simulated, probed.

Part, placement, fitted surface, stock and holding are made once; every strategy starts from them. A program that its
own proof would refuse is measured all the same, and its row says so; a strategy that has no program is a row with its
reason.

The folder of a comparison: table, claims, curves, pictures and pages. No program is written: some are refused.
"""

import csv
import html
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from bonecam_plugins.study.pictures import draw_compared_left, draw_compared_paths, draw_probed
from bonecam_plugins.study.probing import (
    RUBY,
    PostedProgram,
    Probed,
    ProbeLine,
    check_line,
    measuring_program,
    probe_line,
    probe_surface,
    roughness_of,
)
from bonecam_plugins.study.rows import Claim, Comparison, Measured, Row, claims_of, figures_of

from bonecam import (
    BonecamError,
    Job,
    Morphed,
    Posting,
    check_job,
    check_one_feed,
    machine_levels,
    morph_standing,
    read_job,
    simulate,
    stand_part,
)
from bonecam.errors import FileError, JobError, LevelError
from bonecam.files import check_files, check_folder, whole_folder, write_whole
from bonecam.job import OF_MORPH, PathJob
from bonecam.levels import make_levels
from bonecam.machine import Machine, read_machine
from bonecam.mechanics import mechanics_of_job
from bonecam.mesh import MeshDistance, MeshLike, mesh_from
from bonecam.nc import Dialect, check_reach, job_dialect
from bonecam.progress import Progress, part, report, silent
from bonecam.report import Report, kept_contents, kept_levels
from bonecam.surface import holds_surface, load_surface
from bonecam.verify import check_removal_of_job, cutters_of, given_surface, program_text, prove_removal
from bonecam.workholding import post_below

LINES: tuple[tuple[str, str], ...] = (
    ("length_m", "length of the cuts, m"),
    ("feed_min", "time at the feed, min"),
    ("axes_min", "time with the limits of the axes, min"),
    ("program_min", "time of the program with rapids and links, min"),
    ("air_share", "share of the feed time in air"),
    *(
        (f"depth_{cutter}_{name}", f"depth {cutter}, {what}")
        for cutter in ("roughing", "finishing")
        for name, what in (("mean", "mean mm"), ("p99", "99 % mm"), ("max", "max mm"), ("cv", "cv"))
    ),
    *(
        (f"force_{cutter}_{name}", f"force {cutter}, {what}")
        for cutter in ("roughing", "finishing")
        for name, what in (
            ("mean", "mean N"),
            ("peak_p99", "peak 99 % N"),
            ("peak_max", "peak max N"),
            ("ripple", "ripple"),
            ("jump_p99", "jump 99 % N"),
            ("jump_max", "jump max N"),
            ("jumps_per_min", "jumps over 10 N a minute"),
        )
    ),
    ("bend_finishing_p95_um", "deflection while finishing, 95 % um"),
    ("error_kept_median_um", "error kept by bending, median um"),
    ("error_kept_p95_um", "error kept by bending, 95 % um"),
    ("error_kept_p99_um", "error kept by bending, 99 % um"),
    ("stress_p99_mpa", "stress at the peaks, 99 % MPa"),
    ("left_mean_mm", "what stays, mean mm"),
    ("left_p99_mm", "what stays, 99 % mm"),
    ("left_max_mm", "what stays, max mm"),
    ("left_area_mm2", "more than 0.02 mm stays, mm2"),
    ("gouge_mm", "deepest gouge, mm"),
    ("probe_mean_mm", "probed deviation, mean mm"),
    ("probe_min_mm", "probed deviation, min mm"),
    ("probe_max_mm", "probed deviation, max mm"),
    ("probe_within_0_05_share", "share of points within 0.05 mm"),
    ("probe_waves_mm", "waves from point to point, mm"),
    ("probe_lean_mm", "lean by bending over the line, mm"),
    ("rough_ra_along_um", "Ra along the feed, um"),
    ("rough_rz_along_um", "Rz along the feed, um"),
    ("rough_ra_across_um", "Ra across the feed, um"),
    ("rough_rz_across_um", "Rz across the feed, um"),
    ("rough_feed_marks_um", "height of the feed marks, um"),
)
"""Figures of a row, and what the table says they are."""


CLAIM_HEAD = ("claim", "of", "told", "figures")


def table_cells(rows: Sequence[Row]) -> list[list[str]]:
    """The lines of the table: names of the strategies, how they ended, and their figures; what each is comes first."""
    cells = [["", *(row.name for row in rows)], ["ended", *(row.state for row in rows)]]
    return cells + [[what, *(_shown(row.figures.get(name)) for row in rows)] for name, what in LINES]


def claim_cells(claims: Sequence[Claim]) -> list[list[str]]:
    """The lines of the claims, below CLAIM_HEAD."""
    return [[claim.text, claim.of, claim.verdict, claim.figures] for claim in claims]


def reasons(rows: Sequence[Row]) -> list[str]:
    """Why a strategy was refused or failed, a line each."""
    return [f"{row.name} {row.state}: {row.reason}" for row in rows if row.reason]


def table_text(rows: Sequence[Row]) -> str:
    """The table, and below it why a strategy was refused or failed."""
    cells = table_cells(rows)
    widths = [max(len(line[k]) for line in cells) for k in range(len(rows) + 1)]
    text = [
        "  ".join(
            cell.ljust(width) if not k else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]
    return "\n".join([*text, *reasons(rows)]) + "\n"


def claims_text(claims: Sequence[Claim]) -> str:
    """Each claim, whether it holds, and the figures that say so."""
    lines = (f"{told:13}  {text} ({of}): {figures}\n" for text, of, told, figures in claim_cells(claims))
    return "".join(lines)


def _piped(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def table_csv(rows: Sequence[Row]) -> str:
    """All figures, a strategy a row."""
    names = list(dict.fromkeys(name for row in rows for name in row.figures))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["strategy", "state", "reason", *names])
    for row in rows:
        values = (row.figures.get(name) for name in names)
        writer.writerow([row.name, row.state, row.reason, *("" if v is None else v for v in values)])
    return out.getvalue()


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:g}"


File = str | Path | None


def probe(
    keep: str | Path,
    *,
    points: int = 100,
    line: float | None = None,
    radius: float = RUBY,
    csv: File = None,
    picture: File = None,
    program: File = None,
    progress: Progress = silent,
) -> Probed:
    """Touch the surface that the program of a kept folder leaves with a ball of `radius` (mm), at so many `points` of
    the line s = `line` (None: the back of the part), approaching along the nominal normal.

    Writes the points as `csv`, the curve as `picture`, and a measuring `program` for the machine's own probe in the
    words of the job's controller. FileError where the folder is of another version or not whole, JobError for a line
    off the part, MachineError where no measuring program is known for the controller.
    """
    folder = Path(keep)
    check_files([csv, picture, program])
    kept_contents(folder)  # a folder of another version is refused
    job = read_job(folder / "job.toml")
    machine, dialect = read_machine(job.nc.machine), job_dialect(job.nc)
    kept = folder / f"program{dialect.extension}"
    if not kept.exists():
        remedy = "give the folder that `convert --keep` wrote beside the program"
        raise FileError(f"{folder}: has no {kept.name}: {remedy}", file=str(kept))
    text = program_text(kept, machine, dialect, job)
    mesh, _, _ = kept_levels(text, kept, folder)
    part_surface = load_surface(folder / "surface.tspline")
    probed_line = probe_line(part_surface, post_below(mesh, job.holding), radius, points, line)
    measuring = ""
    if program is not None:
        measuring = measuring_program(probed_line, radius, MeshDistance(mesh), dialect.name)
    removal = simulate(kept, folder, job, progress=part(progress, 0.0, 0.9))
    report(progress, 0.9, "probing")
    cutters = tuple(cutters_of(job, machine))
    posted = PostedProgram(text, machine, dialect=dialect, cutters=cutters, part=part_surface, removal=removal)
    probed = probe_surface(posted, probed_line, radius)
    if csv is not None:
        write_whole(csv, probed.csv)
    if picture is not None:
        draw_probed([("as simulated", probed)], picture)
    if program is not None:
        write_whole(program, measuring)
    return probed


OWN = r"comparison\.(txt|md|csv|json)|probe_[\w-]+\.csv|(paths|left|probe)\.png|(index|page_[\w-]+)\.html"
"""Names of the files of a comparison, as a regular expression; a later one removes those of an earlier."""
PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>body{{margin:1rem;font:14px sans-serif}}
table{{border-collapse:collapse;margin:1rem 0}}td,th{{border:1px solid #ccc;padding:.15rem .5rem;text-align:left}}
.figures td+td{{text-align:right;font-variant-numeric:tabular-nums}}
img{{display:block;max-width:100%;margin:1rem 0}}
.pages{{display:flex;height:95vh}}section{{flex:1;display:flex;flex-direction:column;min-width:20rem}}
h2{{margin:.3rem;font-size:1rem}}iframe{{flex:1;border:0;border-left:1px solid #888}}</style></head>
<body><h1>{title}</h1>{pictures}{claims}{figures}<div class="pages">{frames}</div></body></html>
"""
FRAME = '<section><h2>{title}</h2><iframe src="{file}" title="{title}" loading="lazy"></iframe></section>'
PICTURES = {
    "probe.png": "deviation along the line that was probed",
    "left.png": "what each strategy leaves, from the front and from behind",
    "paths.png": "a middle and the last path of each strategy",
}


def write_comparison(made: Comparison, folder: str | Path) -> None:
    """Write a comparison: comparison.txt, .md, .csv and .json, probe_STRATEGY.csv, paths.png, left.png and probe.png,
    and index.html: pictures, claims and table, and the pages of all strategies beside one another."""
    with whole_folder(folder, OWN) as work:
        write_whole(work / "comparison.txt", table_text(made.rows) + "\n" + claims_text(made.claims))
        # Table, reasons and claims in Markdown.
        head, *cells = table_cells(made.rows)
        lines = [_piped(head), "|---" + "|---:" * len(made.rows) + "|", *map(_piped, cells)]
        lines += [f"\n{reason}" for reason in reasons(made.rows)]
        lines += ["", _piped(CLAIM_HEAD), "|---" * len(CLAIM_HEAD) + "|", *map(_piped, claim_cells(made.claims))]
        write_whole(work / "comparison.md", "\n".join(lines) + "\n")
        write_whole(work / "comparison.csv", table_csv(made.rows))
        write_whole(work / "comparison.json", json.dumps(made.report, indent=2) + "\n")
        left = []
        scallop = 0.0
        for name, one in made.measured.items():
            write_whole(work / f"probe_{name}.csv", one.probed.csv)
            write_whole(work / f"page_{name}.html", one.result.page)
            if one.result.removal is not None:
                left.append((name, one.result.removal))
                scallop = one.result.job.finishing.scallop
        if made.measured:
            draw_compared_paths([(name, one.result) for name, one in made.measured.items()], work / "paths.png")
            draw_compared_left(left, scallop, work / "left.png")
            draw_probed([(name, one.probed) for name, one in made.measured.items()], work / "probe.png")
        # The page of a comparison.
        names = [html.escape(name) for name in made.measured]
        pictures = PICTURES if names else {}
        why = "".join(f"<p>{html.escape(reason)}</p>" for reason in reasons(made.rows))
        write_whole(
            work / "index.html",
            PAGE.format(
                title=html.escape(f"{Path(made.part).name}: strategies compared"),
                pictures="".join(f'<img src="{file}" alt="{what}">' for file, what in pictures.items()),
                claims=_html_table("claims", [CLAIM_HEAD, *claim_cells(made.claims)]),
                figures=_html_table("figures", table_cells(made.rows)) + why,
                frames="".join(FRAME.format(title=name, file=f"page_{name}.html") for name in names),
            ),
        )


def _html_table(kind: str, lines: Sequence[Sequence[str]]) -> str:
    """A table of this class, its first line as head."""
    head, *body = ([html.escape(cell) for cell in line] for line in lines)
    rows = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in line)}</tr>" for line in body)
    return f'<table class="{kind}"><tr>{"".join(f"<th>{cell}</th>" for cell in head)}</tr>{rows}</table>'


@dataclass(frozen=True)
class Strategy:
    """A way to machine the part: its name in tables and files, and what it is."""

    name: str
    title: str

    @property
    def is_morph(self) -> bool:
        """Whether it cuts the levels of a morph."""
        return self.name in MORPHS

    def job(self, job: Job) -> Job:
        """The job by this strategy."""
        if self.name == "published":
            methods = {
                "strategy": "morph",
                "pattern": "published",
                "orientation": "published" if job.path.orientation == "published" else "lead",
                "certify": "distances",
            }
            return job.with_values(levels={"method": "published", "even": False}, path=methods)
        if self.is_morph:
            return job.with_values(path={"strategy": "morph"})
        defaults = PathJob()
        own = {name: getattr(defaults, name) for name in OF_MORPH}
        return job.with_values(path={"strategy": self.name, **own})


MORPHS = ("published", "bonecam")
"""Names of the strategies that morph."""
STRATEGIES = (
    Strategy("published", "morphing as published: printed program of the levels, whole zig-zag, lead angle"),
    Strategy("bonecam", "morphing as bonecam does it, by the job"),
    Strategy("iso-height", "iso-height milling from both sides"),
    Strategy("rotary", "sectional rotary milling"),
)
"""All of them, in the order of the table."""
MORPH = STRATEGIES[1]
"""The one whose levels are those of the job."""


def compare(
    mesh: "str | Path | MeshLike",  # a text, as help() would write the union out
    job: Job | None = None,
    *,
    folder: str | Path | None = None,
    strategies: Sequence[str] | None = None,
    points: int = 100,
    line: float | None = None,
    progress: Progress = silent,
) -> Comparison:
    """The comparison of the strategies (by name; None: all) on one part, probed at `points` of the line s = `line`
    (None: its back); written to `folder` if one is given: table, claims, pictures, pages.

    JobError for an unknown strategy or a line off the part; errors of the part, its stock and its holding as in
    `convert`. What fails later fails one row.
    """
    job = job or Job()

    known = {strategy.name: strategy for strategy in STRATEGIES}
    unknown = [name for name in strategies or () if name not in known]
    if unknown:
        raise JobError(f"strategy {unknown[0]!r} is unknown: take some of {', '.join(known)}")
    chosen = [known[name] for name in strategies or known]

    if folder is not None:
        check_folder(folder)
    job = job.with_values(holding={"second": ""})
    machine, dialect = read_machine(job.nc.machine), job_dialect(job.nc)
    mechanics_of_job(job)
    check_one_feed(job, "strategies are compared at one feed")
    failures = _failures(chosen, job, machine, dialect)
    given = mesh if isinstance(mesh, str | Path) else mesh_from(mesh)
    if not isinstance(given, str | Path) or not holds_surface(given):
        check_line(points, line)
    able = [strategy for strategy in chosen if strategy.name not in failures]
    base, failure = _base(given, job, able, Posting(machine, dialect), part(progress, 0.0, 0.2))
    if failure is not None:
        failures[MORPH.name] = failure
    post = post_below(base.part.mesh, base.job.holding)
    study = _Study(base, failures, machine, dialect, probe_line(base.surface, post, RUBY, points, line))
    rows = []
    measured = {}
    for k, strategy in enumerate(chosen):
        share = part(progress, 0.2 + 0.8 * k / len(chosen), 0.2 + 0.8 * (k + 1) / len(chosen))
        report(share, 0.0, strategy.title)
        row, measurement = study.row(strategy, share)
        rows.append(row)
        if measurement is not None:
            measured[strategy.name] = measurement
    comparison = Comparison(base.part.file, tuple(rows), claims_of(rows), measured)
    if folder is not None:
        write_comparison(comparison, folder)
    return comparison


def _failures(chosen: Sequence[Strategy], job: Job, machine: Machine, dialect: Dialect) -> dict[str, BonecamError]:
    """Why strategies cannot be run on the machine, by name, before anything is planned; raised where none can."""
    failures: dict[str, BonecamError] = {}
    for strategy in chosen:
        try:
            own = strategy.job(job)
            check_job(own, machine, dialect)
            check_reach(own, machine)
        except BonecamError as error:
            failures[strategy.name] = error
    if len(failures) == len(chosen):
        raise failures[chosen[0].name]
    return failures


def _base(
    given: Any, job: Job, chosen: Sequence[Strategy], posting: Posting, progress: Progress
) -> tuple[Morphed, BonecamError | None]:
    """Part, surface, stock, holding and the levels of the job; where these fail, without them and with the reason.

    Sizes of the holding that the job leaves open are found for tools that lie level, where a strategy has such: they
    need more room above the clamping than those of a morph, which then stand on the same. Depths of cuts are those of
    the numbers, for all strategies, unless the job asks for others.
    """
    if job.levels.automatic:
        job = job.with_values(levels={"schedule": "numbers"})
    layers = [strategy for strategy in chosen if not strategy.is_morph]
    first = (layers or [MORPH])[0]
    times = posting.times
    share = part(progress, 0.2, 1.0)
    standing = stand_part(given, first.job(job), posting.machine, times, part(progress, 0.0, 0.2))
    failure = None
    if len(layers) < len(chosen):
        morph = MORPH.job(replace(job, holding=standing.job.holding, levels=standing.job.levels))
        try:
            return morph_standing(replace(standing, job=morph), None, times, share), None
        except LevelError as error:
            if not layers:
                raise
            failure = error
    return morph_standing(standing, None, times, share), failure


@dataclass(frozen=True, eq=False)
class _Study:
    """What all strategies of a comparison share; `failures`: why some have no program, by name."""

    base: Morphed
    failures: dict[str, BonecamError]
    machine: Machine
    dialect: Dialect
    line: ProbeLine

    def row(self, strategy: Strategy, progress: Progress) -> tuple[Row, Measured | None]:
        """The row of a strategy, and its program if there is one."""
        try:
            if strategy.name in self.failures:
                raise self.failures[strategy.name]
            job, levels = strategy.job(self.base.job), self.base.levels
            share = part(progress, 0.0, 0.7)
            if strategy is not MORPH:
                levels = make_levels(self.base.surface, self.base.stock, job, part(share, 0.0, 0.2))
            posting = Posting(self.machine, self.dialect, file=self.base.part.file)
            result = machine_levels(replace(self.base, levels=levels, job=job), posting, part(share, 0.2, 1.0))

            # What it removes, whatever that is
            given = given_surface(result.part, result.job, result.report)
            cut = result.program.text, self.machine, self.dialect, result.job, result.stock, result.levels.levels
            removal = prove_removal(*cut, part(progress, 0.7, 0.95), given, check=False)
            figures = cast(Report, {**result.report, **removal.sections})
            result = replace(result, removal=removal, report=figures)
            assert removal.mechanics is not None
            state, reason = "done", ""
            try:
                check_removal_of_job(removal, result.job)
            except BonecamError as error:
                state = "refused"
                reason = str(error)
            cutters = tuple(cutters_of(result.job, self.machine))
            posted = PostedProgram(
                result.program.text, self.machine, self.dialect, cutters, result.surface, removal=removal
            )
            probed = probe_surface(posted, self.line)
            roughness = roughness_of(posted, result.job.tool("finishing").flutes)
            row = figures_of(result, posted.motions(), cutters, probed, roughness)
            return Row(strategy.name, strategy.title, state, reason, row), Measured(result, probed)
        except BonecamError as error:
            return Row(strategy.name, strategy.title, "failed", str(error)), None
