"""What a summary tells of what holds the part, of force and bending, and what a report has where these were not
asked."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from bonecam.job.sections import CUTTERS

NOT_ASKED = {"skipped": "force and bending were not asked"}
"""The section `mechanics` of a report without them."""
NOT_KNOWN = {"skipped": "force and bending are not known without a simulation of the removal"}
"""That of a report without a simulation."""


def mechanics_lines(mechanics: Mapping[str, Any] | None) -> Iterator[str]:
    """The section `mechanics` of a report in words, a line each."""
    if not mechanics:
        return
    if "skipped" in mechanics:
        yield f"bending   {mechanics['skipped']}"
        return
    levels = mechanics["levels"]
    mean, high, most = (
        max((level[name] for level in levels), default=0.0) for name in ("force_mean_n", "peak_p95_n", "peak_max_n")
    )
    yield f"force     up to {mean:.1f} N in the mean of a level, peaks {high:.0f} N at 95 %, {most:.0f} N at most"
    yield f"bending   {bending_text(mechanics)}"
    low, up = mechanics["band"]
    yield f"          authors differ for {mechanics['material']}: {low:g} to {up:g} times this"
    yield from (f"          {fault}" for fault in mechanics["faults"])
    yield from (
        f"          {one['what']} would keep {one['p99_um']:.1f} um at {one['stress_mpa']:.0f} MPa"
        for one in mechanics["remedies"]
    )
    if mechanics["scaled"]:
        yield f"          {mechanics['coefficients']}"


def bending_text(mechanics: Mapping[str, Any]) -> str:
    """The error kept, the stress and the lowest frequency in one line."""
    kept = mechanics["error_kept_um"]
    error = ""
    if kept:
        error = f"error kept {kept['median']:.1f} um, {kept['p95']:.1f} at 95 %, {kept['p99']:.1f} at 99 %; "
    stress = f"stress at peaks {mechanics['neck_stress_p99_mpa']:.0f} of {mechanics['yield_mpa']:g} MPa"
    if mechanics["first_hz"] is None:
        return f"{error}{stress}"
    return f"{error}{stress}; lowest at {mechanics['first_hz']:.0f} Hz, edges {mechanics['tooth_hz']:.0f}"


def feed_lines(feed: Mapping[str, Any] | None) -> Iterator[str]:
    """What feeds by the force have won, the section `feed` of a report."""
    if feed:
        before, after = feed["time_min"]
        yield f"feed      by the force: {after:.1f} min, {before:.1f} with one feed a cutter"
        for one in feed["cutters"]:
            (high, lower), (most, least) = one["peak_p95_n"], one["peak_max_n"]
            peaks = f"{lower:.0f} N at 95 %, {least:.0f} at most, before {high:.0f} and {most:.0f}"
            yield f"          tool {one['tool']} to peaks of {one['target_n']:.0f} N: {peaks}"


def cutter_lines(cutters: Mapping[str, Any] | None) -> Iterator[str]:
    """The best sets of cutters that were tried, where they were chosen, the one that is taken first; and what a cutter
    that the list lacks would bring."""
    if cutters is None:
        return
    sets = [*cutters["sets"], *([cutters["more"]] if "more" in cutters else [])]
    names = [" / ".join(one[name] or "own" for name in CUTTERS if name in one) for one in sets]
    width = max(map(len, names))
    yield f"cutters   {'':{width}}   min  left mm2    mm  at post mm2    um   MPa"
    for name, one in zip(names, sets, strict=True):
        left = f"{one['left_mm2']:9.1f} {one['left_mm']:5.2f} {one['at_post_mm2']:12.0f}"
        told = "  with the catalogue" if one is cutters.get("more") else "" if one["holds"] else "  gives way"
        bends = f"{one['shift_um']:5.1f} {one['stress_mpa']:5.0f}"
        yield f"          {name:{width}} {one['minutes']:5.1f} {left} {bends}{told}"
    yield f"          foretold; the best of {cutters['tried']} sets"
    if "finer" in cutters:
        stays = f"{sets[0]['left_mm']:.2f} mm stay in {sets[0]['left_mm2']:.1f} mm2 of hollows"
        finer = cutters["finer"]
        less = f"{finer['left_mm']:.2f} mm in {finer['left_mm2']:.1f} mm2 for {finer['minutes']:.1f} min more"
        yield f"          {stays}: fine.preset = {finer['preset']} would leave {less}"


def post_lines(post: Mapping[str, Any] | None) -> Iterator[str]:
    """The post, what it stands on, and what would shorten it."""
    if post is not None:
        length = post.get("neck_mm", post["length_mm"])
        yield f"post      {post['diameter_mm']:g} x {length:g} mm"
        for name, column in reversed(post.get("held_by", {}).items()):
            sizes = f"{column['diameter_mm']:g} mm, z {column['from_mm']:g} to {column['to_mm']:g}"
            yield f"          on a {name} of {sizes}"
        yield from _neck_lines(post.get("necks", ()))
        yield from (f"          {text}" for text in _remedy_texts(post))
        if post.get("depths_found"):
            *first, beyond = post["depths_found"]
            near = f"{', '.join(f'{depth:g}' for depth in first)}, then " if first else ""
            yield f"          bears cuts of {near}{beyond:g} mm"
        if "footprint_mm2" in post:
            yield f"          {post['footprint_mm2']:.1f} mm2 of the part stay under it"
        yield from _tailstock_lines(post.get("tailstock"))
        remedies = [f"{each['length_mm']:g} mm with {each['change']}" for each in post.get("remedies", ())]
        if remedies:
            yield f"          {', '.join(remedies)}"
        costs = [
            f"{each['length_mm']:g} mm leaves {each['uncut_mm2']:g} mm2 uncut round it"
            for each in post.get("shorter", ())
        ]
        if costs:
            yield f"          {', '.join(costs)}"


def _tailstock_lines(tailstock: Mapping[str, Any] | None) -> Iterator[str]:
    """What holds the free end, and what of the part it takes from the tool."""
    if tailstock is None:
        return
    x, y = tailstock["at_mm"]
    ends = f"z {tailstock['from_mm']:.2f} to {tailstock['to_mm']:.2f}"
    sizes = f"{tailstock['diameter_mm']:g} mm at ({x:.2f}, {y:.2f}), {ends}"
    yield f"          held above by a {tailstock['kind']} of {sizes}"
    yield f"          {tailstock['footprint_mm2']:.1f} mm2 of the part stay under it"
    if tailstock.get("blocked_share"):
        yield f"          {100 * tailstock['blocked_share']:.0f} % of the part are in its way or that of its bracket"


def _neck_lines(necks: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """The necks that were tried, the one that is taken first."""
    if necks:
        minutes = "    min" if "machining_min" in necks[0] else ""
        yield f"          neck mm      uncut mm2   um/N     um    MPa      Hz{minutes}"
    for neck in necks:
        size = f"{neck['diameter_mm']:g} x {neck['length_mm']:g}"
        moved = f"{neck['um_per_n']:6.2f} {neck['shift_um']:6.1f} {neck['stress_mpa']:6.0f} {neck['first_hz']:7.0f}"
        moved += f" {neck['machining_min']:6.1f}" if "machining_min" in neck else ""
        yield f"          {size:12} {neck['left_mm2']:9.0f} {moved}{'' if neck['holds'] else '  gives way'}"


def neck_text(post: Mapping[str, Any]) -> str:
    """What is foretold of the neck that is taken where none holds, beside what is wanted of one."""
    taken = post["necks"][0]
    wanted = post["neck_wanted"]
    error = f"{taken['shift_um']:.1f} um of error at 95 % ({wanted['shift_um']:g} at most)"
    stress = f"{taken['stress_mpa']:.0f} MPa at peaks ({wanted['stress_mpa']:.0f} at most)"
    swing = f"{taken['first_hz']:.0f} Hz ({wanted['first_hz']:.0f} at least)"
    size = f"{taken['diameter_mm']:g} x {taken['length_mm']:g} mm"
    figures = f"{error}, {taken['shift_p99_um']:.0f} at 99 %; {stress}; {swing}"
    none = "the neck does not hold" if post["neck_stated"] else "no neck holds"
    return f"{none}: foretold on that of {size} are {figures}"


def neck_remedy_text(post: Mapping[str, Any]) -> str:
    """With what that neck holds, or nearly; another one where the job states it."""
    other = ["give holding.diameter = 0, which finds one"] if post["neck_stated"] else []
    return " or ".join([*other, *_remedy_texts(post)]) or "give shallower cuts, or a larger stock for a thicker neck"


def _remedy_texts(post: Mapping[str, Any]) -> list[str]:
    """Each change with which a neck holds, or nearly, and what is foretold with it."""
    return [
        f"{'holds' if one['holds'] else 'at best'} with {one['change']}: "
        f"{one['shift_um']:.1f} um, {one['stress_mpa']:.0f} MPa, {one['first_hz']:.0f} Hz"
        for one in post.get("holds_with", ())
    ]
