"""Checkpoints of workspaces: which samples of each chunk are accepted.

The content of a record: chunk (uint64), samples (uint32), flags (one bit a sample); integers are little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..base.checkpoint import ACCEPTED, Checkpoint, Kind, open_checkpoint
from ..base.errors import InputError
from .sampling import CHUNK

_HEAD = struct.Struct("<QI")
KIND = Kind(b"towline workspace checkpoint 2\n", "chunk", _HEAD.size + CHUNK // 8)


class ChunkCheckpoint:
    """Read the chunks of an open checkpoint one by one, then append."""

    def __init__(self, records: Checkpoint):
        self._records, self._known, self._read = records, records.stored, 0

    def flags(self, chunk: int, size: int) -> bytes | None:
        """Return the packed flags of a chunk, or None if the file does not have it; chunks are read in their order.

        Raises
        ------
        InputError
            If the chunk in the file has another number or size.
        """
        if chunk >= self._known:
            return None
        content = self._records.read() or b""
        head, flags = content[: _HEAD.size], content[_HEAD.size :]
        if chunk != self._read or head != _HEAD.pack(chunk, size) or len(flags) != -(-size // 8):
            path = self._records.path
            raise InputError(f"checkpoint must be {ACCEPTED}, got {path} whose chunk {chunk} is of another run")
        self._read += 1
        return flags

    def append(self, chunk: int, size: int, flags: bytes) -> None:
        """Append a chunk, unless the file has it already; raise InputError as `Checkpoint.append` does."""
        if chunk >= self._known:
            self._records.append(_HEAD.pack(chunk, size) + flags)


@contextmanager
def open_chunks(path: Path, header: dict[str, Any], resume: bool) -> Iterator[ChunkCheckpoint]:
    """Open a checkpoint of chunks, as `open_checkpoint` does."""
    with open_checkpoint(path, KIND, header, resume) as records:
        yield ChunkCheckpoint(records)
