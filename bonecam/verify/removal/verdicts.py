"""What refuses a program: a rapid that cuts, a tool that touches what it may not, a ball in the part."""

from bonecam.errors import VerifyError, place_name
from bonecam.verify.removal.result import Clearance, Removal


def check_removal(removal: Removal, gouge_tolerance: float = 0.01) -> None:
    """VerifyError, with `line` and `place`, where a rapid removes material, shank, holder or spindle enter what
    stands, the tool meets table or chuck, or a ball goes into the part by more than `gouge_tolerance` mm.

    Depths over a limit, links that cut, and leftovers are told in the report and refuse nothing.
    """
    contact = removal.rapid_contact
    if contact:
        raise VerifyError(
            f"line {contact.line}: a rapid removes {contact.value:.4f} mm3 at {place_name(contact.place)}: "
            "make it a feed, or retract farther before it; for a program of bonecam try a larger path.clearance",
            line=contact.line,
            place=contact.place,
            error=contact.value,
        )
    remedies = {
        "shank": "give a slimmer shank, or a larger overhang or flute length",
        "holder": "give a slimmer holder, or a larger overhang",
        "spindle": "give a longer holder or a longer post (holding.length)",
    }
    for part in (removal.shank, removal.holder, removal.spindle):
        _check_clearance(part, "enters material", remedies[part.part])
    _check_clearance(removal.table, "meets table or chuck", "give a longer post (holding.length)")
    gouge = removal.left.deepest_gouge if removal.left else None
    if gouge and gouge.value > gouge_tolerance:
        raise VerifyError(
            f"line {gouge.line}: the tool goes {gouge.value:.4f} mm into the part at {place_name(gouge.place)}, "
            f"allowed {gouge_tolerance:g}: lift the path there; for a program of bonecam try a smaller "
            "path.max_step, a larger tip or a longer post (holding.length)",
            line=gouge.line,
            place=gouge.place,
            error=gouge.value,
        )


def _check_clearance(clearance: Clearance, what: str, remedy: str) -> None:
    """VerifyError where this part of the tool touches."""
    if clearance.touched and clearance.least:
        place = clearance.least.place
        raise VerifyError(
            f"line {clearance.touched}: the {clearance.part} {what} at {place_name(place)}: {remedy}",
            line=clearance.touched,
            place=place,
            error=-clearance.least.value,
        )
