"""Logs whose bytes changed on a disk: what is damaged is no measurement."""

import gzip
import warnings

import numpy as np
import pytest
import xarray as xr

from towline.base.errors import InputError
from towline.estimation.logs import read_log, recordings

mcap = pytest.importorskip("mcap.writer", reason="the extra logs reads MCAP")


def test_damaged_numbers_are_no_measurements(tmp_path):
    """A chunk has a check sum; a table, which has none, may say that a cable is 1e200 m long."""
    CompressionType, Writer = mcap.CompressionType, mcap.Writer
    with (tmp_path / "log.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        channel = writer.register_channel("/winch", "json", writer.register_schema("l", "jsonschema", b"{}"))
        for i in range(5):
            writer.add_message(channel, i, b'{"l1": 1.25}', i)
        writer.finish()
    content = (tmp_path / "log.mcap").read_bytes()
    (tmp_path / "log.mcap").write_bytes(content.replace(b"1.25", b"1.75", 1))
    with pytest.raises(InputError, match=r"got a damaged file .*crc validation failed"):
        recordings(tmp_path / "log.mcap")
    (tmp_path / "log.csv").write_text("t,l1\n0,1\n1,1e200\n2,1\n")
    with pytest.raises(InputError, match=r"l1 must be at most 1e.09, got 1e.200 at sample 1"):
        read_log(tmp_path / "log.csv")


def test_tables_of_spreadsheets_and_of_text_files_opened_twice(tmp_path):
    """UTF-16, two byte order marks, and ends of lines that were written twice: no sample is lost."""
    text = "t,l1,l2\ns,mm,mm\n0,1000,2000\n1,1001,2001\n2,1002,2002\n"
    forms = {
        "utf16": text.replace(",", "\t").encode("utf-16"),
        "marks": b"\xef\xbb\xbf" + text.encode("utf-8-sig"),
        "ends": text.replace("\n", "\r\r\n").encode(),
    }
    for name, content in forms.items():
        (tmp_path / f"{name}.csv").write_bytes(content)
        read = read_log(tmp_path / f"{name}.csv").measurements
        np.testing.assert_allclose(read.lengths, [[1, 2], [1.001, 2.001], [1.002, 2.002]], err_msg=name)
        np.testing.assert_array_equal(read.times, [0, 1, 2])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (gzip.compress(b"t,l1\n0,1\n", mtime=0)[:15], r"got one that is packed \(gzip\); unpack it first"),
        (b"t|l1\n0|1\n", r"line 2 must have numbers below the header, got '0\|1'"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 9\n", "line 2 must have numbers below"),
        (b"t,l1,x,y,z\n0,1,0,0,1\n1,1,inf,0,1\n2,1,0,0,1\n", "poses must have rows that are finite or nan as a whole"),
    ],
)
def test_what_is_no_table_is_one_line(content, message, tmp_path):
    (tmp_path / "log.csv").write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match=message) as error:
            read_log(tmp_path / "log.csv")
    assert str(error.value).isprintable()


def test_a_map_that_names_nothing(tmp_path):
    (tmp_path / "log.csv").write_text("t,l1\n0,1\n1,1\n")
    (tmp_path / "map.yaml").write_text("lengths: ''\n")
    with pytest.raises(InputError, match="map: lengths must name fields of the log, got ; the log has the table"):
        read_log(tmp_path / "log.csv", fields=tmp_path / "map.yaml")


def test_packed_numbers_of_netcdf(tmp_path):
    """Lengths in whole millimetres from 1 m, as the CF conventions write them, with one missing sample."""
    lengths = np.array([[1.5, 2.0], [np.nan, np.nan], [1.7, 2.2]])
    variables = {"cable_lengths": (("time", "cable"), lengths, {"units": "m"})}
    log = xr.Dataset(variables, {"time": ("time", np.arange(3.0), {"units": "s"})})
    packed = {"cable_lengths": {"scale_factor": 1e-3, "add_offset": 1.0, "dtype": "i2", "_FillValue": -999}}
    log.to_netcdf(tmp_path / "log.nc", engine="h5netcdf", encoding=packed)
    read = read_log(tmp_path / "log.nc")
    np.testing.assert_allclose(read.measurements.lengths, lengths[[0, 2]])
    assert "samples skipped because lengths or tensions are missing: 1" in read.notes
