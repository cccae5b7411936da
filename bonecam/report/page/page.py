"""One HTML file with everything in it: three.js, our scripts, and the packed contents.

three.js (MIT) is what `assets/three/entry.js` names of it, in one script of 0.56 MB: k3d's bundle has 2.6 MB, plotly's
4.8 MB.
"""

import base64
import html
from pathlib import Path
from string import Template

ASSETS = Path(__file__).parent / "assets"
THREE = ASSETS / "three" / "three.min.js"
SCRIPTS = ("unpack", "colours", "orbit", "bodies", "controls", "shapes", "cones", "path", "program", "timeline", "main")
"""The scripts in the order in which the page runs them."""


def page_html(packed: bytes, title: str) -> str:
    """The text of the page that shows packed contents."""
    template = Template((ASSETS / "page.html").read_text(encoding="utf-8"))
    scripts = [(ASSETS / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS]
    return template.substitute(
        title=html.escape(title),
        style=(ASSETS / "page.css").read_text(encoding="utf-8"),
        three=THREE.read_text(encoding="utf-8").replace("</script", "<\\/script"),
        payload=base64.b64encode(packed).decode("ascii"),
        script="\n".join(scripts),
    )
