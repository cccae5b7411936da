"""A picture of the page in a browser, while it plays the program."""

from pathlib import Path
from tempfile import TemporaryDirectory

FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader")
CHROMIUM = "/usr/bin/chromium"
WIDTH, HEIGHT = 1280, 720
LEVEL = 6
"""The level that is cut in the picture."""
CHOICE = """(level) => {
    const a = page.arrays, right = page.orbit.rightOfView;
    const { low, high } = page.part;
    const score = (i) => a.move_axis[3 * i] * right.x + a.move_axis[3 * i + 1] * right.y;
    const inside = (z) => z > (low.z + high.z) / 2 && z < 0.2 * low.z + 0.8 * high.z;
    const first = firstMoveOf(level), last = a.move_level.lastIndexOf(level);
    let best = -1;
    for (let i = first + Math.round(0.3 * (last - first)); i < last; i++)
        if (a.move_kind[i] === 0 && coneOf(i) >= 0 && inside(a.move_tip[3 * i + 2]))
            if (best < 0 || score(i) > score(best)) best = i;
    change({ cones: true });
    goTo(best);
}"""
"""Of the level's later moves the cut in the upper half of the part in which the tool is most seen from its side."""


def picture_page(page: str, file: Path) -> None:
    """Write a picture of the text of a page."""
    from playwright.sync_api import sync_playwright

    with TemporaryDirectory() as folder, sync_playwright() as started:
        place = Path(folder) / "page.html"
        place.write_text(page, encoding="utf-8")
        browser = started.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        opened = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        opened.goto(place.as_uri())
        while not opened.evaluate("page.ready"):
            opened.wait_for_timeout(100)
        opened.evaluate("setMode('program')")
        opened.evaluate(CHOICE, LEVEL)
        opened.wait_for_timeout(500)
        opened.screenshot(path=str(file))
        browser.close()
