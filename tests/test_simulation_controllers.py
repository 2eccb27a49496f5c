"""A controller of the user's: one run uses it as it is, many use copies; runs that are killed keep what they have."""

import os
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from towline import load, simulate
from towline.base.errors import InputError
from towline.control import ANSWERS, Command, ComputedTorque, Controller, Predictive
from towline.simulation.flights import save

ROBOT = load("wang-flying")


class Logging(Controller):
    """Command the reference's tensions, keep a log and an integral, and hold a socket, which cannot be copied."""

    def __init__(self, handle=None):
        self.log, self.handle, self.sum, self.resets = [], handle, 0.0, 0

    def reset(self):
        self.sum, self.resets = 0.0, self.resets + 1

    def step(self, time, state, reference):
        self.log.append(time)
        self.sum += 1.0
        tensions = reference.tensions + 1e-3 * self.sum
        return Command(tensions, *reference[3:6], ANSWERS.index("as planned"))


def fly(controller, **given):
    return simulate(ROBOT, ROBOT.home, controller, **{"duration": 0.02, "wind": (3, 2, 0), "gusts": 1.0} | given)


def test_one_run_uses_the_controller_itself():
    with socket.socket() as handle:
        controller = Logging(handle)
        first = fly(controller)
        assert len(controller.log) == 20
        assert controller.resets == 1
        again = fly(controller)
        assert len(controller.log) == 40
        assert (first.record.motions == again.record.motions).all()


@pytest.mark.parametrize("law", [ComputedTorque, Predictive])
def test_a_second_run_starts_afresh(tmp_path, law):
    controller = law(ROBOT)
    first = fly(controller).save(tmp_path / "first.nc").read_bytes()
    fly(controller, seed=3, duration=0.03, events=["cut 2 at 0.005"])
    assert fly(controller).save(tmp_path / "second.nc").read_bytes() == first


@pytest.mark.parametrize("others", [{}, {"workers": 2}, {"checkpoint": "runs"}])
def test_many_runs_refuse_what_cannot_be_copied_in_one_line(tmp_path, monkeypatch, others):
    monkeypatch.chdir(tmp_path)
    refused = pytest.raises(InputError, match="controller must be copyable")
    with socket.socket() as handle, refused as error:
        fly(Logging(handle), runs=3, **others)
    assert "Logging (cannot pickle 'socket' object)" in str(error.value)
    assert "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_many_runs_leave_the_controller_as_it_is():
    controller = Logging()
    table = fly(controller, runs=3)
    assert controller.log == []
    assert np.ptp(table["error_max"].values) > 0


SCRIPT = """\
import time

from towline import load, simulate


def progress(*done):
    print(*done, flush=True)
    time.sleep(600)  # until it is killed, however late that is


if __name__ == "__main__":
    robot = load("wang-flying")
    simulate(robot, robot.home, wind=(3, 2, 0.5), gusts=1.0, duration=1, runs=40, workers=2, checkpoint="runs",
             progress=progress)
"""


@pytest.mark.skipif(os.name == "nt", reason="signals are sent otherwise there")
def test_few_long_runs_that_are_killed_keep_what_they_have(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    process = subprocess.Popen(
        [sys.executable, "script.py"], cwd=tmp_path, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    stored = int(process.stdout.readline().split()[0])
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    assert 0 < stored < 40
    done = []
    given = {"wind": (3, 2, 0.5), "gusts": 1.0, "duration": 1, "runs": 40}
    resumed = simulate(
        ROBOT, ROBOT.home, **given, checkpoint=tmp_path / "runs", resume=True, progress=lambda *now: done.append(now[0])
    )
    assert done[0] > stored
    files = [save(resumed, tmp_path / "a.nc"), save(simulate(ROBOT, ROBOT.home, **given), tmp_path / "b.nc")]
    assert files[0].read_bytes() == files[1].read_bytes()


def test_a_slow_controller_is_stored_every_few_seconds(tmp_path):
    """Each step takes 2 ms, so that a block of all 20 would take 4 s."""

    class Slow(Logging):
        def step(self, *now):
            time.sleep(2e-3)
            return super().step(*now)

    stored = []
    fly(Slow(), runs=20, duration=0.1, progress=lambda done, *_: stored.append(done))
    assert len(stored) >= 2
    assert stored[-1] == 20
