"""`towline simulate` through its entry point: what it prints and writes, exit codes, and wrong input as one line."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from towline import plan
from towline.base.errors import InputError
from towline.cli import stopping
from towline.cli.main import app
from towline.cli.watching import resumable
from towline.simulation.flights import report

from .warm import towline as run

DURATION, PERIOD = 0.5, 1e-3
TASK = {
    "name": "step",
    "path": {"kind": "line", "start": [0, 0, -1], "end": [0.03, 0, -1.05]},
    "duration": DURATION,
    "steps": 10,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a plan of wang-flying."""
    place = tmp_path_factory.mktemp("flights")
    made = plan("wang-flying", TASK)
    assert made.feasible
    made.save(place / "step.nc")
    (place / "late.yaml").write_text("delay: -1\n")
    (place / "noise.yaml").write_text("{position: 0.001, attitude: 0.001, delay: 0.002}\n")
    return place


def simulate(folder, *arguments, code=0):
    return run("simulate", "wang-flying", "step.nc", *arguments, cwd=folder, code=code)


def test_a_flight_prints_the_promised_keys_and_writes_what_it_says(folder):
    done = simulate(folder, "--json", "--figures", "drawn", "--out", "flown.nc")
    answer = json.loads(done.stdout)
    promised = {"passed", "error_rms", "error_max", "tension_min", "tension_max", "slack_s", "answered", "step_us"}
    assert promised | {"real_time_factor", "file"} <= set(answer)
    assert set(answer["step_us"]) == {"median", "p99", "max"}
    assert answer["passed"]
    assert sum(answer["answered"].values()) == round(DURATION / PERIOD)
    assert [str(folder / name) for name in answer["figures"]] == [
        str(folder / "drawn" / f"{name}.png") for name in ("simulation", "tensions")
    ]
    for name in answer["figures"]:
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    # The numbers are those of the file: the distance from the line that the task asks for, and its tensions.
    with xr.open_dataset(folder / answer["file"]) as flown:
        error = np.linalg.norm(flown.pose.values[:, :3] - flown.reference_pose.values[:, :3], axis=1)
        along = flown.reference_pose.values[:, :3] - [0, 0, -1]
        np.testing.assert_allclose(np.cross(along, [0.03, 0, -0.05]), 0, atol=1e-9)
        assert answer["error_max"] == pytest.approx(error.max())
        assert answer["error_rms"] == pytest.approx(np.sqrt(np.mean(error**2)))
        assert answer["tension_min"] == pytest.approx(flown.tensions.values.min())
        assert flown.attrs["status"] == "passed"


def test_wind_and_noise_move_the_robot_and_the_same_seed_gives_the_same_file(folder):
    options = ["--wind", "3 2 0.5", "--gusts", "1", "--noise", "noise.yaml", "--duration", "0.2"]
    files = []
    for seed in (4, 4):
        done = simulate(folder, *options, "--seed", seed, "--out", f"{len(files)}.nc")
        assert "PASSED" in done.stdout.splitlines()[0]
        files.append((folder / f"{len(files)}.nc").read_bytes())
    assert files[0] == files[1]
    with xr.open_dataset(folder / "0.nc") as flown:
        assert len(np.unique(np.diff(flown.wind.values, axis=0))) > 100
        assert flown.tracking_error.values.max() > 1e-5  # in calm air it stays below 1e-6
        assert flown.wind.values[:, 0].mean() == pytest.approx(3, abs=2.5)


def test_a_flight_that_fails_reports_why_and_exits_1(folder):
    """Cable 3 tears at 0.2 s: its tension is zero from then on, and five cables cannot hold the platform."""
    options = ["--fault", "cut 3 at 0.2", "--duration", "0.6", "--tolerance", "0.01"]
    done = simulate(folder, *options, "--out", "cut.nc", code=1)
    first = done.stdout.splitlines()[0]
    assert "FAILED" in first
    assert "error of" in first
    assert "tolerance 10 mm" in first
    with xr.open_dataset(folder / "cut.nc") as flown:
        torn = flown.tensions.sel(cable=3).values
        np.testing.assert_array_equal(torn[200:], 0)
        assert (torn[:200] > 0.5 - 1e-3).all()


