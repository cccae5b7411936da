"""The page of a run that is over: made from its kept files, or opened in the browser."""

import webbrowser
from pathlib import Path

from bonecam.errors import FileError
from bonecam.files import check_files, input_bytes, second_file
from bonecam.report.page.packing import Contents, unpack
from bonecam.report.page.page import page_html
from bonecam.runtime.staging import staged

PAGES = (".html", ".htm")
"""Endings of pages."""
VIEW = "view.gz"
"""The file of a kept folder with all that the page shows."""
SECOND_VIEW = "second_view.gz"
"""That of its second clamping."""


def view(keep: str | Path, file: str | Path) -> Path:
    """Write the page of the run whose files are in the folder `keep`, and that of its second clamping beside it, if it
    has one (bone.second.html beside bone.html); returns the name of the first.

    FileError where the folder holds no run, one of another version or damaged files, or a page cannot be written.
    """
    pages = kept_pages(keep, file)
    check_files(pages)
    check_page_name(file)
    views = [kept_contents(Path(keep), name) for name in (VIEW, SECOND_VIEW)[: len(pages)]]
    with staged() as staging:
        for page, (packed, contents) in zip(pages, views, strict=True):
            staging.write(page, page_html(packed, str(contents.facts["name"])))
    return Path(file)


def kept_pages(keep: str | Path, file: str | Path) -> list[Path]:
    """The pages that `view` writes."""
    return [Path(file), *([second_file(file)] if (Path(keep) / SECOND_VIEW).exists() else [])]


def check_page_name(file: str | Path) -> None:
    """FileError where the name of a page has no ending of one."""
    if Path(file).suffix.lower() not in PAGES:
        raise FileError(f"{file}: a page ends in .html: name it {Path(file).name}.html", file=str(file))


def kept_contents(keep: Path, name: str = VIEW) -> tuple[bytes, Contents]:
    """What the page of a kept run shows, packed and unpacked, from the file `name`; FileError where it is not there or
    damaged."""
    path = keep / name
    try:
        packed = input_bytes(path)
    except OSError as error:
        trouble = "is no folder" if not keep.is_dir() else f"{name} cannot be read ({error.strerror})"
        remedy = "give the folder of `--keep` or `levels -o`, made by this version"
        raise FileError(f"{keep}: {trouble}: {remedy}", file=str(path)) from error
    contents = unpack(packed, str(path))
    if not _is_whole(contents):
        raise FileError(f"{path}: is damaged: make it again with --keep", file=str(path))
    return packed, contents


def _is_whole(contents: Contents) -> bool:
    """Whether a page has a title, and its levels their meshes."""
    try:
        names = [(f"level_{level['index']}", level["faces"]) for level in contents.facts["levels"]]
        return bool(contents.facts["name"]) and all(set(pair) <= contents.arrays.keys() for pair in names)
    except (KeyError, TypeError):
        return False


def show_page(file: Path) -> Path:
    """Open a page in the browser; returns its name."""
    webbrowser.open(file.resolve().as_uri())
    return file
