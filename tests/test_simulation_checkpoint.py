"""Many flights with a checkpoint: killed and resumed they are the same; those of other flights are refused."""

import contextlib
import os
import shutil
import signal
import sqlite3
import subprocess
import sys

import numpy as np
import pytest

from towline import load, simulate
from towline.base.errors import InputError
from towline.control import ComputedTorque
from towline.simulation import runs as simulation_runs
from towline.simulation.flights import save

GIVEN = {"wind": (3, 2, 0.5), "gusts": 1.0, "duration": 0.03, "seed": 5}
SCRIPT = """\
from towline import load, simulate

if __name__ == "__main__":
    simulate("wang-flying", load("wang-flying").home, wind=(3, 2, 0.5), gusts=1.0, duration=0.03, seed=5, runs=400,
             checkpoint="flights", resume=True, progress=lambda *done: print(*done, flush=True))
"""


def fly(file, runs=150, **changed):
    robot = load("wang-flying")
    return simulate(robot, robot.home, **GIVEN | changed, runs=runs, checkpoint=file, resume=True)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The checkpoint of runs that are finished, and their table."""
    file = tmp_path_factory.mktemp("flown") / "flights"
    return file, fly(file)


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_killed_and_resumed_they_are_the_same(tmp_path, monkeypatch):
    (tmp_path / "script.py").write_text(SCRIPT)
    process = subprocess.Popen([sys.executable, "script.py"], cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    stored, runs, _ = map(int, process.stdout.readline().split())  # how many depends on the machine's speed
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    flown, fly_part = [], simulation_runs.fly_part

    def counted(everything, first, seeds):
        if len(everything[2].references) > simulation_runs.TRIED + 1:  # no trial of how long a flight takes
            flown.append(len(seeds))
        return fly_part(everything, first, seeds)

    monkeypatch.setattr(simulation_runs, "fly_part", counted)
    resumed = fly(tmp_path / "flights", runs)
    assert 0 < stored <= runs - sum(flown)
    alone = simulate("wang-flying", load("wang-flying").home, **GIVEN, runs=400)
    files = [save(table, tmp_path / name).read_bytes() for table, name in ((resumed, "a.nc"), (alone, "b.nc"))]
    assert files[0] == files[1]


def test_what_is_missing_is_flown_again(flown, tmp_path):
    file, whole = shutil.copy(flown[0], tmp_path / "flights"), flown[1]
    assert whole.identical(fly(file))  # nothing is left to fly
    blocks = stored(file)
    with contextlib.closing(sqlite3.connect(file)) as database, database:
        database.execute("DELETE FROM record WHERE number = 0")
    assert 0 not in stored(file)
    assert whole.identical(fly(file))
    again = stored(file)
    assert sum(map(len, again.values())) == sum(map(len, blocks.values()))
    assert {number: again[number] for number in blocks if number} == {
        number: content for number, content in blocks.items() if number
    }


def stored(file):
    """The blocks of a checkpoint by the number of their first flight."""
    with contextlib.closing(sqlite3.connect(file)) as database:
        return dict(database.execute("SELECT number, content FROM record WHERE number >= 0"))


@pytest.mark.parametrize(
    ("changed", "name"),
    [
        ({"runs": 151}, "seeds"),
        ({"seed": 6}, "seeds"),
        ({"gusts": 2.0}, "wind"),
        ({"duration": 0.04}, "reference"),
        ({"disturbance": np.ones(6)}, "disturbance"),
        ({"noise": {"position": 1e-3}}, "noise"),
        ({"events": ["cut 1 at 0.01"]}, "events"),
        ({"events": ["push 1 0 0 at 0.01"]}, "events"),
        ({"controller": ComputedTorque("wang-flying", bandwidth=9.0)}, "controller"),
        ({"drive": "tensions"}, "robot"),
    ],
)
def test_a_checkpoint_of_other_flights_is_refused(flown, tmp_path, changed, name):
    file = shutil.copy(flown[0], tmp_path / "flights")
    content = file.read_bytes()
    with pytest.raises(InputError, match=f"of another run, with {name} "):
        fly(file, **changed)
    assert file.read_bytes() == content


def test_what_cannot_be_stored_is_refused_before_anything_is_written(tmp_path):
    with pytest.raises(InputError, match="checkpoint must be None for a controller or a wind that cannot be stored"):
        fly(tmp_path / "flights", wind=lambda times, seed: np.zeros((len(times), 3)), gusts=0.0)
    assert not list(tmp_path.iterdir())


def test_a_cluster_flies_as_one_process_does():
    distributed = pytest.importorskip("distributed")
    alone = simulate("wang-flying", load("wang-flying").home, **GIVEN, runs=60)
    options = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options, protocol="tcp://") as cluster:
        address = cluster.scheduler_address
        there = simulate("wang-flying", load("wang-flying").home, **GIVEN, runs=60, scheduler=address)
    assert alone.identical(there)
