"""Plans whose lowest natural frequency stays above a limit: by differences of the forces of cables of fixed lengths."""

import numpy as np
import pytest
from scipy.optimize import minimize

from towline import Dynamics, InputError, load, plan, tensions
from towline.statics.stiffness import natural_frequencies

from .stiff_robots import elastic, frequencies
from .told import told

LINE = {"path": {"kind": "line", "start": [-1, -0.5, 2.2], "end": [1, 0.5, 2.8]}, "duration": 3, "steps": 20}


def lowest(found, every=100):
    seen = found.audit
    rows = range(0, len(seen.times), every)
    return min(frequencies(found.scenario.robot, seen.motion.pose[k], seen.tensions[k])[0] for k in rows)


@pytest.fixture(scope="module")
def robot():
    return elastic("ipanema-2", 5e3, t_min=5.0)


def test_the_planner_pretensions_cables_as_far_as_the_limit_requires(robot):
    without = plan(robot, LINE)
    before = lowest(without)
    bound = 1.02 * before
    found = plan(robot, LINE | {"limits": {"natural_frequency": bound}})
    assert found.feasible, found.report()
    assert lowest(found) >= bound * (1 - 1e-5)
    assert found.audit.tensions.sum() > 1.1 * without.audit.tensions.sum()
    with pytest.raises(InputError, match="soft must name limits"):  # tensions alone are not traded against a cost
        plan(robot, LINE | {"limits": {"natural_frequency": bound, "soft": {"natural_frequency": 0.01}}})


def test_more_than_any_tensions_reach_is_refused(robot):
    """The lowest frequency is concave in the tensions, so a local search at both ends of the line finds the most."""
    most = []
    for end in (LINE["path"]["start"], LINE["path"]["end"]):
        pose = np.array([*end, 0, 0, 0.0])
        base, N = tensions(robot, pose).tensions, np.linalg.svd(Dynamics(robot).wrench_matrix(pose))[2][6:]

        def slowness(shift, pose=pose, base=base, N=N):
            t = base + shift @ N
            outside = np.maximum(0, np.maximum(robot.t_min - t, t - robot.t_max)).sum()
            return 1e3 * outside - natural_frequencies(robot, pose, np.maximum(t, robot.t_min))[0]

        most.append(-minimize(slowness, 10 * np.ones(2), method="Nelder-Mead", options={"maxiter": 400}).fun)
    beyond = plan(robot, LINE | {"steps": 8, "limits": {"natural_frequency": 1.01 * min(most)}})
    assert not beyond.feasible
    assert "natural_frequency of the platform must be at least" in told(beyond)
    assert plan(robot, LINE | {"steps": 8, "limits": {"natural_frequency": 0.98 * min(most)}}).feasible


def test_a_planar_robot_has_the_frequencies_of_its_plane():
    robot = elastic("planar-4", 1e3, t_min=5.0)
    task = {"path": {"kind": "line", "start": [-0.2, 0, 0.6], "end": [0.2, 0, 0.9]}, "duration": 2, "steps": 20}
    before = lowest(plan(robot, task))
    found = plan(robot, task | {"limits": {"natural_frequency": 1.03 * before}})
    assert found.feasible, found.report()
    assert lowest(found) >= 1.03 * before * (1 - 1e-5)


@pytest.mark.parametrize(
    ("EA", "t_min", "value", "names"),
    [
        (None, 5.0, 2.0, r"cables\[0\].stiffness"),
        (1e4, 0.0, 2.0, r"cables\[0\].t_min"),
        (1e4, 5.0, -1.0, "natural_frequency"),
        (1e4, 5.0, float("nan"), "natural_frequency"),
        (1e4, 5.0, "high", "natural_frequency"),
    ],
)
def test_wrong_limits_are_refused_in_one_line(EA, t_min, value, names):
    robot = load("ipanema-2") if EA is None else elastic("ipanema-2", EA, t_min)
    with pytest.raises(InputError, match=names) as error:
        plan(robot, LINE | {"limits": {"natural_frequency": value}})
    assert len(str(error.value).splitlines()) == 1


def test_phases_are_refused(robot):
    phases = [{"name": "all", "path": LINE["path"], "duration": 3}]
    with pytest.raises(InputError, match="natural_frequency must be left out with phases"):
        plan(robot, {"phases": phases, "limits": {"natural_frequency": 2.0}})
