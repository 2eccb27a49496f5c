r"""Checkpoints: the answers so far in a file that only grows, so that a run that was killed goes on where it was.

A line that tells what the file is, a header, records:

    towline workspace checkpoint 1\n
    length of the header (uint32), header (JSON: all that decides on the answers), its CRC-32
    for each chunk in turn: chunk (uint64), samples (uint32), accepted (uint32), flags (one bit a sample), CRC-32

Integers are little-endian. A record that was cut short by the end of the process is dropped; any other damage is told,
and such a file is never written to.
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
_SAFE_EVERY = 1.0  # [s] between writes that outlive a power cut


class Checkpoint:
    """An open checkpoint: reads what it has, chunk by chunk, then appends.

    Attributes
    ----------
    stored
        How many chunks it had when it was opened.
    """

    def __init__(self, path: Path, stream: FileIO, start: int, stored: int):
        self.stored = stored
        self._path, self._stream, self._read = path, stream, 0
        self._safe_at = time.monotonic()
        stream.seek(start)

    def answer(self, chunk: int, size: int) -> bytes | None:
        """The packed flags of a chunk, or None if it is not there; to be asked for chunk after chunk.

        Raises
        ------
        InputError
            If the chunk there is not of this size.
        """
        if chunk >= self.stored:
            return None
        record = _record(self._stream)
        if record is None or chunk != self._read or record[:2] != (chunk, size):
            raise InputError(f"{self._path}: chunk {chunk} is not of this run; accepted: {ACCEPTED}")
        self._read += 1
        return record[2]

    def append(self, chunk: int, size: int, flags: bytes) -> None:
        """Add a chunk; those that are there already are not added again.

        Raises
        ------
        InputError
            If there is no room for it. What was there before is safe.
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
                f"{self._path}: cannot be written ({error.strerror}) after chunk {chunk}; accepted: to resume it, once "
                "there is room"
            ) from None


@contextmanager
def open_checkpoint(path: Path, header: dict[str, Any], resume: bool) -> Iterator[Checkpoint]:
    """Open a checkpoint for a run that `header` describes.

    Parameters
    ----------
    resume
        False: a new file. True: go on with the file, or begin it if there is none.

    Raises
    ------
    InputError
        If the file cannot be written; if it is there and `resume` is False; if it is no checkpoint, of another run,
        damaged, or in use. It is left as it was then.
    """
    target = check_writable(path)
    if target.exists() and not resume:
        raise InputError(f"{path}: is there already; accepted: a new path, or resume to go on with it")
    text = json.dumps(header, sort_keys=True).encode()
    try:
        if not target.exists() and not begin(target, MAGIC + _SUM.pack(len(text)) + text + _SUM.pack(zlib.crc32(text))):
            raise InputError(f"{path}: another run has just begun it; accepted: a checkpoint that is not in use")
        stream = FileIO(target, "r+b")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); accepted: a writable place") from None
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
    """Make a new file, whole or not at all; False if there is one by now, which is left as it is."""
    temporary = target.with_name(f".{uuid.uuid4().hex}")
    try:
        temporary.write_bytes(content)
        try:
            os.link(temporary, target)  # other than a renaming it never replaces a file
        except FileExistsError:
            return False
        except OSError:  # a file system without links
            os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
    return True


def _lock(path: Path, stream: FileIO) -> None:
    """Keep other processes away as long as the stream is open, where the system can."""
    try:
        import fcntl
    except ModuleNotFoundError:
        return
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(f"{path}: another run is writing to it; accepted: a checkpoint that is not in use") from None
    except OSError:  # a network file system without locks
        return


def _check_header(path: Path, stream: FileIO, header: dict[str, Any]) -> None:
    """Read the header, and raise unless it is this run's."""
    if stream.read(len(MAGIC)) != MAGIC:
        raise InputError(f"{path}: is no checkpoint of towline; accepted: {ACCEPTED}, or a new path")
    size = stream.read(_SUM.size)
    text = stream.read(_SUM.unpack(size)[0]) if len(size) == _SUM.size else b""
    if stream.read(_SUM.size) != _SUM.pack(zlib.crc32(text)) or not text:
        raise InputError(f"{path}: its header is damaged; accepted: {ACCEPTED}")
    there = json.loads(text)
    for name in {**header, **there}:
        if header.get(name) != there.get(name):
            ours, theirs = (_brief(values.get(name)) for values in (header, there))
            raise InputError(f"{path}: is of another run: its {name} is {theirs}, not {ours}; accepted: {ACCEPTED}")


def _scan(path: Path, stream: FileIO) -> tuple[int, int]:
    """How many whole records there are, and where they end."""
    chunk, end = 0, stream.tell()
    length = os.fstat(stream.fileno()).st_size
    while (record := _record(stream)) is not None and record[0] == chunk:
        chunk, end = chunk + 1, stream.tell()
    stream.seek(end)
    stream.read(_LONGEST)
    # A power cut can leave a file as long as it was to be, with zeros where nothing was written.
    if length - end > _LONGEST and any(any(block) for block in iter(lambda: stream.read(_LONGEST), b"")):
        raise InputError(f"{path}: is damaged after chunk {chunk}, byte {end}; accepted: {ACCEPTED}")
    return chunk, end


def _record(stream: FileIO) -> tuple[int, int, bytes] | None:
    """The next record, (chunk, samples, flags), or None if there is no whole one."""
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
