"""A measuring program for a probe in the spindle: the points of a line, each approached along its nominal normal.

Words as the controls' public descriptions have them: Heidenhain TCH PROBE 4 (measuring in 3-D), Siemens MEAS with
$AA_MW and WRITE (CYCLE978 touches along one axis only), Fanuc G31 with #5061 to #5063 and DPRNT. None of it has run on
a machine: the programs say that they are unproved. The tool axis is Z with the rotary axes at zero; points at which the
stem above the ball would touch the part are left out. Program zero is that of the NC program, positions are those of
the ball's centre.
"""

from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from bonecam.errors import MachineError
from bonecam.mesh.distance import MeshDistance
from bonecam.verify.probing.line import ProbeLine

CLEAR = 2.0
"""The ball begins and ends its approach so far from the nominal surface, mm."""
BEYOND = 1.0
"""It looks for the surface down to so far below it, mm."""
STEM_SHARE = 0.7
"""Radius of the stem as a share of the ball's, as styli of 1 mm have it."""
STEM_LENGTH = 60.0
"""The stem is looked at up to so far above the ball, mm."""
SAFE = 10.0
"""Height above the part at which the probe goes from point to point, mm."""
FEED, RAPID = 100, 2000
"""Feeds of the approach and between points, mm/min."""
UNPROVED = "UNPROVED - NO MACHINE HAS RUN THIS. CHECK EVERY MOVE, CALIBRATE TO THE BALL CENTRE"

Point = tuple[int, Float[ndarray, "3"], Float[ndarray, "3"]]
"""Number of a point, its place and its outward normal."""


def measuring_program(line: ProbeLine, radius: float, part: MeshDistance, controller: str, name: str = "PROBE") -> str:
    """The text for one of CONTROLLERS, which touches the points of a line with a ball of this `radius`, mm; `part` is
    the nominal one.

    MachineError for another controller, or where the stem is in the way of all points.
    """
    if controller not in CONTROLLERS:
        known = ", ".join(CONTROLLERS)
        raise MachineError(f"no measuring program is known for {controller}: take one of {known}")
    free = is_free(line.places, line.normals, radius, part)
    if not free.any():
        raise MachineError("the stem of the probe is in the way of every point: give another line")
    points = [(k + 1, line.places[k], line.normals[k]) for k in np.flatnonzero(free).tolist()]
    left = f"{len(points)} OF {len(free)} POINTS - THE STEM IS IN THE WAY OF THE OTHERS"
    safe = float(part.mesh.bounds[1, 2]) + SAFE
    lines = CONTROLLERS[controller](name, left, points, radius, safe)
    return "\n".join(lines) + "\n"


def is_free(
    places: Float[ndarray, "n 3"], normals: Float[ndarray, "n 3"], radius: float, part: MeshDistance
) -> Bool[ndarray, " n"]:
    """Whether the part is clear of the stem while the ball touches each place, and of the ball as it comes down to
    where its approach begins."""
    stem = STEM_SHARE * radius
    touching = places + radius * normals
    beginning = places + (radius + CLEAR) * normals
    return _column_is_free(touching, radius, stem, part) & _column_is_free(beginning, 0.0, radius, part)


def _column_is_free(foot: Float[ndarray, "n 3"], low: float, radius: float, part: MeshDistance) -> Bool[ndarray, " n"]:
    """Whether a column of this radius above each foot, from the height `low` on, is clear of the part."""
    above = np.arange(low, STEM_LENGTH, radius / 2)
    points = foot[:, None] + above[:, None] * np.array([0.0, 0.0, 1.0])
    return np.asarray((part.signed(points.reshape(-1, 3)).reshape(len(foot), -1) > radius).all(axis=1))


def _stops(point: Point, radius: float) -> tuple[Float[ndarray, "3"], Float[ndarray, "3"]]:
    """Where the ball's centre begins its approach, and where that ends without a touch."""
    _, place, normal = point
    return place + (radius + CLEAR) * normal, place + (radius - BEYOND) * normal


def _words(place: Float[ndarray, "3"], form: str = "{}{:.3f}") -> str:
    return " ".join(form.format(axis, value) for axis, value in zip("XYZ", place, strict=True))


