"""Puts the public names of a package, as its stub lists them, at the head of its page of the reference."""

import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
EXPORT = re.compile(r"^from \.([\w.]+) import (\w+) as \2$", re.MULTILINE)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The page with links from each public name to its description."""
    folder, _, name = page.file.src_uri.removesuffix(".md").partition("/")
    if folder != "reference":
        return markdown
    package = "bonecam" if name == "bonecam" else f"bonecam.{name}"
    stub = ROOT.joinpath(*package.split("."), "__init__.pyi")
    if not stub.exists():
        return markdown
    links = [
        f"[`{public}`][{package}.{module}.{public}]" for module, public in EXPORT.findall(stub.read_text())
    ]
    title, _, rest = markdown.partition("\n")
    return f"{title}\n\n**Public names of `{package}`:** {', '.join(links)}.\n{rest}"
