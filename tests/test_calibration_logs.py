"""Logs of calibration, good and bad, and `towline calibrate` through the entry point."""

import json
import time
import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import load
from towline.base.errors import InputError
from towline.cli.calibrate import by_name
from towline.estimation.calibration import Measurements, read_measurements
from towline.estimation.logs import Sigma, opening
from towline.estimation.logs.recording import Samples
from towline.estimation.logs.streams import interpolated
from towline.models import points
from towline.ocp.tasks.paths.point_file import read_points

from .robots_as_built import as_built
from .warm import towline

HEADER = [
    "t [s]",
    *(f"l{i} [m]" for i in range(8)),
    *("x [mm]", "y [mm]", "z [cm]", "roll [deg]", "pitch [deg]", "yaw [rad]"),
]


def table(built):
    poses = built.poses * [1e3, 1e3, 1e2, 180 / np.pi, 180 / np.pi, 1]
    return np.column_stack([np.arange(len(poses)) * 0.5, built.readings, poses])


def write(path, header, rows):
    text = [",".join(header), *(",".join(f"{value:.12g}" for value in row) for row in rows)]
    path.write_text("\n".join(text) + "\n")
    return path


@pytest.fixture(scope="module")
def built():
    return as_built(60, 0)


def test_csv_has_units(built, tmp_path):
    log = read_measurements(write(tmp_path / "log.csv", HEADER, table(built)))
    np.testing.assert_allclose(log.lengths, built.readings, atol=1e-10)
    np.testing.assert_allclose(log.poses, built.poses, atol=1e-10)
    np.testing.assert_allclose(log.times, np.arange(60) / 2)
    assert log.sigma == (1e-3, 0, 0, 0.02, 0.02, 0)
    semicolons = (tmp_path / "log.csv").read_text().replace(",", ";")
    (tmp_path / "other.csv").write_text("\ufeff" + semicolons.replace("\n", "\r\n"))
    np.testing.assert_array_equal(read_measurements(tmp_path / "other.csv").lengths, log.lengths)


def test_quaternions_and_empty_fields(built, tmp_path):
    half = built.poses[:, 3:] / 2
    zero = np.zeros(60)
    about_z = np.column_stack([zero, zero, np.sin(half[:, 2]), np.cos(half[:, 2])])
    header = [*(f"l{i} [mm]" for i in range(8)), "x [m]", "y [m]", "z [m]", "qx [1]", "qy [1]", "qz [1]", "qw [1]"]
    path = write(tmp_path / "q.csv", header, np.hstack([1e3 * built.readings, built.poses[:, :3], about_z]))
    log = read_measurements(path)
    expected = points.rotations(np.column_stack([zero, zero, built.poses[:, 5]]))
    np.testing.assert_allclose(points.rotations(log.poses[:, 3:]), expected, atol=1e-9)
    lines = path.read_text().splitlines()
    lines[7] = ",".join([*lines[7].split(",")[:8], *("" for _ in range(7))])
    path.write_text("\n".join(lines))
    log = read_measurements(path)
    assert np.isnan(log.poses[6]).all()
    assert np.isfinite(np.delete(log.poses, 6, axis=0)).all()


def test_netcdf_there_and_back(built, tmp_path):
    sigma = {"lengths": 2e-3, "position": 1e-3, "rotation": 3e-3, "tensions": 0.05, "directions": 0.03, "clocks": 0.01}
    poses = built.poses.copy()
    poses[3] = np.nan
    tensions = np.full((60, 8), 300.0)
    first = Measurements(built.readings, poses, tensions=tensions, times=np.arange(60) / 9, sigma=sigma)
    first.framed = ("frame", "body")  # as `corrected` found them
    log = read_measurements(first.save(tmp_path / "log.nc"))
    for name in ("lengths", "poses", "tensions", "times"):
        np.testing.assert_array_equal(getattr(log, name), getattr(first, name))
    assert log.sigma._asdict() == sigma
    assert log.framed == ("frame", "body")
    bare = Measurements(built.readings)
    log = read_measurements(bare.save(tmp_path / "log.nc"), sigma=5e-3)
    assert log.poses is log.tensions is log.times is None
    assert log.sigma.lengths == 5e-3
    assert log.framed == ()


