"""Thrusts of drones with wrong gains: found by what balances weight and inertia across the cable."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import load
from towline.estimation.calibration import calibrate
from towline.estimation.logs import read_log

from . import user_recordings as user

NAMES = [f"cable{i + 1}_dir_{axis}" for i in range(2) for axis in "xyz"]


@pytest.fixture(scope="module")
def recorded():
    return user.team(12)


@pytest.mark.parametrize(
    ("gains", "end", "tilt", "said"),
    [
        ((1.0, 1.0), 1.0, 0.0, []),
        ((1.0, 1.0), 1.0, 1.5, ["cf1 are 1 times", "tilted by 2.1 deg"]),
        ((0.985, 1.0), 1.0, 0.0, ["cf1 are 0.98"]),
        ((1.08, 0.93), 1.0, 0.0, ["cf1 are 1.08 times", "cf2 are 0.93"]),
        ((1.06, 1.0), 0.9, 1.5, ["cf1 are 1.06 (at the end 0.96", "cf2 are 1 (at the end 0.9"]),
    ],
)
def test_gains_drift_and_tilt_of_thrusts(gains, end, tilt, said, recorded, tmp_path):
    """The load of 0.4 kg is found to 1 %; by the recorded thrusts it would be up to 20 % off."""
    t, x, drones = recorded
    drift = np.linspace(1.0, end, len(t))
    turned = Rotation.from_euler("xy", [tilt, -tilt], degrees=True).as_matrix()  # of the attitudes that are recorded
    wrong = [(p, R @ turned, thrust * gain * drift, q) for (p, R, thrust, q), gain in zip(drones, gains, strict=True)]
    robot = load(user.team_robot(tmp_path))
    path = user.flight(tmp_path / "flight.csv", (t, x, wrong), user.directions_of(drones), NAMES)
    log = read_log(path, robot=robot, sigma={"lengths": 1e-3, "directions": 0.01})
    notes = [note for note in log.notes if note.startswith("recorded thrusts of")]
    assert len(notes) == len(said)
    for note, words in zip(notes, said, strict=True):
        assert words in note
    found = calibrate(robot, log.measurements, free=("offsets", "mass"))
    assert found.robot.platform.mass == pytest.approx(0.4, rel=0.01)


@pytest.mark.parametrize("tilt", [0.0, 3.0])
def test_directions_that_contradict_thrusts_are_named(tilt, recorded, tmp_path):
    """Without the load nothing shows which of them is wrong, and 3 degrees make cables seem 6 cm longer."""
    turned = user.directions_of(recorded[2]) @ Rotation.from_euler("x", tilt, degrees=True).as_matrix()
    path = user.flight(tmp_path / "flight.csv", recorded, turned, NAMES, load=False)
    notes = [note for note in read_log(path, robot=user.team_robot(tmp_path)).notes if "one of them is wrong" in note]
    assert len(notes) == (2 if tilt else 0)
    assert all(2.0 < float(note.split(" differs by ")[1].split()[0]) < 4.0 for note in notes)
