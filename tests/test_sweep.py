"""Sweeps: a table that closed forms give, the same on every number of workers, and after a kill; what is refused."""

import contextlib
import csv
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from towline import Robot, Task, load, plan, sweep
from towline.base.errors import InputError
from towline.cli.main import app
from towline.models.parsing import to_yaml
from towline.models.uncertainty import Uncertainty
from towline.ocp.sweeps import cases as row_module
from towline.ocp.sweeps.axis import read_axes, read_option
from towline.ocp.sweeps.cases import Cases, Row
from towline.ocp.sweeps.result import Sweep

TOWLINE = Path(sys.executable).with_name("towline")
GRAVITY = 9.81
FRAME = 32 + 24 + 16_384  # bytes of the log of a checkpoint with one row
RISE = 1.0  # [m]
MASS, T_MAX = 2.0, 50.0  # [kg, N]
LIFT = {"name": "lift", "path": {"kind": "line", "start": [0, 0, 0.5], "end": [0, 0, 0.5 + RISE]}, "duration": 1.2}
DURATIONS, MARGINS = [0.5, 1.0, 2.0], [0, 3, 12]


def hoist():
    """A point mass on one vertical cable, so that its tension is m (g + ddz)."""
    data = load("point-mass-3").model_dump(mode="json")
    cable = {**data["cables"][0], "anchor": [0, 0, 3], "t_min": 0, "t_max": T_MAX}
    platform = {**data["platform"], "mass": MASS}
    return Robot.model_validate({**data, "name": "hoist", "platform": platform, "cables": [cable]})


def ends(duration, mass=MASS):
    """The smallest and the largest tension on a line with the law s = u^4 (35 - 84 u + 70 u^2 - 20 u^3), [N].

    Its acceleration 420 u^2 (1 - u)^2 (1 - 2 u) is extreme where 5 u^2 - 5 u + 1 = 0.
    """
    u = (1 - np.sqrt(1 / 5)) / 2
    peak = 420 * u**2 * (1 - u) ** 2 * (1 - 2 * u) * RISE / duration**2
    return mass * (GRAVITY - peak), mass * (GRAVITY + peak)


@pytest.fixture(scope="module")
def swept():
    return sweep(hoist(), LIFT, {"duration": DURATIONS, "margin": MARGINS})


def test_the_table_is_that_of_closed_forms(swept):
    table = swept.table
    assert dict(table.sizes) == {"task.duration": 3, "task.margin": 3}
    assert table["task.duration"].attrs["units"] == "s"
    feasible = 0
    for duration, margin in product(DURATIONS, MARGINS):
        low, high = ends(duration)
        row = table.sel({"task.duration": duration, "task.margin": margin})
        assert float(row["duration"]) == duration
        if margin <= low and high <= T_MAX - margin:
            feasible += 1
            assert row["status"] == "feasible"
            assert row["reason"] == ""
            assert float(row["tension_max"]) == pytest.approx(high, rel=1e-4)
            assert float(row["margin"]) == pytest.approx(min(low, T_MAX - high), abs=2e-3)
            # The mean of (1 + ddz / g)^2; the integral of (s'')^2 over u is 420^2 (B(5, 5) - 4 B(6, 6)) = 280 / 11.
            cost = 1 + 280 / 11 * (RISE / (GRAVITY * duration**2)) ** 2
            assert float(row["cost"]) == pytest.approx(cost, rel=1e-3)
        else:
            assert row["status"] == "infeasible"
            shortfall = max(margin - low, high - T_MAX + margin)
            assert str(row["reason"].values).startswith(f"{shortfall:.4g} N short of the required wrench")
            assert np.isnan(row["cost"])
    assert feasible == swept.feasible == 5