def test_netcdf_of_others(built, tmp_path):
    import xarray as xr

    data = {f"l{i}": ("k", 1e3 * built.readings[:, i], {"units": "mm"}) for i in range(8)}
    data["t"] = ("k", np.arange(60.0), {"units": "ms"})
    xr.Dataset(data).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    log = read_measurements(tmp_path / "other.nc")
    np.testing.assert_allclose(log.lengths, built.readings, rtol=1e-12)
    assert log.times[-1] == pytest.approx(0.059)
    data["l3"] = ("k", built.readings[:, 3])
    xr.Dataset(data).to_netcdf(tmp_path / "bad.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"bad\.nc: variable l3 must have the attribute units, got none"):
        read_measurements(tmp_path / "bad.nc")


def spoiled(what):
    """A log of 60 samples with one fault, as text or bytes."""
    built = as_built(60, 0)
    header, rows = list(HEADER), table(built)
    lines = None
    if what == "no unit":
        header[3] = "l2"
    elif what == "wrong unit":
        header[3] = "l2 [N]"
    elif what == "unknown column":
        header[3] = "length [m]"
    elif what == "twice":
        header[3] = "l1 [m]"
    elif what == "a name of another kind":
        header[8] = "length8 [m]"
    elif what == "a gap":
        header[3] = "l9 [m]"
    elif what == "nan":
        rows[:, 4] = np.nan
    elif what == "times":
        rows[20, 0] = rows[18, 0]
    elif what == "no lengths":
        header, rows = HEADER[9:], rows[:, 9:]
    elif what == "part of a position":
        header[9:] = ["x [m]", "y [m]", "roll [deg]", "pitch [deg]", "yaw [deg]", "tension0 [N]"]
    elif what == "half a pose":
        rows[5, 9] = np.nan
    if what == "empty":
        return b""
    if what == "header alone":
        return (",".join(header) + "\n").encode()
    if what == "binary":
        return bytes(range(256)) * 10
    if what == "damaged NetCDF":
        return b"\x89HDF\r\n\x1a\n" + bytes(2000)
    lines = [",".join(header), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    if what == "text":
        lines[4] = lines[4].replace(lines[4].split(",")[2], "much")
    if what == "truncated":
        return "\n".join(lines).encode()[:-60]
    return "\n".join(lines).encode()


FAULTS = {
    "no unit": "the unit of l2 must be one of m, dm, cm, mm, um, km, in, rad, .*, counts, ticks, got ''",
    "wrong unit": "the unit of l2 must be one of m, dm, cm, mm, um, km, in, rad, .*, counts, ticks, got 'N'",
    "unknown column": "must have columns l0 to l6 without a gap, got no l2",
    "twice": "must have each column once, got l1 twice",
    "a name of another kind": "must have lengths under names of one kind, got l0, l1, l2, l3, l4, l5, l6 and length8",
    "a gap": "must have columns l0 to l7 without a gap, got no l2",
    "nan": "l3 must be a finite number at sample 0, got nan; [0-9]+ of [0-9]+ samples are incomplete",
    "times": "times must increase from sample to sample, got 9.5 s and then 9 s at sample 20; "
    "cut the log where its clock was set back",
    "no lengths": "must have columns l0, l1, ... of lengths, got x, y, z, roll, pitch, yaw",
    "part of a position": "must have all columns x, y, z or none of them, got x, y",
    "half a pose": "poses must have rows that are finite or nan as a whole, got both at sample 5",
    "empty": "must be a CSV, NetCDF or MCAP file or a ROS bag, got an empty file",
    "header alone": "must have a line for each sample below its header, got none",
    "binary": "must be a CSV file in UTF-8, or NetCDF, got other bytes",
    "damaged NetCDF": "must be a NetCDF 4 file, got one that cannot be read",
    "text": r"line 5, column l1 \[m\] must be a number, got 'much'",
    "truncated": "line 61 must have 15 values like the header, got",
}


@pytest.mark.parametrize("what", FAULTS)
def test_bad_logs_are_refused_in_one_line(what, tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(spoiled(what))
    with pytest.raises(InputError, match=FAULTS[what]) as caught:
        read_measurements(path)
    assert str(caught.value).startswith(str(path))
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("read", "header"),
    [(read_measurements, "l0 [m]\n"), (read_measurements, ""), (lambda file: read_points(file.name, file.parent), "")],
)
def test_a_csv_field_without_end_is_refused_in_one_line(read, header, tmp_path):
    (tmp_path / "log.csv").write_text(f'{header}"{"x" * 200_000}\n1\n2\n')
    with pytest.raises(InputError, match=r"log\.csv: must be CSV that can be read, got field larger than") as error:
        read(tmp_path / "log.csv")
    assert str(error.value).isprintable()


def test_a_cut_netcdf_file_is_refused(built, tmp_path):
    path = built.measurements().save(tmp_path / "log.nc")
    content = path.read_bytes()
    for size in (100, len(content) // 2, len(content) - 100):
        path.write_bytes(content[:size])
        with pytest.raises(InputError, match=r"must be a NetCDF 4 file, got one that cannot be read") as caught:
            read_measurements(path)
        assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"lengths": [[1, 2], [3]]}, "lengths must be an array of real numbers"),
        ({"lengths": [1, 2]}, r"lengths must have the shape \(N, m\), got \(2,\)"),
        ({"lengths": [[1, np.nan]]}, "lengths must be finite numbers up to 1e.09, got nan at sample 0, column 1"),
        ({"lengths": [[1, -2e9]]}, "lengths must be finite numbers up to 1e.09, got -2e.09 at sample 0, column 1"),
        ({"poses": np.zeros((2, 5))}, r"poses must have the shape \(1, 6\), or \(1, 3\) of positions, got \(2, 5\)"),
        ({"poses": np.zeros((1, 3)), "orientations": [[0, 0, 0, 2]]}, "orientations must be quaternions of length 1"),
        ({"times": [0, 1]}, r"times must have the shape \(1,\), got \(2,\)"),
        ({"tensions": [[1]]}, r"tensions must have the shape \(1, 2\), got \(1, 1\)"),
        ({"sigma": 0}, "sigma must be a number from 1e-09 to 100, or a mapping of .*, got 0"),
        (
            {"sigma": {"length": 1}},
            "sigma must have only the keys lengths, position, rotation, tensions, directions, clocks, got 'length'",
        ),
        ({"sigma": {"position": -1}}, "sigma.position must be a number from 0 to 100, got -1"),
    ],
)
def test_wrong_measurements(arguments, message):
    with pytest.raises(InputError, match=message):
        Measurements(**{"lengths": [[1.0, 2.0]], **arguments})


