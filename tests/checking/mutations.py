"""Damage to files, from a seed, and what every reader promises of a damaged file: a result or one typed line,
soon."""

import random
import re
import signal
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

from bonecam.errors import BonecamError

Mutate = Callable[[random.Random, bytes], bytes]
SECONDS = 10
"""Longest processor time that reading a damaged file may take: other work on the machine does not count."""
NUMBER = re.compile(rb"(?<![\w.])[-+]?\d+(\.\d*)?([eE][-+]?\d+)?")
HOSTILE = (
    *b"nan inf -inf NaN 1e999 -1e308 1e-320 9e18 -0 0 1 2 3 -1 -2 255 256 65536 1000000000 2147483647".split(),
    *b"4294967295 4294967296 9223372036854775808 99999999999999999999999 0x10 1_0 3.5 one , ; / // \xff".split(),
    b"",
    b"1" * 5000,
)
"""What is written where a number stood."""
TYPES = b"char uchar short ushort int uint float double int8 uint8 float32 float64 int64 list string".split()
BLANKS = (b"\t", b"\v", b"\f", b"  ", b"\0", b"\xc2\xa0", b"\r", b"")
LINE_ENDS = (b"\r", b"\r\n", b"\n\n", b"\v", b"\n\r", b" ", b"\0\n", b"\\\n")


def _place(rng: random.Random, data: bytes) -> int:
    """A place in the data; every other one is near its beginning, where the headers are."""
    return rng.randrange(min(len(data), rng.choice((200, len(data)))) or 1)


def flip_bytes(rng: random.Random, data: bytes) -> bytes:
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        if found:
            found[_place(rng, data)] = rng.choice((0, 10, 13, 32, 48, 57, 127, 128, 255, rng.randrange(256)))
    return bytes(found)


def flip_bit(rng: random.Random, data: bytes) -> bytes:
    k = _place(rng, data)
    return data[:k] + bytes([data[k] ^ (1 << rng.randrange(8))]) + data[k + 1 :] if data else data


def cut_short(rng: random.Random, data: bytes) -> bytes:
    return data[: rng.choice((_place(rng, data), len(data) - rng.randrange(1, 40)))]


def cut_out(rng: random.Random, data: bytes) -> bytes:
    k = _place(rng, data)
    return data[:k] + data[k + rng.choice((1, 2, 10, 100)) :]


def insert_bytes(rng: random.Random, data: bytes) -> bytes:
    k = _place(rng, data)
    return data[:k] + rng.choice((rng.randbytes(rng.choice((1, 4, 100))), rng.choice(HOSTILE))) + data[k:]


def repeat_piece(rng: random.Random, data: bytes) -> bytes:
    k = _place(rng, data)
    return data[:k] + data[k : k + rng.choice((1, 20, 200, len(data)))] + data[k:]


def replace_number(rng: random.Random, data: bytes) -> bytes:
    found = list(NUMBER.finditer(data))
    if not found:
        return data
    match = found[min(int(rng.random() * rng.choice((10, len(found)))), len(found) - 1)]
    return data[: match.start()] + rng.choice(HOSTILE) + data[match.end() :]


def scale_number(rng: random.Random, data: bytes) -> bytes:
    """A whole number made a little or much larger or smaller."""
    found = [match for match in NUMBER.finditer(data) if match[0].isdigit()]
    if not found:
        return data
    match = found[min(int(rng.random() * rng.choice((10, len(found)))), len(found) - 1)]
    value = int(match[0][:18])
    changed = rng.choice((value + 1, value - 1, value * 1000, value * 10**9, -value))
    return data[: match.start()] + b"%d" % changed + data[match.end() :]


def swap_word(rng: random.Random, data: bytes) -> bytes:
    """A word of the first lines replaced by a type's name, or by another word of them."""
    head = list(re.finditer(rb"[A-Za-z_]\w*", data[:600]))
    if not head:
        return data
    match = rng.choice(head)
    return data[: match.start()] + rng.choice((*TYPES, rng.choice(head)[0])) + data[match.end() :]


def change_blanks(rng: random.Random, data: bytes) -> bytes:
    return data.replace(b" ", rng.choice(BLANKS), rng.choice((1, 10, -1)))


def change_line_ends(rng: random.Random, data: bytes) -> bytes:
    return data.replace(b"\n", rng.choice(LINE_ENDS), rng.choice((1, 10, -1)))


def move_line(rng: random.Random, data: bytes) -> bytes:
    """A line repeated, left out, or put elsewhere."""
    lines = data.split(b"\n")
    k = rng.randrange(len(lines))
    line = lines[k]
    kind = rng.randrange(3)
    if kind:
        del lines[k]
    if kind != 1:
        lines.insert(rng.randrange(len(lines) + 1), line)
    return b"\n".join(lines)


MUTATIONS: tuple[Mutate, ...] = (
    flip_bytes,
    flip_bit,
    cut_short,
    cut_out,
    insert_bytes,
    repeat_piece,
    replace_number,
    scale_number,
    swap_word,
    change_blanks,
    change_line_ends,
    move_line,
)


def mutate(rng: random.Random, data: bytes) -> bytes:
    """Damages data in one to three ways that the random generator chooses."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        data = rng.choice(MUTATIONS)(rng, data)
    return data


@contextmanager
def time_limit(seconds: float, *, wall: bool = False) -> Iterator[None]:
    """TimeoutError in this thread where the block takes more processor time, or with `wall` more time."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"not done in {seconds:g} s")

    kind = signal.SIGALRM if wall else signal.SIGPROF
    clock = signal.ITIMER_REAL if wall else signal.ITIMER_PROF
    before = signal.signal(kind, stop)
    signal.setitimer(clock, seconds)
    try:
        yield
    finally:
        signal.setitimer(clock, 0)
        signal.signal(kind, before)


def within(seconds: float) -> AbstractContextManager[None]:
    """A limit (s) on the time that a block takes: TimeoutError where it takes longer."""
    return time_limit(seconds, wall=True)


def outcome(reader: Callable[[Path], object], file: Path) -> str:
    """Reads a file under the time limit: "" where that gives a result, else the one line of its typed error.

    Any other exception, and a message of more lines or without the file's name, fail the test.
    """
    try:
        with time_limit(SECONDS):
            reader(file)
    except BonecamError as error:
        message = str(error)
        assert file.name in message, message
        assert "\n" not in message, message
        assert len(message) < 1000, message
        return message
    return ""
