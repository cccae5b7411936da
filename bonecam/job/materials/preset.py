"""How stiff and strong a material is, and what force cuts it: the tables [stiffness] and [force] of its file.

The force coefficients are those of a mechanistic model (Altintas 2012, Manufacturing Automation, 2.8): an edge of the
length b that takes a chip of the thickness h loads the work along its way (t), along the normal of its surface (r) and
along itself (a) by (ktc h + kte) b, (krc h + kre) b and (kac h + kae) b. Authors differ by a factor of two for one
alloy: `band` holds the smallest and the largest multiple of the forces that they give.

Spindle speed and feed of a cutter in a material.

A material is data: a TOML file with `title`, `source`, `range` (what others give) and `note`, and either `spindle`
(1/min) and `feed` (mm/min) for every cutter, or `cutting_speed` v (m/min, at the ball's full diameter D, since the tool
leans), `feed_per_tooth` f (the thickest chip, a share of D) and `teeth` z. At a depth a below the radius R a chip is
thinner than the feed of a tooth by sin(acos(1 - a / R)) at least, so that

    spindle = min(1000 v / (pi D), what the machine turns),
    feed = min(f / sin(acos(1 - a / R)), 0.06) D z spindle.

Its tables [stiffness] and [force] say how it bends and what force cuts it; `mechanics_of` names the
material whose tables they are instead.

The section [mechanics] of a job.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from bonecam.errors import JobError, did_you_mean
from bonecam.files import input_text
from bonecam.job.parameter import JobSection, millimetres, parameter
from bonecam.plugins import named_files
from bonecam.text.numbers import shown
from bonecam.text.record import Record, checked
from bonecam.text.toml import parse_toml

NAMES = ("ktc", "krc", "kac", "kte", "kre", "kae")
SCALED = (631.0, 99.0, 273.0, 13.0, 10.0, 2.8)
"""Coefficients of aluminium 6082-T6 (its file has the source), which stand in, by the share of the yield strengths, for
those of a material that has none: N/mm^2, N/mm."""
SCALED_YIELD = 250.0
"""Yield strength of that alloy, N/mm^2."""
SCALED_BAND = (0.5, 2.0)
"""Band of what was scaled: a guess of the size of the difference between authors for one alloy."""


class StiffnessTable(Record):
    """The schema of [stiffness]: modulus (N/mm^2), density (kg/m^3), yield strength (N/mm^2)."""

    elasticity: float
    density: float
    yield_strength: float
    source: str


class ForceTable(Record):
    """The schema of [force]: ktc, krc, kac (N/mm^2), kte, kre, kae (N/mm), their band between authors."""

    ktc: float
    krc: float
    kac: float
    kte: float
    kre: float
    kae: float
    band: list[float]
    source: str
    range: str


@dataclass(frozen=True)
class CuttingForce:
    """Force coefficients (ktc, krc, kac in N/mm^2, kte, kre, kae in N/mm), the smallest and the largest multiple of the
    force that others give, and where they are from; `scaled`: from the yield strength alone."""

    coefficients: tuple[float, ...]
    band: tuple[float, float]
    source: str
    scaled: bool

    @property
    def array(self) -> Float[ndarray, "6"]:
        """The coefficients as an array."""
        return np.array(self.coefficients)


def cutting_force(force: ForceTable | None, yield_strength: float) -> CuttingForce:
    """The force that it takes to cut a material with a yield strength (N/mm^2): its coefficients, or those of aluminium
    by the share of the yield strengths."""
    if force is not None:
        values = tuple(float(getattr(force, name)) for name in NAMES)
        return CuttingForce(values, (force.band[0], force.band[1]), force.source, scaled=False)
    share = yield_strength / SCALED_YIELD
    source = f"no coefficients are known: those of aluminium 6082 times {share:.2f}, the share of the yield strengths"
    return CuttingForce(tuple(share * value for value in SCALED), SCALED_BAND, source, scaled=True)


FOLDER = Path(__file__).parent
MOST_FEED = 0.06
"""Largest feed of a tooth as a share of the ball's diameter, however thin the chip."""
SPINDLE_STEP = 10.0
"""Computed spindle speeds are rounded down to multiples of this, 1/min."""


class MaterialFile(Record):
    """The schema of a material file."""

    title: str
    source: str
    range: str
    note: str
    spindle: float | None = None
    feed: float | None = None
    cutting_speed: float | None = None
    feed_per_tooth: float | None = None
    teeth: int | None = None
    mechanics_of: str = ""
    stiffness: StiffnessTable | None = None
    force: ForceTable | None = None


