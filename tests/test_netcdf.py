"""Datasets as NetCDF files: what xarray reads is what xarray would have written."""

import gc
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

from towline.base.errors import InputError
from towline.base.netcdf import Contents, Variable, load_netcdf, numbers_of, save_netcdf

CONTENTS = Contents(
    {
        "tensions": Variable(("time", "cable"), np.arange(6.0).reshape(3, 2), {"units": "N"}),
        "slack": Variable(("cable",), np.array([True, False])),
        "status": Variable(("time",), np.array(["optimal", "µ", ""])),
        "margin": Variable((), np.array(np.nan), {"units": "N"}),
        "count": Variable(("carrier",), np.array([2**40])),
        "empty": Variable(("point", "cable"), np.zeros((0, 2))),
    },
    {
        "time": Variable(("time",), np.array([0.0, 0.5, 1.0]), {"units": "s"}),
        "cable": Variable(("cable",), np.array([1, 2])),
        "carrier": Variable(("carrier",), np.array(["quad"])),
        "carrier_kind": Variable(("carrier",), np.array(["prescribed"])),
    },
    {"title": "a plan", "samples": 7, "seconds": 0.25, "robot": "name: x\n" * 20_000},
)


def test_what_is_read_is_what_xarray_would_have_saved(tmp_path):
    save_netcdf(CONTENTS, tmp_path / "ours.nc")
    CONTENTS.dataset().to_netcdf(tmp_path / "theirs.nc", engine="h5netcdf")
    ours, theirs = (xr.load_dataset(tmp_path / name) for name in ("ours.nc", "theirs.nc"))
    xr.testing.assert_identical(ours, theirs)
    assert {name: ours[name].dtype for name in ours.variables} == {name: theirs[name].dtype for name in ours.variables}
    assert set(ours.coords) == set(CONTENTS.coordinates)
    xr.testing.assert_identical(Contents.of(ours).dataset(), ours)


def test_equal_contents_are_equal_files_and_compressed_ones_smaller(tmp_path):
    many = CONTENTS._replace(variables={"zero": Variable(("point", "axis"), np.zeros((10_000, 3)))})
    for name, compressed in (("one", ()), ("two", ()), ("packed", ["zero"])):
        save_netcdf(many, tmp_path / name, compressed)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    assert (tmp_path / "packed").stat().st_size < 0.5 * (tmp_path / "one").stat().st_size
    xr.testing.assert_identical(xr.load_dataset(tmp_path / "packed"), xr.load_dataset(tmp_path / "one"))


def test_a_place_that_cannot_be_written_to_is_named(tmp_path):
    with pytest.raises(InputError, match="must be the path of a file, got a folder"):
        save_netcdf(CONTENTS, tmp_path)


def test_saving_loads_no_ecosystem(tmp_path):
    """Xarray, pandas and dask cost a second each, and more than the file does."""
    code = f"""
import sys, numpy, pathlib
from towline.base.netcdf import Contents, Variable, save_netcdf
save_netcdf(Contents({{"x": Variable(("row",), numpy.ones(3))}}, {{}}, {{}}), pathlib.Path({str(tmp_path / "x.nc")!r}))
print(*sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"xarray", "pandas", "dask", "scipy", "casadi"} & set(done.stdout.split())


@pytest.mark.filterwarnings("error")
def test_damaged_files_are_refused_in_one_line_and_leave_no_traceback(tmp_path, capfd):
    """Closing a file that h5netcdf could open only half prints a traceback as soon as it is collected."""
    whole, draw, refusals = save_netcdf(CONTENTS, tmp_path / "whole.nc").read_bytes(), np.random.default_rng(5), []
    for _ in range(10):
        content = bytearray(whole[: int(draw.integers(0, 3 * len(whole)))])
        for at in draw.integers(0, max(len(content), 1), 30 if content else 0):
            content[at] = draw.integers(256)
        (tmp_path / "damaged.nc").write_bytes(content)
        try:
            load_netcdf(tmp_path / "damaged.nc", "file must be a plan")
        except InputError as error:
            refusals.append(str(error))
    assert len(refusals) > 5
    assert all(line.startswith("file must be a plan (") and line.isprintable() for line in refusals)
    gc.collect()
    assert capfd.readouterr() == ("", "")


def test_a_variable_is_read_without_the_others_of_a_dataset():
    """A workspace in a Zarr folder may be larger than the memory."""
    delayed = pytest.importorskip("dask").delayed
    array = pytest.importorskip("dask.array")

    def fail():
        raise AssertionError("another variable was read")

    large = array.from_delayed(delayed(fail)(), (3,), float)
    dataset = xr.Dataset({"time": ("n", [0.0, 1.0, 2.0]), "large": ("n", large)})
    np.testing.assert_array_equal(numbers_of(dataset, "time", (3,), "file"), [0.0, 1.0, 2.0])
