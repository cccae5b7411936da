"""Writes our figures into the docs (`make papers`): comparisons of parts into pages/theory/papers.md, with the pictures
of the last, and what the benchmarks print into pages/benchmarks.md.

    python docs/papers.py [--only NAME]... [PART[:UNITS[:JOB]] ...]

By default the phalanx that ships, by the job `paper-coarse`. NAME: `compare`, or a script of tests/benchmarks; all
without. The comparison of a part is kept in out/papers/JOB/PART and not made again while it is there.
"""

import argparse
import re
import shutil
import subprocess
import sys
from datetime import date
from pathlib import Path

import bonecam

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs" / "pages"
KEPT = ROOT / "out" / "papers"
PICTURES = ("paths", "left", "probe")
LEFT_OUT = re.compile(
    r"(depth \w+, (99 %|max)|force \w+, (peak max|jump max|jumps)|error kept by bending, (median|99 %)"
    r"|probed deviation, mean|Rz )"
)
"""Rows of a comparison that no claim rests on and that stay in its folder."""
BLOCK = "<!-- made by {name} -->{text}<!-- end -->"
"""What is written here stands between such lines."""


def names_in(page: Path) -> list[str]:
    """What makes the blocks of a page."""
    return re.findall("<!-- made by (.+?) -->", page.read_text(encoding="utf-8"))


def fill(page: Path, name: str, text: str) -> None:
    """Write the text of one block of a page."""
    pattern = BLOCK.format(name=re.escape(name), text=".*?")
    written = BLOCK.format(name=name, text=f"\n\n{text}\n\n")
    whole = page.read_text(encoding="utf-8")
    page.write_text(re.sub(pattern, lambda _: written, whole, flags=re.DOTALL), encoding="utf-8")


def comparisons(parts: list[str]) -> str:
    """The tables of all parts; the pictures of the last one go into the docs."""
    sys.path.append(str(ROOT / "tests" / "figures"))
    from palette import shrink

    folders = [compared(part) for part in parts]
    for name in PICTURES:
        picture = PAGES / "figures" / f"compared-{name}.png"
        shutil.copy(folders[-1] / f"{name}.png", picture)
        shrink(picture)
    return tables(folders)


def compared(part: str) -> Path:
    """The folder of the comparison of a part, kept or made."""
    file, units, name = (*part.split(":"), *("mm", "paper-coarse")[part.count(":") :])
    folder = KEPT / name / Path(file).stem
    if not (folder / "comparison.md").exists():
        folder.mkdir(parents=True, exist_ok=True)
        bonecam.compare(file, bonecam.read_job(name).with_values(mesh={"units": units}), folder=folder)
    return folder


def tables(folders: list[Path]) -> str:
    """One table of the figures and one of the claims, of several parts side by side in each cell and column."""
    figures: dict[str, list[list[str]]] = {}
    claims: dict[str, list[list[str]]] = {}
    for number, folder in enumerate(folders):
        text = (folder / "comparison.md").read_text(encoding="utf-8")
        rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line]
        start = next(at for at, row in enumerate(rows) if row[0] == "claim")
        for label, *cells in rows[2:start]:
            if not LEFT_OUT.match(label):
                figures.setdefault(label, []).append(cells)
        for claim, strategy, told, *_ in rows[start + 2 :]:
            of = claims.setdefault(told, [[] for _ in folders])[number]
            of.append(f"{claim} ({strategy})")
    names = [f"{folder.name}, job `{folder.parent.name}`" for folder in folders]
    lines = [f"### {' / '.join(names)}", "", table_row("", rows[0][1:]), "|---|" + "---:|" * len(rows[0][1:])]
    lines += [table_row(label, [" / ".join(side) for side in zip(*cells)]) for label, cells in figures.items()]
    lines += ["", table_row("told", [folder.name for folder in folders]), "|---|" + "---|" * len(folders)]
    lines += [table_row(told, ["; ".join(shared(of)) for of in parts]) for told, parts in claims.items()]
    return "\n".join(lines)


def table_row(label: str, cells: list[str]) -> str:
    """One row of a Markdown table."""
    return f"| {' | '.join([label, *cells])} |"


def shared(claims: list[str]) -> list[str]:
    """Each claim once, with all strategies that it is told of."""
    strategies: dict[str, list[str]] = {}
    for claim in claims:
        text, _, strategy = claim.rpartition(" (")
        strategies.setdefault(text, []).append(strategy.rstrip(")"))
    return [f"{text} ({', '.join(names)})" for text, names in strategies.items()]


def printed(script: str) -> str:
    """What a benchmark prints, and whether it ended early; its arguments follow its name."""
    command = [sys.executable, *f"tests/benchmarks/{script}".split()]
    run = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    if not run.stdout:
        raise SystemExit(f"{script}: printed nothing: run it by itself")
    missed = ", ended early" if run.returncode else ""
    told = f"`python tests/benchmarks/{script}`, {date.today()}{missed}:"
    return f"{told}\n\n<!-- output -->\n```text\n{run.stdout.rstrip()}\n```"


def main() -> None:
    """Make what is asked for, and put it into the pages."""
    from bonecam_meshes import path

    parser = argparse.ArgumentParser()
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("parts", nargs="*", default=[f"{path('phalanx')}"])
    given = parser.parse_args()

    for page, make in (
        (PAGES / "theory" / "papers.md", lambda _: comparisons(given.parts)),
        (PAGES / "benchmarks.md", printed),
    ):
        for name in names_in(page):
            if not given.only or name.split()[0] in given.only:
                fill(page, name, make(name))


if __name__ == "__main__":
    main()
