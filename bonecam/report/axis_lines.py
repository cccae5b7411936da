"""What a summary tells of entries, tool axes, their cones, and rotary axes."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from bonecam.errors import counted


def entry_lines(toolpath: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """How many cuts begin along their own direction, from the section `toolpath` of a report."""
    total, along = (sum(row[name] for row in toolpath) for name in ("entries", "entries_tangential"))
    if total:
        yield f"entries   {along} of {counted(total, 'cut')} begin tangentially, on arcs; {total - along} straight"


def axis_lines(toolpath: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Lines from the section `toolpath` of a report."""
    yield from _cone_lines(toolpath)
    yield from _lead_lines(toolpath)


def _cone_lines(toolpath: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Which shape cones have, if not all are elliptic, and what FCL says of them and of poses outside of them, where it
    was asked."""
    shapes = {row["level"]: row["cones"]["shape"] for row in toolpath if row["cones"]}
    circular = list(shapes.values()).count("circular")
    if circular:
        where = f"{circular} of {counted(len(shapes), 'level')}"
        yield f"cones     circular on {where}, where axes turn sooner or less in these"
    checks = {
        row["level"]: row["cones"]["fcl"] for row in toolpath if row["cones"]
    }  # all paths of a level share one
    of_names = (
        [check[name] for check in checks.values() if check] for name in ("asked", "narrowed", "refused")
    )
    asked, narrowed, refused = map(sum, of_names)
    if asked:
        yield f"cones     {asked} checked by planes, else by FCL: {narrowed} narrowed, {refused} refused"
    poses = [row["poses"] for row in toolpath if row["poses"]]
    asked, refused = (sum(pose[name] for pose in poses) for name in ("asked", "refused"))
    if asked:
        yield f"poses     {asked} outside of such cones put before FCL one by one: {refused} refused"


def _lead_lines(toolpath: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Where smooth axes come nearer to the normal than they should."""
    near = [row for row in toolpath if row["near_normal_contacts"]]
    contacts, forced = (
        sum(row[f"near_normal_{name}"] for row in near) for name in ("contacts", "without_choice")
    )
    if near:
        share = contacts / sum(row["contacts"] for row in toolpath)
        most = max(near, key=lambda row: row["near_normal_contacts"])
        where = f"{most['near_normal_contacts']} of them on level {most['level']}"
        choice = f"{forced} have no other in their cones"
        yield f"lead      {share:.1%} of the contacts are cut nearer to the ball's tip than path.least_lead_deg"
        yield f"          {contacts} contacts, {where}; {choice}"


def rewind_lines(nc: Mapping[str, Any]) -> Iterator[str]:
    """How often rotary axes are rewound, where they are; `nc` of the report."""
    if nc["rewinds"]:
        lifted = f", {nc['rewinds_lifted']} of them lifted from a cut or a link and set down again"
        reported = lifted if nc["rewinds_lifted"] else ""
        yield f"rewinds   {counted(nc['rewinds'], 'rewind')} of the rotary axes off the part{reported}"
