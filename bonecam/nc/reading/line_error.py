"""The error of a line of a program."""

from bonecam.errors import ProgramError


def line_error(line: int, why: str) -> ProgramError:
    """The error of a line (from 1) of a program."""
    return ProgramError(f"line {line}: {why}", line=line)