def test_values_of_the_robot_vary_too(swept):
    """Tensions are proportional to the mass; a key without a number means all cables."""
    table = sweep(hoist(), LIFT, {"robot.platform.mass": [1, 3], "robot.cables.t_max": [30, 90]}).table
    np.testing.assert_allclose(table["tension_max"][:, 1], [ends(1.2, mass)[1] for mass in (1, 3)], rtol=1e-4)
    assert table["status"].values.tolist() == [["feasible"] * 2, ["infeasible", "feasible"]]
    assert table["robot.platform.mass"].attrs["units"] == "kg"
    assert table["robot.cables.t_max"].attrs["units"] == "N"


def test_a_cable_that_is_cut_carries_nothing():
    """Of three equal vertical cables, those that are left share the load, whatever number they had."""
    three = hoist().model_copy(update={"cables": (hoist().cables[0],) * 3})
    table = sweep(three, LIFT, {"robot.cables[2].t_max": ["cut", 90], "robot.cables[0].t_max": [90, "cut"]}).table
    np.testing.assert_allclose(table["tension_max"], ends(1.2)[1] / np.array([[2, 1], [3, 2]]), rtol=1e-4)
    assert table["robot.cables[2].t_max"].attrs["units"] == "N"
    with pytest.raises(InputError, match=r"cables must have at least 1 item, got 0 .with robot.cables.t_max = cut"):
        sweep(three, LIFT, {"robot.cables.t_max": ["cut"]})
    with pytest.raises(InputError, match="must be a mapping with carrier"):
        sweep(three, LIFT, {"robot.cables[0]": ["cut"]})


def test_without_a_cable_the_uncertainty_of_the_others_stays_theirs():
    two = (hoist().cables[0],) * 2
    known = Uncertainty(
        parameters=("cables[0].anchor.x", "cables[1].anchor.x", "cables[1].anchor.y"),
        covariance=((1e-4, 0, 0), (0, 9e-4, 2e-4), (0, 2e-4, 4e-4)),
    )
    robot = hoist().model_copy(update={"cables": two, "uncertainty": known})
    cut = [Cases(robot, Task(**LIFT), read_axes({f"robot.cables[{i}].t_max": ["cut"]})) for i in (0, 1)]
    left = [cases.case(0)[0].uncertainty for cases in cut]
    assert left[0].parameters == ("cables[0].anchor.x", "cables[0].anchor.y")
    np.testing.assert_array_equal(left[0].matrix, [[9e-4, 2e-4], [2e-4, 4e-4]])
    assert left[1].parameters == ("cables[0].anchor.x",)
    np.testing.assert_array_equal(left[1].sigmas, [1e-2])


def test_whole_robots_and_tasks_vary_and_fields_of_each(folder, monkeypatch):
    """A matrix of two tasks and three robots, of which one cannot do the task with wind, and a field of both."""
    monkeypatch.chdir(folder)
    slow = Task.model_validate({**LIFT, "name": "slow", "duration": 2})
    slow.save("slow.yaml")
    hoist().model_copy(update={"name": "other"}).save("other.yaml")
    vary = {"robot": ["hoist.yaml", "other.yaml"], "task": ["lift.yaml", "slow.yaml"], "robot.platform.mass": [1, 3]}
    found = sweep("wang-flying", {**LIFT, "margin": 24}, vary)
    assert found.table["tension_max"].dims == ("robot", "task", "robot.platform.mass")
    for i, j, k in product(range(2), repeat=3):
        high = ends((1.2, 2)[j], (1, 3)[k])[1]
        assert float(found.table["tension_max"][i, j, k]) == pytest.approx(high, rel=1e-4)
    assert found.plan(7).scenario.robot.name == "other"
    assert found.plan(7).scenario.task.name == "slow"
    assert str(found.report()).startswith("2 robots, 2 tasks: 8 of 8 plans feasible")
    windy = sweep("hoist.yaml", "lift.yaml", {"task": ["lift.yaml", {**LIFT, "wind": [1, 0, 0]}]})
    assert windy.table["status"].values.tolist() == ["feasible", "failed"]
    assert "wind must be left out, because robot" in windy.rows[1].reason
    with pytest.raises(InputError, match="wind must be left out"):
        sweep("hoist.yaml", "lift.yaml", {"task": [{**LIFT, "wind": [1, 0, 0]}]})
    with pytest.raises(InputError, match=r"none.yaml: no such file"):
        sweep("hoist.yaml", "lift.yaml", {"task": ["lift.yaml", "none.yaml"]})
    with pytest.raises(InputError, match="no robot or file 'hoisd'"):
        sweep("hoist.yaml", "lift.yaml", {"robot": ["hoisd"]})


