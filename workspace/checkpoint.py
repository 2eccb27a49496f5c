r"""Checkpoints: the results so far in a file that only grows, so that a run that was stopped can be resumed.

The file has a first line that identifies it, a header, and records:

    towline workspace checkpoint 1\n
    length of the header (uint32), header (JSON: everything the flags depend on), its CRC-32
    for each chunk in turn: chunk (uint64), samples (uint32), accepted (uint32), flags (one bit a sample), CRC-32

Integers are little-endian. A record that was cut short by the end of the process is dropped; any other damage
is an error, and such a file is never written to.
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
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..writing import check_writable
from .sampling import CHUNK

MAGIC = b"towline workspace checkpoint 1\n"
ACCEPTED = "a checkpoint of this run"
_HEAD, _SUM = struct.Struct("<QII"), struct.Struct("<I")
_LONGEST = _HEAD.size + CHUNK // 8 + _SUM.size  # of a record
_SAFE_EVERY = 1.0  # [s] between writes that survive a power cut


class Checkpoint:
    """Read the chunks of an open checkpoint one by one, then append.

    Attributes
    ----------
    stored
        Number of chunks that it had when it was opened.
    """

    def __init__(self, path: Path, stream: FileIO, start: int, stored: int):
        self.stored = stored
        self._path, self._stream, self._read = path, stream, 0
        self._safe_at = time.monotonic()
        stream.seek(start)

    def flags(self, chunk: int, size: int) -> bytes | None:
        """Return the packed flags of a chunk, or None if the file does not have it; chunks are read in their order.

        Raises
        ------
        InputError
            If the chunk in the file has another number or size.
        """
        if chunk >= self.stored:
            return None
        record = _record(self._stream)
        if record is None or chunk != self._read or record[:2] != (chunk, size):
            raise InputError(f"checkpoint must be {ACCEPTED}, got {self._path} whose chunk {chunk} is of another run")
        self._read += 1
        return record[2]

    def append(self, chunk: int, size: int, flags: bytes) -> None:
        """Append a chunk, unless the file has it already.

        Raises
        ------
        InputError
            If it cannot be written, as on a full disk. The file can be resumed.
        """
        if chunk < self.stored:
            return
        accepted = int(np.unpackbits(np.frombuffer(flags, np.uint8)).sum())
        record = _HEAD.pack(chunk, size, accepted) + flags
        left = memoryview(record + _SUM.pack(zlib.crc32(record)))
        try:
            self._stream.seek(0, os.SEEK_END)
            while left:
                left = left[self._stream.write(left) :]
            if time.monotonic() - self._safe_at > _SAFE_EVERY:
                os.fsync(self._stream.fileno())
                self._safe_at = time.monotonic()
        except OSError as error:
            raise InputError(
                f"checkpoint {self._path} cannot be written after chunk {chunk} ({error.strerror}); it can be resumed"
            ) from None


@contextmanager
def open_checkpoint(path: Path, header: dict[str, Any], resume: bool) -> Iterator[Checkpoint]:
    """Open a checkpoint for a run that `header` describes.

    Parameters
    ----------
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
    try:
        if not target.exists() and not begin(target, MAGIC + _SUM.pack(len(text)) + text + _SUM.pack(zlib.crc32(text))):
            raise InputError(f"checkpoint must not be in use, got {path}, which another run has just begun")
        stream = FileIO(target, "r+b")
    except OSError as error:
        raise InputError(f"checkpoint must be a file that can be written, got {path} ({error.strerror})") from None
    with stream:
        _lock(path, stream)
        _check_header(path, stream, header)
        start = stream.tell()
        stored, end = _scan(path, stream)
        stream.truncate(end)
        checkpoint = Checkpoint(path, stream, start, stored)
        yield checkpoint
        os.fsync(stream.fileno())


def begin(target: Path, content: bytes) -> bool:
    """Create a new file, whole or not at all; return False if it exists by now, and leave it as it is."""
    temporary = target.with_name(f".{uuid.uuid4().hex}")
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


def _check_header(path: Path, stream: FileIO, header: dict[str, Any]) -> None:
    """Read the header; raise InputError unless it is that of this run."""
    if stream.read(len(MAGIC)) != MAGIC:
        raise InputError(f"checkpoint must be {ACCEPTED} or a new file, got {path}, which is no checkpoint of towline")
    size = stream.read(_SUM.size)
    text = stream.read(_SUM.unpack(size)[0]) if len(size) == _SUM.size else b""
    if stream.read(_SUM.size) != _SUM.pack(zlib.crc32(text)) or not text:
        raise InputError(f"checkpoint must be {ACCEPTED}, got {path} with a damaged header")
    stored = json.loads(text)
    for name in {**header, **stored}:
        if header.get(name) != stored.get(name):
            ours, theirs = (_brief(values.get(name)) for values in (header, stored))
            raise InputError(
                f"checkpoint must be {ACCEPTED}, got {path} of another run, whose {name} is {theirs}, not {ours}"
            )


def _scan(path: Path, stream: FileIO) -> tuple[int, int]:
    """Return how many whole records there are, and where they end."""
    chunk, end = 0, stream.tell()
    length = os.fstat(stream.fileno()).st_size
    while (record := _record(stream)) is not None and record[0] == chunk:
        chunk, end = chunk + 1, stream.tell()
    stream.seek(end)
    stream.read(_LONGEST)
    # A power cut can leave a file as long as it was to be, with zeros where nothing was written.
    if length - end > _LONGEST and any(any(block) for block in iter(lambda: stream.read(_LONGEST), b"")):
        raise InputError(f"checkpoint must be {ACCEPTED}, got {path}, which is damaged after chunk {chunk}, byte {end}")
    return chunk, end


def _record(stream: FileIO) -> tuple[int, int, bytes] | None:
    """Return the next record, (chunk, samples, flags), or None if there is no whole one."""
    head = stream.read(_HEAD.size)
    if len(head) < _HEAD.size:
        return None
    chunk, size, accepted = _HEAD.unpack(head)
    if size > CHUNK or accepted > size:
        return None
    flags = stream.read(-(-size // 8))
    if stream.read(_SUM.size) != _SUM.pack(zlib.crc32(head + flags)):
        return None
    return chunk, size, flags


def _brief(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
