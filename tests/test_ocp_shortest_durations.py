"""Durations of phases and of paths that dwell as ranges: each the shortest that is feasible."""

import numpy as np
import pytest

from towline import InputError, load, plan, read_task, time_along
from towline.models.part import PositiveRange
from towline.ocp import Planner
from towline.ocp.search.shortest_durations import _shortest

HIGH, LOW, FAR = [-2, -1, 1.6], [-2, -1, 1], [2, 1, 1.6]
BOX = {"mass": 300, "com": [0, 0, -0.4]}
PHASES = [
    {"name": "lift", "path": {"kind": "line", "start": LOW, "end": HIGH}, "duration": {"min": 0.1, "max": 10}},
    {
        "name": "carry",
        "path": {"kind": "line", "start": HIGH, "end": FAR},
        "duration": {"min": 0.1, "max": 20},
        "load": BOX,
    },
    {"name": "wait", "duration": {"min": 0.3, "max": 2}, "load": BOX},
    {"name": "return", "path": {"kind": "line", "start": FAR, "end": HIGH}, "duration": 5},
]


def task(phases=PHASES, **others):
    return {"name": "bricks", "phases": phases, "limits": {"cable_speed": 3}, **others}


@pytest.fixture(scope="module")
def bricks():
    return plan("cogiro", task())


def lasting(phase, seconds):
    """Return a phase that lasts as long as is said."""
    return {**phase, "duration": seconds}


def test_each_phase_is_as_short_as_alone_and_no_shorter_one_is_feasible(bricks):
    assert bricks.feasible
    durations = {phase.name: phase.end - phase.start for phase in bricks.phases}
    assert durations["return"] == pytest.approx(5)
    assert durations["wait"] == pytest.approx(0.3)
    for phase in PHASES[:2]:
        seconds = durations[phase["name"]]
        assert plan("cogiro", task([lasting(phase, 1.0001 * seconds)])).feasible
        assert not plan("cogiro", task([lasting(phase, 0.995 * seconds)])).feasible
    # Heavier loads take longer: with the unloaded leg's fastest time the loaded one breaks its limits.
    empty = {key: value for key, value in PHASES[1].items() if key != "load"}
    assert plan("cogiro", task([empty])).duration <= durations["carry"] * 1.002


def test_the_task_of_the_plan_has_the_durations_as_numbers(bricks, tmp_path):
    numbers = [phase.duration for phase in bricks.scenario.task.phases]
    assert all(isinstance(number, float) for number in numbers)
    file = bricks.scenario.task.save(tmp_path / "chosen.yaml")
    again = plan("cogiro", file)
    assert again.feasible
    assert again.duration == pytest.approx(bricks.duration, rel=1e-9)
    assert bricks.stages[0].name == "durations of phases"


def test_a_phase_without_a_feasible_duration_keeps_its_longest():
    beyond = [{**PHASES[0], "load": {"mass": 1e5}, "duration": {"min": 0.5, "max": 3}}]
    found = plan("cogiro", task(beyond))
    assert not found.feasible
    assert found.duration == 3
    assert found.certificate.shortfall > 0


def test_a_time_limit_leaves_the_longest():
    found = plan("cogiro", task(time_limit=1e-9))
    assert found.duration == pytest.approx(10 + 20 + 2 + 5)
    assert found.stages[0].message.startswith("time limit")


def test_a_free_motion_with_a_range_is_refused_in_one_line():
    with pytest.raises(InputError, match=r"phases\[0\].duration must be a number where tube or base") as error:
        plan("cogiro", task(PHASES[:1], tube={"position": 0.1}))
    assert "\n" not in str(error.value)


def test_planning_again_takes_the_durations_of_the_first_plan():
    planner = Planner(load("cogiro"), read_task(task(PHASES[:1])))
    first, second = planner.plan(), planner.plan()
    assert first.duration == second.duration
    assert "durations of phases" not in [stage.name for stage in second.stages]


STILL = {"kind": "waypoints", "points": [[-1, 0, 1], [1, 1, 1.5], [1, -1, 1], [-1, 0, 1]], "dwell": [0, 0.5, 0.3, 0]}
RANGE = {"min": 0.5, "max": 20}