def test_many_flights_have_one_table(folder):
    options = ["--runs", "4", "--seed", "7", "--wind", "2 0 0", "--gusts", "1", "--duration", "0.2"]
    done = simulate(folder, *options, "--json", "--figures", "many")
    answer = json.loads(done.stdout)
    assert (answer["runs"], answer["passed"], answer["file"]) == (4, 4, "step-runs.nc")
    assert (folder / "many" / "errors.png").exists()
    with xr.open_dataset(folder / "step-runs.nc") as table:
        assert table.seed.values.tolist() == [7, 8, 9, 10]
        worst = table.error_max.values
        assert answer["error_max"]["worst"] == pytest.approx(worst.max())
        assert answer["error_max"]["median"] == pytest.approx(np.median(worst))
        assert answer["worst_seed"] == table.seed.values[worst.argmax()]
        assert report(table).text().splitlines()[0] == "wang-flying, 4 runs of 0.2 s: PASSED, 4 passed"


@pytest.mark.parametrize(
    ("robot", "file", "options", "message"),
    [
        ("cogiro", "step.nc", [], "must be a plan of robot 'cogiro', got one of 'wang-flying'"),
        ("wang-flying", "none.nc", [], "none.nc: no such file"),
        ("wang-flying", "late.yaml", [], "must be a plan, the NetCDF file of one"),
        ("wang-flying", "step.nc", ["--fault", "cut 9 at 1"], "must name a cable of 'wang-flying', 1 to 6, got 9"),
        ("wang-flying", "step.nc", ["--fault", "snap 1"], "must be 'cut CABLE at SECONDS', 'stick CABLE at SECONDS'"),
        ("wang-flying", "step.nc", ["--fault", "cut 1 at nan"], "at must be a finite number, got nan"),
        ("wang-flying", "step.nc", ["--noise", "late.yaml"], "delay must be greater than or equal to 0, got -1"),
        ("wang-flying", "step.nc", ["--wind", "nan 0 0"], "--wind must be 3 finite numbers, got 'nan 0 0'"),
        ("wang-flying", "step.nc", ["--gusts", "1"], "gusts must be 0 without a wind"),
        ("wang-flying", "step.nc", ["--duration", "nan"], "duration must be a number"),
        ("wang-flying", "step.nc", ["--tolerance", "nan"], "tolerance must be a number"),
        (
            "wang-flying",
            "step.nc",
            ["--controller", "pid"],
            "--controller must be one of computed-torque, predictive, lengths, open-loop, fault-tolerant, got 'pid'",
        ),
        ("wang-flying", "step.nc", ["--workers", "2"], "--workers must be left out without --runs"),
        ("wang-flying", "step.nc", ["--runs", "2", "--animate", "film.gif"], "--animate must be left out with --runs"),
        ("wang-flying", "step.nc", ["--animate", "film.txt"], "file must end in .gif or .mp4"),
        ("wang-flying", "step.nc", ["--out", "step.nc"], "--out must be a file other than the plan, got step.nc"),
        ("wang-flying", "step.nc", ["--out", "/proc/nowhere/flight.nc"], "cannot be written"),
    ],
)
def test_wrong_input_is_refused_in_one_line(folder, monkeypatch, robot, file, options, message):
    """In this process; the next test shows that the command prints the line and exits with 2."""
    before = {path.name for path in folder.iterdir()}
    monkeypatch.chdir(folder)
    done = CliRunner().invoke(app, ["simulate", robot, file, *options])
    assert isinstance(done.exception, InputError)
    assert message in str(done.exception)
    assert "\n" not in str(done.exception)
    assert {path.name for path in folder.iterdir()} == before


def test_an_interrupt_before_the_first_result_explains_how_to_resume(monkeypatch):
    monkeypatch.setattr(stopping, "_message", "towline: stopped")
    show = resumable(lambda *counts: None, Path("my run"), "flights")
    more = "to continue, repeat the command with --resume 'my run'"
    assert stopping._message == f"towline: stopped; {more}"
    show(2, 4, 2)
    assert stopping._message == f"towline: stopped after 2 of 4 flights; {more}"


def test_the_line_is_printed_and_the_exit_code_is_2(folder):
    done = simulate(folder, "--event", "cut 9 at 1", "--json", code=2)
    assert done.stdout == ""
    assert done.stderr == "towline: --event 'cut 9 at 1' must name a cable of 'wang-flying', 1 to 6, got 9\n"


def test_the_viewer_plays_a_flight(folder):
    pytest.importorskip("viser")
    simulate(folder, "--duration", "0.1", "--out", "short.nc", "--animate", "short.gif")
    assert (folder / "short.gif").read_bytes().startswith(b"GIF8")
    done = run("view", "short.nc", "--html", "short.html", "--json", cwd=folder)
    assert json.loads(done.stdout)["kind"] == "simulation"
    page = (folder / "short.html").read_text()
    assert "wang-flying, simulation: passed" in page
    assert "reference of the platform" in page
