"""Fills a page of the reference with the public names of its package, as the package's stub lists them."""

import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
EXPORT = re.compile(r"^from \.([\w.]+) import (\w+) as \2$", re.MULTILINE)
PACKAGE = re.compile(r"^::: (bonecam(?:_plugins)?(?:\.\w+)?)$", re.MULTILINE)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """The page with the description of each public name after that of its package."""
    return PACKAGE.sub(_described, markdown) if page.file.src_uri.startswith("reference/") else markdown


def _described(found: re.Match[str]) -> str:
    """The package's own text and its public names; a module without a stub as it is."""
    package = found[1]
    stub = ROOT.joinpath(*package.replace("bonecam_plugins", "plugins").split("."), "__init__.pyi")
    if not stub.exists():
        return found[0]
    names = (f"::: {package}.{module}.{public}" for module, public in EXPORT.findall(stub.read_text()))
    return "\n\n".join([f"{found[0]}\n    options: {{members: false, show_submodules: false}}", *names])
