"""The folder of a comparison: table, claims, curves, pictures and pages. No program is written: some are refused."""

import html
import json
from pathlib import Path

from bonecam.files import whole_folder, write_whole
from bonecam.study.compared import Comparison
from bonecam.study.pictures.compared_left import draw_compared_left
from bonecam.study.pictures.compared_paths import draw_compared_paths
from bonecam.study.pictures.probed_line import draw_probed
from bonecam.study.table import claims_text, table_csv, table_text

OWN = r"comparison\.(txt|csv|json)|probe_[\w-]+\.csv|(paths|left|probe)\.png|(index|page_[\w-]+)\.html"
"""Names of the files of a comparison, as a regular expression; a later one removes those of an earlier."""
PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>body{{margin:0;display:flex;height:100vh;font:14px sans-serif}}
section{{flex:1;display:flex;flex-direction:column;min-width:20rem}}h2{{margin:.3rem;font-size:1rem}}
iframe{{flex:1;border:0;border-left:1px solid #888}}</style></head>
<body>{frames}</body></html>
"""
FRAME = '<section><h2>{title}</h2><iframe src="{file}" title="{title}"></iframe></section>'


def write_comparison(made: Comparison, folder: str | Path) -> None:
    """Write a comparison: comparison.txt, .csv and .json, probe_STRATEGY.csv, paths.png, left.png and probe.png, and
    index.html, which shows the pages of all strategies beside one another."""
    with whole_folder(folder, OWN) as work:
        write_whole(work / "comparison.txt", table_text(made.rows) + "\n" + claims_text(made.claims))
        write_whole(work / "comparison.csv", table_csv(made.rows))
        write_whole(work / "comparison.json", json.dumps(made.report, indent=2) + "\n")
        if made.measured:
            _write_measured(made, work)


def _write_measured(made: Comparison, work: Path) -> None:
    """The files of the strategies that have a program."""
    frames = []
    for name, one in made.measured.items():
        write_whole(work / f"probe_{name}.csv", one.probed.csv)
        write_whole(work / f"page_{name}.html", one.result.page)
        frames.append(FRAME.format(title=html.escape(name), file=f"page_{name}.html"))
    title = html.escape(f"{made.part}: strategies compared")
    write_whole(work / "index.html", PAGE.format(title=title, frames="".join(frames)))
    probes = {
        name: one.result.removal.remaining.normal_probes
        for name, one in made.measured.items()
        if one.result.removal is not None
    }
    draw_compared_paths([(name, one.result) for name, one in made.measured.items()], work / "paths.png")
    draw_compared_left([(name, each) for name, each in probes.items() if each], work / "left.png")
    draw_probed([(name, one.probed) for name, one in made.measured.items()], work / "probe.png")
