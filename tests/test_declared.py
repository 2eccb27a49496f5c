"""Files that declare or expand to far more than their size are refused before they are read, by every reader."""

import os
import threading
import time
import tracemalloc
import zlib
from functools import cache

import h5py
import numpy as np
import pytest
import xarray as xr

from towline import InputError, load, read_measurements, simulate
from towline.base.declared import check_hdf5, check_heaps
from towline.base.netcdf import load_netcdf
from towline.viewer import read
from towline.workspace import StaticEquilibrium, sample, save

READERS = {
    "calibrate": read_measurements,
    "simulate": lambda file: simulate("wang-flying", file, duration=0.01),
    "view": read,
    "load": lambda file: load_netcdf(file, "file must be a plan"),
}
MOST_MEMORY = 300e6  # [bytes]


def written(path, fill):
    with h5py.File(path, "w") as file:
        fill(file)
    return path


def zeros(count):
    """Fill a file with nothing but the promise of numbers."""

    def fill(file):
        variable = file.create_dataset("l0", (count,), "f8", chunks=(min(count, 10**6),), compression="gzip")
        variable.attrs["units"] = "m"

    return fill


@cache
def packed_zeros():
    packed = zlib.compressobj(9)
    return b"".join(packed.compress(bytes(10**7)) for _ in range(30)) + packed.flush()


def stored_otherwise(file):
    """Fill a chunk of 8 kB with 2 GB: HDF5 gives what the compressed bytes ask for."""
    variable = file.create_dataset("l0", (1000,), "f8", chunks=(1000,), compression="gzip")
    variable.attrs["units"] = "m"
    variable.id.write_direct_chunk((0,), packed_zeros())


def twice_compressed(file):
    kind = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    kind.set_chunk((1000,))
    kind.set_deflate(9)
    kind.set_deflate(9)
    h5py.h5d.create(file.id, b"l0", h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple((1000,)), kind)


def with_large_chunks(file):
    """Fill one chunk of 2.4 GB with ten numbers."""
    kind = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    kind.set_chunk((3 * 10**8,))
    space = h5py.h5s.create_simple((10,), (h5py.h5s.UNLIMITED,))
    h5py.h5d.create(file.id, b"l0", h5py.h5t.IEEE_F64LE, space, kind)


def shorter_than_its_dimension(file):
    """Let three numbers be all that is stored of 10^7: what is missing is filled up as the file is read."""
    file.create_dataset("time", (10**7,), "f8", chunks=(10**6,)).make_scale("time")
    for name in ("l0", "l1"):
        file[name] = np.ones(3)
        file[name].dims[0].attach_scale(file["time"])


CASES = {
    "2.4 GB": (zeros(3 * 10**8), r"must hold at most (40|100) MB in a file of 0\.0 MB, got 2400 MB \(l0\)"),
    "8 TB": (zeros(10**12), "got 8000000 MB"),
    "bytes": (lambda file: file.create_dataset("l0", (10**8,), "i1", chunks=(10**6,)), "got 800 MB"),
    "fill value": (lambda file: file.create_dataset("l0", (10**8,), "f8", fillvalue=1.0), "got 800 MB"),
    "chunk": (stored_otherwise, "l0 must have chunks of the size that it declares"),
    "large chunk": (with_large_chunks, "got 2400 MB"),
    "many chunks": (lambda file: file.create_dataset("l0", (10**6,), "f8", chunks=(1,)), r"at most 200\d\d chunks"),
    "short": (shorter_than_its_dimension, r"got (80|160) MB \(l[01]\)"),
    "compressed twice": (twice_compressed, "l0 must be plain or compressed by gzip"),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("case", CASES)
def test_a_bomb_is_refused_before_it_is_read(case, reader, tmp_path):
    fill, message = CASES[case]
    file = written(tmp_path / "bomb.nc", fill)
    start = time.process_time()
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=message) as error:
            READERS[reader](file)
        assert tracemalloc.get_traced_memory()[1] < MOST_MEMORY
    finally:
        tracemalloc.stop()
    assert time.process_time() - start < 10  # also what loads only once
    assert str(error.value).isprintable()


