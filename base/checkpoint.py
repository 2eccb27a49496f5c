r"""Checkpoints: the results so far in a file that only grows, so that a run that was stopped can be resumed.

The file has a first line that identifies it, a header, and records:

    towline KIND checkpoint VERSION\n
    length of the header (uint32), header (JSON: everything that the records depend on), its CRC-32
    for each record in turn: length of its content (uint32), content, CRC-32 of both

Integers are little-endian. If the last `longest_record` bytes or fewer cannot be read, they count as a record
that was cut short by the end of the process, and are dropped. Damage farther from the end is an error, and the file is
left unchanged.
"""

from __future__ import annotations

import json
import os
import struct
import time
import uuid
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Any

from .errors import InputError
from .writing import check_writable

__all__ = ["ACCEPTED", "Checkpoint", "Kind", "begin", "open_checkpoint"]

ACCEPTED = "a checkpoint of this run"
_SIZE = struct.Struct("<I")  # of a length and of a CRC-32
_SAFE_EVERY = 1.0  # [s] between writes that survive a power cut


@dataclass(frozen=True)
class Kind:
    """The kind of records in a checkpoint.

    Attributes
    ----------
    magic
        Its first line.
    unit
        What a record is called in messages, such as "chunk".
    longest
        Length of the longest content of a record [bytes].
    """

    magic: bytes
    unit: str
    longest: int

    @property
    def longest_record(self) -> int:
        """Return the length of the longest record [bytes]."""
        return 2 * _SIZE.size + self.longest


class Checkpoint:
    """Read the records of an open checkpoint one by one, then append.

    Attributes
    ----------
    stored
        Number of records that it has.
    path
        Its file.
    """

    def __init__(self, path: Path, kind: Kind, stream: FileIO, start: int, stored: int):
        self.path, self.stored = path, stored
        self._kind, self._stream, self._left = kind, stream, stored
        self._safe_at = time.monotonic()
        stream.seek(start)

    def read(self) -> bytes | None:
        """Return the content of the next record; None if there is no other. Read them all before you append."""
        if not self._left:
            return None
        self._left -= 1
        return _record(self._stream, self._kind)

    def append(self, content: bytes) -> None:
        """Append a record.

        Raises
        ------
        InputError
            If it cannot be written, as on a full disk. The file can be resumed.
        """
        record = _SIZE.pack(len(content)) + content
        left = memoryview(record + _SIZE.pack(zlib.crc32(record)))
        try:
            self._stream.seek(0, os.SEEK_END)
            while left:
                left = left[self._stream.write(left) :]
            if time.monotonic() - self._safe_at > _SAFE_EVERY:
                os.fsync(self._stream.fileno())
                self._safe_at = time.monotonic()
        except OSError as error:
            where = f"after {self._kind.unit} {self.stored}"
            raise InputError(
                f"checkpoint {self.path} cannot be written {where} ({error.strerror}); it can be resumed"
            ) from None
        self.stored += 1


@contextmanager
def open_checkpoint(path: Path, kind: Kind, header: dict[str, Any], resume: bool) -> Iterator[Checkpoint]:
    """Open a checkpoint for a run that `header` describes.

    Parameters
    ----------
    path
        The file.
    kind
        What it holds.
    header
        Everything that the records depend on, by names for messages; ready for JSON.
    resume
        False: create a new file. True: continue the file, or create it if there is none.

    Raises
    ------
    InputError
        If the file cannot be written; if it exists and `resume` is False; if it is no checkpoint, of another run,
        damaged, or in use. The file is not changed then.
    """
    target = check_writable(path)
    if target.exists() and not resume:
        raise InputError(f"checkpoint must be a new file unless it is resumed, got {path}, which exists")
    text = json.dumps(header, sort_keys=True).encode()
    content = kind.magic + _SIZE.pack(len(text)) + text + _SIZE.pack(zlib.crc32(text))
    try:
        if not target.exists() and not begin(target, content):
            raise InputError(f"checkpoint must not be in use, got {path}, which another run has just begun")
        stream = FileIO(target, "r+b")
    except OSError as error:
        raise InputError(f"checkpoint must be a file that can be written, got {path} ({error.strerror})") from None
    with stream:
        _lock(path, stream)
        _check_header(path, kind, stream, header)
        start = stream.tell()
        stored, end = _scan(path, kind, stream)
        stream.truncate(end)
        yield Checkpoint(path, kind, stream, start, stored)
        os.fsync(stream.fileno())


def begin(target: Path, content: bytes) -> bool:
    """Create a new file atomically; return False if it exists by now, and leave it as it is."""
    temporary = target.with_name(f".{uuid.uuid4().hex}")
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        temporary.write_bytes(content)
        try:
            os.link(temporary, target)  # unlike renaming, this never replaces a file
        except FileExistsError:
            return False
        except OSError:  # a file system without links
            os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
    return True


def _lock(path: Path, stream: FileIO) -> None:
    """Lock the file as long as the stream is open, where the system has locks."""
    try:
        import fcntl
    except ModuleNotFoundError:
        return
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"checkpoint must not be in use, got {path}, to which another run is writing") from None
    except OSError:  # a network file system without locks
        return


def _check_header(path: Path, kind: Kind, stream: FileIO, header: dict[str, Any]) -> None:
    """Read the header; raise InputError unless it is that of this run."""
    if stream.read(len(kind.magic)) != kind.magic:
        what = kind.magic.decode().partition(" checkpoint")[0].replace(" ", "'s ", 1)
        raise InputError(f"checkpoint must be {ACCEPTED} or a new file, got {path}, which is no checkpoint of {what}")
    size = stream.read(_SIZE.size)
    text = stream.read(_SIZE.unpack(size)[0]) if len(size) == _SIZE.size else b""
    if stream.read(_SIZE.size) != _SIZE.pack(zlib.crc32(text)) or not text:
        raise InputError(f"checkpoint must be {ACCEPTED}, got {path} with a damaged header")
    stored = json.loads(text)
    for name in {**header, **stored}:
        if header.get(name) != stored.get(name):
            ours, theirs = (_brief(values.get(name)) for values in (header, stored))
            raise InputError(
                f"checkpoint must be {ACCEPTED}, got {path} of another run, with {name} {theirs}, not {ours}"
            )


def _scan(path: Path, kind: Kind, stream: FileIO) -> tuple[int, int]:
    """Return how many whole records there are, and where they end."""
    count, end = 0, stream.tell()
    length = os.fstat(stream.fileno()).st_size
    while _record(stream, kind) is not None:
        count, end = count + 1, stream.tell()
    longest = kind.longest_record
    stream.seek(end)
    stream.read(longest)
    # A power cut can leave a file as long as it was to be, with zeros where nothing was written.
    if length - end > longest and any(any(block) for block in iter(lambda: stream.read(longest), b"")):
        where = f"{kind.unit} {count}, byte {end}"
        raise InputError(f"checkpoint must be {ACCEPTED}, got {path}, which is damaged after {where}")
    return count, end


def _record(stream: FileIO, kind: Kind) -> bytes | None:
    """Return the content of the next record, or None if there is no whole one."""
    head = stream.read(_SIZE.size)
    if len(head) < _SIZE.size:
        return None
    (size,) = _SIZE.unpack(head)
    if not 0 < size <= kind.longest:
        return None
    content = stream.read(size)
    return content if stream.read(_SIZE.size) == _SIZE.pack(zlib.crc32(head + content)) else None


def _brief(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