def test_a_checkpoint_knows_the_files_of_its_tasks(folder, monkeypatch):
    monkeypatch.chdir(folder)
    arguments = ["plan", "hoist.yaml", "lift.yaml", "--vary", "task=lift.yaml", "--resume", "sweep.chk"]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    Task.model_validate({**LIFT, "duration": 2}).save("lift.yaml")
    with pytest.raises(InputError, match="with values of task"):
        sweep("hoist.yaml", LIFT, {"task": ["lift.yaml"]}, checkpoint="sweep.chk", resume=True)
    done = CliRunner().invoke(app, ["plan", "hoist.yaml", "lift.yaml", "--vary", "task=5"])
    assert isinstance(done.exception, InputError)
    assert "\n" not in str(done.exception)


def test_each_row_is_that_of_a_plan(swept):
    number = int(swept.table["plan"].sel({"task.duration": 1.0, "task.margin": 3}))
    alone = plan(hoist(), {**LIFT, "duration": 1.0, "margin": 3})
    row, again = swept.rows[number], swept.plan(number)
    assert (row.margin, row.tension_max, row.iterations) == (alone.margin, alone.tension_max, alone.iterations)
    np.testing.assert_array_equal(again.audit.tensions, alone.audit.tensions)


def test_fields_inside_of_lists_mappings_and_unset_blocks():
    path = {"kind": "waypoints", "points": [[0, 0, 0.5], [0, 0, 1], [0, 0, 1.5]]}
    task = Task.model_validate({**LIFT, "path": path, "duration": 2})
    vary = {"path.points[2][2]": np.array([1.5, 2.0]), "limits.platform_speed": (0.1, 5), "tube": [{"position": 0.0}]}
    result = sweep(hoist(), task, vary)
    assert result.table["status"].values.tolist() == [[["infeasible"], ["feasible"]]] * 2
    assert result.table["task.tube"].values.tolist() == ['{"position": 0.0}']
    assert result.table["task.path.points[2][2]"].attrs["units"] == "m"
    top = result.plan(3).audit.motion.pose[-1, 2]
    assert top == pytest.approx(2.0)
    assert "platform_speed" in result.rows[0].reason


def test_workers_and_resumption_give_the_same_bits(tmp_path, swept):
    """Two processes, then a checkpoint of which half is lost."""
    vary, file = {"duration": DURATIONS, "margin": MARGINS}, tmp_path / "sweep.chk"
    calls = []
    two = sweep(hoist(), LIFT, vary, workers=2, checkpoint=file, progress=lambda *counts: calls.append(counts))
    assert same(two.table, swept.table)
    assert calls[0] == (0, 9, 0)
    assert calls[-1] == (9, 9, swept.feasible)
    with contextlib.closing(sqlite3.connect(file)) as database, database:
        database.execute("DELETE FROM record WHERE number IN (1, 5, 8)")
    calls.clear()
    again = sweep(hoist(), LIFT, vary, checkpoint=file, resume=True, progress=lambda *counts: calls.append(counts))
    assert same(again.table, swept.table)
    assert calls[0][0] == 9 - (len(calls) - 1) == 6  # only what is missing is planned
    kept = two.rows, again.rows
    assert sum(one.seconds == other.seconds for one, other in zip(*kept, strict=True)) == calls[0][0]


