"""The table of a comparison with a strategy a column, as text and in Markdown, as CSV with a strategy a row; its
claims."""

import csv
import io
from collections.abc import Sequence

from bonecam.study.claims import Claim
from bonecam.study.rows import Row

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


def markdown(rows: Sequence[Row], claims: Sequence[Claim]) -> str:
    """Table, reasons and claims in Markdown."""
    head, *cells = table_cells(rows)
    lines = [_piped(head), "|---" + "|---:" * len(rows) + "|", *map(_piped, cells)]
    lines += [f"\n{reason}" for reason in reasons(rows)]
    lines += ["", _piped(CLAIM_HEAD), "|---" * len(CLAIM_HEAD) + "|", *map(_piped, claim_cells(claims))]
    return "\n".join(lines) + "\n"


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
