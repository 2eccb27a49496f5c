"""`towline time` and the schema of tasks, through the entry point."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from towline.models import load
from towline.models.parsing import parse_yaml
from towline.ocp import Task, plan as plan_motion, read_task

from .warm import towline as run

pytest.importorskip("toppra")

GRAVITY = 9.81
ROBOT = """\
name: hoist
source: a test, a mass on one vertical cable
platform: {mass: 2, home: [0, 0, 0, 0, 0, 0], dof: [z]}
carriers: [{name: frame, kind: ground, home: [0, 0, 0, 0, 0, 0]}]
cables: [{carrier: frame, anchor: [0, 0, 3], attachment: [0, 0, 0], t_min: 0, t_max: 39.24}]
"""
TASK = """\
name: lift
path: {kind: line, start: [0, 0, 0.5], end: [0, 0, 1.5]}
duration: 9
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "hoist.yaml").write_text(ROBOT)
    (tmp_path / "lift.yaml").write_text(TASK)
    return tmp_path


def test_time_prints_the_least_time_and_what_holds_it(folder):
    """Full force, twice the weight, up the first half; none up the second: T^2 = 4 d / g."""
    done = run("time", "hoist.yaml", "lift.yaml", "--json", cwd=folder)
    told = json.loads(done.stdout)
    assert told["feasible"]
    assert told["duration"] == pytest.approx(np.sqrt(4 / GRAVITY), rel=2e-3)
    first, second = told["bottlenecks"]
    assert (first["limit"], second["limit"]) == ("t_max of cable 1", "t_min of cable 1")
    assert first["to"] == second["from"] == pytest.approx(0.5, abs=0.02)
    assert first["seconds"] + second["seconds"] == pytest.approx(told["duration"])
    assert told["file"] == "hoist-lift-timed.yaml"
    # What it wrote is a task; the audit of plans finds nothing wrong with it.
    written = read_task(folder / told["file"])
    found = plan_motion(load(folder / "hoist.yaml"), written)
    assert found.feasible
    assert found.scenario.duration == pytest.approx(told["duration"])
    text = run("time", "hoist.yaml", "lift.yaml", "--out", "other.yaml", cwd=folder).stdout
    assert f"(for {first['seconds']:.3f} s): t_max of cable 1" in text
    assert text.startswith(f"hoist, lift: FEASIBLE, shortest duration {told['duration']:.6g} s\n")
    assert (folder / "other.yaml").exists()


def test_limits_of_the_task_count(folder):
    (folder / "slow.yaml").write_text(TASK + "limits: {cable_speed: 0.5}\n")
    told = json.loads(run("time", "hoist.yaml", "slow.yaml", "--json", cwd=folder).stdout)
    # At 0.5 m/s but for 0.5 / g at each end, on the way of which half is lost.
    assert told["duration"] == pytest.approx(1 / 0.5 + 0.5 / GRAVITY, rel=2e-3)
    assert [each["limit"] for each in told["bottlenecks"]][1] == "speed of cable 1"


def test_without_a_law_there_is_a_proof_and_no_file(folder):
    (folder / "heavy.yaml").write_text(ROBOT.replace("39.24", "15"))
    done = run("time", "heavy.yaml", "lift.yaml", "--json", cwd=folder, code=1)
    told = json.loads(done.stdout)
    assert (told["status"], told["duration"], told["file"]) == ("infeasible", None, None)
    assert told["certificate"]["shortfall"] == pytest.approx(2 * GRAVITY - 15)
    assert told["bottlenecks"] == []
    assert not list(folder.glob("*-timed.yaml"))
    text = run("time", "heavy.yaml", "lift.yaml", cwd=folder, code=1).stdout
    assert text.startswith("hoist, lift: INFEASIBLE, 4.62 N short of the required wrench at s = ")
    assert "of the path (0 at its start, 1 at its end), where no time law is feasible" in text


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("tube: {position: 0.1}\n", "tube must be left out to time a path"),
        ("base: {kind: free}\n", "base.kind must be hold or given to time a path"),
        ("wind: {min: [0, 0, 0], max: [1, 0, 0]}\n", "wind must be [0, 0, 0], still air"),
        ("limits: {tension_rate: 3}\n", "limits.tension_rate must be left out to time a path"),
        ("stop_within: 0.01\n", "stop_within must be left out to time a path"),
        ("initial: {pose: [0, 0, 1], velocity: [0, 0, 1]}\n", "initial must be left out to time a path"),
    ],
)
def test_what_timing_cannot_do_is_told(folder, more, message):
    (folder / "more.yaml").write_text(TASK + more)
    done = run("time", "hoist.yaml", "more.yaml", cwd=folder, code=2)
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def test_published_schema_is_that_of_tasks(folder):
    printed = json.loads(run("plan", "--schema", cwd=folder).stdout)
    published = json.loads((Path(sys.modules[Task.__module__].__file__).parent / "task.schema.json").read_text())
    assert printed == published == Task.model_json_schema()
    assert set(published["properties"]) == set(Task.model_fields)
    # The line that editors go by is a comment of the file.
    assert parse_yaml("# yaml-language-server: $schema=task.schema.json\n" + TASK, Task, "lift").name == "lift"