def same(one, other):
    return one.drop_vars("seconds").identical(other.drop_vars("seconds"))


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """The checkpoint of a sweep."""
    file = tmp_path_factory.mktemp("stored") / "sweep.chk"
    sweep(hoist(), LIFT, {"margin": [0, 1]}, checkpoint=file)
    return file.read_bytes()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"robot": load("point-mass-3").name}, 'with robot "hoist'),
        ({"task": {**LIFT, "steps": 50}}, 'with task "lift'),
        ({"vary": {"margin": [0, 1, 2]}}, r"with vary margin \[0, 1\], not \[0, 1, 2\]"),
        ({"vary": {"duration": [2]}}, r'with order of vary \["margin"\], not \["duration"\]'),
        ({"keep": "plans"}, "with keep false, not true"),
    ],
)
def test_a_checkpoint_of_another_sweep_is_refused(tmp_path, monkeypatch, stored, changed, message):
    monkeypatch.chdir(tmp_path)
    arguments = {"robot": hoist(), "task": LIFT, "vary": {"margin": [0, 1]}, "checkpoint": "sweep.chk"}
    Path("sweep.chk").write_bytes(stored)
    with pytest.raises(InputError, match="checkpoint must be a new file"):
        sweep(**arguments)
    with pytest.raises(InputError, match=message) as caught:
        sweep(**{**arguments, **changed}, resume=True)
    assert "\n" not in str(caught.value)
    assert Path("sweep.chk").read_bytes() == stored


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"margn": [1]}, "margn is not a known key, did you mean 'margin'?.*with margn = 1"),
        ({"margin": [1, -1]}, r"margin must be greater than or equal to 0, got -1 \(with margin = -1\)"),
        ({"margin": [0, 30]}, r"margin must be at most 25 N.*got 30 N \(with margin = 30\)"),
        ({"margin": 5}, "vary margin must be a list of different values"),
        ({"margin": "5"}, "vary margin must be a list of different values"),
        ({"margin": []}, "vary margin must be a list of different values as in a task file, at least one, got none"),
        ({"margin": [1, 2, 1.0]}, "got 1 twice"),
        ({"margin": [float("nan")]}, "got values that no task file has"),
        ({"margin": [object()]}, "got values that no task file has"),
        ({"margin": range(10**9)}, "at most 100000 combinations"),
        ({"margin": range(1000), "duration": range(1, 1001)}, "at most 100000 combinations of values, got 1000000"),
        ({"tube": [{}], "tube.position": [0]}, "vary must have keys of different fields, got tube and tube.position"),
        ({"path.points[0]": [1]}, "path.points must have an item 0, got 0 items"),
        ({"name.x": ["a"]}, "name must be a mapping, got 'lift'"),
        ({"a..b": [1]}, "vary must have dotted keys of a task file.*got the key 'a..b'"),
        ({5: [1]}, "vary must have dotted keys of a task file.*got the key 5"),
        ({"robot.platform.mass": [1, 0]}, r"robot 'hoist': platform.mass must be.*with robot.platform.mass = 0"),
        ({}, "vary must be a mapping from dotted keys"),
    ],
)
def test_wrong_values_are_refused_before_anything_is_planned(vary, message, monkeypatch, tmp_path):
    monkeypatch.setattr(row_module, "plan", None)
    with pytest.raises(InputError, match=message) as caught:
        sweep(hoist(), LIFT, vary, checkpoint=tmp_path / "sweep.chk")
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("option", "values"),
    [
        ("margin=0:20:5", [0, 5, 10, 15, 20]),
        ("margin=0:19:5", [0, 5, 10, 15]),
        ("margin=0:1:0.1", [k / 10 for k in range(11)]),
        ("margin=1e-3:2e-3:5e-4", [0.001, 0.0015, 0.002]),
        ("margin=3:1:-1, 7", [3, 2, 1, 7]),
        ("margin=2:2:1", [2]),
        ("scheme=linear,hermite", ["linear", "hermite"]),
        ("tube.position= 0, 0.05, free", [0, 0.05, "free"]),
        ("path.end=[0, 0, 1],[0, 0, 2]", [[0, 0, 1], [0, 0, 2]]),
        ("duration={min: 1, max: 2},3", [{"min": 1, "max": 2}, 3]),
    ],
)
def test_values_of_an_option(option, values):
    ((key, read),) = read_option([option]).items()
    assert read == values
    assert key == option.partition("=")[0]
    assert [type(one) for one in read] == [type(one) for one in values]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["margin"], "--vary must be KEY=VALUES"),
        (["margin="], "--vary must be KEY=VALUES"),
        (["=1"], "--vary must be KEY=VALUES"),
        (["margin=[1"], "--vary margin must be values as in a task file"),
        (["margin=1], values: [2"], "--vary margin must be values as in a task file"),
        (["margin=0:10:-1"], "--vary margin must have ranges start:stop:step whose steps lead to stop"),
        (["margin=0:10:0"], "whose steps lead to stop"),
        (["margin=0:1e99:1e-9"], "at most 100000 values, got 1e\\+108"),
        (["margin=1", "margin=2"], "got margin twice"),
    ],
)
def test_wrong_options(options, message):
    with pytest.raises(InputError, match=message):
        read_option(options)


