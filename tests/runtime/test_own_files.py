"""The list of own files may be forged: nothing outside the folder, and nothing changed, is ever taken for ours."""

import shutil
import subprocess

import pytest

from bonecam.runtime.own_files import OWN_FILES, digest, folder_digest, is_own, list_of_own, stale_files


@pytest.mark.parametrize(
    "name", ["../victim", "a/../../victim", "/{}/victim", "link/victim", "./../victim", "a\0/victim"]
)
def test_a_list_that_names_what_is_outside_names_nothing(name, tmp_path):
    folder = tmp_path / "kept"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    victim = tmp_path / "victim"
    victim.write_text("mine")
    written = name.format(tmp_path)
    (folder / OWN_FILES).write_text(f"{digest(victim)}  {written}\n")
    assert stale_files(folder, ".*", []) == []
    assert not is_own(folder, written)


def test_only_what_has_the_content_that_the_list_tells_is_ours(tmp_path):
    for name in ("same", "other"):
        (tmp_path / name).write_text(name)
    content = digest(tmp_path / "same")
    (tmp_path / OWN_FILES).write_text("".join(f"{content}  {name}\n" for name in ("same", "other")))
    assert stale_files(tmp_path, ".*", []) == [tmp_path / "same"]


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="sha256sum is not installed")
@pytest.mark.parametrize("name", ["plain", "a\nb", "a\\b", "a\\nb", "a\n\\nb"])
def test_any_name_is_listed_as_sha256sum_does(name, tmp_path):
    (tmp_path / name).write_text(name)
    text = list_of_own(tmp_path, tmp_path, [name], [])
    told = subprocess.run(["sha256sum", name], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert text == told
    (tmp_path / OWN_FILES).write_text(text)
    subprocess.run(["sha256sum", "--check", OWN_FILES], cwd=tmp_path, check=True)
    assert is_own(tmp_path, name)
    assert list_of_own(tmp_path, tmp_path, [], []) == text


def test_the_digest_of_a_folder_is_that_of_names_and_bytes_but_for_what_was_compiled(tmp_path):
    folder_digest.cache_clear()

    def digest_of(**files):
        folder = tmp_path / str(len(list(tmp_path.iterdir())))
        for name, text in files.items():
            file = folder / name.replace("_in_", "/")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        return folder_digest(folder)

    same = digest_of(a="1", b_in_c="2")
    assert digest_of(b_in_c="2", a="1") == same
    assert digest_of(a="1", b_in_c="2", __pycache___in_a="3") == same
    others = [digest_of(a="1"), digest_of(a="1", c="2"), digest_of(a="12", b_in_c=""), digest_of(a="2", b_in_c="1")]
    assert len({same, *others}) == 5
