"""Check what HDF5 files, and so NetCDF 4 files, and Zarr folders declare, before any of it is read.

They may come from anyone. A file of a few kilobytes may declare terabytes, or expand to them; and parts of it may lie
in any other file of this machine, or in a named pipe, from which reading never ends.
"""

from __future__ import annotations

import math
import mmap
import os
import stat
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .inputs import InputError, printable

if TYPE_CHECKING:
    import h5py

ALWAYS_ACCEPTED = 100_000_000  # [bytes], whatever the size of the file
EXPANSION = 20  # larger contents may be so many times larger than their file: workspaces of less than 100 MB may be 70
MOST_BLOCKS = 20_000  # chunks of an array without data; each takes time also if it is not stored
STORED_BLOCK = 64  # [bytes] of the file that a stored chunk takes at least
MOST_PARTS = 600  # variables and attributes: a variable takes some milliseconds; a plan has 120, a flight 170
CHARACTER = 4  # [bytes] in memory
NUMBER = 8  # [bytes] of a number in memory, however short it is in the file
FIXED = 2**12  # [bytes] by which a chunk that does not compress may grow
HEAP = b"GCOL\1\0\0\0"  # what a global heap of HDF5 begins with: a list of texts, each with its number and length
HEADER = struct.Struct("<HHIQ")
FREE = 0  # the number of a space without a text; its length counts from its header on