def test_a_plan_that_ends_with_an_error_is_a_row(monkeypatch):
    def failing(robot, task):
        if task.margin == 1:
            raise InputError("task 'lift': start must fit")
        if task.margin == 2:
            raise ZeroDivisionError("division by zero")
        return plan(robot, task)

    monkeypatch.setattr(row_module, "plan", failing)
    result = sweep(hoist(), LIFT, {"margin": [0, 1, 2]})
    assert [row.status for row in result.rows] == ["feasible", "failed", "failed"]
    assert [row.reason for row in result.rows] == [
        "",
        "task 'lift': start must fit",
        "ZeroDivisionError: division by zero",
    ]
    assert np.isnan(result.table["duration"].values[1:]).all()
    assert result.report().startswith("hoist, lift: 1 of 3 plans feasible, 2 failed\n")
    json.dumps(result.to_dict(), allow_nan=False)


def test_files_hold_the_table(swept, tmp_path):
    netcdf, text = swept.save(tmp_path / "table.nc")
    xr.testing.assert_identical(xr.load_dataset(netcdf), swept.table)
    with text.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 9
    for number, (row, kept) in enumerate(zip(rows, swept.rows, strict=True)):
        index = np.unravel_index(number, (3, 3))
        assert (int(row["plan"]), row["status"], row["reason"]) == (number, kept.status, kept.reason)
        assert float(row["task.duration [s]"]) == DURATIONS[index[0]]
        assert float(row["task.margin [N]"]) == MARGINS[index[1]]
        assert (row["cost"] == "") == np.isnan(kept.cost)
    with pytest.raises(InputError, match="must be a NetCDF file"):
        swept.save(tmp_path / "table.csv")


def test_figures_show_where_plans_are_feasible(swept):
    cost, margin = [ax for ax in swept.figure().axes if ax.images]
    feasible = (swept.table["status"] == "feasible").values
    drawn = cost.images[0].get_array()
    np.testing.assert_array_equal(~np.ma.getmaskarray(np.ma.masked_invalid(drawn)), feasible.T)
    np.testing.assert_array_equal(np.ma.filled(drawn, np.nan), swept.table["cost"].values.T)
    (crosses,) = cost.lines
    assert set(zip(*crosses.get_data(), strict=True)) == set(zip(*np.nonzero(~feasible), strict=True))
    assert (margin.get_xlabel(), cost.get_ylabel(), margin.get_ylabel()) == ("duration [s]", "margin [N]", "margin [N]")
    assert cost.get_shared_x_axes().joined(cost, margin)


