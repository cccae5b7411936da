"""The sections [material], [roughing], [finishing] and [fine] of a job: what is cut, and one cutter each."""

from dataclasses import dataclass
from typing import Any

from bonecam.errors import JobError
from bonecam.job.parameter import JobSection, check, is_list, millimetres, parameter
from bonecam.machine.bodies import Frustum, stack_as_text, stack_from_text
from bonecam.text.numbers import shown


@dataclass(frozen=True)
class MaterialJob(JobSection):
    """The material of the stock, which gives spindle speed and feed where a cutter's section leaves them 0."""

    name: str = parameter(
        "aluminium",
        "Material",
        "aluminium, cortical-bone, paper, peek, titanium, or the path of a material's .toml file.",
        file=".toml",
    )


def holder_from_text(text: str) -> tuple[Frustum, ...]:
    """The stack that `holder` states, if any; ValueError with what is wrong and the remedy."""
    try:
        return stack_from_text(text)
    except ValueError as error:
        raise ValueError(f"{error}: give rows like '35 10 17, 20 40'") from error


AUTO = "auto"
"""The preset of a cutter that is chosen for the part."""
SHAPE = frozenset({"shape", "radius", "flute_length", "shank_diameter"})
"""What states the shape of a cutter of one's own."""
SIZES = SHAPE | {"neck_diameter", "neck_length", "overhang", "holder", "holder_diameter", "holder_length"}
"""All that is of the cutter and its holder, and not of how it is used."""


@dataclass(frozen=True)
class ToolJob(JobSection):
    """One cutter in its holder, from the tip up: ball and flutes, a neck if it has one, shank, holder.

    `holder` may also be given as a list of [length, diameter] or [length, diameter, upper diameter] (mm).
    """

    preset: str = parameter(
        "",
        "Preset",
        "Name or number of a cutter of nc.tools, name of one that `bonecam tools` lists, or path of its .toml file: "
        "what the section leaves out is its; auto: chosen for the part from nc.tools. A section that states a size "
        "has a cutter of its own.",
        file=".toml",
    )
    number: int = parameter(
        0,
        "Tool number",
        "Number in the tool changer, and of the length offset; 0: 1 for roughing, 2 for finishing, 3 for fine.",
        0,
        9999,
    )
    flutes: int = parameter(
        0,
        "Flutes",
        "Cutting edges, for feed and force; 0: those of mechanics.flutes for the force, and the feed that the material "
        "gives with the teeth of its file.",
        0,
        20,
    )
    shape: str = parameter("ball", "Shape", "End of the cutter: only balls cut.", choices=("ball",))
    radius: float = millimetres(2.0, "Radius", "Radius of the ball.", 0.05, 50.0)
    flute_length: float = millimetres(8.0, "Flute length", "From the tip to the end of the cutting edge.", 0.1, 300.0)
    shank_diameter: float = millimetres(4.0, "Shank diameter", "Diameter of the shank above the flutes.", 0.1, 100.0)
    neck_diameter: float = millimetres(
        0.0, "Neck diameter", "Diameter of a neck between flutes and shank; 0: none.", 0.0, 100.0
    )
    neck_length: float = millimetres(0.0, "Neck length", "From the tip to the end of the neck; 0: none.", 0.0, 500.0)
    overhang: float = millimetres(30.0, "Overhang", "Stick-out: from the tip to the holder's nose.", 1.0, 500.0)
    holder_diameter: float = millimetres(20.0, "Holder diameter", "Diameter of the holder.", 1.0, 200.0)
    holder_length: float = millimetres(
        50.0, "Holder length", "From the holder's nose to the gauge line, where the spindle begins.", 1.0, 500.0
    )
    holder: str = parameter(
        "",
        "Holder",
        "Cylinders and cones of the holder instead, from its nose to the gauge line: length, diameter and, of a "
        "cone, upper diameter (mm), like '35 10 17, 20 40'.",
        form=holder_from_text,
    )
    spindle: float = parameter(0.0, "Spindle", "Spindle speed; 0: that of the material.", 0.0, 100000.0, unit="1/min")
    feed: float = parameter(
        0.0, "Feed", "Cutting feed of the tip; 0: that of the material.", 0.0, 30000.0, unit="mm/min"
    )
    scallop: float = millimetres(0.05, "Scallop", "Largest scallop height between passes.", 0.0005, 2.0)

    def __post_init__(self) -> None:
        if is_list(self.holder):
            rows = [row if is_list(row) else [row] for row in self.holder]
            object.__setattr__(self, "holder", stack_as_text(rows))
        check(self)

    def completed(self, values: dict[str, Any]) -> dict[str, Any]:
        """The values by name that another cutter is stated with, and what they take away of this one: its neck where
        the shape is stated, its pieces of a holder where one cylinder is, its being chosen where any size is. JobError
        where they ask for a chosen cutter of a stated size."""
        gone: dict[str, Any] = {}
        stated = sorted(key for key in values.keys() & SIZES if values[key] != getattr(self, key))
        if stated and values.get("preset") == AUTO:
            what = f"{stated[0]} = {shown(values[stated[0]])}: preset = {AUTO!r} chooses it: leave one of them out"
            raise JobError(what, field=stated[0])
        if values.keys() & SIZES and self.preset == AUTO:
            gone["preset"] = ""
        if values.keys() & SHAPE and not values.keys() & {"neck_diameter", "neck_length"}:
            gone |= {"neck_diameter": 0.0, "neck_length": 0.0}
        if values.keys() & {"holder_diameter", "holder_length"} and "holder" not in values:
            gone["holder"] = ""
        return {**gone, **values}

    @property
    def holder_stack(self) -> tuple[Frustum, ...]:
        """The holder from its nose to the gauge line."""
        return holder_from_text(self.holder) or (
            Frustum(self.holder_length, self.holder_diameter, self.holder_diameter),
        )


