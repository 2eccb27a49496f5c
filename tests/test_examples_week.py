"""An engineer's week: each command of its page succeeds, run in the order of the page, and does what the job says."""

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from .warm import towline

WEEK = Path(__file__).parent.parent / "examples" / "week"
COMMANDS = [shlex.split(text)[1:] for text in re.findall(r"`(towline [^`]*)`", (WEEK / "README.md").read_text())]


@pytest.fixture(scope="module")
def week(tmp_path_factory):
    """The folder after all commands."""
    folder = tmp_path_factory.mktemp("week")
    shutil.copytree(WEEK, folder, dirs_exist_ok=True)
    for command in COMMANDS:
        towline(*command, cwd=folder)
    return folder


def motion(week, name):
    (file,) = week.glob(f"*{name}.nc")
    with xr.open_dataset(file, engine="h5netcdf") as found:
        return found.load()


def test_every_job_has_its_file(week):
    used = {word for command in COMMANDS for word in command if word.endswith(".yaml")}
    assert {file.name for file in WEEK.glob("*.yaml")} == used


def test_the_facade_is_painted_steadily(week):
    speed = np.linalg.norm(motion(week, "facade").velocity.values[:, :3], axis=1)
    assert np.mean(speed > 0.98 * 0.3) > 0.96
    assert speed.max() < 0.3 * 1.001


def test_the_cup_does_not_spill(week):
    found = motion(week, "cup")
    assert np.linalg.norm(found.acceleration.values[:, :2], axis=1).max() <= 0.5 * 1.001


def test_the_hall_is_crossed_slowly_near_the_stage(week):
    found = motion(week, "crowd")
    near = np.linalg.norm(found.pose.values[:, :3] - [0, 0, 1.5], axis=1) < 0.8
    assert np.linalg.norm(found.velocity.values[near, :3], axis=1).max() <= 0.2501


def test_the_part_moves_with_the_conveyor_and_the_broken_robot_rests(week):
    np.testing.assert_allclose(motion(week, "conveyor").velocity.values[-1], [0.4, 0, 0, 0, 0, 0], atol=1e-6)
    np.testing.assert_allclose(motion(week, "-stop").velocity.values[-1], 0, atol=1e-6)


def test_winches_keep_their_power(week):
    found = motion(week, "winches")
    rates = np.gradient(found.cable_lengths.values, found.time.values, axis=0)
    assert np.abs(rates * found.tensions.values).max() <= 1500 * 1.01


@pytest.mark.parametrize(("name", "printed"), [("gains", "40 rad/s: at most 0."), ("contact", "39.2 N")])
def test_a_program_has_at_most_fifteen_lines(week, monkeypatch, capsys, name, printed):
    """The wall and the controller are springs in series: 20 mm / (1 / 2000 N/m + 1 / 1e5 N/m) = 39.2 N."""
    text = (week / f"{name}.py").read_text()
    assert f"`python {name}.py`" in (WEEK / "README.md").read_text()
    assert len([line for line in text.splitlines() if line.strip()]) <= 15
    monkeypatch.chdir(week)
    exec(compile(text, name, "exec"), {})
    assert printed in capsys.readouterr().out


def test_robots_that_differ_pass_and_a_replay_blames_nothing(week):
    assert motion(week, "differs").passed.all()
    replayed = motion(week, "simulation-replay")
    assert float(np.abs(replayed.position_residual).max()) < 1e-3
