"""What a comparison is: its rows, the claims beside them, and what was measured."""

from dataclasses import dataclass
from typing import Any

from bonecam.report.files.result import Result
from bonecam.study.claims import Claim
from bonecam.study.rows import Row
from bonecam.verify.probing.probe import Probed


@dataclass(frozen=True, eq=False)
class Measured:
    """The program of a strategy, with what it removes and what a probe tells of it."""

    result: Result
    probed: Probed


@dataclass(frozen=True, eq=False)
class Comparison:
    """The `rows` of a comparison in the order of their strategies, the `claims` of the paper beside them, and what was
    `measured` by name of the strategy, for pictures and pages."""

    part: str
    rows: tuple[Row, ...]
    claims: tuple[Claim, ...]
    measured: dict[str, Measured]

    @property
    def report(self) -> dict[str, Any]:
        """The comparison as JSON has it."""
        return {
            "part": self.part,
            "strategies": [row.report for row in self.rows],
            "claims": [claim.report for claim in self.claims],
        }