def _heidenhain(name: str, left: str, points: list[Point], radius: float, safe: float) -> Iterator[str]:
    """TCH PROBE 4; deviations are kept in Q1600 and following."""
    body = [f"BEGIN PGM {name} MM", f"; {UNPROVED}", f"; {left}", f"L Z{safe:+.3f} R0 F{RAPID}"]
    for point in points:
        number, place, normal = point
        begin, end = _stops(point, radius)
        signed = "{}{:+.3f}"
        body += [
            f"L X{begin[0]:+.3f} Y{begin[1]:+.3f} R0 F{RAPID}",
            f"L Z{begin[2]:+.3f} R0 F{RAPID}",
            "TCH PROBE 4.0 MEASURING IN 3-D",
            "TCH PROBE 4.1 Q1",
            f"TCH PROBE 4.2 {_words(end - begin, 'I{}{:+.4f}')}",
            f"TCH PROBE 4.3 DIST+{CLEAR + BEYOND:.3f} F{FEED} MB{CLEAR:g} REFERENCE SYSTEM:1",
            f"Q{1599 + number} = ( Q1 - {place[0]:.4f} ) * {normal[0]:.6f} + ( Q2 - {place[1]:.4f} ) * "
            f"{normal[1]:.6f} + ( Q3 - {place[2]:.4f} ) * {normal[2]:.6f} - {radius:g}",
            f"L {_words(begin, signed)} R0 F{RAPID}",
            f"L Z{safe:+.3f} R0 F{RAPID}",
        ]
    body.append(f"END PGM {name} MM")
    for k, text in enumerate(body):
        yield f"{k} {text}"


def _siemens(name: str, left: str, points: list[Point], radius: float, safe: float) -> Iterator[str]:
    """MEAS=1; deviations are written to the file PROBE_DEV."""
    yield from (f"; {name}", f"; {UNPROVED}", f"; {left}", "DEF INT FAULT", "DEF REAL DEV", "G17 G90 G94 G71")
    yield f"G1 Z{safe:.3f} F{RAPID}"
    for point in points:
        number, place, normal = point
        begin, end = _stops(point, radius)
        yield f"G1 X{begin[0]:.3f} Y{begin[1]:.3f} F{RAPID}"
        yield f"G1 Z{begin[2]:.3f}"
        yield f"MEAS=1 G1 {_words(end)} F{FEED}"
        yield "STOPRE"
        terms = [
            f"($AA_MW[{axis}]-({value:.4f}))*({lean:.6f})"
            for axis, value, lean in zip("XYZ", place, normal, strict=True)
        ]
        yield f"DEV={'+'.join(terms)}-{radius:g}"
        yield "IF $AC_MEA[1]==0 DEV=999"
        yield f'WRITE(FAULT,"PROBE_DEV","{number} "<<DEV)'
        yield f"G1 {_words(begin)} F{RAPID}"
        yield f"G1 Z{safe:.3f}"
    yield "M30"


def _fanuc(name: str, left: str, points: list[Point], radius: float, safe: float) -> Iterator[str]:
    """G31; deviations are printed by DPRNT."""
    yield from ("%", f"O0046 ({name})", f"({UNPROVED})", f"({left})", "G17 G21 G90 G94", "POPEN")
    yield f"G1 Z{safe:.3f} F{RAPID}"
    for point in points:
        number, place, normal = point
        begin, end = _stops(point, radius)
        yield f"G1 X{begin[0]:.3f} Y{begin[1]:.3f} F{RAPID}"
        yield f"G1 Z{begin[2]:.3f}"
        yield f"G31 {_words(end)} F{FEED}"
        terms = [
            f"[#{5061 + k}-[{value:.4f}]]*[{lean:.6f}]"
            for k, (value, lean) in enumerate(zip(place, normal, strict=True))
        ]
        yield f"#100={'+'.join(terms)}-{radius:g}"
        yield f"#101={number}"
        yield "DPRNT[K#101[40]D#100[44]]"
        yield f"G1 {_words(begin)} F{RAPID}"
        yield f"G1 Z{safe:.3f}"
    yield from ("PCLOS", "M30", "%")


CONTROLLERS: dict[str, Callable[[str, str, list[Point], float, float], Iterator[str]]] = {
    "heidenhain": _heidenhain,
    "siemens-840d": _siemens,
    "fanuc-30i": _fanuc,
}
"""Dialects that have a probe, by name."""
