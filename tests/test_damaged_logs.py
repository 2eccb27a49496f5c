"""Logs whose bytes changed on a disk: what is damaged is no measurement."""

import pytest

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
