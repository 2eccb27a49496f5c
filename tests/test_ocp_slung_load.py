"""A load under one quadrotor, whose motion follows from that of the load: nothing is left to choose but the time."""

import re
from math import comb

import numpy as np
import pytest
from scipy.optimize import brentq

from towline.ocp import plan

from .slung_load import ACCELERATION, LENGTH, slung

GRAVITY = 9.81
START, END = np.array([0.0, 0.0, 1.0]), np.array([2.0, 0.0, 1.5])


def largest_acceleration(seconds):
    """Return the largest acceleration of a quadrotor above a load on a straight line.

    The cable has the direction of the load's force.
    The least smooth polynomial law after which the quadrotor, too, starts and ends at rest has degree 11.
    """
    powers = [comb(5 + k, k) * comb(11, 5 - k) * (-1) ** k for k in range(6)]
    law = np.polynomial.Polynomial([0.0] * 6 + powers)
    shares = np.linspace(0, 1, 2001)
    force = np.outer(law.deriv(2)(shares) / seconds**2, END - START) + np.array([0, 0, GRAVITY])
    above = np.outer(law(shares), END - START) + LENGTH * force / np.linalg.norm(force, axis=1)[:, None]
    step = seconds / 2000
    return np.linalg.norm(np.diff(above, 2, axis=0) / step**2, axis=1).max()


def carried(steps, **objective):
    return {
        "path": {"kind": "line", "start": START.tolist(), "end": END.tolist()},
        "base": {"kind": "free", "ends": "rest"},
        "duration": {"min": 0.3, "max": 15},
        "objective": objective,
        "steps": steps,
    }


def test_the_least_time_is_that_of_the_quadrotors_acceleration():
    """No tension exerts a moment on the load: those rows are 0 = 0, and with them there were too many equations."""
    load = slung(inertia=[1e-3, 1e-3, 1e-3, 0, 0, 0])
    found = plan(load, carried(40, time=1e-3, jerk=1e3, carrier_acceleration=1e3))  # nearly nothing but time costs
    assert found.feasible, found.report()
    least = brentq(lambda seconds: largest_acceleration(seconds) - ACCELERATION, 1.0, 5.0)
    assert found.scenario.duration == pytest.approx(least, rel=0.01)


@pytest.mark.parametrize("steps", [40, 50])
def test_programs_of_one_unknown_end_soon(steps):
    """The Jacobian is nearly singular; with what IPOPT adds to it by default one program took 300 iterations.

    Of 18 such programs one or two still take more than 200, and rounding decides which.
    """
    found = plan(slung(dof=["x", "y", "z"]), carried(steps, time=3e-3))
    assert found.feasible, found.report()
    counts = [int(count) for stage in found.stages for count in re.findall(r"(\d+) iterations", stage.message)]
    assert len(counts) >= 1
    assert max(counts) < 60
