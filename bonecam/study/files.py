"""The folder of a comparison: table, claims, curves, pictures and pages. No program is written: some are refused."""

import html
import json
from collections.abc import Sequence
from pathlib import Path

from bonecam.files import whole_folder, write_whole
from bonecam.study.compared import Comparison
from bonecam.study.pictures.compared_left import draw_compared_left
from bonecam.study.pictures.compared_paths import draw_compared_paths
from bonecam.study.pictures.probed_line import draw_probed
from bonecam.study.table import (
    CLAIM_HEAD,
    claim_cells,
    claims_text,
    markdown,
    reasons,
    table_cells,
    table_csv,
    table_text,
)

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
        write_whole(work / "comparison.md", markdown(made.rows, made.claims))
        write_whole(work / "comparison.csv", table_csv(made.rows))
        write_whole(work / "comparison.json", json.dumps(made.report, indent=2) + "\n")
        if made.measured:
            _write_measured(made, work)
        write_whole(work / "index.html", _index(made))


def _index(made: Comparison) -> str:
    """The page of a comparison."""
    names = [html.escape(name) for name in made.measured]
    pictures = PICTURES if names else {}
    why = "".join(f"<p>{html.escape(reason)}</p>" for reason in reasons(made.rows))
    return PAGE.format(
        title=html.escape(f"{Path(made.part).name}: strategies compared"),
        pictures="".join(f'<img src="{file}" alt="{what}">' for file, what in pictures.items()),
        claims=_html_table("claims", [CLAIM_HEAD, *claim_cells(made.claims)]),
        figures=_html_table("figures", table_cells(made.rows)) + why,
        frames="".join(FRAME.format(title=name, file=f"page_{name}.html") for name in names),
    )


def _html_table(kind: str, lines: Sequence[Sequence[str]]) -> str:
    """A table of this class, its first line as head."""
    head, *body = ([html.escape(cell) for cell in line] for line in lines)
    rows = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in line)}</tr>" for line in body)
    return f'<table class="{kind}"><tr>{"".join(f"<th>{cell}</th>" for cell in head)}</tr>{rows}</table>'


def _write_measured(comparison: Comparison, work: Path) -> None:
    """The files of the strategies that have a program."""
    left = []
    scallop = 0.0
    for name, one in comparison.measured.items():
        write_whole(work / f"probe_{name}.csv", one.probed.csv)
        write_whole(work / f"page_{name}.html", one.result.page)
        if one.result.removal is not None:
            left.append((name, one.result.removal.remaining))
            scallop = one.result.job.finishing.scallop
    draw_compared_paths([(name, one.result) for name, one in comparison.measured.items()], work / "paths.png")
    draw_compared_left(left, scallop, work / "left.png")
    draw_probed([(name, one.probed) for name, one in comparison.measured.items()], work / "probe.png")