def test_the_command_writes_a_robot_file(built, tmp_path):
    write(tmp_path / "log.csv", HEADER, table(built))
    done = towline("calibrate", "cogiro", "log.csv", "--json", cwd=tmp_path)
    told = json.loads(done.stdout)
    assert told["residual_after"] < 1.1e-3 < 0.02 < told["residual_before"]
    assert told["not_identifiable"] == []
    assert len(told["parameters"]) == 32
    assert {"name", "value", "sigma"} <= set(told["parameters"][0])
    assert told["file"] == "cogiro-calibrated.yaml"
    robot = load(tmp_path / told["file"])
    np.testing.assert_allclose(robot.anchors, built.robot.anchors, atol=0.03)
    assert robot.uncertainty is not None
    done = towline(
        *("calibrate", "cogiro", "log.csv", "--free", "anchors, offsets", "--prior", "anchors=0.02,offsets=0.05"),
        *("--sigma", "lengths=0.001,position=0.0005,rotation=0.001", "--out", "mine.yaml"),
        cwd=tmp_path,
    )
    assert "residual of the lengths" in done.stdout
    assert "all directions of the parameters are observable" in done.stdout
    assert (tmp_path / "mine.yaml").exists()


def test_the_command_names_what_is_open(built, tmp_path):
    write(tmp_path / "log.csv", HEADER[:9], table(built)[:, :9])
    done = towline("calibrate", "cogiro", "log.csv", "--free", "anchors", "--json", cwd=tmp_path)
    told = json.loads(done.stdout)
    assert len(told["not_identifiable"]) == 6
    assert told["parameters"][0]["sigma"] is None
    done = towline("calibrate", "cogiro", "log.csv", "--free", "anchors", cwd=tmp_path)
    assert "all anchors together along x of {G}" in done.stdout


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--free", "anchor"), "free must be 'auto' or some of anchors"),
        (("--prior", "anchors:1"), "--prior must be NAME=NUMBER, separated by commas"),
        (("--sigma", "small"), "--sigma must be a number [m]"),
        (("--out", "log.csv"), "--out must be a file other than the log"),
        (("--free", "clock,offsets", "--prior", "anchors=1"), "prior must only have keys that are in free"),
    ],
)
def test_wrong_options(built, tmp_path, options, line):
    write(tmp_path / "log.csv", HEADER, table(built))
    done = towline("calibrate", "cogiro", "log.csv", *options, cwd=tmp_path, code=2)
    assert done.stderr.count("\n") == 1
    assert line in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


