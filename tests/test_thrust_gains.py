"""Thrusts of drones with wrong gains: found by what balances weight and inertia across the cable."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import load
from towline.estimation.calibration import calibrate
from towline.estimation.logs import read_log
from towline.estimation.logs.recorded import read_recorded

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
    # A replay flies with the recorded thrusts, whose errors may look like another mass.
    replayed = [note for note in read_recorded(robot, path).notes if "the replay flies with other forces" in note]
    assert [note.split(",")[0] for note in replayed] == [note.split(",")[0] for note in notes]
    found = calibrate(robot, log.measurements, free=("offsets", "mass"))
    assert found.robot.platform.mass == pytest.approx(0.4, rel=0.01)


def test_drag_makes_no_load_lighter(tmp_path):
    """Of up to 0.16 N across the plane of the cables, whose balance the drag alone disturbs."""
    robot, recorded = load(user.team_robot(tmp_path)), user.team(12, drag=0.15)
    log = user.flight(tmp_path / "flight.csv", recorded, user.directions_of(recorded[2]), NAMES)
    found = calibrate(robot, read_log(log, robot=robot).measurements, free=("offsets", "mass"))
    assert found.robot.platform.mass == pytest.approx(0.4, rel=0.01)


def test_noise_of_thrusts_makes_no_load_lighter(recorded, tmp_path):
    """Of 2 %: 0.2 N of 2 N in the cables. Weights that follow it are larger where the tensions are too small."""
    t, x, drones = recorded
    robot, off = load(user.team_robot(tmp_path)), []
    for seed in range(3):
        draw = np.random.default_rng(seed)
        columns = {"t": t[:, None], "load": x + draw.normal(0, 1e-3, x.shape)}
        for i, (p, R, thrust, _) in enumerate(drones):
            columns[f"cf{i + 1}"] = p + draw.normal(0, 1e-3, p.shape)
            columns[f"cf{i + 1}_q"] = Rotation.from_matrix(R).as_quat()
            columns[f"cf{i + 1}_thrust"] = (1.03 * thrust * (1 + draw.normal(0, 0.02, len(t))))[:, None]
        axes = {"load": "_x _y _z", "cf1": "_x _y _z", "cf2": "_x _y _z", "cf1_q": "x y z w", "cf2_q": "x y z w"}
        names = [name + axis for name in columns for axis in axes.get(name, "").split() or [""]]
        path = user.write(tmp_path / f"flight{seed}.csv", names, np.hstack(list(columns.values())))
        mass = calibrate(robot, read_log(path, robot=robot).measurements, free=("offsets", "mass")).parameters[-1]
        off.append((mass.value - 0.4) / mass.sigma)
    assert abs(np.mean(off)) < 1.7  # three standard deviations of the mean


@pytest.mark.parametrize("tilt", [0.0, 3.0])
def test_directions_that_contradict_thrusts_are_named(tilt, recorded, tmp_path):
    """Without the load nothing shows which of them is wrong, and 3 degrees make cables seem 6 cm longer."""
    turned = user.directions_of(recorded[2]) @ Rotation.from_euler("x", tilt, degrees=True).as_matrix()
    path = user.flight(tmp_path / "flight.csv", recorded, turned, NAMES, load=False)
    notes = [note for note in read_log(path, robot=user.team_robot(tmp_path)).notes if "one of them is wrong" in note]
    assert len(notes) == (2 if tilt else 0)
    assert all(2.0 < float(note.split(" differs by ")[1].split()[0]) < 4.0 for note in notes)
