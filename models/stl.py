"""Read the triangles of an STL file, binary or text: `read_stl`."""

import re
from pathlib import Path

import numpy as np

from ..base.errors import InputError
from ..base.inputs import printable
from ..base.reading import read_bytes
from .part import LARGEST

LARGEST_FILE = 50_000_000  # [bytes], of text with as many triangles
MOST = 250_000  # triangles
HEADER = 84  # bytes of a binary file before its triangles
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")  # in small letters
MARK = b"\xef\xbb\xbf"  # with which some editors begin a text in UTF-8


def read_stl(path: Path) -> np.ndarray:
    """Return the corners of all triangles of a file, (n, 3, 3), in the file's unit, which STL does not state.

    Raises `InputError` if it cannot be read, is cut off or has no triangles, or coordinates that are not finite;
    one line that names the file.
    """
    where, content = printable(path.name), read_bytes(path, "an STL file", LARGEST_FILE)
    count = int.from_bytes(content[HEADER - 4 : HEADER], "little") if len(content) >= HEADER else 0
    begins = content[:HEADER].removeprefix(MARK).lstrip()
    if begins[:5].lower() == b"solid" and len(content) != HEADER + RECORD.itemsize * count:
        triangles = _from_text(content.lower(), where)
    else:
        triangles = _from_binary(content, count, where)
    if not len(triangles):
        raise InputError(f"{where} must have triangles, got none")
    wrong = np.flatnonzero(~(np.abs(triangles) <= LARGEST).all(axis=(1, 2)))
    if wrong.size:
        raise InputError(
            f"{where} must have finite coordinates up to {LARGEST:g}, got others in triangle {wrong[0] + 1}"
        )
    return triangles


def _from_binary(content: bytes, count: int, where: str) -> np.ndarray:
    size = HEADER + RECORD.itemsize * count
    if len(content) < HEADER:
        raise InputError(f"{where} must be an STL file, got {len(content)} bytes, fewer than its header has")
    if size > LARGEST_FILE:  # four bytes of anything else are a number too
        raise InputError(f"{where} must be an STL file, got other content")
    if len(content) < size:
        stated = f"the {count} triangles that its header states, {size} bytes"
        raise InputError(f"{where} must have {stated}, got {len(content)} bytes")
    _check_count(count, where)
    with np.errstate(invalid="ignore"):  # of a signalling nan, which is refused with the others
        return np.frombuffer(content, RECORD, count, HEADER)["corners"].astype(float)


def _from_text(content: bytes, where: str) -> np.ndarray:
    _check_count(content.count(b"vertex") // 3, where)
    vertices = VERTEX.findall(content)
    if b"endsolid" not in content or len(vertices) % 3 or len(vertices) != content.count(b"vertex"):
        raise InputError(f"{where} must be an STL file, got text that is cut off after {len(vertices)} vertices")
    try:
        return np.array(vertices, dtype="S32").astype(float).reshape(-1, 3, 3)
    except ValueError:
        raise InputError(f"{where} must have numbers as coordinates, got a vertex with another word") from None


def _check_count(count: int, where: str) -> None:
    """Raise InputError if there are so many triangles that reading them takes too much time and memory."""
    if count > MOST:
        raise InputError(f"{where} must have at most {MOST} triangles, got {count}")
