"""The sections [roughing] and [finishing] of a job: one cutter each."""

from dataclasses import dataclass

from bonecam.job.parameter import Section, parameter


@dataclass(frozen=True)
class ToolJob(Section):
    """One ball-end cutter in its holder, from the tip up: ball and flutes, shank, holder."""

    radius: float = parameter(2.0, "Radius", "Ball radius.", unit="mm", low=0.05, high=50.0)
    flute_length: float = parameter(
        8.0, "Flute length", "From the tip to the end of the cutting edge.", unit="mm", low=0.1, high=300.0
    )
    shank_diameter: float = parameter(
        4.0, "Shank diameter", "Diameter of the shank above the flutes.", unit="mm", low=0.1, high=100.0
    )
    overhang: float = parameter(
        30.0, "Overhang", "From the tip to the holder's nose.", unit="mm", low=1.0, high=500.0
    )
    holder_diameter: float = parameter(
        20.0, "Holder diameter", "Diameter of the holder.", unit="mm", low=1.0, high=200.0
    )
    holder_length: float = parameter(
        50.0, "Holder length", "Length of the holder above its nose.", unit="mm", low=1.0, high=500.0
    )
    spindle: float = parameter(12000.0, "Spindle", "Spindle speed.", unit="1/min", low=1.0, high=100000.0)
    feed: float = parameter(900.0, "Feed", "Cutting feed of the tip.", unit="mm/min", low=1.0, high=30000.0)
    scallop: float = parameter(
        0.05, "Scallop", "Largest scallop height between passes.", unit="mm", low=0.0005, high=2.0
    )


ROUGHING = ToolJob()
"""The default roughing cutter: a ball of 4 mm diameter."""
FINISHING = ToolJob(radius=1.0, flute_length=4.0, shank_diameter=2.0, overhang=25.0, feed=900.0, scallop=0.01)
"""The default finishing cutter: a ball of 2 mm diameter."""
