"""A control's names and lines: what it would refuse is told before planning, with a name that it takes."""

import re
from pathlib import Path

import pytest

from bonecam.errors import FileError
from bonecam.job import Job
from bonecam.nc.dialect import dialect_names, read_dialect
from bonecam.nc.posting.header.header import _divided, comment
from bonecam.nc.program import check_file_name, second_program_file
from bonecam.report.files.output_files import Outputs

LONG = "Proximale Phalanx links - Versuch Nr 12 Größe L (für Dr X) - bitte nicht verwechseln"


@pytest.mark.parametrize("name", dialect_names())
@pytest.mark.parametrize(("second", "split"), [(False, False), (True, True)])
def test_a_name_that_a_control_refuses_is_told_with_one_that_it_takes(
    name: str, second: bool, split: bool
) -> None:
    dialect = read_dialect(name)
    check_file_name(Path(f"bone{dialect.extension}"), dialect, second=second, split=split)
    for stem in (LONG, "1", "größe", "a" * 300):
        try:
            check_file_name(Path(f"{stem}{dialect.extension}"), dialect, second=second, split=split)
        except FileError as error:
            proposed = Path(str(error).rsplit("name it ", 1)[1])
            assert proposed.suffix == dialect.extension
            check_file_name(proposed, dialect, second=second, split=split)
            other = second_program_file(proposed, dialect)
            assert re.fullmatch(dialect.file_name.pattern, other.stem)
            assert len(f"{other.stem}_99") <= dialect.file_name.longest or not second


def test_siemens_takes_24_letters_digits_and_underscores(tmp_path: Path) -> None:
    dialect = read_dialect("siemens-840d")
    told = r"takes programs named by 24 characters of .* at most: name it Proximale_Phalanx_links\.mpf"
    with pytest.raises(FileError, match=told):
        Outputs(program=tmp_path / f"{LONG}.mpf").check(None, dialect)
    assert second_program_file("bone.mpf", dialect).name == "bone_second.mpf"
    assert second_program_file("bone.h", read_dialect("heidenhain")).name == "bone.second.h"


@pytest.mark.parametrize("name", dialect_names())
def test_comments_keep_to_the_longest_line(name: str) -> None:
    dialect = read_dialect(name).model_copy(update={"longest_line": 80})
    text = " ".join(["warning, towards X+ and Y+ and Z+, something bends by 0.123 mm"] * 9)
    lines = [comment(line, dialect) for line in _divided(text, dialect)]
    assert max(map(len, lines)) <= 80
    assert "".join("".join(lines).split()).count("BENDS") == 9


def test_linuxcnc_reads_no_line_over_255_characters() -> None:
    assert read_dialect("linuxcnc").longest_line == 255
    assert Job().nc.controller == ""