def test_texts_that_are_all_one_place_of_the_file_are_refused(tmp_path):
    """2000 texts of 1 MB, in a file of 1 MB: values of any length are places in it, here all the same one."""

    def fill(file):
        texts = file.create_dataset("l0", (2000,), h5py.string_dtype())
        texts[0] = "x" * 10**6

    path = written(tmp_path / "texts.nc", fill)
    with h5py.File(path) as file:
        start = file["l0"].id.get_offset()
    content = bytearray(path.read_bytes())
    content[start : start + 2000 * 16] = bytes(content[start : start + 16]) * 2000
    path.write_bytes(content)
    for reader in READERS.values():
        with pytest.raises(InputError, match=r"must hold at most (40|100) MB in a file of 1"):
            reader(path)


def test_texts_of_which_one_is_long_are_refused(tmp_path):
    """In an array of texts each takes as much memory as the longest: 5000 times 1.6 MB, in a file of 0.4 MB."""

    def fill(file):
        file.create_dataset("l0", (5000,), h5py.string_dtype())[0] = "x" * 400_000

    path = written(tmp_path / "texts.nc", fill)
    for reader in READERS.values():
        with pytest.raises(InputError, match=r"got 8000 MB \(l0\)"):
            reader(path)


def test_more_variables_or_attributes_than_anyone_needs_are_refused(tmp_path):
    def variables(file):
        for index in range(601):
            file[f"v{index}"] = 0

    def attributes(file):
        file["l0"] = np.ones(3)
        for index in range(601):
            file["l0"].attrs[f"a{index}"] = 0

    for name, fill in (("variables", variables), ("attributes", attributes)):
        with pytest.raises(InputError, match="must have at most 600 variables and attributes"):
            READERS["load"](written(tmp_path / name, fill))


def test_a_log_is_read_beside_what_is_not_read(tmp_path):
    """Variables of other names may be of any size: a recording has pictures, too."""

    def fill(file):
        for name in ("l0", "l1"):
            file[name] = np.arange(1.0, 4.0)
            file[name].attrs["units"] = "m"
        file.create_dataset("picture", (10**9,), "i1", chunks=(10**6,), compression="gzip")

    assert read_measurements(written(tmp_path / "log.nc", fill)).lengths.tolist() == [[1, 1], [2, 2], [3, 3]]


def test_what_towline_and_xarray_compress_is_accepted(tmp_path):
    """The best compressed of ours: cells of a grid; and of others: gzip with any of its companions, chunked."""
    result = sample(load("wang-flying"), StaticEquilibrium(), samples=100_000, method="grid", keep="all")
    for name in ("grid.nc", "grid.zarr"):
        file = save(result, tmp_path / name)
        assert read(file).kind == "workspace"
    assert result["position"].nbytes > 20 * (tmp_path / "grid.nc").stat().st_size
    plain = xr.Dataset({"x": (("row", "column"), np.zeros((3000, 100))), "text": (("row",), ["abc"] * 3000)})
    for number, packing in enumerate(({"zlib": True}, {"gzip": 9, "fletcher32": True}, {"chunksizes": (10, 100)})):
        encoding = {"x": packing if "gzip" not in packing else {"zlib": True, "fletcher32": True, "shuffle": False}}
        plain.to_netcdf(tmp_path / f"{number}.nc", engine="h5netcdf", encoding=encoding)
        xr.testing.assert_identical(load_netcdf(tmp_path / f"{number}.nc", "file must be readable"), plain)


def test_a_zarr_folder_is_checked_before_it_is_read(tmp_path):
    zarr = pytest.importorskip("zarr")
    for name, shape, chunks, message in (
        ("large", (3 * 10**8,), (10**6,), "must hold at most 100 MB in a file of 0\\.0 MB, got 2400 MB"),
        ("chunk", (10,), (3 * 10**8,), "got 2400 MB"),
        ("many", (10**6,), (1,), "chunks, got more"),
    ):
        group = zarr.open_group(tmp_path / f"{name}.zarr", mode="w", zarr_format=2)
        array = group.create_array("position", shape=shape, chunks=chunks, dtype="f8")
        array.attrs["_ARRAY_DIMENSIONS"] = ["point"]
        with pytest.raises(InputError, match=message):
            read(tmp_path / f"{name}.zarr")


