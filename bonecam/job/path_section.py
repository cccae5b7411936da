"""The section [path] of a job."""

from dataclasses import dataclass, fields

from bonecam.errors import JobError
from bonecam.job.parameter import JobSection, check, millimetres, parameter
from bonecam.plugins import added_names
from bonecam.text.numbers import shown

OF_MORPH = ("pattern", "direction", "fine_cutter", "orientation", "certify", "least_lead_deg")
"""What only paths on the levels of a morph heed."""


@dataclass(frozen=True)
class PathJob(JobSection):
    """The passes on a level, the tool axis, and the links between passes."""

    strategy: str = parameter(
        "morph",
        "Strategy",
        "morph: levels between part and stock; others cut in layers of their own, for comparison.",
        choices=("morph", *added_names("strategies")),
    )
    pattern: str = parameter(
        "fastest",
        "Pattern",
        "Passes along the bone (s = const), round it (t = const), along it each at the local step from the one before "
        "(iso-scallop), on each level the fastest of these; in one spiral, in bands of lines of their own; or as "
        "published: whole lines s = const, the next at the least step found on one, air cut too. The paper leaves open "
        "how to enter and to link: here ramps, links and rest paths of the others.",
        choices=("fastest", "along", "round", "iso-scallop", "spiral", "bands", "published", *added_names("patterns")),
    )
    direction: str = parameter(
        "zigzag",
        "Direction",
        "Passes to and fro, or all in the direction of climb or of conventional milling (spindle M3).",
        choices=("zigzag", "climb", "conventional"),
    )
    chord_tolerance: float = millimetres(
        0.004,
        "Chord tolerance",
        "Largest distance between the path on the surface and the straight moves that replace it.",
        0.0005,
        0.5,
    )
    most_length: float = parameter(
        500.0,
        "Most length",
        "A stock with so much material round the part that passes longer than this in all are needed is refused.",
        1.0,
        100000.0,
        unit="m",
    )
    clearance: float = millimetres(
        2.0, "Clearance", "Distance kept from the stock while moving between passes.", 0.2, 50.0
    )
    least_depth: float = millimetres(
        0.03,
        "Least depth",
        "Roughing passes over what a cut would remove less of, or less than half of its scallop; 0: they cut "
        "everywhere.",
        0.0,
        1.0,
    )
    fine_cutter: bool = parameter(
        False,
        "Fine cutter",
        "Cut the hollows of the part that the finishing ball does not enter with the cutter of [fine], at the end.",
    )
    lead_deg: float = parameter(
        10.0,
        "Lead",
        "Lead angle: the tool axis leans forward, along the feed, by this angle. The paper tells the angle, not which "
        "way: here forward, and where that collides or is out of reach turned to the nearest free axis.",
        -60.0,
        60.0,
        unit="deg",
    )
    orientation: str = parameter(
        "cones",
        "Orientation",
        "Tool axes: turning the machine as smoothly as cones of free axes allow (cones), leaning forward (lead), or as "
        "another orientation fixes them: contacts at which those collide stay uncut.",
        choices=("cones", "lead", *added_names("orientations")),
    )
    certify: str = parameter(
        "automatic",
        "Certificate",
        "Cones of free axes are proven by distances, and then each is put before FCL too, and narrowed where it finds "
        "a collision (automatic: wherever axes are chosen in cones; fcl: they must be); so is every axis outside of "
        "these. By distances alone they are proven some seconds sooner.",
        choices=("automatic", "fcl", "distances"),
    )
    least_lead_deg: float = parameter(
        10.0,
        "Least lead",
        "Angle from the surface normal that a smooth field keeps where it can: the tip of a ball does not cut.",
        0.0,
        60.0,
        unit="deg",
    )
    feed: str = parameter(
        "constant",
        "Feed",
        "One feed for each cutter; or more and less of it from block to block, so that the peak of the force that the "
        "simulation of the text finds is even (force): the program is then posted and proved again.",
        choices=("constant", "force"),
    )
    max_tilt_deg: float = parameter(
        75.0, "Largest tilt", "Largest angle between tool axis and surface normal.", 1.0, 89.0, unit="deg"
    )
    gouge_tolerance: float = millimetres(
        0.01, "Gouge tolerance", "Largest depth by which the ball may enter the part.", 0.002, 0.5
    )

    def __post_init__(self) -> None:
        check(self)
        if abs(self.lead_deg) > self.max_tilt_deg:
            bound = f"keep it within path.max_tilt_deg ({self.max_tilt_deg:g})"
            raise self.fault("lead_deg", bound)
        for item in fields(self):
            value = getattr(self, item.name)
            if self.strategy != "morph" and item.name in OF_MORPH and value != item.default:
                bound = f"strategy = {self.strategy!r} has passes and axes of its own: leave it out, or take 'morph'"
                raise JobError(f"{item.name} = {shown(value)}: {bound}", field=item.name)
        if self.certify == "fcl" and self.orientation != "cones":
            bound = f"orientation = {self.orientation!r} makes no cones to certify: leave it out, or take 'cones'"
            raise self.fault("certify", bound)
