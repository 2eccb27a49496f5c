"""Kernels of controllers as plain Python, which checks every index; machine code writes anywhere."""

import numpy as np
import pytest

from towline.control import (
    ComputedTorque,
    Predictive,
    ageing,
    aiming,
    carrier_references,
    computed_torque,
    fixed_length_carriers,
    mechanics,
    prediction,
    predictive,
    thrusts,
)
from towline.models import load
from towline.simulation import simulate

PLAIN = [
    (computed_torque, "mechanics", mechanics.write_rows),
    (computed_torque, "move_on", ageing.move_on),
    (computed_torque, "thrusts", thrusts.write_thrusts),
    (predictive, "write_stages", prediction.write_stages),
    (predictive, "aim", aiming.aim),
    (carrier_references, "directions", fixed_length_carriers.write_directions),
    (carrier_references, "carriers_of", fixed_length_carriers.write_carriers),
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

    class Late(law):
        def step(self, time, state, reference):
            return super().step(time, state._replace(time=max(time - 1e-3, 0.0)), reference)

    noise = {"position": 1e-3, "attitude": 1e-3, "velocity": 1e-2, "tension": 0.1}

    def fly():
        given = {"controller": Late(robot), "wind": wind, "noise": noise, "duration": 1e-3 * steps, "substeps": 2}
        motions = simulate(robot, robot.home, **given).trajectory
        return [motions[part].to_numpy() for part in ("pose", "velocity", "tensions", "cable_lengths", "carrier_pose")]

    fast = fly()
    monkeypatch.setattr(
        predictive, "grows", lambda *_: False
    )  # that the loop is stable, machine code found in 400 steps
    for module, attribute, function in PLAIN:
        monkeypatch.setattr(module, attribute, lambda function=function: function)
    for one, other in zip(fast, fly(), strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9)


def test_the_aim_is_the_least_change_whose_motion_obeys_the_model():
    """By least squares of the stacked equations; states of a stage and the next share no moved place."""
    rng, m, f, stages, length = np.random.default_rng(1), 7, 2, 3, 0.5
    n, dt, efforts = 12 + 2 * f, np.array([0.01, 0.02, 0.03]), rng.uniform(0.5, 2.0, m + f)
    A, B = rng.normal(size=(stages, n, n)), rng.normal(size=(stages, n, m + f))
    c, wanted, planned = rng.normal(size=(stages, n)), rng.normal(size=(stages + 1, n)), rng.normal(size=(4, m + f))
    aimed, ordered = wanted.copy(), planned.copy()
    aiming.aim(dt, length, efforts, A, B, c, aimed, ordered)
    weigh = np.repeat([1.0, length], 3)[:, None]
    for k in range(stages):
        columns = np.hstack([B[k, 6:12, :m], A[k, 6:12, 12 : 12 + f]]) * weigh / dt[k]
        lacking = (wanted[k + 1] - A[k] @ wanted[k] - B[k] @ planned[k] - c[k])[6:12] * weigh[:, 0] / dt[k]
        root = np.sqrt(efforts)
        least = np.linalg.lstsq(columns / root, lacking, rcond=None)[0] / root
        change = np.append(ordered[k, :m] - planned[k, :m], aimed[k, 12 : 12 + f] - wanted[k, 12 : 12 + f])
        np.testing.assert_allclose(change, least, rtol=0.05, atol=0.02 * np.abs(least).max())
    np.testing.assert_allclose(aimed[-1, 12 : 12 + f] - wanted[-1, 12 : 12 + f], change[m:])
