"""Facts and arrays as one compressed block of bytes, which a page and a kept folder hold.

Floats become whole numbers of 16 bits over the range of their array (a range of 100 mm in steps of 1.5 um). Columns
follow one another as differences, their bytes in planes: neighbours on paths and meshes differ little, so that gzip
halves them. Bytes (of a text) stay as they are. `assets/unpack.js` reads it too.
"""

import gzip
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from bonecam.errors import FileError

VERSION = 1
"""Of the format. A reader refuses others."""
FLOAT_BYTES, INTEGER_BYTES = 2, 3
"""Bytes of a packed number: integers are below 2^24."""
LEVEL = 6
"""Of gzip: 9 takes three times as long and saves 1 %."""


@dataclass(frozen=True, eq=False)
class Contents:
    """What a page shows: `facts` are values of JSON, `arrays` have one item a row, lengths in mm."""

    facts: dict[str, Any]
    arrays: dict[str, ndarray]


def pack(contents: Contents) -> bytes:
    """The contents as bytes, without empty arrays: equal contents make equal bytes."""
    index = {}
    blocks = []
    at = 0
    for name, array in contents.arrays.items():
        if not len(array):
            continue
        entry, block = _packed(np.asarray(array))
        index[name] = {**entry, "at": at}
        blocks.append(block)
        at += len(block)
    head = json.dumps({"bonecam_view": VERSION, "facts": contents.facts, "arrays": index}).encode()
    return gzip.compress(b"".join([len(head).to_bytes(4, "little"), head, *blocks]), LEVEL, mtime=0)


def unpack(packed: bytes, file: str) -> Contents:
    """The contents of packed bytes; FileError, which names the `file`, where they are damaged or of another version."""
    try:
        data = gzip.decompress(packed)
        size = int.from_bytes(data[:4], "little")
        head = json.loads(data[4 : 4 + size])
        version = head["bonecam_view"]
    except (OSError, EOFError, zlib.error, ValueError, KeyError, TypeError) as error:
        raise FileError(f"{file}: is damaged: make it again with --keep", file=file) from error
    if version != VERSION:
        raise FileError(
            f"{file}: has version {version!r}, this bonecam reads {VERSION}: make it again with --keep, or use "
            "the bonecam that made it",
            file=file,
        )
    try:
        arrays = {name: _unpacked(entry, data, 4 + size) for name, entry in head["arrays"].items()}
        return Contents(dict(head["facts"]), arrays)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise FileError(f"{file}: is damaged: make it again with --keep", file=file) from error


def _packed(array: ndarray) -> tuple[dict[str, Any], bytes]:
    """How an array is described, and its bytes."""
    columns = array.reshape(len(array), -1)
    entry: dict[str, Any] = {"shape": list(array.shape)}
    if array.dtype.kind == "f":
        size = FLOAT_BYTES
        low = columns.min(axis=0)
        step = float(np.ptp(columns, axis=0).max()) / (2 ** (8 * size) - 1)
        entry |= {"low": low.tolist(), "step": step}
        whole = np.rint((columns - low) / (step or 1.0)).astype(np.int64)
    elif array.dtype == np.uint8:
        return {**entry, "bytes": 1}, array.tobytes()
    else:
        size = INTEGER_BYTES
        whole = columns.astype(np.int64)
    differences = np.diff(whole, axis=0, prepend=0) & (2 ** (8 * size) - 1)
    planes = [(differences >> (8 * k)).astype(np.uint8).T.tobytes() for k in range(size)]
    return {**entry, "bytes": size}, b"".join(planes)


def _unpacked(entry: Mapping[str, Any], data: bytes, start: int) -> ndarray:
    """The array that an entry describes; ValueError where bytes are missing."""
    shape, size = tuple(entry["shape"]), int(entry["bytes"])
    count = int(np.prod(shape))
    flat: UInt8[ndarray, " b"] = np.frombuffer(data, np.uint8, count * size, start + int(entry["at"]))
    if size == 1:
        return flat.reshape(shape)
    planes = flat.reshape(size, -1, shape[0]).astype(np.int64)
    differences = sum(planes[k] << (8 * k) for k in range(size))
    whole = (np.cumsum(differences, axis=1) & (2 ** (8 * size) - 1)).T.reshape(shape)
    if "step" not in entry:
        return np.asarray(whole)
    low = np.array(entry["low"])
    return whole * entry["step"] + (low if len(shape) > 1 else low[0])