@pytest.mark.parametrize("what", ["no unit", "binary", "truncated", "nan"])
def test_the_command_refuses_bad_logs(what, tmp_path):
    (tmp_path / "log.csv").write_bytes(spoiled(what))
    done = towline("calibrate", "cogiro", "log.csv", cwd=tmp_path, code=2)
    assert done.stderr.count("\n") == 1
    missing = towline("calibrate", "cogiro", "none.csv", cwd=tmp_path, code=2)
    assert missing.stderr == "towline: none.csv: no such file\n"
    towline("calibrate", "point-mass-3", "log.csv", cwd=tmp_path, code=2)


HEAD = "l0 [m],l1 [m]\n"
LARGE = {
    "rows": (HEAD + "1,2\n" * 1_000_000, "must have at most 2000000 fields, got 2000"),
    "other ends": (HEAD + "1,2\u2028" * 1_000_000, "must have at most 2000000 fields, got 2000"),
    "columns": (HEAD + "1," * 1_999_000, "line 2 must have at most 1000 columns, got 1999001"),
    "header": ("l0 [m]," * 1_999_000 + "\n1\n", "line 1 must have at most 1000 columns, got 1999001"),
    "bytes": (HEAD + " " * 50_000_000, "must be a CSV, NetCDF or MCAP file or a ROS bag of at most 50 MB, got 50"),
}


@pytest.mark.parametrize("case", LARGE)
def test_csv_that_is_too_large_is_refused_before_its_fields_are_read(case, tmp_path, monkeypatch):
    """The limits are lowered here, to spare the test large files."""
    monkeypatch.setattr(opening, "MOST_FIELDS", 2_000_000)
    monkeypatch.setattr(opening, "LARGEST_CSV", 50_000_000)
    text, message = LARGE[case]
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    start = time.process_time()
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=message):
            read_measurements(tmp_path / "log.csv")
        assert tracemalloc.get_traced_memory()[1] < 300e6
    finally:
        tracemalloc.stop()
    assert time.process_time() - start < 5


def test_values_at_the_times_of_another_sensor_take_little_memory():
    """With coefficients of all splines, and all matrices of attitudes, a million rows of two clocks took 1.5 GB."""
    t, draw = 1e-3 * np.arange(200_000), np.random.default_rng(0)
    lengths = np.sin(np.outer(t, np.linspace(0.5, 2, 8)))
    quaternions = Rotation.from_rotvec(draw.normal(0, 0.3, (len(t), 3))).as_quat()
    tracemalloc.start()
    found = interpolated(t[1:-1] + 4e-4, Samples(t, lengths))
    splines = tracemalloc.get_traced_memory()[1]
    np.testing.assert_allclose(found, np.sin(np.outer(t[1:-1] + 4e-4, np.linspace(0.5, 2, 8))), atol=1e-9)
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    log = Measurements(lengths, orientations=quaternions)
    attitudes = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    np.testing.assert_allclose(Rotation.from_euler("xyz", log.poses[-1, 3:]).as_quat(), quaternions[-1], atol=1e-12)
    assert splines < 6 * lengths.nbytes
    assert attitudes < 4.5 * lengths.nbytes


def test_empty_fields_and_quotes_are_read_as_before(tmp_path):
    (tmp_path / "log.csv").write_text('l0 [mm]; x [m];y [m];z [m]\n"1000";;nan; \n# between\n\n2000; 1;2 ;"3"\n')
    log = read_measurements(tmp_path / "log.csv")
    np.testing.assert_array_equal(log.lengths, [[1.0], [2.0]])
    np.testing.assert_array_equal(log.poses[:, :3], [[np.nan] * 3, [1.0, 2.0, 3.0]])


def test_an_unknown_name_in_an_option_is_refused_with_the_option_and_not_with_the_log():
    assert by_name("--sigma", "lengths=0.001, clocks=0.1", Sigma._fields) == {"lengths": 0.001, "clocks": 0.1}
    with pytest.raises(InputError, match=r"^--sigma must name some of lengths, .*, got 'lenghts'$"):
        by_name("--sigma", "lengths=1,lenghts=1", Sigma._fields)
