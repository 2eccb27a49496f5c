"""A long session keeps what it has loaded, and the last few robots; not what it has done."""

import gc
import sys
from pathlib import Path

import numpy as np
import pytest

import towline
from towline.estimation.calibration import Measurements
from towline.viewer import read
from towline.workspace import StaticEquilibrium

REST = {"name": "rest", "path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 0.3, "output_rate": 20}
LINE = {"path": {"kind": "line", "start": [0, 0, -1], "end": [0.1, 0, -1]}}
REMEMBERED = 17  # rounds after which bounded memories of robots are full, and all libraries are loaded


def resident():
    """Return the memory of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_mixed_operations_on_ever_new_robots_keep_nothing(tmp_path):
    robot, random = towline.load("wang-flying"), np.random.default_rng(0)
    kept = []
    for number in range(REMEMBERED + 5):
        mass = robot.platform.mass * (1 + 1e-3 * number)
        other = robot.model_copy(update={"platform": robot.platform.model_copy(update={"mass": mass})})
        towline.tensions(other, other.home)
        found = towline.plan(other, REST)
        if number >= REMEMBERED - 1:  # takes most of the time
            read(found.save(tmp_path / "plan.nc"))
        found.report()
        towline.simulate(other, found, duration=0.01).to_dict()
        towline.sample(other, StaticEquilibrium(), samples=200)
        towline.time_along(other, LINE, grid=10)
        poses = other.home + random.uniform(-0.2, 0.2, (9, 6))
        towline.calibrate(other, Measurements(towline.Dynamics(other).cable_lengths(poses), poses), ("offsets",))
        with pytest.raises(towline.InputError):
            towline.plan(other, {"path": number})
        if number >= REMEMBERED:
            gc.collect()
            kept.append((len(gc.get_objects()), resident()))
    objects, memory = np.array(kept).T
    assert objects[-1] - objects[0] < 300  # of 150 000; one robot has more
    assert memory[-1] - memory[0] < 20e6