@dataclass(frozen=True)
class Material:
    """A material and its cutting data, as its file states them; the text of the module says what they mean."""

    name: str
    title: str
    source: str
    range: str
    note: str
    spindle: float
    feed: float
    cutting_speed: float
    feed_per_tooth: float
    teeth: int
    stiffness: StiffnessTable | None
    force: ForceTable | None

    def speeds(
        self, radius: float, depth: float, fastest: float, spindle: float = 0.0, teeth: int = 0
    ) -> tuple[float, float]:
        """Spindle speed (1/min), at most the `fastest`, and feed (mm/min) of a ball of `radius` mm that cuts `depth` mm
        deep; the feed at another `spindle` speed, and of other `teeth`, where these are given."""
        if self.spindle:
            return spindle or self.spindle, self.feed
        turns = min(1000 * self.cutting_speed / (2 * math.pi * radius), fastest)
        turns = spindle or max(math.floor(turns / SPINDLE_STEP), 1) * SPINDLE_STEP
        thinner = math.sin(math.acos(1 - min(depth / radius, 1.0)))
        share = min(self.feed_per_tooth / thinner, MOST_FEED)
        return turns, float(max(math.floor(2 * radius * share * (teeth or self.teeth) * turns), 1))


def material_files() -> dict[str, Path]:
    """The files, by name, of the materials that come with bonecam, are the user's, or come with other packages."""
    return named_files("materials", FOLDER)


def read_material(name: str) -> Material:
    """The material of a name, or of a path to a TOML file; JobError names file and key of what is wrong."""
    files = material_files()
    path = Path(name) if name.endswith(".toml") else files.get(name)
    if path is None:
        raise JobError(
            f"[material] name = {name!r} is unknown{did_you_mean(name, files)}: use one of {', '.join(files)}, or the "
            "path of a .toml file",
            section="material",
            field="name",
        )
    try:
        return _material(path.stem, checked(MaterialFile, parse_toml(input_text(path))))
    except ValueError as error:
        raise JobError(f"{path}: {error}", file=str(path)) from error
    except OSError as error:
        raise JobError(f"{path}: {error.strerror}: give a readable material file", file=str(path)) from error


def _material(name: str, table: MaterialFile) -> Material:
    """The material of a file; ValueError where a number is not positive or the numbers of neither way are whole."""
    fixed = {"spindle": table.spindle, "feed": table.feed}
    scaled = {"cutting_speed": table.cutting_speed, "feed_per_tooth": table.feed_per_tooth, "teeth": table.teeth}
    given = {key: value for key, value in {**fixed, **scaled}.items() if value is not None}
    if set(given) not in (set(fixed), set(scaled)):
        raise ValueError(f"has {', '.join(given) or 'no numbers'}: give {' and '.join(fixed)}, or {', '.join(scaled)}")
    for key, value in given.items():
        if value <= 0:
            raise ValueError(f"{key} = {value:g}: give a positive number")
    if table.mechanics_of:
        shipped = sorted(path.stem for path in FOLDER.glob("*.toml"))  # these end: none names one that names it
        if table.mechanics_of not in shipped:
            known = ", ".join(shipped)
            raise ValueError(f"mechanics_of = {shown(table.mechanics_of)}: give one of {known}")
        alike = read_material(table.mechanics_of)
        table = table.model_copy(update={"stiffness": alike.stiffness, "force": alike.force})
    for key in ("elasticity", "density", "yield_strength") if table.stiffness else ():
        if getattr(table.stiffness, key) <= 0:
            raise ValueError(f"[stiffness] {key} = {getattr(table.stiffness, key):g}: give a positive number")
    if table.force:
        for key in NAMES:
            value = getattr(table.force, key)
            if value < 0 or (key == "ktc" and value == 0):
                raise ValueError(f"[force] {key} = {value:g}: give a positive number")
        band = table.force.band
        if len(band) != 2 or not 0 < band[0] <= 1 <= band[1]:
            raise ValueError(f"[force] band = {band}: give two multiples with 1 between, like [0.6, 1.9]")
    return Material(
        name=name,
        **{key: getattr(table, key) for key in ("title", "source", "range", "note", "stiffness", "force")},
        **{key: value or 0.0 for key, value in {**fixed, **scaled}.items()},  # type: ignore[arg-type]
    )


@dataclass(frozen=True)
class MechanicsJob(JobSection):
    """What bending under the force of the cut may do to the part, as it is told of a program."""

    largest_error: float = millimetres(
        0.05,
        "Largest error",
        "Error that bending may leave on 99 % of the finished surface; the paper's own bound.",
        0.001,
        10.0,
    )
    refuse: bool = parameter(
        True, "Refuse", "Refuse a program whose stress or error is larger; false: header and summary tell it."
    )
    flutes: int = parameter(2, "Flutes", "Cutting edges of a cutter whose section does not tell.", 1, 4)