def made_up(vary, status=lambda number: "feasible"):
    """A sweep whose rows were not planned."""
    cases = Cases(hoist(), Task.model_validate(LIFT), read_axes(vary))
    numbers = range(len(cases))
    return Sweep(
        cases, tuple(Row(status(n), "", n if status(n) == "feasible" else np.nan, 2, n, n, 0, 0) for n in numbers)
    )


def test_figures_of_one_and_three_fields():
    one = made_up({"duration": [2, 0.5, 1]}, lambda number: ["feasible", "not-found", "feasible"][number])
    panels = one.figure().axes
    assert [ax.get_ylabel() for ax in panels] == ["cost", "tension margin [N]"]
    assert panels[0].lines[0].get_xdata().tolist() == [0.5, 1, 2]
    assert panels[0].lines[1].get_xdata().tolist() == [0.5]
    assert panels[0].lines[1].get_label() == "not-found"
    words = made_up({"scheme": ["linear", "hermite"]}).figure()
    assert [text.get_text() for text in words.axes[-1].get_xticklabels()] == ["linear", "hermite"]
    three = {"duration": [1, 2], "margin": [0, 1], "robot.platform.mass": [1, 2, 3]}
    maps = [ax for ax in made_up(three).figure().axes if ax.images]
    assert len(maps) == 6
    assert maps[0].figure.get_suptitle() == "titles: robot.platform.mass [kg]"
    assert [ax.get_title(loc="left") for ax in maps[:3]] == ["1", "2", "3"]
    np.testing.assert_array_equal(maps[1].images[0].get_array(), [[1, 7], [4, 10]])  # margin upwards, duration across
    none = made_up({"margin": [1, 2]}, lambda number: "failed").figure()
    assert [ax.lines[1].get_xdata().tolist() for ax in none.axes] == [[1, 2]]  # marks, once
    with pytest.raises(InputError, match="at most 3 varied fields, got 4"):
        made_up({"duration": [1], "margin": [1], "steps": [50], "scheme": ["linear"]}).figure()
    with pytest.raises(InputError, match="at most 6 values of the third varied field, got 7 of steps"):
        made_up({"duration": [1], "margin": [1], "steps": range(10, 17)}).figure()


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "hoist.yaml").write_text(to_yaml(hoist()))
    (tmp_path / "lift.yaml").write_text(to_yaml(Task.model_validate(LIFT)))
    return tmp_path


def test_the_command(folder, monkeypatch):
    monkeypatch.chdir(folder)
    common = ["plan", "hoist.yaml", "lift.yaml", "--vary", "duration=0.5,1"]
    done = CliRunner().invoke(
        app, [*common, "--vary", "margin=0:3:3", "--figures", "drawn", "--keep", "plans", "--json"]
    )
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert (answer["plans"], answer["feasible"], answer["counts"]["infeasible"]) == (4, 2, 2)
    assert answer["rows"][3]["varied"] == {"duration": 1, "margin": 3}
    assert answer["rows"][0]["cost"] is None
    assert Path(answer["figure"]).read_bytes().startswith(b"\x89PNG")
    assert (answer["file"], answer["csv"]) == ("hoist-lift-sweep.nc", "hoist-lift-sweep.csv")
    kept = sorted(os.listdir("plans"))
    assert kept == [f"plan-{number}.nc" for number in range(4)]
    saved = xr.load_dataset(Path("plans") / kept[3])
    assert float(saved["tensions"].max()) == pytest.approx(answer["rows"][3]["tension_max"], rel=1e-3)
    none = CliRunner().invoke(app, ["plan", "hoist.yaml", "lift.yaml", "--vary", "duration=0.3,0.4", "--out", "no.nc"])
    assert none.exit_code == 1
    assert none.stdout.startswith("hoist, lift: 0 of 2 plans feasible, 2 infeasible\n")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--workers", "2"], "--workers must be left out without --vary"),
        (["--keep", "plans"], "--keep must be left out without --vary"),
        (["--vary", "margin=1", "--report", "x.html"], "--report must be left out with --vary"),
        (["--vary", "margin=1", "--out", "x.csv"], "--out must be a NetCDF file"),
        (["--vary", "margin=1", "--out", "x.nc", "--resume", "x.nc"], "--out must be a file other than the checkpoint"),
        (["--vary", "margin=1", "--checkpoint", "a", "--resume", "b"], "--checkpoint must not be given with --resume"),
    ],
)
def test_options_that_do_not_fit(options, message, folder, monkeypatch):
    monkeypatch.chdir(folder)
    before = set(os.listdir(folder))
    done = CliRunner().invoke(app, ["plan", "hoist.yaml", "lift.yaml", *options])
    assert isinstance(done.exception, InputError)
    assert message in str(done.exception)
    assert set(os.listdir(folder)) == before


