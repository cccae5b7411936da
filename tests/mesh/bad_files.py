"""What every reader of part files promises of a bad file."""

from pathlib import Path

import pytest

from bonecam.errors import FileError
from bonecam.mesh.files.mesh_files import read_mesh


def check_refused(file: Path, content: bytes | str, reason: str) -> None:
    """A file of this content is refused in one line that names it and holds `reason`."""
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(FileError) as caught:
        read_mesh(file)
    assert str(caught.value).startswith(str(file))
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
