"""What holds the part, in lines for a person."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from bonecam.workholding.post import SLENDER


def post_lines(post: Mapping[str, Any] | None) -> Iterator[str]:
    """The post, and a warning where it is so slender that it bends like a spring."""
    if post is not None:
        length = post.get("neck_mm", post["length_mm"])
        slender = length > SLENDER * post["diameter_mm"]
        warning = "; slender: a thicker post, a chuck below it or a slimmer holder and spindle help" * slender
        yield f"post      {post['diameter_mm']:g} x {length:g} mm{warning}"
        for name, column in reversed(post.get("held_by", {}).items()):
            sizes = f"{column['diameter_mm']:g} mm, z {column['from_mm']:g} to {column['to_mm']:g}"
            yield f"          on a {name} of {sizes}"
        yield from _neck_lines(post.get("necks", ()))
        if "footprint_mm2" in post:
            yield f"          {post['footprint_mm2']:.1f} mm2 of the part stay under it"
        remedies = [f"{each['length_mm']:g} mm with {each['change']}" for each in post.get("remedies", ())]
        if remedies:
            yield f"          {', '.join(remedies)}"
        costs = [
            f"{each['length_mm']:g} mm leaves {each['uncut_mm2']:g} mm2 uncut round it"
            for each in post.get("shorter", ())
        ]
        if costs:
            yield f"          {', '.join(costs)}"


def _neck_lines(necks: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """The necks that were tried, the one that is taken first."""
    if necks:
        yield "          neck mm      uncut mm2   um/N     um    MPa      Hz"
    for neck in necks:
        size = f"{neck['diameter_mm']:g} x {neck['length_mm']:g}"
        moved = f"{neck['um_per_n']:6.2f} {neck['shift_um']:6.1f} {neck['stress_mpa']:6.0f} {neck['first_hz']:7.0f}"
        yield f"          {size:12} {neck['left_mm2']:9.0f} {moved}{'' if neck['holds'] else '  gives way'}"
