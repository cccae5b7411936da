"""What refuses a program: rapids and links that cut, a tool that touches what it may not, a ball in the part, a cut
too deep."""

from collections.abc import Sequence

from bonecam.errors import BodiesError, VerifyError, place_name
from bonecam.text.numbers import told_apart
from bonecam.tool.path import PARTING
from bonecam.verify.removal.clearances.link_bodies import NEAR as BODIES_NEAR
from bonecam.verify.removal.clearances.table import NEAR
from bonecam.verify.removal.result import LINK_ALLOWED, Clearance, LevelRemoval, Removal, Spot

REMEDIES = {
    "shank": "give a slimmer shank, or a larger overhang or flute length",
    "holder": "give a slimmer holder, or a larger overhang",
    "spindle": "give a longer holder or a longer post (holding.length)",
    "tailstock": "give a longer pin (holding.tailstock_length) or a farther column (holding.tailstock_reach)",
    "bodies": "give a longer post (holding.length) or overhang, or narrower limits_deg of the axis that brings them "
    "together, as paths are planned round nose and table alone",
    "shell": "end the shell farther up the part, or give a longer overhang",
}
"""What to do where a part of the tool enters material, and where the tool meets tailstock or shell."""


def check_removal(
    removal: Removal, gouge_tolerance: float = 0.01, bridge: float = 0.0, *, limited: bool = True
) -> None:
    """VerifyError, with `line` and `place`, where a rapid removes material or the moves between two passes more
    than LINK_ALLOWED, shank, holder or spindle enter what stands, the tool meets table, chuck, tailstock or shell,
    a body of the machine meets anything (BodiesError), a ball goes into the part by more than `gouge_tolerance` mm
    or too deep into the mesh as given, or a cut is deeper than its limit by more than is allowed (`over_allowed`);
    where a level is cut after the parting; and where nothing, or less than a `bridge` of this diameter (mm, within
    two cells), is left of a post that is parted: the part drops.

    Leftovers are told in the report and refuse nothing; nor do depths where they are not `limited`.
    """
    if removal.rapid_contact:
        _refuse(
            removal.rapid_contact,
            f"a rapid removes {removal.rapid_contact.value:.4f} mm3",
            "make it a feed, or retract farther before it; for a program of bonecam try a larger path.clearance",
        )
    for part in (removal.shank, removal.holder, removal.spindle):
        _check_clearance(part, "enters material", REMEDIES[part.part])
    _check_clearance(removal.table, "meets table or chuck", "give a longer post (holding.length) or overhang")
    if removal.tailstock is not None:
        _check_clearance(removal.tailstock, "meets the tailstock", REMEDIES["tailstock"])
    if removal.bodies is not None:
        what = f"comes within {BODIES_NEAR:g} mm of the {removal.bodies.other}"
        _check_clearance(removal.bodies, what, REMEDIES["bodies"], BodiesError)
    if removal.shell is not None:
        _check_clearance(removal.shell, f"comes within {NEAR:g} mm of the shell", REMEDIES["shell"])
    if removal.link_contact:
        _refuse(
            removal.link_contact,
            f"the moves from one pass to the next remove {removal.link_contact.value:.4f} mm3, "
            f"allowed {LINK_ALLOWED:g},",
            "lift them, or mark them as a cut; for a program of bonecam try another path.pattern",
        )
    if removal.left is not None and removal.left.deepest_gouge.value > gouge_tolerance:
        depth, most = told_apart(removal.left.deepest_gouge.value, gouge_tolerance, decimals=4)
        _refuse(
            removal.left.deepest_gouge,
            f"the tool goes {depth} mm into the part, allowed {most},",
            "lift the path there; for a program of bonecam try a smaller path.max_step, a larger tip or a longer post "
            "(holding.length)",
        )
    for level in removal.levels if limited else ():
        if level.deepest and level.over_limit is not None and level.over_limit > level.over_allowed:
            name = "the parting" if level.index == PARTING else f"level {level.index}"
            _refuse(
                level.deepest,
                f"a cut of {name} is {level.deepest.value:.3f} mm deep, {level.over_limit:.3f} over its "
                f"limit, allowed {level.over_allowed:.3f},",
                "cut the levels in their order; for a program of bonecam try a smaller scallop of the cutter before",
            )
    _check_parted_last(removal.levels)
    if removal.given is not None:
        removal.given.check()
    if removal.bridge is not None and not removal.bridge > max(bridge - 2 * removal.cell, 0.0):
        raise VerifyError(
            f"parting: {removal.bridge:.2f} mm of the post hold the part, {bridge:g} mm are wanted: write the "
            "program again, or give a larger holding.parting_core",
            error=bridge - removal.bridge,
        )


def _refuse(spot: Spot, what: str, remedy: str) -> None:
    """The VerifyError of what was found at a spot."""
    raise VerifyError(
        f"line {spot.line}: {what} at {place_name(spot.place)}: {remedy}",
        line=spot.line,
        place=spot.place,
        error=spot.value,
    )


def _check_parted_last(levels: Sequence[LevelRemoval]) -> None:
    """VerifyError where a level is cut after the parting."""
    parted = False
    for level in levels:
        if parted and level.index != PARTING and level.deepest:
            what = "a cut follows the parting, on a part that only the bridge holds,"
            _refuse(level.deepest, what, "part at the end of the program")
        parted |= level.index == PARTING


def _check_clearance(clearance: Clearance, what: str, remedy: str, kind: type[VerifyError] = VerifyError) -> None:
    """The error of this kind where this part of the tool touches."""
    if clearance.touched and clearance.least:
        place = clearance.least.place
        raise kind(
            f"line {clearance.touched}: the {clearance.part} {what} at {place_name(place)}: {remedy}",
            line=clearance.touched,
            place=place,
            error=-clearance.least.value,
        )
