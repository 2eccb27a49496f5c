"""Files that other programs or accidents made: motions with other units, times or types are refused in one line."""

import time
import warnings

import h5py
import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from towline import InputError, Task, load, plan, read_measurements, simulate
from towline.cli.main import app
from towline.models.parsing import _without_branches, parse_yaml
from towline.models.uncertainty import Uncertainty
from towline.viewer import read
from towline.workspace import Lengths

REST = {"name": "rest", "path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 0.3}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return plan("wang-flying", REST).save(tmp_path_factory.mktemp("plan") / "rest.nc")


def changed(dataset, name, values=None, **attributes):
    """Return a dataset with another array or other attributes of one variable."""
    variable = dataset[name]
    array = variable.values if values is None else values(variable.values)
    return dataset.assign({name: (variable.dims, array, {**variable.attrs, **attributes})})


WRONG = {
    "pose in mm": ("pose", {"units": "mm, deg"}, "pose must have the units 'm, rad', got 'mm, deg'"),
    "time in ms": ("time", {"units": "ms"}, "time must have the units 's', got 'ms'"),
    "a carrier in feet": ("carrier_pose", {"units": "ft"}, "carrier_pose must have the units 'm, rad', got 'ft'"),
    "complex": ("pose", {"values": lambda x: x + 1j}, "got .*complex128"),
    "text": ("velocity", {"values": lambda x: x.astype(str).astype(object)}, "got .*(object|str|U3)"),
    "a huge number": ("pose", {"values": lambda x: x * 0 + 1e300}, "got 1e[+]300"),
    "nan": ("acceleration", {"values": lambda x: x * np.nan}, "got nan"),
    "backwards": ("time", {"values": lambda x: x[::-1].copy()}, "increas"),
    "at one time": ("time", {"values": lambda x: x * 0}, "increas"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_motion_is_refused_in_one_line_by_flights_and_by_the_viewer(case, saved, tmp_path):
    name, change, message = WRONG[case]
    with xr.open_dataset(saved, engine="h5netcdf") as dataset:
        wrong = changed(dataset.load(), name, **change)
    file = tmp_path / "wrong.nc"
    wrong.to_netcdf(file, engine="h5netcdf", invalid_netcdf=case == "complex")
    for use in (lambda: simulate("wang-flying", file, duration=0.01), lambda: read(str(file))):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(InputError, match=message) as error:
                use()
        assert str(error.value).isprintable()
        assert name in str(error.value) or "times" in str(error.value)


def test_a_flight_needs_two_times_from_zero_on(saved):
    with xr.open_dataset(saved, engine="h5netcdf") as dataset:
        dataset.load()
    for wrong in (dataset.isel(time=[0]), dataset.isel(time=[]), changed(dataset, "time", lambda x: x - 1)):
        with pytest.raises(InputError, match="reference must be a plan of two times or more that increase from 0 s on"):
            simulate("wang-flying", wrong, duration=0.01)


def test_a_log_in_other_units_and_with_signalling_nan_is_refused_in_silence(tmp_path):
    lengths = np.full((3, 6), np.uint64(0x7FF0000000000001)).view(np.float64)  # nan that raise a signal
    for name, units, message in (("pose", "mm, deg", "pose must have the units"), ("cable_lengths", "m", "got nan")):
        with h5py.File(tmp_path / "log.nc", "w") as file:
            file["cable_lengths"] = lengths if name == "cable_lengths" else np.ones((3, 6))
            file["pose"] = np.zeros((3, 6))
            for variable, own in (("cable_lengths", "m"), ("pose", "m, rad")):
                file[variable].attrs["units"] = units if variable == name else own
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(InputError, match=message):
                read_measurements(tmp_path / "log.nc")


def test_a_file_of_plain_hdf5_makes_no_noise(saved, tmp_path):
    with h5py.File(saved) as source, h5py.File(tmp_path / "plain.nc", "w") as file:
        for name in ("pose", "time"):
            file[name] = source[name][...]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match="with the variable velocity"):
            simulate("wang-flying", tmp_path / "plain.nc", duration=0.01)


def test_many_wrong_items_take_time_in_proportion():
    """Each copied the list of those that followed it."""
    with pytest.raises(
        InputError, match=r"^lengths: max\[0\] must be a number.*; also wrong: max\[1\], .* and 2496 more$"
    ):
        Lengths(min=0.1, max=["x"] * 2500)

    def took(count: int) -> float:
        details = [{"loc": ("max", i), "type": "float_type", "msg": "x", "input": "x"} for i in range(count)]
        start = time.process_time()
        assert len(_without_branches(details)) == count
        return time.process_time() - start

    least = [min(took(count) for _ in range(3)) for count in (2500, 20_000)]
    assert least[1] < 24 * least[0]  # 8 in proportion, 64 if each copies the rest


def test_a_yaml_file_of_many_items_is_refused_before_the_rest_is_read():
    """Half a million took half a minute: each becomes several objects of the YAML reader, then an error of its own."""
    text = f"name: many\npath:\n  points: [{', '.join(['{a: 1}'] * 100_000)}}}"  # what ends it is never reached
    with pytest.raises(
        InputError, match=r"^many\.yaml: text is not YAML \(has more than 30000 values and keys, line 3\)"
    ):
        parse_yaml(text, Task, "many.yaml")


def test_a_robot_of_24_cables_is_read_with_all_its_covariance(tmp_path):
    robot = load("wang-flying")
    parameters = [f"cables[{i}].{end}.{axis}" for i in range(24) for end in ("anchor", "attachment") for axis in "xyz"]
    uncertainty = Uncertainty(parameters=parameters, covariance=(1e-6 * np.eye(144)).tolist())
    large = robot.model_copy(update={"cables": 4 * robot.cables, "uncertainty": uncertainty})
    assert np.array_equal(load(large.save(tmp_path / "large.yaml")).uncertainty.covariance, uncertainty.covariance)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("plan wang-flying rest.yaml --speed 2", "--speed must be left out without --animate, got 2"),
        ("plan wang-flying rest.yaml --fps nan", "--fps must be left out without --animate, got nan"),
        ("simulate wang-flying rest.nc --fps -1", "--fps must be left out without --animate, got -1"),
        ("view wang-flying --html x.html --port -1", "--port must be left out with --html: a page needs no server"),
        ("view wang-flying --html x.html --host x", "--host must be left out with --html: a page needs no server"),
        ("calibrate wang-flying log.nc --out x.nc", "--out must end in .yaml or .yml, got 'x.nc'"),
        ("import caspr folder --out x.xml", "--out must end in .yaml or .yml, got 'x.xml'"),
        ("export wang-flying --mjcf --out x.yaml", "--out must end in .xml, got 'x.yaml'"),
        ("export wang-flying --c --out x.h", "--out must end in .c, got 'x.h'"),
    ],
)
def test_options_without_effect_and_other_endings_are_refused(command, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, command.split())
    assert isinstance(done.exception, InputError)
    assert str(done.exception) == message
    assert not list(tmp_path.iterdir())


def test_a_robot_is_saved_as_yaml(tmp_path):
    with pytest.raises(InputError, match=r"^file must end in \.yaml or \.yml, got "):
        load("wang-flying").save(tmp_path / "robot.nc")
