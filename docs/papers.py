"""Writes the tables of pages/theory/papers.md (`make papers`): each part compared with the job papers.toml.

    python docs/papers.py [PART[:UNITS] ...]

By default the phalanx that ships. The comparison of a part is kept in out/papers/NAME and not made again while it is
there.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

import bonecam
from bonecam.study.table import LINES

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "pages" / "theory" / "papers.md"
KEPT = ROOT / "out" / "papers"
BEGIN, END = "<!-- written by make papers -->", "<!-- end of what make papers wrote -->"


def compared(part: str) -> dict[str, Any]:
    """The comparison of a part, kept or made."""
    file, _, units = part.partition(":")
    folder = KEPT / Path(file).stem
    if not (folder / "comparison.json").exists():
        job = bonecam.read_job(ROOT / "docs" / "papers.toml").with_values(mesh={"units": units or "mm"})
        bonecam.compare(file, job, folder=folder)
    found: dict[str, Any] = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))
    return found


def tables(found: dict[str, Any]) -> str:
    """The figures and the claims of one comparison."""
    rows = found["strategies"]
    lines = [
        f"### {Path(found['part']).stem}",
        "",
        f"| | {' | '.join(row['strategy'] for row in rows)} |",
        f"|---|{'---:|' * len(rows)}",
    ]
    for name, what in LINES:
        values = (row["figures"].get(name) for row in rows)
        lines.append(f"| {what} | {' | '.join('-' if v is None else f'{v:g}' for v in values)} |")
    lines += [f"\n{row['strategy']} {row['state']}: {row['reason']}" for row in rows if row["reason"]]
    lines += ["", "| claim | of | told | figures |", "|---|---|---|---|"]
    for claim in found["claims"]:
        lines.append(f"| {claim['claim']} | {claim['of']} | **{claim['verdict']}** | {claim['figures']} |")
    return "\n".join(lines)


def main(parts: list[str]) -> None:
    """Compare the parts and put their tables into the page."""
    from bonecam_meshes import path

    parts = parts or [f"{path('phalanx')}:mm"]
    text = "\n\n".join(tables(compared(part)) for part in parts)
    page = PAGE.read_text(encoding="utf-8")
    written, count = re.subn(
        f"{BEGIN}.*{END}", lambda _: f"{BEGIN}\n\n{text}\n\n{END}", page, flags=re.DOTALL
    )
    if count != 1:
        raise SystemExit(f"{PAGE}: give it one pair of the lines {BEGIN} and {END}")
    PAGE.write_text(written, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
