"""What refuses a program: a rapid that cuts, a shank or holder in material, a ball in the part."""

from bonecam.errors import VerifyError, place_name
from bonecam.verify.removal.result import Clearance, Removal


def check_removal(removal: Removal, gouge_tolerance: float = 0.01) -> None:
    """VerifyError, with `line` and `place`, where a rapid removes material, shank or holder enter what
    stands, or a ball goes into the part by more than `gouge_tolerance` mm.

    Depths over a limit and leftovers are told in the report and refuse nothing.
    """
    contact = removal.rapid_contact
    if contact:
        raise VerifyError(
            f"line {contact.line}: a rapid removes {contact.value:.4f} mm3 at {place_name(contact.place)}: "
            "make it a feed, or retract farther before it",
            line=contact.line,
            place=contact.place,
            error=contact.value,
        )
    _check_clearance("shank", removal.shank)
    _check_clearance("holder", removal.holder)
    if removal.table.value < 0:
        raise VerifyError(
            f"line {removal.table.line}: the tool goes {-removal.table.value:.3f} mm below the table: "
            "give a longer post (holding.length)",
            line=removal.table.line,
            place=removal.table.place,
            error=-removal.table.value,
        )
    gouge = removal.left.deepest_gouge if removal.left else None
    if gouge and gouge.value > gouge_tolerance:
        raise VerifyError(
            f"line {gouge.line}: the tool goes {gouge.value:.4f} mm into the part at {place_name(gouge.place)}, "
            f"allowed {gouge_tolerance:g}: lift the path there",
            line=gouge.line,
            place=gouge.place,
            error=gouge.value,
        )


def _check_clearance(name: str, clearance: Clearance) -> None:
    """VerifyError where this part of the tool enters material."""
    if clearance.touched and clearance.least:
        depth = -clearance.least.value
        raise VerifyError(
            f"line {clearance.touched}: the {name} enters material at {place_name(clearance.least.place)}: "
            f"give a slimmer {name}, or a larger overhang or flute length",
            line=clearance.touched,
            place=clearance.least.place,
            error=depth,
        )
