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
    r"\| (depth \w+, (99 %|max)|force \w+, (peak max|jump max|jumps)|error kept by bending, (median|99 %)"
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
    return "\n\n".join(tables(folder) for folder in folders)


def compared(part: str) -> Path:
    """The folder of the comparison of a part, kept or made."""
    file, units, name = (*part.split(":"), *("mm", "paper-coarse")[part.count(":") :])
    folder = KEPT / name / Path(file).stem
    if not (folder / "comparison.md").exists():
        folder.mkdir(parents=True, exist_ok=True)
        bonecam.compare(file, bonecam.read_job(name).with_values(mesh={"units": units}), folder=folder)
    return folder


def tables(folder: Path) -> str:
    """The figures and the claims of one comparison, without what its folder alone keeps."""
    lines = (folder / "comparison.md").read_text(encoding="utf-8").rstrip().splitlines()
    start = next(at for at, line in enumerate(lines) if line.startswith("| claim "))
    figures = [line for line in lines[:start] if not LEFT_OUT.match(line)]
    return "\n".join([f"### {folder.name}, job `{folder.parent.name}`", "", *figures, *claims(lines[start + 2 :])])


def claims(rows: list[str]) -> list[str]:
    """What is told of the claims, each with the strategies that it is told of; figures stand above."""
    strategies: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        claim, strategy, told, *_ = (cell.strip() for cell in row.strip("|").split("|"))
        strategies.setdefault((told, claim), []).append(strategy)
    told_of: dict[str, list[str]] = {}
    for (told, claim), names in strategies.items():
        told_of.setdefault(told, []).append(f"{claim} ({', '.join(names)})")
    return ["| told | claims |", "|---|---|", *(f"| {told} | {'; '.join(of)} |" for told, of in told_of.items())]


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