def start(folder, *options):
    """Start a sweep of 12 plans, a few tenths of a second each, as a process of its own."""
    command = [
        str(TOWLINE),
        "plan",
        "hoist.yaml",
        "lift.yaml",
        "--vary",
        "margin=0:2.5:0.5",
        "--vary",
        "duration=1,1.1",
    ]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    heed = None if os.name == "nt" else lambda: signal.signal(signal.SIGINT, signal.default_int_handler)
    return subprocess.Popen([*command, *options], cwd=folder, preexec_fn=heed, **pipes)


def children_of(process):
    return [int(child) for child in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]


def alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def wait_until(condition, process=None):
    deadline = time.monotonic() + 60
    while not condition():
        assert process is None or process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.005)


def stored_size(file):
    return file.stat().st_size if file.exists() else 0


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are listed there")
def test_killed_interrupted_and_resumed_is_the_same_table(folder):
    """SIGKILL, then Ctrl-C, then the rest; the records that were there stay, and none is added twice."""
    file = folder / "run.chk"
    first = start(folder, "--checkpoint", "run.chk")
    log = folder / "run.chk-wal"
    wait_until(lambda: stored_size(log) >= FRAME, first)
    first.kill()
    first.communicate()
    (folder / "killed").mkdir()
    for left in (file, log):  # reading takes the log in
        shutil.copy(left, folder / "killed")
    before = rows_of(folder / "killed" / "run.chk")
    size = stored_size(log)

    second = start(folder, "--workers", "2", "--resume", "run.chk")
    wait_until(lambda: stored_size(log) > size, second)
    workers = children_of(second)
    second.send_signal(signal.SIGINT)
    out, err = second.communicate(timeout=60)
    assert (second.returncode, out) == (130, "")
    assert err.startswith("towline: stopped after ")
    assert err.endswith(" of 12 plans; to continue, repeat the command with --resume run.chk\n")
    assert int(err.split()[3]) < 12  # it ends before the rest is planned
    assert err.count("\n") == 1
    wait_until(lambda: not any(map(alive, workers)))
    assert not list(folder.glob("*.nc"))

    vary = {"margin": [k / 2 for k in range(6)], "duration": [1, 1.1]}
    resumed = sweep(folder / "hoist.yaml", folder / "lift.yaml", vary, checkpoint=file, resume=True)
    assert same(resumed.table, sweep(hoist(), LIFT, vary).table)
    after = rows_of(file)
    assert 0 < len(before) < 12
    assert {number: after[number] for number in before} == before
    assert sorted(after) == list(range(12))
    assert not log.exists()


def rows_of(file):
    """Return the rows of a checkpoint by their numbers."""
    with contextlib.closing(sqlite3.connect(file)) as database:
        rows = dict(database.execute("SELECT number, content FROM record WHERE number >= 0"))
    return {number: json.loads(content) for number, content in rows.items()}


def test_a_dask_cluster_gives_the_same_table(swept):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        shared = sweep(hoist(), LIFT, {"duration": [2], "margin": MARGINS}, scheduler=cluster.scheduler_address)
    assert [row[:-1] for row in shared.rows] == [row[:-1] for row in swept.rows[-3:]]