class _Account:
    """Count the memory that the contents of a file will take, up to what is accepted.

    - `size`: of the file [bytes].
    - `accepted`: the most memory for its contents [bytes].
    """

    def __init__(self, size: int, always: int = ALWAYS_ACCEPTED):
        self.size, self.accepted = size, max(always, EXPANSION * size)
        self._bytes, self._blocks, self._parts = 0, 0, 0

    def part(self, name: str) -> None:
        """Count a variable or an attribute."""
        self._parts += 1
        if self._parts > MOST_PARTS:
            raise InputError(f"must have at most {MOST_PARTS} variables and attributes, got more ({_name(name)})")

    def memory(self, name: str, needed: int) -> None:
        """Count memory [bytes]."""
        self._bytes += needed
        self.block(name, self._bytes)

    def block(self, name: str, needed: int) -> None:
        """Check what is needed at once [bytes]."""
        if needed > self.accepted:
            accepted, size = self.accepted / 1e6, self.size / 1e6
            raise InputError(
                f"must hold at most {accepted:.0f} MB in a file of {size:.1f} MB, got {needed / 1e6:.0f} MB "
                f"({_name(name)})"
            )

    def chunks(self, name: str, shape: tuple[int, ...], chunks: tuple[int, ...], itemsize: int) -> None:
        """Count the chunks of an array; each is read as a whole, whatever part of it is wanted."""
        self.block(name, math.prod(chunks) * itemsize)
        if math.prod(shape):
            self._blocks += math.prod(-(-length // max(chunk, 1)) for length, chunk in zip(shape, chunks, strict=True))
        most = MOST_BLOCKS + self.size // STORED_BLOCK
        if self._blocks > most:
            raise InputError(f"must have at most {most} chunks, got more ({_name(name)})")


def check_heaps(content: bytes | mmap.mmap) -> None:
    """Check the lists of texts of a file: HDF5 never comes to the end of one whose free space has no length.

    Raises `InputError` if a list has such a space.
    """
    start = content.find(HEAP)
    while start >= 0 and start + HEADER.size <= len(content):
        *_, length = HEADER.unpack_from(content, start)
        place, end = start + HEADER.size, min(start + length, len(content))
        while place + HEADER.size <= end:
            number, _, _, length = HEADER.unpack_from(content, place)
            if number == FREE and length < HEADER.size:
                raise InputError(f"must have free spaces of at least {HEADER.size} bytes among its texts, got {length}")
            place += length if number == FREE else HEADER.size + -(-length // 8) * 8
        start = content.find(HEAP, start + 1)


def check_hdf5(
    file: h5py.File, size: int, wanted: Callable[[str], bool] = lambda name: True, always: int = ALWAYS_ACCEPTED
) -> dict[str, h5py.Dataset]:
    """Return the datasets at the top of an open file that are wanted, none of whose data has been read, by their names.

    - `file`: the open file.
    - `size`: its size [bytes].
    - `wanted`: whether a dataset is read; the others are not looked at. Default: all.
    - `always`: memory that the contents may take, however small the file is [bytes].

    Raises `InputError` if part of it is in another file, if it declares or expands to much more than its size, or is
    compressed in another way than gzip.
    """
    import h5py

    account = _Account(size, always)
    _check_attributes(file, account)
    found: dict[str, h5py.Dataset] = {}
    for name in map(str, file):
        if not wanted(name):
            continue
        account.part(name)
        if not isinstance(file.get(name, getlink=True), h5py.HardLink):
            raise InputError(f"{_name(name)} must be in the file itself, got a link")
        part = file[name]
        if isinstance(part, h5py.Dataset):
            _check_dataset(name, part.id, account)
            found[name] = part
        _check_attributes(part, account)
    return found


def _check_dataset(name: str, dataset: Any, account: _Account) -> None:
    import h5py

    layout = dataset.get_create_plist()
    # Before the shape, which in a virtual dataset depends on the other files.
    if layout.get_external_count() or layout.get_layout() == h5py.h5d.VIRTUAL:
        raise InputError(f"{_name(name)} must be in the file itself, got values in other files")
    kind = dataset.get_type()
    account.memory(name, math.prod(_as_read(dataset)) * max(kind.get_size(), NUMBER))
    chunks = layout.get_chunk() if layout.get_layout() == h5py.h5d.CHUNKED else None
    if chunks is not None:
        account.chunks(name, dataset.shape, chunks, kind.get_size())
    filters = [layout.get_filter(index)[0] for index in range(layout.get_nfilters())]
    checksum = h5py.h5z.FILTER_FLETCHER32
    if [code for code in filters if code != checksum] not in (
        [],
        [h5py.h5z.FILTER_SHUFFLE],
        [h5py.h5z.FILTER_DEFLATE],
        [h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE],
    ):
        raise InputError(f"{_name(name)} must be plain or compressed by gzip, got another compression")
    if chunks is not None and h5py.h5z.FILTER_DEFLATE in filters:
        _check_expansion(name, dataset, math.prod(chunks) * kind.get_size() + FIXED)
    if _has_any_length(kind):
        values, shape = h5py.Dataset(dataset), dataset.shape
        account.block(name, math.prod(shape[1:]) * account.size)
        step = max(1, account.accepted // max(1, math.prod(shape[1:]) * account.size))
        longest = 0
        for at in range(0, shape[0] if shape else 1, step):  # the first piece that is too long ends it
            longer = max(longest, _longest(values[at : at + step] if shape else values[()]))
            account.memory(name, math.prod(shape) * (longer - longest))
            longest = longer


def _as_read(dataset: Any) -> tuple[int, ...]:
    """Return the shape of a dataset in NetCDF: one shorter than its dimensions is filled up to them."""
    import h5py

    shape = list(dataset.shape)
    for axis, dimension in enumerate(h5py.Dataset(dataset).dims):
        shape[axis] = max([shape[axis], *(scale.size for scale in dimension.values() if scale.size)])
    return tuple(shape)


def _check_expansion(name: str, dataset: Any, most: int) -> None:
    """Expand each chunk, as far as it may: HDF5 takes as much memory as the compressed bytes expand to."""
    stored: list[Any] = []
    dataset.chunk_iter(stored.append)
    for chunk in stored:
        if chunk.size <= most:
            _, content = dataset.read_direct_chunk(chunk.chunk_offset)
            if len(zlib.decompressobj().decompress(content, most + 1)) <= most:
                continue
        raise InputError(f"{_name(name)} must have chunks of the size that it declares, got a larger one")


def _check_attributes(part: Any, account: _Account) -> None:
    import h5py

    for name in part.attrs:
        account.part(name)
        attribute = h5py.h5a.open(part.id, name.encode("utf-8", "surrogateescape"))
        kind = attribute.get_type()
        account.memory(name, math.prod(attribute.shape) * kind.get_size())
        if _has_any_length(kind):
            account.block(name, math.prod(attribute.shape) * account.size)
            account.memory(name, math.prod(attribute.shape) * _longest(part.attrs[name]))


def _longest(values: Any) -> int:
    """Return the memory of the longest of some texts or lists [bytes]: in an array all take as much as the longest."""
    flat = np.asarray(values, dtype=object).ravel()
    return max((CHARACTER * len(value) if np.ndim(value) == 0 else value.nbytes for value in flat), default=0)


def _has_any_length(kind: Any) -> bool:
    """Return whether values of a type have lengths of their own: they may all be one place of the file, of any size."""
    import h5py

    if isinstance(kind, h5py.h5t.TypeStringID):
        return kind.is_variable_str()
    if isinstance(kind, h5py.h5t.TypeVlenID):
        return True
    if kind.detect_class(h5py.h5t.VLEN) or kind.detect_class(h5py.h5t.STRING):
        raise InputError("must hold numbers and texts, got records with texts or lists in them")
    return False


def check_zarr(folder: Path) -> None:
    """Check a Zarr folder before any array of it is read.

    Raises `InputError` if it has anything but plain files, or its arrays declare much more than their size.
    """
    import zarr

    size = 0
    for where, folders, files in os.walk(folder):
        for name in (*folders, *files):
            found = os.lstat(Path(where, name))
            if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
                raise InputError(f"{_name(name)} must be a file or a folder, got a link, a device or a pipe")
            size += found.st_size if stat.S_ISREG(found.st_mode) else 0
    account = _Account(size)
    for name, array in zarr.open_group(folder, mode="r").arrays():
        account.part(name)
        account.memory(name, math.prod(array.shape) * max(array.dtype.itemsize, NUMBER))
        account.chunks(name, array.shape, array.chunks, array.dtype.itemsize)


def _name(name: str) -> str:
    return printable(name, 60)
