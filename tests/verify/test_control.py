"""A short posted program of two tools in each dialect that ships, and edits of it.

Edits of a posted program by hand, in every dialect: what a control would refuse or what would cut wrong is refused,
what is harmless is not.

Limits of rotary axes that wind, travel, and retracts in machine coordinates.

Where the spindle nose goes between the ends of a block.

A program restarts at a tool call or a level, behind its safe start, and nowhere else.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
import pytest
from controls import KINDS
from machine_files import CHAINS
from small_parts import PATH_CAPSULE, capsule_path

from bonecam.errors import ProgramError, VerifyError
from bonecam.job import Job
from bonecam.machine import Machine, read_machine
from bonecam.machine.kinematics import inverse_linear
from bonecam.mesh import MeshDistance
from bonecam.mesh.smooth_surface import convex_hull
from bonecam.nc import Dialect, Motions, drivable_paths, read_dialect, read_program, write_program
from bonecam.nc.words import number_blocks
from bonecam.setup import ConvexStock
from bonecam.tool import Cutter
from bonecam.verify import Accuracy, check_removal, simulate_removal
from bonecam.verify.control import check_control, check_limits, nose_moves
from bonecam.verify.gouge import measure_gouge
from bonecam.verify.removal import cutters_of
from bonecam.workholding import Post


@dataclass(frozen=True, eq=False)
class Posted:
    """A program: its `blocks` without numbers, and what it was written for."""

    dialect: Dialect
    machine: Machine
    job: Job
    blocks: tuple[str, ...]

    @property
    def klartext(self) -> bool:
        return self.dialect.grammar == "klartext"

    def text(self, blocks: list[str] | None = None) -> str:
        """The numbered text of blocks."""
        return number_blocks(list(self.blocks if blocks is None else blocks), self.dialect)[0]

    @cached_property
    def motions(self) -> Motions:
        """The program as its control would run it."""
        return read_program(self.text(), self.machine, self.dialect)

    def line(self, block: int) -> int:
        """The line of a block."""
        return block + 1

    @cached_property
    def cuts(self) -> list[int]:
        """The blocks that cut, between a comment CUT and the next LINK."""
        found, cutting = [], False
        for at, block in enumerate(self.blocks):
            if block.strip("(); ") in ("CUT", "LINK"):
                cutting = "CUT" in block
            elif cutting and re.match(r"(L|G0?1) X.* F\d", block):
                found.append(at)
        return found


@pytest.fixture(scope="package")
def posted_of():
    """The short program of a dialect, by its name."""
    made: dict[str, Posted] = {}

    def post(name):
        if name not in made:
            machine = read_machine("linuxcnc-xyzbc" if name == "linuxcnc" else "mikron-ucp600")
            dialect = read_dialect(name)
            job = Job().with_values(nc={"machine": machine.name, "controller": name}, material={"name": "paper"})
            roughing, finishing = cutters_of(job, machine)
            paths = (
                replace(capsule_path(level=1, radius=2.0, offset=0.3, count=90, turns=3.0), cutter=roughing),
                replace(capsule_path(level=0, radius=1.0, count=90, turns=3.0), cutter=finishing),
            )
            text = write_program(drivable_paths(paths, machine, dialect, job), machine, dialect, job).text
            made[name] = Posted(dialect, machine, job, tuple(unnumbered(text, dialect)))
        return made[name]

    return post


def unnumbered(text: str, dialect: Dialect) -> list[str]:
    """The blocks of a text without their numbers."""
    if not dialect.numbering.format:
        return text.splitlines()
    return [re.sub(r"^N?\d+ ", "", line) for line in text.splitlines()]


@pytest.fixture(params=KINDS)
def posted(request, posted_of):
    return posted_of(request.param)


Blocks = list[str]
Edit = Callable[..., Blocks]
ALLOWED_GOUGE = 0.05
"""mm: the mesh of the capsule and the chords of its short path bow by less."""


@pytest.fixture(scope="module")
def part():
    """The distances to the capsule."""
    return MeshDistance(capsule(PATH_CAPSULE, 0.0))


@pytest.fixture(scope="module")
def stock():
    """The capsule with 0.5 mm more all round."""
    return ConvexStock(convex_hull(capsule(PATH_CAPSULE, 0.5).vertices), proven=True)


def capsule(shape, offset):
    bottom, top, radius = shape
    slope, angle = np.meshgrid(np.linspace(-np.pi / 2, np.pi / 2, 41), np.linspace(0, 2 * np.pi, 81)[:-1])
    r = (radius + offset) * np.cos(slope)
    heights = np.where(slope < 0, bottom, top) + (radius + offset) * np.sin(slope)
    return convex_hull(np.stack([r * np.cos(angle), r * np.sin(angle), heights], -1).reshape(-1, 3))


def judge(posted, text, part, stock):
    """Read a text, judge it as its control would run it, and by what its ball and its rapids do."""
    motions = read_program(text, posted.machine, posted.dialect)
    check_control(motions, posted.machine, posted.dialect, posted.job)
    same = posted.motions
    goes_alike = np.array_equal(motions.words, same.words) and np.array_equal(motions.rapid, same.rapid)
    if goes_alike and text != posted.text():
        return  # the text as posted is judged as `nothing`
    gouge = measure_gouge(motions, part)
    if gouge.depth > ALLOWED_GOUGE:
        raise VerifyError(f"line {gouge.line}: gouge", line=gouge.line, place=None, error=gouge.depth)
    cutters: list[Cutter] = cutters_of(posted.job, posted.machine)
    removal = simulate_removal(
        text, posted.machine, posted.dialect, stock, Post(1.0, 30.0), cutters, accuracy=Accuracy(0.4)
    )
    check_removal(removal, limited=False)


# edits: of the blocks, without their numbers, and what they were posted for


def changed(blocks: Blocks, at: int, pattern: str, new: str) -> Blocks:
    """The blocks with one of them changed."""
    assert re.search(pattern, blocks[at]), (pattern, blocks[at])
    return [*blocks[:at], re.sub(pattern, new, blocks[at], count=1), *blocks[at + 1 :]]


def before(blocks: Blocks, at: int, block: str) -> Blocks:
    """The blocks with another one before one of them."""
    return [*blocks[:at], block, *blocks[at:]]


def first(blocks: Blocks, pattern: str) -> int:
    """The first block that is like a pattern."""
    return next(at for at, block in enumerate(blocks) if re.search(pattern, block))


def middle(posted) -> int:
    """The block of a cut in the middle of the first level."""
    return posted.cuts[len(posted.cuts) // 4]


def word(posted, letter: str, value: float) -> Edit:
    """A cut with another number of one axis."""

    def edit(posted, blocks):
        sign = "+" if posted.klartext else ""
        return changed(blocks, middle(posted), rf" {letter}(=DC\()?[-+]?[\d.]+", rf" {letter}\g<1>{value:{sign}.3f}")

    return edit


def code(posted, klartext: str, iso: str) -> str:
    """A block by the grammar, with codes of two digits where the control has them."""
    if posted.klartext:
        return klartext
    return re.sub(r"\b([GM])(\d)\b", r"\g<1>0\2", iso) if posted.dialect.decimal_point else iso


def planted(klartext: str, iso: str) -> Edit:
    """A block before a cut."""
    return lambda posted, blocks: before(blocks, middle(posted), code(posted, klartext, iso))


def every_feed(change: Callable[[float], float]) -> Edit:
    """All feeds of cuts changed."""

    def edit(posted, blocks):
        chosen = set(posted.cuts)
        digits = posted.dialect.numbers.feed.decimals

        def new(found):
            point = "." if found[2] == "." else ""
            return f" F{change(float(found[1])):.{digits}f}{point}"

        return [re.sub(r" F(\d+(?:\.\d+)?)(\.?)$", new, b) if k in chosen else b for k, b in enumerate(blocks)]

    return edit


def without(pattern: str) -> Edit:
    """The first block like a pattern left out."""

    def edit(posted, blocks):
        at = first(blocks, pattern)
        return [*blocks[:at], *blocks[at + 1 :]]

    return edit


def replaced(pattern: str, new: str) -> Edit:
    """What is like a pattern replaced in the first block that has it."""
    return lambda posted, blocks: changed(blocks, first(blocks, pattern), pattern, new)


def position_beyond(posted, blocks):
    """Above the part, before tool-centre control is on, B beyond its limit."""
    at = first(blocks, r"^(L|G0) B-|^G00 B0")
    return changed(blocks, at, r" B[-+]?[\d.]+", " B+60.000")


def over_zero_beyond(posted, blocks):
    """The spindle over a place far out of the machine, before anything else is known."""
    at = first(blocks, r"^(L|G0?0) X\S+ Y\S+( R0 FMAX)?$")
    return changed(blocks, at, r" X[-+]?[\d.]+", " X+2000.000")


def shorter_tool(posted, blocks):
    return replaced(r"LENGTH 100\.0000", "LENGTH 90.0000")(posted, blocks)


def inward(posted, blocks):
    """The tip 0.6 mm nearer to the axis of the capsule, along the tool: by Z, and by X and Y."""
    at = middle(posted)
    if posted.dialect.tool_centre:
        scale = 0.6

        def smaller(found):
            sign = "+" if posted.klartext else ""
            return f" {found[1]}{scale * float(found[2]):{sign}.3f}"

        return [*blocks[:at], re.sub(r" ([XY])([-+]?[\d.]+)", smaller, blocks[at]), *blocks[at + 1 :]]
    return changed(blocks, at, r" Z([-+]?[\d.]+)", lambda found: f" Z{float(found[1]) - 1.5:.5f}")


def rapid_in_cut(posted, blocks):
    at = middle(posted)
    if posted.klartext:
        return changed(blocks, at, r"F\d+$", "FMAX")
    gone = changed(blocks, at, r" F[\d.]+$", "")
    return changed(gone, at, r"^G(0?)1", r"G\g<1>0")


def spindle_speed(factor: float) -> Edit:
    return lambda posted, blocks: [
        re.sub(r"\bS(\d+)( M0?3)?$", lambda f: f"S{factor * float(f[1]):.0f}{f[2] or ''}", block) for block in blocks
    ]


def with_tolerance(posted, blocks, value):
    """The contour tolerance of the first level changed, or left to the control; where the text has none, another
    datum."""
    if posted.dialect.decimal_point:
        return planted("", "G55")(posted, blocks)
    at = first(blocks, r"^[;(] ?LEVEL") + 1 + posted.klartext
    if value:
        return changed(blocks, at, r"(T\+|832\(|P)[\d.]+", rf"\g<1>{value}")
    return changed(blocks, at, r" T\+[\d.]+| P[\d.]+|\(.*\)", "()" if "832" in blocks[at] else "")


DIFFERENT = ("heidenhain", "siemens-840d", "linuxcnc")
"""Klartext, words of the tool's centre and words of joints in inverse time: what differs in the code, not in the files
of the dialects."""

WRONG: dict[str, Edit] = {
    # limits
    "B beyond its upper limit": lambda p, b: word(p, "B", 60.0)(p, b),
    "B beyond its lower limit": lambda p, b: word(p, "B", -130.0)(p, b),
    "X beyond its travel": lambda p, b: word(p, "X", 2000.0)(p, b),
    "Y beyond its travel": lambda p, b: word(p, "Y", -1500.0)(p, b),
    "Z beyond its travel": lambda p, b: word(p, "Z", 1900.0)(p, b),
    "B beyond its limit above the part": position_beyond,
    "X beyond its travel above the part": over_zero_beyond,
    "a number out of the control's range": lambda p, b: word(p, "C", 1000000.0)(p, b),
    # feeds
    "every feed 99999": every_feed(lambda feed: 99999.0),
    "feeds three times as large": every_feed(lambda feed: 3 * feed + 900),
    "feed 0": every_feed(lambda feed: 0.0),
    "no feed": lambda p, b: changed(b, first(b, r"^(L|G0?1) .* F[\d.]+$"), r" F[\d.]+$", ""),
    # modes
    "feed per minute in inverse time, or the other way round": lambda p, b: before(
        b, middle(p), "M136" if p.klartext else "G94" if p.dialect.feed_mode == "inverse-time" else "G93"
    ),
    "feed per revolution": planted("M136", "G95"),
    "increments": planted("L IX+1.000 R0 F100", "G91"),
    "another plane": planted("PLANE SPATIAL SPA+10 SPB+0 SPC+0 STAY", "G18"),
    "an arc": planted("C X+1.000 Y+1.000 DR+ R0 F100", "G2 X1.0 Y1.0 I1.0 J0.0 F100."),
    "another datum": lambda p, b: changed(
        b, first(b, "^  Q339=1|^G54$"), "Q339=1|G54", "Q339=2" if p.klartext else "G55"
    ),
    "radius compensation": lambda p, b: changed(
        b, middle(p), "( F.*)?$" if p.klartext else "^G0?1", " RL" if p.klartext else "G41 G1"
    ),
    "the end left out": without(r"^M30$|^M0?2$"),
    "a cycle": planted("CYCL CALL M3", "G81 X1.0 Y1.0 Z1.0 R2.0 F100."),
    "a mirror image": planted("CYCL DEF 8.0 MIRROR IMAGE", "G51.1 X0."),
    # spindle
    "the spindle stopped before a cut": planted("M5", "M5"),
    "the spindle never started": lambda p, b: without(r"^M3$")(p, b)
    if p.klartext
    else changed(b, first(b, r"\bM0?3$"), r" M0?3$", ""),
    "the spindle the other way round": lambda p, b: changed(b, first(b, r"\bM0?3$"), r"M(0?)3$", r"M\g<1>4"),
    "the spindle twice as fast": spindle_speed(2.0),
    "the spindle half as fast": spindle_speed(0.5),
    "no speed of the spindle": lambda p, b: [re.sub(r" S\d+$|^S\d+ (?=M)", "", block) for block in b],
    # coolant
    "no coolant": lambda p, b: [block for block in b if block not in ("M8", "M08")],
    "the coolant stopped before a cut": planted("M9", "M9"),
    # tolerances of the contour, where the text has them
    "a contour tolerance of 1 mm": lambda p, b: with_tolerance(p, b, "1.0"),
    "the contour left to the control": lambda p, b: with_tolerance(p, b, ""),
    # units
    "inches": lambda p, b: changed(b, first(b, "PGM|G21|G710"), " MM$|G21|G710", " INCH" if p.klartext else "G20"),
    "inches before a cut": planted("BEGIN PGM A INCH", "G70"),
    # tools
    "another length in the header": shorter_tool,
    "another radius in the header": replaced(r"BALL RADIUS 2\.0000", "BALL RADIUS 3.0000"),
    "a tool that is not described": replaced(r"^TOOL CALL 1 |^T1\b", r"TOOL CALL 9 "),
    "no length, no tool-centre control": without(r"^FUNCTION TCPM F|^TRAORI$|^G00 G43|^G43"),
    "the length of another tool": replaced(r"^TOOL CALL 1 |\bH0?1$|^D1$", "D2"),
    # jumps, rapids, retracts
    "a jump into the part": inward,
    "a rapid in a cut": rapid_in_cut,
    "no retract before the first move": without(r"^L M140|^G0 SUPA|^G28 G91|^G0 Z"),
    # form
    "a number in another form": lambda p, b: changed(
        b, middle(p), r" X\+?(-?\d+)\.\d+", r" X\1" if p.dialect.decimal_point else r" X\1e0"
    ),
    "a letter of no axis": lambda p, b: changed(b, middle(p), r" C[^ ]+", " W1.000"),
    "a block cut in two": lambda p, b: changed(b, middle(p), r" Y.*$", " Y"),
}  # fmt: skip


def remark(posted, blocks):
    """A remark behind a block."""
    return changed(blocks, middle(posted), "$", " (SEEN)" if posted.dialect.comment == "({text})" else " ; SEEN")


HARMLESS: dict[str, Edit] = {
    "nothing": lambda p, b: b,
    "a comment": lambda p, b: before(b, middle(p), "(SEEN)" if p.dialect.comment == "({text})" else "; SEEN"),
    "a remark behind a block": remark,
    "half the feed": every_feed(lambda feed: max(feed / 2, 1.0)),
    "one feed lower": lambda p, b: (
        changed(b, middle(p), r" F\d+(\.?)", " F100." if p.dialect.decimal_point else " F100")
        if p.dialect.feed_mode == "per-minute"
        else b
    ),
    "mist for coolant": lambda p, b: [re.sub(r"^M(0?)8$", r"M\g<1>7", block) for block in b],
    "the spindle started again": planted("M3", "M3"),
    "the spindle a little slower, and the feeds": lambda p, b: spindle_speed(0.9)(
        p, every_feed(lambda feed: max(np.floor(0.8 * feed), 1.0))(p, b)
    ),
    "coolant off and on above the part": lambda p, b: before(
        before(b, first(b, "^M0?8$"), code(p, "M9", "M9")), first(b, "^M0?8$"), code(p, "M8", "M8")
    ),
    "blanks and zeros as the control takes them": lambda p, b: (
        b if p.klartext else changed(changed(b, middle(p), r" Y", "   Y"), middle(p), r"(\.\d+?)0*(?= Y|   Y)", r"\1")
    ),
}


@pytest.mark.parametrize(("name", "dialect"), [*product(WRONG, DIFFERENT), ("a number in another form", "fanuc-30i")])
def test_what_a_control_would_refuse_or_cut_wrong_is_refused(posted_of, dialect, name, part, stock):
    posted = posted_of(dialect)
    blocks = WRONG[name](posted, list(posted.blocks))
    text = posted.text(blocks)
    assert text != posted.text()
    with pytest.raises((VerifyError, ProgramError)) as caught:
        judge(posted, text, part, stock)
    assert "line" in caught.value.evidence
    assert ": " in str(caught.value)


@pytest.mark.parametrize("dialect", DIFFERENT)
@pytest.mark.parametrize("name", HARMLESS)
def test_what_is_harmless_is_accepted(posted_of, dialect, name, part, stock):
    posted = posted_of(dialect)
    judge(posted, posted.text(HARMLESS[name](posted, list(posted.blocks))), part, stock)


MIKRON = read_machine("mikron-ucp600")
HEIDENHAIN, SIEMENS = read_dialect("heidenhain"), read_dialect("siemens-840d")


PATHS = [capsule_path(count=120, turns=3.0)]


def winding(limit_deg):
    """The machine with limits of C."""
    c, b = MIKRON.part_axes
    bounds = (-np.radians(limit_deg), np.radians(limit_deg))
    return replace(MIKRON, part_axes=(replace(c, limits=bounds), b))


@pytest.mark.parametrize("words", ["wrapped", "wound"])
def test_an_axis_that_may_wind_is_held_to_its_limits(words):
    """The helix turns C three times without a break: wrapped words leave open in which turn it begins."""
    job = Job().with_values(nc={"endless_words": words})
    text = write_program(PATHS, MIKRON, HEIDENHAIN, job).text
    motions = read_program(text, MIKRON, HEIDENHAIN)
    turned = np.degrees(motions.words[:, 4])
    with pytest.raises(VerifyError, match=r"C goes to .* deg, its limit is -?450 deg"):
        check_limits(motions, winding(450.0))
    enough = 360.0 * np.ceil(np.ptp(turned) / 360.0) if words == "wrapped" else np.abs(turned).max() + 0.001
    check_limits(motions, winding(float(enough)))


def test_the_place_that_is_out_of_the_way_is_named_where_a_travel_is_passed():
    text = write_program(PATHS, MIKRON, HEIDENHAIN, Job()).text
    lines = text.splitlines()
    at = [k for k, line in enumerate(lines) if re.search(r" L X.* C\S+$", line)][7]
    lines[at] = re.sub(r" X\S+", " X-2000.000", lines[at])
    motions = read_program("\n".join(lines) + "\n", MIKRON, HEIDENHAIN)
    with pytest.raises(VerifyError, match=r"runs over \d+\.\d mm in the program, its travel is \d+ mm") as caught:
        check_limits(motions, MIKRON)
    assert caught.value.evidence["line"] in (at + 1, at + 2)


@pytest.mark.parametrize(
    ("limits", "why"),
    [
        ((-900.0, -5.0), "Z goes to 0.000 mm, its limit is -5 mm"),
        ((0.0, 900.0), "the retract to Z 0 of the machine is below the spindle nose"),
    ],
)
def test_a_retract_in_machine_coordinates_stays_within_limits_and_above_all(limits, why):
    text = write_program(PATHS, MIKRON, SIEMENS, Job()).text
    x, y, z = MIKRON.linear
    low = -600.0 if limits[1] < 0 else 0.0  # the part stands so low that its cuts are within the limits
    machine = replace(
        MIKRON,
        part_zero=(0.0, 0.0, low),
        part_axes=tuple(replace(axis, pivot=(0.0, 0.0, low)) for axis in MIKRON.part_axes),
        linear=(x, y, replace(z, limits=limits)),
    )
    with pytest.raises(VerifyError, match=re.escape(why)):
        check_limits(read_program(text, machine, SIEMENS), machine)
    machine = replace(MIKRON, linear=(x, y, replace(z, limits=(-900.0, np.inf))))
    check_limits(read_program(text, machine, SIEMENS), machine)


@pytest.fixture(scope="module", params=[(name, point) for name in CHAINS for point in ("tip", "centre")])
def moves(request, tmp_path_factory):
    """The nose of a helix in long blocks, and that sampled at a thousand places of each block."""
    name, point = request.param
    path = tmp_path_factory.mktemp("machine") / "test.toml"
    chain = CHAINS[name]
    if name == "head-head":  # whose C comes first, and would reach its limits in three turns
        chain = chain.replace("limits_deg = [-179.0, 179.0]", "endless = true", 1)
    path.write_text(f'programmed_point = "{point}"\n{chain}')
    machine = read_machine(path)
    job = Job().with_values(path={"chord_tolerance": 0.5, "gouge_tolerance": 0.5})
    text = write_program([capsule_path(count=60, turns=3.0)], machine, SIEMENS, job).text
    motions = read_program(text, machine, SIEMENS)
    rows = np.flatnonzero(motions.known_start)
    control = motions.controls[1]
    dense = np.empty((len(rows), 1001, 3))
    for at, u in enumerate(np.linspace(0, 1, 1001)):
        tips, _ = control.between(motions.words[rows - 1], motions.words[rows], u)
        angles = (1 - u) * motions.words[rows - 1, 3:] + u * motions.words[rows, 3:]
        dense[:, at] = inverse_linear(machine, tips, angles, control.tool_length)[:, :3]
    dense[:, :, 2] += control.tool_length
    return nose_moves(motions, machine), rows, dense


def test_no_block_leaves_the_line_between_its_ends_by_more_than_its_bow(moves):
    noses, rows, dense = moves
    line = np.linspace(0, 1, 1001)[:, None]
    starts, ends = noses.starts[rows][:, None], noses.ends[rows][:, None]
    off = np.abs(dense - ((1 - line) * starts + line * ends)).max(axis=(1, 2))
    assert (off <= noses.bows[rows] + 1e-9).all()
    assert off.max() > 0.02  # the blocks are bowed enough to tell


def test_the_highest_place_of_each_block_is_found(moves):
    noses, rows, dense = moves
    for column, sign in product(range(3), (1.0, -1.0)):
        highest = (sign * dense[:, :, column]).max(axis=1)
        found = noses.highest(column, sign, rows)
        assert np.abs(found - highest).max() < 0.002
        value = float(np.median(highest))
        assert set(rows[highest > value + 0.002]) <= set(noses.reaching(column, sign, value).tolist())


def test_a_limit_that_is_passed_between_the_ends_of_a_block_only_is_kept():
    """The tip stays at X 100 of the part while C turns from -20 to 20: X goes from 94 over 100 to 94."""
    mikron, heidenhain = read_machine("mikron-ucp600"), read_dialect("heidenhain")
    lines = write_program([capsule_path(count=24)], mikron, heidenhain, Job()).text.splitlines()
    start = next(k for k, line in enumerate(lines) if " L B" in line)
    blocks = [
        "L B+0.000 C-20.000 R0 FMAX",
        "FUNCTION TCPM F TCP AXIS POS PATHCTRL AXIS",
        "L X+100.000 Y+0.000 Z+60.000 R0 FMAX",
        "L X+100.000 Y+0.000 Z+60.000 B+0.000 C+20.000 R0 F100",
        "FUNCTION RESET TCPM",
        "M30",
        "END PGM BONE MM",
    ]
    number = int(lines[start].split(" ")[0])
    text = "\n".join([*lines[:start], *(f"{number + k} {block}" for k, block in enumerate(blocks))]) + "\n"
    motions = read_program(text, mikron, heidenhain)
    with pytest.raises(VerifyError, match=r"X goes to 100\.000 mm, its limit is 99\.9 mm") as caught:
        check_limits(motions, with_limits(mikron, 0, 99.9))
    assert caught.value.evidence["line"] == start + 4
    check_limits(motions, with_limits(mikron, 0, 100.001))
    assert nose_moves(motions, mikron).ends[:, 0].max() < 94.0


def with_limits(machine, column, high):
    linear = list(machine.linear)
    linear[column] = replace(linear[column], limits=(-1e4, float(high)))
    return replace(machine, linear=tuple(linear))


RETRACTS = {"siemens-840d": 1, "fanuc-30i": 2}
"""Blocks of the retract before the call of a tool."""


def place(posted, pattern):
    return next(at for at, block in enumerate(posted.blocks) if re.search(pattern, block))


def tool_start(posted, number):
    """The first block of a tool's start."""
    return place(posted, rf"^(TOOL CALL {number} |T{number}\b)") - RETRACTS.get(posted.dialect.name, 0)


