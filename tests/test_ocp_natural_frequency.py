"""Plans whose lowest natural frequency stays above a limit: by differences of the forces of cables of fixed lengths."""

import numpy as np
import pytest

from towline import InputError, load, plan
from towline.statics.stiffness import stiffest

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


def test_no_tensions_reach_more_than_the_stiffest(robot):
    """At the end of the line no tensions inside the limits have the frequency, by a bound that `stiffest` proves."""
    most = min(
        stiffest(robot, np.array([*end, 0, 0, 0.0])).bound for end in (LINE["path"]["start"], LINE["path"]["end"])
    )
    beyond = plan(robot, LINE | {"steps": 8, "limits": {"natural_frequency": 1.01 * most}})
    assert not beyond.feasible
    assert "natural_frequency of the platform must be at least" in told(beyond)


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