def test_a_path_that_dwells_has_the_fastest_time_law_and_rests_as_long_as_its_dwells():
    found = plan("cogiro", {"path": STILL, "duration": RANGE})
    assert found.feasible
    assert found.duration == pytest.approx(time_along("cogiro", {"path": STILL}).duration)
    times, motion = found.audit.times, found.audit.motion
    for point, dwell in zip(STILL["points"][1:3], STILL["dwell"][1:3], strict=True):
        there = np.linalg.norm(motion.pose[:, :3] - point, axis=1) < 1e-9
        assert np.ptp(times[there]) >= dwell - 2e-3
        assert np.abs(motion.velocity[there]).max() < 1e-3


def test_a_phase_that_dwells_lasts_longer_than_its_dwells():
    phase = {"name": "tour", "path": STILL, "duration": RANGE}
    found = plan("cogiro", {"phases": [phase]})
    assert found.feasible
    assert not plan("cogiro", {"phases": [lasting(phase, 0.998 * found.duration)]}).feasible


def test_a_limit_that_time_laws_do_not_know_takes_the_shortest_duration_of_the_own_law():
    most = 50.0  # [m/s^3]
    task = {"path": STILL, "limits": {"cable_jerk": most}}
    found = plan("cogiro", task | {"duration": RANGE})
    assert found.feasible
    step = 1e-3
    times = np.arange(0.0, found.duration, step)
    lengths = found.scenario.dynamics.cable_lengths(found.scenario.motion(times, None)[0].pose)
    jerk = np.abs(np.diff(lengths, 3, axis=0)).max() / step**3
    assert 0.95 * most < jerk < 1.01 * most
    assert not plan("cogiro", task | {"duration": 0.99 * found.duration}).feasible


def test_a_limit_that_the_fastest_law_of_a_path_that_dwells_does_not_know_is_kept():
    """That law, with its own audit, would take half as long."""
    short = {"kind": "waypoints", "points": [[0, 0, 1], [0.3, 0, 1], [0.3, 0.3, 1]], "dwell": [0, 0.2, 0]}
    made = plan("cogiro", {"path": short, "duration": RANGE, "limits": {"tension_rate": 3000.0}})
    assert made.feasible
    rates = np.gradient(made.trajectory["tensions"].values, made.trajectory["time"].values, axis=0)
    assert np.abs(rates).max() < 3030.0


def test_what_no_known_law_of_a_path_that_dwells_keeps_is_not_called_infeasible():
    planner = Planner("cogiro", {"path": STILL, "duration": RANGE, "limits": {"tension_rate": 1.0}})
    assert [planner.plan().status.value for _ in range(2)] == ["not-found"] * 2
    assert plan("cogiro", {"path": STILL, "duration": {"min": 1, "max": 1.5}}).status.value == "infeasible"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"tube": {"position": 0.1}}, "duration must be a number .s., because path has a dwell"),
        ({"duration": {"min": 0.1, "max": 0.8}}, "more than the 0.8 s for which path dwells, got 0.8 s"),
    ],
)
def test_a_range_for_a_dwell_that_cannot_be_is_one_line(change, expected):
    with pytest.raises(InputError, match=expected) as refused:
        plan("cogiro", {"path": STILL, "duration": RANGE} | change)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("power", "moving"), [(1, 2.0), (2, 2.0), (1, 0.11), (1.5, 9.9)])
@pytest.mark.parametrize("resting", [0.0, 1.2])
def test_a_power_of_the_duration_is_found_from_a_few_audits(power, moving, resting):
    """Of a speed and an acceleration, which fall with the time of moving and its square, and of a power between."""
    tried = []

    def beyond(seconds):
        tried.append(seconds)
        return max((moving / (seconds - resting)) ** power - 1, 0.0)

    shortest = resting + moving
    found = _shortest(PositiveRange(min=0.1, max=1000), resting, beyond)
    assert shortest <= found <= shortest * (1 + 1e-3)
    assert len(tried) <= 5
    assert max(tried) <= 1.6 * shortest  # the longer the motion, the more its audit takes


def test_undefined_values_do_not_end_the_search():
    found = _shortest(PositiveRange(min=0.1, max=10), 0.0, lambda seconds: np.inf if seconds < 3 else 0.0)
    assert 3 <= found <= 3 * (1 + 1e-3)
    assert _shortest(PositiveRange(min=0.1, max=10), 0.0, lambda _: np.inf) == 10
