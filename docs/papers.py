"""Writes our figures into the docs (`make papers`): comparisons of parts into pages/theory/papers.md, with the pictures
of the first, and what the benchmarks print into pages/benchmarks.md.

    python docs/papers.py [--only NAME]... [PART[:UNITS[:JOB]] ...]

By default the phalanx that ships, by the job `paper-coarse`. NAME: `compare`, or a script of tests/benchmarks; all
without. The comparison of a part is kept in out/papers/JOB/PART and not made again while it is there.
"""

import argparse
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from datetime import date
from pathlib import Path

import bonecam

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs" / "pages"
KEPT = ROOT / "out" / "papers"
PICTURES = ("paths", "left", "probe")
BLOCK = re.compile(r"<!-- made by (.+?) -->.*?<!-- end -->", re.DOTALL)
"""What is written here stands between such lines."""


def fill(page: Path, text_of: Callable[[str], str | None]) -> None:
    """Write the text of each block of a page by the name of what makes it; one that is not made again stays."""

    def block(found: re.Match[str]) -> str:
        text = text_of(found[1])
        return found[0] if text is None else f"<!-- made by {found[1]} -->\n\n{text}\n\n<!-- end -->"

    page.write_text(BLOCK.sub(block, page.read_text(encoding="utf-8")), encoding="utf-8")


def comparisons(parts: list[str]) -> str:
    """The tables of all parts; the pictures of the first one go into the docs."""
    folders = [compared(part) for part in parts]
    for name in PICTURES:
        shutil.copy(folders[0] / f"{name}.png", PAGES / "figures" / f"compared-{name}.png")
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
    """The figures and the claims of one comparison, as it wrote them."""
    written = (folder / "comparison.md").read_text(encoding="utf-8")
    return f"### {folder.name}, job `{folder.parent.name}`\n\n{written.rstrip()}"


def printed(script: str) -> str:
    """What a benchmark prints; its arguments follow its name."""
    command = [sys.executable, *f"tests/benchmarks/{script}".split()]
    told = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    return f"`python tests/benchmarks/{script}`, {date.today()}:\n\n```text\n{told.rstrip()}\n```"


def main() -> None:
    """Make what is asked for, and put it into the pages."""
    from bonecam_meshes import path

    parser = argparse.ArgumentParser()
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("parts", nargs="*", default=[f"{path('phalanx')}"])
    given = parser.parse_args()

    def wanted(name: str) -> bool:
        return not given.only or name.split()[0] in given.only

    fill(
        PAGES / "theory" / "papers.md",
        lambda name: comparisons(given.parts) if wanted(name) else None,
    )
    fill(PAGES / "benchmarks.md", lambda name: printed(name) if wanted(name) else None)


if __name__ == "__main__":
    main()