def test_the_size_of_the_file_decides_how_much_it_may_hold(tmp_path):
    path = written(tmp_path / "x.nc", lambda file: file.create_dataset("x", (15_000_000,), "f8"))
    with h5py.File(path) as file:
        assert list(check_hdf5(file, 6_000_000)) == ["x"]  # 20 times as large
        with pytest.raises(InputError, match=r"must hold at most 118 MB in a file of 5\.9 MB, got 120 MB"):
            check_hdf5(file, 5_900_000)


def elsewhere(kind, pipe):
    """Fill a file whose lengths are in another file: in a named pipe, from which reading never ends."""

    def fill(file):
        if kind == "external storage":
            file.create_dataset("l0", (10,), "f8", external=[(str(pipe), 0, 80)])
        elif kind == "virtual dataset":
            layout = h5py.VirtualLayout((10,), "f8")
            layout[:] = h5py.VirtualSource(str(pipe), "x", (10,))
            file.create_virtual_dataset("l0", layout)
        elif kind == "endless virtual dataset":  # whose shape is that of the other file
            layout, space = (
                h5py.h5p.create(h5py.h5p.DATASET_CREATE),
                h5py.h5s.create_simple((10,), (h5py.h5s.UNLIMITED,)),
            )
            rows = space.copy()
            rows.select_hyperslab((0,), (1,), (1,), (h5py.h5s.UNLIMITED,))
            layout.set_virtual(rows, str(pipe).encode(), b"x", rows)
            h5py.h5d.create(file.id, b"l0", h5py.h5t.IEEE_F64LE, space, layout)
        elif kind == "external link":
            file["l0"] = h5py.ExternalLink(str(pipe), "x")
        else:
            file["group"] = h5py.ExternalLink(str(pipe), "/")
            file["l0"] = h5py.SoftLink("/group/x")

    return fill


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(
    "kind", ["external storage", "virtual dataset", "endless virtual dataset", "external link", "soft link"]
)
def test_a_file_whose_numbers_are_in_another_file_is_refused(kind, reader, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    file = written(tmp_path / "log.nc", elsewhere(kind, pipe))
    ends = threading.Timer(20, lambda: os.close(os.open(pipe, os.O_WRONLY)))  # so that a failure of this test ends
    ends.daemon = True
    ends.start()
    try:
        with pytest.raises(InputError, match=r"(l0|group) must be in the file itself, got") as error:
            READERS[reader](file)
    finally:
        ends.cancel()
    assert str(error.value).isprintable()


def test_pipes_devices_and_links_of_a_folder_are_refused(tmp_path):
    pipe = tmp_path / "pipe.nc"
    os.mkfifo(pipe)
    for reader in READERS.values():
        with pytest.raises(InputError):
            reader(pipe)
    pytest.importorskip("zarr")
    xr.Dataset({"position": (("point", "axis"), np.zeros((3, 3)))}).to_zarr(tmp_path / "a.zarr", zarr_format=2)
    chunk = tmp_path / "a.zarr" / "position" / "0.0"
    chunk.unlink()
    chunk.symlink_to(pipe)
    with pytest.raises(InputError, match=r"0\.0 must be a file or a folder, got a link, a device or a pipe"):
        read(tmp_path / "a.zarr")


@pytest.mark.parametrize("reader", READERS)
def test_a_list_of_texts_without_end_is_refused(tmp_path, reader):
    """HDF5 skips a free space among texts by its length: with a length of 0 it stays there for ever."""

    def texts(file):
        file.attrs["units"] = "m"  # a text of any length, in a global heap of 4 kB
        file.create_dataset("l0", data=np.zeros(3)).attrs["units"] = "m"

    path = written(tmp_path / "log.nc", texts)
    content = bytearray(path.read_bytes())
    place = content.index(b"GCOL") + 16
    while number := int.from_bytes(content[place : place + 2], "little"):
        place += 16 + -(-int.from_bytes(content[place + 8 : place + 16], "little") // 8) * 8
    assert number == 0
    assert int.from_bytes(content[place + 8 : place + 16], "little") > 3000  # the rest of the heap
    with h5py.File(path) as file:
        assert list(check_hdf5(file, len(content))) == ["l0"]
    check_heaps(bytes(content))
    content[place + 8 : place + 16] = bytes(8)
    path.write_bytes(content)
    with pytest.raises(InputError, match="free spaces of at least 16 bytes among its texts, got 0") as caught:
        READERS[reader](path)
    assert "\n" not in str(caught.value)