def judge_blocks(posted, blocks):
    motions = read_program(posted.text(blocks), posted.machine, posted.dialect)
    check_control(motions, posted.machine, posted.dialect, posted.job)
    return motions


def test_behind_the_safe_start_a_program_begins_at_a_later_tool(posted):
    blocks = list(posted.blocks)
    motions = judge_blocks(posted, blocks[: tool_start(posted, 1)] + blocks[tool_start(posted, 2) :])
    assert set(motions.tools) == {2}


def test_behind_the_start_of_its_tool_a_program_begins_at_a_level(posted):
    blocks = list(posted.blocks)
    level = place(posted, r"^[;(] ?LEVEL 0")
    start = blocks[: tool_start(posted, 1)] + blocks[tool_start(posted, 2) : level]
    whole = judge_blocks(posted, blocks)
    motions = judge_blocks(posted, start + blocks[level:])
    assert (motions.tips == whole.tips[whole.tools == 2]).all()


def test_from_a_level_on_a_program_states_all_that_it_needs(posted):
    """The frame of the program and what describes its tools are all that stands before."""
    blocks = list(posted.blocks)
    level = place(posted, r"^[;(] ?LEVEL 0")
    frame = [block for block in blocks[:level] if re.match(r"%|BEGIN|O\d{4}$|[;(] ?TOOL \d BALL", block)]
    assert "RESTART MAY BEGIN HERE" in "".join(blocks[level : level + 3])
    whole = judge_blocks(posted, blocks)
    motions = judge_blocks(posted, frame + blocks[level:])
    assert (motions.tips == whole.tips[whole.tools == 2]).all()
    modes = next(k for k, block in enumerate(blocks[level:]) if re.match(r"TRAFOOF|G49|G21|FUNCTION RESET", block))
    with pytest.raises(ProgramError, match="is stated"):
        judge_blocks(posted, frame + blocks[level + modes + 6 :])


def test_a_program_does_not_begin_within_a_run(posted):
    blocks = list(posted.blocks)
    for share in (0.1, 0.5, 0.9):
        cut = posted.cuts[int(share * len(posted.cuts) / 2)]
        for start in (place(posted, r"^[;(] ?LEVEL 1"), tool_start(posted, 1)):
            with pytest.raises((ProgramError, VerifyError), match=r"line \d+: "):
                judge_blocks(posted, blocks[:start] + blocks[cut:])
