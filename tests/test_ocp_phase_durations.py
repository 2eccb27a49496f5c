"""Durations of phases as ranges: each the shortest that is feasible, found in the whole motion."""

import pytest

from towline import InputError, load, plan, read_task
from towline.ocp import Planner

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
