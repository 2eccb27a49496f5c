"""Kernels of plant, sensors and controllers as plain Python, which checks every index; machine code writes anywhere."""

import numpy as np
import pytest

from towline.control import (
    ComputedTorque,
    Predictive,
    computed_torque,
    mechanics,
    moved,
    prediction,
    predictive,
    tethers,
    thrusts,
)
from towline.models import load
from towline.models.plant import periods, plant, rows
from towline.simulation import flying, orders, sensors, simulate, winding

PLAIN = [
    (computed_torque, "mechanics", mechanics.write_rows),
    (computed_torque, "thrusts", thrusts.write_thrusts),
    (predictive, "write_stages", prediction.write_stages),
    (moved, "directions", tethers.write_directions),
    (moved, "carriers_of", tethers.write_carriers),
    (periods, "run_rows", rows.run_rows),
    (plant, "run_rows", rows.run_rows),
    (flying, "sense_rows", sensors.sense_rows),
    (orders, "write_lengths", winding.write_lengths),
]
FLIGHTS = [
    ("caroca-pulleys", ComputedTorque, 4),
    ("multi-quadrotor-3", ComputedTorque, 3),
    ("wang-flying-quadrotor", ComputedTorque, 3),
    ("wang-ctmrts-4", Predictive, 2),
    ("multi-quadrotor-3", Predictive, 2),
]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # limits of rates that are infinite: machine code warns of none
@pytest.mark.parametrize(("name", "law", "steps"), FLIGHTS)
def test_a_flight_in_python_is_that_of_machine_code(monkeypatch, name, law, steps):
    robot = load(name)
    wind = None if robot.platform.aero is None else (2, 1, 0)
    noise = {"position": 1e-3, "attitude": 1e-3, "velocity": 1e-2, "tension": 0.1}

    def fly():
        given = {"controller": law(robot), "wind": wind, "noise": noise, "duration": 1e-3 * steps, "substeps": 2}
        motions = simulate(robot, robot.home, **given).trajectory
        return [motions[part].to_numpy() for part in ("pose", "velocity", "tensions", "cable_lengths", "carrier_pose")]

    fast = fly()
    for module, attribute, function in PLAIN:
        monkeypatch.setattr(module, attribute, lambda function=function: function)
    for one, other in zip(fast, fly(), strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9)
