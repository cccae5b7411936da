"""One HTML file with everything in it: three.js, our scripts, and the packed contents.

three.js (MIT) is the copy that the package pythreejs ships as one script of 0.56 MB: k3d's bundle has 2.6 MB, plotly's
4.8 MB. Nothing of pythreejs is imported.
"""

import base64
import html
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from string import Template

from bonecam.errors import FileError

ASSETS = Path(__file__).parent / "assets"
SCRIPTS = ("unpack", "colours", "orbit", "bodies", "controls", "shapes", "cones", "path", "program", "main")
"""The scripts in the order in which the page runs them."""


def page_html(packed: bytes, title: str) -> str:
    """The text of the page that shows packed contents; FileError where three.js is not installed."""
    template = Template((ASSETS / "page.html").read_text(encoding="utf-8"))
    scripts = [(ASSETS / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS]
    return template.substitute(
        title=html.escape(title),
        style=(ASSETS / "page.css").read_text(encoding="utf-8"),
        three=_three(),
        payload=base64.b64encode(packed).decode("ascii"),
        script="\n".join(scripts),
    )


@lru_cache(maxsize=1)
def _three() -> str:
    """The text of three.js, such that it may stand in a page."""
    package = find_spec("pythreejs")
    folder = Path(package.origin).parent if package and package.origin else Path()
    file = folder / "static" / "three.js"
    try:
        text = file.read_text(encoding="utf-8")
    except OSError as error:
        raise FileError(
            "three.js is missing: install pythreejs again (pip install --force-reinstall pythreejs)",
            file=str(file),
        ) from error
    return text.replace("</script", "<\\/script")