def misfit(tool: Any, nose: float) -> tuple[str, str] | None:
    """Which value of a cutter keeps its pieces from following each other from the tip up into a holder whose nose has
    this diameter (mm), with the bound and the remedy; None where they do: flute_length < neck_length < overhang, neck
    as thin as ball and shank, shank as thin as the nose."""
    if not tool.overhang > tool.flute_length:
        return "overhang", f"give more than flute_length ({tool.flute_length:g} mm)"
    widest = min(2 * tool.radius, tool.shank_diameter)
    if tool.neck_length or tool.neck_diameter:
        if not tool.flute_length < tool.neck_length < tool.overhang:
            ends = f"flute_length ({tool.flute_length:g} mm) and less than overhang ({tool.overhang:g} mm)"
            return "neck_length", f"give more than {ends}"
        if not 0 < tool.neck_diameter <= widest:
            return "neck_diameter", f"give a diameter up to that of ball and shank ({widest:g} mm)"
    if not tool.shank_diameter <= nose:
        return "shank_diameter", f"give at most holder_diameter ({nose:g} mm)"
    return None


SHRINK_FIT = "60 10 19, 20 63"
"""A shrink-fit chuck for shanks of 3 to 5 mm: 10 mm at the nose, 4.5 degrees, the flange of a taper 40 at the gauge
line."""
ROUGHING = ToolJob(preset=AUTO, overhang=20.0, holder=SHRINK_FIT)
"""The default roughing cutter: chosen for a part that is machined whole; of wheels and single surfaces a ball of 4 mm
diameter on a 4 mm shank, shortly clamped."""
FINISHING = ToolJob(
    preset=AUTO,
    radius=1.0,
    flute_length=3.0,
    neck_diameter=1.9,
    neck_length=11.0,
    overhang=20.0,
    holder=SHRINK_FIT,
    scallop=0.01,
)
"""The default finishing cutter: chosen likewise, else a ball of 2 mm diameter on a neck of 1.9 mm, which ends 11 mm
above the tip, and a shank of 4 mm, as such cutters are sold."""
FINE = ToolJob(
    preset=AUTO,
    radius=0.5,
    flute_length=1.5,
    shank_diameter=0.9,
    overhang=8.0,
    holder="17 4, 8 4 20, 42 20",
    scallop=0.01,
)
"""The default cutter for hollows: chosen likewise, else a ball of 1 mm diameter on a neck of 8 mm and a shank of
4 mm."""
