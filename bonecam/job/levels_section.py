"""The section [levels] of a job."""

import math
from dataclasses import dataclass
from typing import Any

from bonecam.errors import JobError
from bonecam.job.parameter import JobSection, check, is_list, millimetres, parameter
from bonecam.plugins import added_names
from bonecam.text.numbers import number

MOST_LEVELS = 2000
"""A number of cuts, or of depths in a list, beyond this is refused: a mistaken depth or unit."""


DEFAULT_NUMBERS = (4, 0.5)
"""Finishing levels, and roughing depth (mm), of Gan et al. (2014)."""
METHODS = ("qp", *reversed(added_names("methods")))
"""Our own, then those that users and packages add, backwards: filter scripts number them so."""
FOUND = "found"
"""Instead of depths: they are found."""


def depths_from_text(text: str) -> tuple[float, ...]:
    """The depths (mm) that `depths` states, none in an empty text or where they are FOUND; ValueError with the remedy
    where it is no list of positive numbers."""
    if text.strip() in ("", FOUND):
        return ()
    try:
        depths = tuple(number(word) for word in text.replace(",", " ").split())
    except ValueError as error:
        raise ValueError(f"give numbers like '0.1 0.1 0.5', or '{FOUND}'") from error
    if len(depths) > MOST_LEVELS:
        raise ValueError(f"give at most {MOST_LEVELS}; the last holds for all others")
    if not depths or not all(0 < depth < math.inf for depth in depths):
        raise ValueError("give positive depths (mm), like '0.1 0.1 0.5'")
    return depths


@dataclass(frozen=True)
class LevelsJob(JobSection):
    """The depth of each cut, and the energy that the levels minimise (Gan et al. 2014, section 4.2).

    `depths` may also be given as one number or as a list of numbers (mm). Of a section built in Python, schedule =
    "numbers" says that numbers equal to the defaults are meant; a job file or a dict that states one means it.
    """

    finishing_depth: float = millimetres(
        0.1, "Finishing depth", "Largest cutting depth of the levels next to the part.", 0.005, 5.0
    )
    finishing_levels: int = parameter(
        DEFAULT_NUMBERS[0],
        "Finishing levels",
        "Number of levels next to the part that are cut at the finishing depth.",
        0,
        50,
    )
    roughing_depth: float = millimetres(
        DEFAULT_NUMBERS[1],
        "Roughing depth",
        "Largest cutting depth of the other levels; of cuts that follow no level always.",
        0.01,
        20.0,
    )
    schedule: str = parameter(
        "automatic",
        "Schedule",
        "numbers: finishing_levels cuts at the finishing depth, the others at the roughing depth; fewest: all cuts at "
        "the roughing depth; automatic: as depths = 'found' has them where the neck is found too and neither number "
        "is stated, else numbers.",
        choices=("automatic", "numbers", "fewest"),
    )
    depths: str = parameter(
        "",
        "Depths",
        "Depths (mm) of the cuts from the part outwards instead, like '0.1 0.1 0.3 0.5'; the last one repeats. found: "
        "the fewest that ball, neck and part bear, the cut onto the part at the finishing depth.",
        form=depths_from_text,
    )
    scallop_share: float = parameter(
        0.0,
        "Scallop share",
        "Before a roughing cut a level may keep scallops of this share of its depth, where that is more than "
        "roughing.scallop; 0: 0.2 where depths are found, else none.",
        0.0,
        0.5,
    )
    most_cuts: int = parameter(250, "Most cuts", "A stock that needs more cuts than this is refused.", 1, 2000)
    even: bool = parameter(
        False, "Even", "Spread the depth evenly over the roughing cuts, so that the outermost cut is not much thinner."
    )
    stiffness: float = parameter(
        5e-7,
        "Stiffness",
        "Weight of the thin-plate energy against the attraction (c_int / c_ext), s and t in [0, 1].",
        0.0,
        1.0,
    )
    attraction: str = parameter(
        "stock",
        "Attraction",
        "Levels are attracted to the nearest point of the stock, or to the bounding sphere (as published).",
        choices=("stock", "sphere"),
    )
    method: str = parameter(
        "qp", "Method", "qp: quadratic programs, solved by levels.solver; others are for comparison.", choices=METHODS
    )
    solver: str = parameter(
        "admm",
        "Solver",
        "Of the quadratic programs: admm; osqp and others are references, and slow.",
        choices=("admm", "osqp", *added_names("solvers")),
    )
    chord_tolerance: float = millimetres(
        0.01,
        "Chord tolerance",
        "Chord tolerance of the tessellated levels, which are measured and written.",
        0.0005,
        1.0,
    )

    def completed(self, values: dict[str, Any]) -> dict[str, Any]:
        """The values by name that other depths are stated with: a number that is stated holds, though it be that of the
        default. Beside depths to be found it has to be that one, as a job that is written states all."""
        usual = DEFAULT_NUMBERS[0]
        if values.get("depths") == FOUND and values.get("finishing_levels", usual) != usual:
            why = "depths = 'found' finds how many: leave one of them out"
            raise JobError(f"finishing_levels = {values['finishing_levels']}: {why}", field="finishing_levels")
        stated = bool(values.keys() & {"finishing_levels", "roughing_depth"})
        return {"schedule": "numbers", **values} if stated and self.schedule == "automatic" else values

    def __post_init__(self) -> None:
        if not isinstance(self.depths, str):
            several = list(self.depths) if is_list(self.depths) else [self.depths]
            if not several:
                raise self.fault("depths", "give one at least, or leave them out")
            object.__setattr__(self, "depths", " ".join(map(str, several)))
        check(self)
        if self.depths.strip() and self.schedule == "fewest":
            raise self.fault("depths", "they give every cut, schedule = 'fewest' too: leave one of them out")

    @property
    def found(self) -> bool:
        """Whether the depths are to be found; until then `cuts` are those of the numbers."""
        return self.depths.strip() == FOUND

    @property
    def automatic(self) -> bool:
        """Whether the depths may be found: nothing of them is stated but the finishing depth."""
        numbers = self.finishing_levels, self.roughing_depth
        return self.schedule == "automatic" and not self.depths.strip() and numbers == DEFAULT_NUMBERS

    @property
    def listed(self) -> tuple[float, ...]:
        """The depths (mm) that are stated one by one, if any."""
        return depths_from_text(self.depths)

    @property
    def cuts(self) -> tuple[tuple[float, ...], float]:
        """Depths (mm) of the first cuts, from the part outwards, and the depth of all others."""
        if self.listed:
            *first, beyond = self.listed
            return tuple(first), beyond
        count = 0 if self.schedule == "fewest" else self.finishing_levels
        return (self.finishing_depth,) * count, self.roughing_depth

    def depth_onto(self, level: int) -> float:
        """Depth (mm) of the cut that leaves a level."""
        first, beyond = self.cuts
        return first[level] if level < len(first) else beyond

    @property
    def layer_depth(self) -> float:
        """Depth (mm) of cuts that follow no level: in layers, and of a groove, which meet material on both sides."""
        return min(self.cuts[1], self.roughing_depth)
