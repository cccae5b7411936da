"""Files are written whole or not at all, and what cannot be written is refused with nothing left."""

import errno
import os
import resource
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bonecam.errors import FileError
from bonecam.files import (
    LARGEST_INPUT,
    check_files,
    check_folder,
    input_bytes,
    input_text,
    whole_file,
    whole_folder,
    write_whole,
)


@pytest.fixture
def folder(tmp_path):
    """A folder with a file and a folder in it."""
    (tmp_path / "file").write_text("old")
    (tmp_path / "inner").mkdir()
    return tmp_path


@contextmanager
def full_disk() -> Iterator[None]:
    """No file may grow beyond 100 bytes; not a fixture, since pytest writes its own log before fixtures
    end."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def names(folder: Path) -> list[str]:
    return sorted(item.name for item in folder.iterdir())


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("", "an empty name"),
        ("inner", "is a folder"),
        ("none/out.h", "does not exist"),
        ("file/out.h", "is a file"),
        ("/dev/null", "is no regular file"),
        ("/proc/out.h", r"no file can be made in /proc \(.*\): choose a folder that may be written"),
        ("x" * 300, "name too long"),
        ("file", "is read as well"),
        ("./given", "named for two outputs"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_before_the_work(name, reason, folder, monkeypatch):
    monkeypatch.chdir(folder)
    with pytest.raises(FileError, match=f"(?i){reason}") as caught:
        check_files(["given", name], ["file"])
    assert "\n" not in str(caught.value)
    assert names(folder) == ["file", "inner"]


@pytest.mark.parametrize("name", ["file", "file/kept", "file/a/b", "/proc/kept", "x" * 300])
def test_a_folder_that_cannot_be_made_is_refused_before_the_work(name, folder, monkeypatch):
    monkeypatch.chdir(folder)
    with pytest.raises(FileError, match=name):
        check_folder(name)
    check_folder("a/b")
    check_folder("inner")
    assert names(folder) == ["file", "inner"]


def test_a_pipe_behind_the_name_of_a_stream_is_refused_as_what_it_is():
    reading, writing = os.pipe()
    try:
        with pytest.raises(FileError, match="is no regular file"):
            check_files([f"/dev/fd/{writing}"])
    finally:
        os.close(reading)
        os.close(writing)


def test_a_file_that_is_write_protected_is_not_replaced(folder):
    (folder / "file").chmod(0o444)
    with pytest.raises(FileError, match=r"file: is write-protected: .*chmod u\+w"):
        check_files([folder / "file"])


def test_a_disk_that_is_full_leaves_what_was_there(folder):
    with full_disk(), pytest.raises(FileError, match="make room") as caught:
        write_whole(folder / "file", "x" * 1000)
    assert str(folder / "file") in str(caught.value)
    with full_disk(), pytest.raises(FileError, match="make room"), whole_folder(folder / "a" / "b") as work:
        write_whole(work / "two", "x" * 1000)
    assert names(folder) == ["file", "inner"]
    assert (folder / "file").read_text() == "old"


def test_a_link_is_followed_and_stays_a_link(folder):
    (folder / "link").symlink_to("file")
    write_whole(folder / "link", "new")
    assert (folder / "file").read_text() == "new"
    assert (folder / "link").is_symlink()


def test_what_fails_or_is_stopped_in_between_leaves_nothing(folder):
    def stopped(half):
        half.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), whole_file(folder / "out") as work:
        stopped(work)
    with pytest.raises(KeyboardInterrupt), whole_folder(folder / "out") as work:
        stopped(work / "half")
    with pytest.raises(FileError, match="Permission"), whole_file(folder / "out"):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    assert names(folder) == ["file", "inner"]


def test_a_folder_in_the_place_of_a_file_is_told_before_any_file_is_moved(folder):
    def two_files():
        with whole_folder(folder) as work:
            (work / "file").write_text("new")
            (work / "inner").write_text("new")

    with pytest.raises(FileError, match=r"inner: is a folder, .*: remove it"):
        two_files()
    assert (folder / "file").read_text() == "old"
    assert names(folder) == ["file", "inner"]


def test_only_regular_files_of_a_bounded_size_are_opened(folder):
    os.mkfifo(folder / "pipe")
    with open(folder / "large", "wb") as file:
        file.truncate(LARGEST_INPUT + 1)
    for name, reason in (("pipe", "a pipe"), ("inner", "a folder"), ("large", "1.0 GiB"), ("none", "No such")):
        with pytest.raises(OSError, match=reason):
            input_bytes(folder / name)
    with pytest.raises(OSError, match="a device"):
        input_bytes("/dev/zero")
    (folder / "text").write_bytes(b"\xef\xbb\xbfone\r\ntwo\rthree\n")
    assert input_text(folder / "text") == "one\ntwo\nthree\n"


def test_a_file_that_is_a_mount_point_is_refused_before_the_work(folder):
    (folder / "given.h").write_text("given")
    (folder / "program.h").touch()
    check_files([folder / "program.h"])
    mount = ["mount", "--bind", str(folder / "given.h"), str(folder / "program.h")]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("only root may mount")
    try:
        with pytest.raises(FileError, match=r"program\.h: is a mount point, which no new file can replace: mount its"):
            check_files([folder / "program.h"])
    finally:
        subprocess.run(["umount", str(folder / "program.h")], check=True)
    assert (folder / "given.h").read_text() == "given"
