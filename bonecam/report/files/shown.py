"""What results have in common: a page in the browser, which a notebook shows beside their summary."""

import base64
import html
from abc import ABC, abstractmethod
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp

from bonecam.files import write_whole
from bonecam.report.files.kept_view import show_page
from bonecam.report.page.page import page_html

INLINE = 30_000_000
"""A page of more characters is not put into a notebook."""
FRAME = "width: 100%; height: 640px; border: 1px solid #dde2e8"
"""The frame of a page in a notebook."""


class Shown(ABC):
    """A result that can be looked at."""

    @property
    @abstractmethod
    def summary(self) -> str:
        """The report in a few lines of text."""

    @property
    @abstractmethod
    def packed_view(self) -> bytes:
        """What `view` shows, packed as `bonecam.report.page` has it."""

    @property
    @abstractmethod
    def _title(self) -> str:
        """The title of the page."""

    @abstractmethod
    def _draw(self, file: Path) -> str:
        """Write the picture for notebooks; returns what it shows."""

    @property
    def page(self) -> str:
        """The text of the HTML file of `view`."""
        return page_html(self.packed_view, self._title)

    def view(self, file: str | Path) -> Path:
        """Write one HTML file that shows the run in a browser, without network; returns its name. FileError where it
        cannot be written."""
        write_whole(file, self.page)
        return Path(file)

    def show(self) -> Path:
        """Show the run in the browser; returns the page's file, in a new folder for temporary files."""
        return show_page(self.view(Path(mkdtemp(prefix="bonecam-")) / "view.html"))

    def _repr_html_(self) -> str:
        """The summary and the page, as notebooks show a value; a picture where the page is too large for one."""
        summary = f'<pre style="font-family: monospace">{html.escape(self.summary)}</pre>'
        page = self.page
        if len(page) <= INLINE:
            return f'{summary}<iframe srcdoc="{html.escape(page)}" style="{FRAME}"></iframe>'
        with TemporaryDirectory() as folder:
            path = Path(folder) / "picture.png"
            reported = self._draw(path)
            data = base64.b64encode(path.read_bytes()).decode("ascii")
        picture = f'<img alt="{html.escape(reported)}" src="data:image/png;base64,{data}">'
        note = f"The page has {len(page) / 1e6:.0f} MB: show() opens it in the browser, view(FILE) writes it."
        return f"{summary}{picture}<p>{note}</p>"
