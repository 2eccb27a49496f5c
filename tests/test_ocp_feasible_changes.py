"""Advice where no duration is feasible: a nearer end, a lighter platform, stronger cables; each is planned."""

import re
from dataclasses import replace

import numpy as np
import pytest

from towline import Robot, Task, load, plan, tensions
from towline.ocp.planner import Planner
from towline.ocp.reports.report import sections
from towline.ocp.result import Offers
from towline.ocp.search.largest_share import _largest, largest_share
from towline.ocp.search.other_forces import smaller_t_min
from towline.ocp.search.other_paths import other_yaws, shifted
from towline.ocp.search.search import Search
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task

WAYS = {
    "beyond the frame": ("cogiro", [0, 0, 2], [9, 0, 2], {}),
    "in a tube": ("cogiro", [0, 0, 1], [9, 6, 1], {"tube": {"position": 0.1}}),
    "any way": ("planar-4", [0, 0, 1], [3, 0, 1], {"tube": {"position": "free"}, "duration": {"min": 3, "max": 20}}),
}


@pytest.fixture(scope="module", params=WAYS)
def refused(request):
    name, start, end, others = WAYS[request.param]
    task = {"name": "way", "path": {"kind": "line", "start": start, "end": end}, "duration": 5, "margin": 1} | others
    found = plan(name, task)
    assert not found.feasible
    return found


def test_there_is_advice_and_all_of_it_is_feasible_when_planned_anew(refused):
    assert refused.relaxations
    for offer in refused.relaxations:
        assert offer.plan.feasible
        varied = offer.plan.scenario
        robot = Robot.model_validate(varied.robot.model_dump())
        again = plan(robot, varied.task.model_dump())
        assert again.feasible
        value = {
            "length of the line": lambda task=varied.task: np.linalg.norm(
                np.subtract(task.path.end, task.path.start)[:3]
            ),
            "platform.mass": lambda robot=robot: robot.platform.mass,
            "cables.t_max": lambda robot=robot: robot.t_max.max(),
            "cables.t_min": lambda robot=robot: robot.t_min.max(),
            "shift of the path": lambda task=varied.task: np.subtract(task.path.end, refused.scenario.task.path.end)[
                "xyz".index(offer.detail[-1])
            ],
        }[offer.name]()
        assert value == pytest.approx(offer.possible, rel=2e-3)


def test_a_nearer_end_is_nearly_the_farthest(refused):
    offer = next(each for each in refused.relaxations if each.name == "length of the line")
    path, task = refused.scenario.task.path, offer.plan.scenario.task
    way = np.subtract(path.end, path.start)
    farther = np.array(path.start) + way * min(1.15 * offer.possible / np.linalg.norm(way[:3]), 1.0)
    longer = task.model_copy(update={"path": path.model_copy(update={"end": tuple(farther)})})
    assert not plan(offer.plan.scenario.robot, longer).feasible


def test_the_report_says_what_can_be_tried_and_where_it_fails(refused):
    text = refused.report()
    assert "What you can try" in text
    assert f"feasible {refused.relaxations[0].name}" in text
    assert refused.relaxations[0].detail in text
    row = int(np.argmin(np.abs(refused.audit.times - refused.certificate.time)))
    x = refused.audit.motion.pose[row, 0]
    assert f"({round(x, 6) + 0.0:.4g}, " in text
    assert refused.to_dict()["relaxations"][0]["detail"] == refused.relaxations[0].detail


def test_a_load_that_is_too_heavy_has_the_heaviest_that_is_not():
    robot = load("cogiro")
    data = robot.model_dump()
    data["platform"] |= {"mass": 3000.0}
    found = plan(
        Robot.model_validate(data), {"path": {"kind": "line", "start": [0, 0, 1], "end": [1, 0, 3]}, "duration": 6}
    )
    assert not found.feasible
    mass = next(each for each in found.relaxations if each.name == "platform.mass")
    strength = next(each for each in found.relaxations if each.name == "cables.t_max")
    data["platform"] |= {"mass": 1.05 * mass.possible}
    assert not plan(Robot.model_validate(data), found.scenario.task).feasible
    assert 91 < mass.possible < 3000
    assert robot.t_max.max() < strength.possible < 3000 / mass.possible * 1.2 * robot.t_max.max()


def test_a_wind_is_weakened_until_a_plan_is_feasible():
    task = {"path": {"kind": "line", "start": [0, 0, -1.2], "end": [0.3, 0, -1.2]}, "duration": 3, "wind": [25, 0, 0]}
    found = plan("wang-flying", task)
    offer = next(each for each in found.relaxations if each.name == "wind")
    assert 1 < offer.possible < 25
    assert f"{offer.possible:.4g} m/s instead of 25 m/s (audited)" in found.report()
    assert plan("wang-flying", task | {"wind": [offer.possible, 0, 0]}).feasible
    assert not plan("wang-flying", task | {"wind": [1.1 * offer.possible, 0, 0]}).feasible


def test_a_rotation_ends_at_a_smaller_angle():
    path = {"kind": "line", "start": [0, 0, 2.5, 0, 0, 0], "end": [0, 0, 2.5, 1.4, 0, 0]}
    found = plan("ipanema-2", {"path": path, "duration": 4})
    offer = next(each for each in found.relaxations if each.name == "part of the rotation")
    share = offer.possible / 100
    degrees = np.rad2deg(1.4 * share)
    assert f"% of it, to roll, pitch, yaw ({degrees:.2f}"[:-2] in found.report()
    for factor, possible in ((0.999, True), (1.01, False)):
        end = [0, 0, 2.5, 1.4 * share * factor, 0, 0]
        assert plan("ipanema-2", {"path": path | {"end": end}, "duration": 4}).feasible == possible


@pytest.mark.parametrize(
    ("start", "yaws", "wrong"), [([-1, 0, 2], [0.2, 0.9, -1.0, 0], [1, 2]), ([-1, 0.2, 2.2], [0, 1.4], [1])]
)
def test_points_whose_yaw_cannot_be_held_are_named_with_the_nearest_that_can(start, yaws, wrong):
    """Statics by itself shows which points are wrong, and that a yaw a little nearer to the given one is wrong too."""
    points = [[start[0] + 0.6 * k, start[1] + 0.2 * (k % 2), start[2], 0, 0, yaw] for k, yaw in enumerate(yaws)]
    held = [tensions("ipanema-2", point).feasible for point in points]
    assert [k for k, possible in enumerate(held) if not possible] == wrong
    line = len(points) == 2

    def task(points):
        path = {"kind": "line", "start": points[0], "end": points[1]}
        return {"path": path if line else {"kind": "waypoints", "points": points}, "duration": 12}

    found = plan("ipanema-2", task(points))
    offer = next(each for each in found.relaxations if each.name.startswith("yaw"))
    assert offer.name == f"yaw at path.{'end' if line else f'points[{wrong[0]}]'}"
    assert (offer.requested, offer.unit) == (yaws[wrong[0]], "rad")
    assert all(f"path.points[{k}]" in offer.detail for k in wrong[1:])
    path = offer.plan.scenario.task.path
    offered = [list(pose) for pose in ((path.start, path.end) if line else path.points)]
    assert offered[wrong[0]][5] == pytest.approx(offer.possible, abs=1e-3)
    assert plan("ipanema-2", task(offered)).feasible
    for k, (old, new) in enumerate(zip(points, offered, strict=True)):
        assert old[:5] == new[:5]
        assert (old[5] != new[5]) == (k in wrong)
    for k in wrong:
        nearer = offered[k].copy()
        nearer[5] += 0.15 * (yaws[k] - nearer[5])
        assert not tensions("ipanema-2", nearer).feasible


def test_no_change_is_offered_that_a_task_cannot_have():
    """The rate of tensions would fall to its limit in more than the longest duration of a task."""
    path = {"kind": "line", "start": [-2, -1, 2.0], "end": [2, 1, 2.5]}
    found = plan("cogiro", {"path": path, "duration": 1.2, "limits": {"tension_rate": 100}})
    assert found.status == "infeasible"
    assert all(each.plan.feasible for each in found.relaxations)


def test_without_a_feasible_change_the_report_says_what_may_help():
    wall = {"kind": "box", "name": "wall", "min": [-0.1, -5, 0], "max": [0.1, 5, 6]}
    line = {"kind": "line", "start": [-1, 0, 1], "end": [1, 0, 1]}
    task = {"path": line, "duration": 4, "limits": {"keep_out": [wall]}}
    # Cables cross the wall wherever the platform is, so there is no way round.
    (fewer,) = plan("ipanema-1", task).relaxations
    assert (fewer.name, fewer.possible) == ("number of keep-out regions", 0)
    assert again(fewer).feasible
    shorter = plan("ipanema-1", task | {"limits": {"keep_out": [wall | {"min": [-0.1, -5, 4.9]}]}})
    assert shorter.feasible
    away = {"kind": "line", "start": [1.1, 0.9, 0.2], "end": [4, 4, 2]}
    above = plan("wang-ctmrts", {"path": away, "duration": 6})
    assert not above.relaxations
    assert "no cable pulls along force (0.00, 0.00, 1.00)" in above.report()  # above all anchors
    assert "a path inside the frame" in above.report()


FLOOR = {"mass": 20, "dof": ["x", "y", "z"]}
ANCHORS = [[x, y, 4.0] for x in (-3, 3) for y in (-2, 2)]


@pytest.mark.parametrize("path", ["line", "feed"])
def test_a_path_below_the_floor_is_offered_as_far_above_it_as_it_was_below(path):
    held = {"carrier": "f", "attachment": [0, 0, 0], "t_min": 1, "t_max": 900}
    cables = [held | {"anchor": anchor} for anchor in ANCHORS]
    frame = {"name": "r", "source": "made up", "carriers": [{"name": "f", "kind": "ground"}]}
    robot = frame | {"platform": FLOOR, "floor": 0.5, "cables": cables}
    start, end = [0, 0, 1], [0.5, 0.2, 0.25]
    paths = {
        "line": {"path": {"kind": "line", "start": start, "end": end}, "duration": 3},
        "feed": {"path": {"kind": "feed", "points": [start, end], "feed": 0.3, "acceleration": 2}},
    }
    found = plan(Robot.model_validate(robot), paths[path])
    (offer,) = found.relaxations
    assert (offer.name, offer.detail) == ("shift of the path", "along z")
    assert offer.possible == pytest.approx(0.25, rel=1e-2)  # the end is as far below the floor
    moved = offer.plan.trajectory["pose"].values - found.trajectory["pose"].values
    np.testing.assert_allclose(moved, np.tile([0, 0, offer.possible, 0, 0, 0], (len(moved), 1)), atol=1e-9)


def test_a_path_that_starts_where_nothing_holds_the_platform_is_offered_beside_that():
    line = {"kind": "line", "start": [7.8, 0, 2], "end": [6, 0.5, 2]}
    found = plan("cogiro", {"path": line, "duration": 4})
    offer = next(each for each in found.relaxations if each.name == "shift of the path")
    at_start = offer.plan.trajectory["pose"].values[0]
    assert tensions("cogiro", at_start).feasible
    back = 0.2 * np.sign(offer.possible) * np.eye(6)["xyz".index(offer.detail[-1])]
    assert not tensions("cogiro", at_start - back).feasible


@pytest.mark.parametrize(
    ("path", "bound"),
    [
        ({"kind": "circle", "centre": [0, 0, 1.5], "radius": 2, "rate": -1}, 1.0),  # a speed of 2 m/s
        ({"kind": "feed", "points": [[-1, 0, 1], [1, 0, 1]], "feed": 2, "acceleration": 4}, 1.0),
    ],
)
def test_a_path_with_its_own_speed_is_offered_at_the_speed_that_the_limit_permits(path, bound):
    found = plan("cogiro", {"path": path, "limits": {"platform_speed": bound}})
    offer = found.relaxations[0]
    assert offer.name in ("path.rate", "path.feed")
    assert offer.possible == pytest.approx(offer.requested * bound / 2, rel=3e-3)  # half of its 2 m/s
    speed = np.linalg.norm(np.gradient(offer.plan.trajectory["pose"].values[:, :3], 0.01, axis=0), axis=1)
    assert bound * 0.99 < speed.max() < bound * 1.0001


PATHS = (
    {"kind": "rest", "pose": [1, 2, 3, 0.1, 0.2, 0.3]},
    {"kind": "line", "start": [0, 0, 1], "end": [1, 2, 3]},
    {"kind": "circle", "centre": [1, 2, 3], "radius": 1, "rate": 1, "drift": [0.1, 0, 0]},
    {"kind": "waypoints", "points": [[0, 0, 1], [1, 0, 1], [1, 1, 2]]},
    {"kind": "feed", "points": [[0, 0, 1], [1, 0, 1], [1, 1, 2]], "feed": 1, "acceleration": 2},
    {"kind": "samples", "times": range(6), "poses": [[k, k**2, 1] for k in range(6)]},
)
RETURN = {"kind": "return", "path": PATHS[3], "duration": 2, "start": 0.5, "settle": 1, "offset": [0.1, 0, 0, 0, 0, 0]}
PARTS = [{"path": PATHS[1], "duration": 1}, {"path": {"kind": "rest", "pose": [1, 2, 3]}, "duration": 1}]


@pytest.mark.parametrize(
    "fields", [*PATHS, RETURN, {"kind": "sequence", "parts": PARTS}], ids=lambda each: each["kind"]
)
def test_a_shifted_path_is_the_path_elsewhere(fields):
    path = Task.model_validate({"path": fields, "duration": 2}).path
    times, by = np.linspace(0, 2, 21), np.array([0.3, -0.2, 0.1])
    before, after = path.at(times, 2.0), shifted(path, by).at(times, 2.0)
    np.testing.assert_allclose(after.pose - before.pose, np.tile([*by, 0, 0, 0], (21, 1)), atol=1e-12)
    np.testing.assert_allclose(after.acceleration, before.acceleration, atol=1e-9)


def test_two_causes_have_two_changes_and_neither_alone_is_enough():
    held = {"carrier": "f", "attachment": [0, 0, 0], "t_min": 1, "t_max": 900}
    aero = {"air_density": 1.2, "drag": 1.0, "lift": 0.0, "area": 1.0}
    robot = {"name": "r", "source": "made up", "carriers": [{"name": "f", "kind": "ground"}]}
    robot |= {"platform": FLOOR | {"aero": aero}, "cables": [held | {"anchor": anchor} for anchor in ANCHORS]}
    line = {"kind": "line", "start": [0, 0, 1], "end": [0.1, 0.1, 1.1]}
    task = {"path": line, "duration": 1, "wind": [60, 0, 0], "margin": 300}
    found = plan(Robot.model_validate(robot), task)
    wind, margin = sorted(found.relaxations, key=lambda offer: offer.unit, reverse=True)
    assert (wind.name, margin.name) == ("wind", "margin")
    changes = {"wind": [wind.possible, 0, 0]}, {"margin": margin.possible}
    assert plan(Robot.model_validate(robot), task | changes[0] | changes[1]).feasible
    for change in ({"wind": [0, 0, 0]}, {"margin": 0}):
        assert not plan(Robot.model_validate(robot), task | change).feasible
    larger = {"wind": [1.1 * wind.possible, 0, 0]}, {"margin": 1.1 * margin.possible}
    for k in (0, 1):
        assert not plan(Robot.model_validate(robot), task | larger[k] | changes[1 - k]).feasible
    assert "together with margin" in advice(found, "feasible wind", found.offers)


def without_attitude(**fields):
    """A frame above the room, whose cables hold a point."""
    held = {"carrier": "f", "attachment": [0, 0, 0], "t_min": 1, "t_max": 900} | fields
    robot = {"name": "r", "source": "made up", "carriers": [{"name": "f", "kind": "ground"}], "platform": FLOOR}
    return Robot.model_validate(robot | {"cables": [held | {"anchor": anchor} for anchor in ANCHORS]})


def test_a_region_in_the_way_does_not_hide_that_t_min_is_too_large():
    """Above the room four cables at t_min already pull up with more than the weight, wherever a path goes."""
    drum = {"kind": "sphere", "name": "drum", "centre": [0, 0.1, 1.1], "radius": 0.2, "cables": None}
    line = {"kind": "line", "start": [-0.5, 0, 1], "end": [0.5, 0.2, 1.2]}
    task = {"path": line, "duration": 5, "limits": {"keep_out": [drum]}}
    found = plan(without_attitude(t_min=600), task)
    strength, nearer = found.relaxations
    assert (strength.name, nearer.name) == ("cables.t_min", "length of the line")
    path = line | {"end": place_in(nearer.detail)}
    robot = without_attitude(t_min=float(f"{strength.possible:.4g}"))
    assert plan(robot, task | {"path": path}).feasible
    assert not plan(robot, task).feasible
    assert not plan(without_attitude(t_min=600), task | {"path": path}).feasible


def test_ranges_of_phases_that_are_too_short_have_durations_beside_another_cause():
    there = {"kind": "line", "start": [-0.5, 0, 1], "end": [0.5, 0.2, 1.2]}
    back = there | {"start": there["end"], "end": there["start"]}
    span = {"min": 0.01, "max": 0.05}
    phases = [{"name": "there", "path": there, "duration": span}, {"name": "wait", "duration": 0.5}]
    task = {"phases": [*phases, {"name": "back", "path": back, "duration": span}], "margin": 440}
    found = plan(without_attitude(), task)
    margin, longer = found.relaxations
    assert (margin.name, longer.name) == ("margin", "phases[0].duration")
    assert "phases[2].duration" in longer.detail
    shorter = [phase | {"duration": longer.possible} if "path" in phase else phase for phase in task["phases"]]
    assert plan(without_attitude(), {"phases": shorter, "margin": margin.possible}).feasible
    assert not plan(without_attitude(), task | {"margin": 0}).feasible
    assert not plan(without_attitude(), task | {"phases": shorter}).feasible


def advice(found, name, offers=Offers):
    """The text of a row of what can be tried, without the relaxations that `Plan.relaxations` takes seconds for."""
    shown = sections(replace(found, offers=offers))
    return dict(next(section for section in shown if section.title == "What you can try").facts)[name]


def with_cables(robot, **fields):
    data = load(robot).model_dump()
    data["cables"] = [cable | fields for cable in data["cables"]]
    return Robot.model_validate(data)


def test_a_load_that_is_too_heavy_has_the_heaviest_that_can_be_carried():
    def fetching(mass):
        crate = {"mass": mass, "com": [0.05, 0, -0.5], "inertia": [mass / 8] * 3 + [0, 0, 0]}
        there = {"kind": "line", "start": [-0.5, -0.5, 1.7], "end": [0.5, 0.5, 1.2]}
        back = there | {"start": there["end"], "end": there["start"]}
        return {
            "phases": [
                {"name": "there", "duration": 2, "path": there},
                {"name": "grip", "duration": 0.5, "ground": {}, "load": crate},
                {"name": "back", "duration": 3, "path": back, "load": crate},
            ],
            "limits": {"cable_speed": 2},
        }

    found = plan("cogiro", fetching(1200))
    assert not found.feasible
    (offer,) = (each for each in found.relaxations if each.name == "phases[1].load.mass")
    assert (offer.requested, offer.detail) == (1200, "instead of 1200 kg, in each phase")
    for factor, possible in ((1.0, True), (1.03, False)):
        assert plan("cogiro", fetching(factor * offer.possible)).feasible == possible


def test_cables_that_pull_too_hard_have_the_largest_t_min_that_is_feasible():
    task = {"path": {"kind": "line", "start": [0, 0, 1], "end": [0.4, 0.2, 1.3]}, "duration": 3}
    found = plan(with_cables("cogiro", t_min=1500.0), task)
    (offer,) = (each for each in found.relaxations if each.name == "cables.t_min")
    assert 0 < offer.possible < 1500
    for factor, possible in ((1.0, True), (1.05, False)):
        assert plan(with_cables("cogiro", t_min=factor * offer.possible), task).feasible == possible


def again(offer):
    """The plan of an offer's robot and task, read again."""
    varied = offer.plan.scenario
    return plan(Robot.model_validate(varied.robot.model_dump()), varied.task.model_dump())


def place_in(detail):
    return [float(each) for each in detail.partition("(")[2].partition(")")[0].split(", ")]


def test_a_region_on_the_way_has_a_way_round():
    post = {"kind": "sphere", "name": "post", "centre": [0, 0, 2], "radius": 0.7, "cables": None}
    task = {"path": {"kind": "line", "start": [-2, 0, 2], "end": [2, 0, 2]}, "duration": 6, "steps": 16}
    task |= {"limits": {"keep_out": [post]}}
    (way,) = plan(without_attitude(), task | {"tube": {"position": 0.05}}).relaxations
    assert way.name == "length of a way round"
    followed = again(way)
    assert followed.feasible
    position = followed.trajectory["pose"].values[:, :3]
    np.testing.assert_allclose(position[[0, -1]], [[-2, 0, 2], [2, 0, 2]], atol=0.05 + 1e-9)
    assert np.linalg.norm(position - post["centre"], axis=1).min() > post["radius"] - 1e-6
    assert way.possible >= 2 * (np.sqrt(4 - 0.49) + 0.7 * np.arcsin(0.35)) - 0.05  # tangents and arc
    assert not any("leaves the frame" in warning for warning in followed.warnings)
    inside = task["limits"] | {"platform_box": {"min": [-2.5, -1.6, 0], "max": [2.5, 1.6, 3.5]}}
    followed = plan(without_attitude(), task | {"tube": {"position": "free"}, "limits": inside})
    assert followed.feasible
    assert not any("leaves the frame" in warning for warning in followed.warnings)


@pytest.mark.parametrize(("which", "tube"), [("start", {}), ("end", {}), ("start", {"position": "free"})])
def test_an_end_inside_a_region_has_a_clear_one_near_by(which, tube):
    crate = {"kind": "box", "name": "crate", "min": [-1, -1, 1], "max": [1, 1.4, 3], "cables": None}
    inside, outside = [0, 0, 2], [3, 2, 2]
    ends = {"start": inside, "end": outside} if which == "start" else {"start": outside, "end": inside}
    task = {"path": {"kind": "line", **ends}, "duration": 6, "limits": {"keep_out": [crate]}, "steps": 15}
    task |= {"tube": tube} if tube else {}
    found = plan("cogiro", task)
    assert found.status == "infeasible"
    offer = next(each for each in found.relaxations if each.name == f"shift of path.{which}")
    place = place_in(offer.detail)
    assert offer.possible == pytest.approx(np.linalg.norm(np.subtract(place, inside)))
    assert plan("cogiro", task | {"path": {"kind": "line", **ends, which: place}}).feasible


def test_in_a_tube_too_the_line_from_another_start_is_clear():
    """The nearest start that is clear lies behind the ball, from where the line leads through it."""
    ball = {"kind": "sphere", "name": "ball", "centre": [-0.25, 0, 0.72], "radius": 0.15, "cables": None}
    behind, end = [-0.41, 0, 0.7], [0.3, 0, 0.7]
    task = {"path": {"kind": "line", "start": [-0.3, 0, 0.7], "end": end}, "duration": 3, "tube": {"position": 0.02}}
    (offer,) = plan("planar-4", task | {"limits": {"keep_out": [ball]}}).relaxations
    assert offer.name == "shift of path.start"
    place = place_in(offer.detail)
    assert again(offer).feasible
    line = place + np.linspace(0, 1, 1001)[:, None] * np.subtract(end, place)
    assert np.linalg.norm(line - ball["centre"], axis=1).min() > ball["radius"]
    assert np.linalg.norm(np.subtract(behind, ball["centre"])) > ball["radius"]
    assert tensions("planar-4", [*behind, 0, 0, 0]).feasible


def test_no_end_below_the_floor_is_suggested():
    everywhere = {"kind": "box", "name": "hall", "min": [-9, -9, 0], "max": [9, 9, 6], "cables": None}
    task = {"path": {"kind": "line", "start": [-3, 0, 2], "end": [3, 0, 2]}, "duration": 6}
    found = plan("cogiro", task | {"limits": {"keep_out": [everywhere]}})
    assert [each.name for each in found.relaxations] == ["number of keep-out regions"]


def test_carriers_that_the_task_holds_may_be_moved_where_tensions_are_missing():
    circle = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.5, "rate": 0.6}
    found = plan("wang-flying", {"path": circle})
    assert found.status == "infeasible"
    assert "`base: {kind: free}`" in advice(found, "moving carriers")
    assert plan("wang-flying", {"path": circle, "base": {"kind": "free", "ends": "periodic"}}).feasible


def test_a_level_beam_whose_cables_end_on_one_line_cannot_be_moved_across_it():
    """No cables exert a moment about that line, which is h above the centre of mass: m a h is missing."""
    robot, h = load("multi-quadrotor-3"), 0.05
    cables = zip(robot.cables, (0.3, 0.0, -0.3), strict=True)
    on_a_line = tuple(cable.model_copy(update={"attachment": (x, 0.0, h)}) for cable, x in cables)
    beam = robot.model_copy(update={"cables": on_a_line})
    path = {"kind": "line", "start": [0, 0, 0], "end": [0, 1, 0]}
    task = {"path": path, "duration": 3, "base": {"kind": "free"}, "steps": 20}
    found = plan(beam, task)
    assert found.status == "infeasible"
    missing = beam.platform.mass * np.abs(found.audit.motion.acceleration[:, 1]).max() * h / np.hypot(h, beam.length)
    assert found.certificate.shortfall == pytest.approx(missing, rel=0.01)
    assert "`tube: {attitude: 0.2}`" in advice(found, "a tilting platform")
    assert plan(beam, task | {"tube": {"attitude": 0.2}}).feasible


def test_a_way_round_to_an_end_without_tensions_has_another_end():
    post = {"kind": "sphere", "name": "post", "centre": [0, 0, 1.4], "radius": 0.1, "cables": None}
    line = {"kind": "line", "start": [-0.8, -0.5, 1], "end": [0.8, 0.5, 1.8]}
    task = {"path": line, "duration": 4, "steps": 30, "limits": {"keep_out": [post]}}
    shift, way = plan("ipanema-1", task).relaxations
    assert (shift.name, way.name) == ("shift of path.end", "length of a way round")
    assert again(way).feasible
    end = place_in(shift.detail)
    assert not tensions(load("ipanema-1"), [*line["end"], 0, 0, 0]).feasible
    assert tensions(load("ipanema-1"), [*end, 0, 0, 0]).feasible
    assert plan("ipanema-1", task | {"path": line | {"end": end}, "tube": {"position": "free"}}).feasible


def test_a_path_outside_the_degrees_of_freedom_has_the_coordinates_that_must_not_change():
    task = {"path": {"kind": "line", "start": [0, 0, 0.6], "end": [0.1, 0.3, 0.7]}, "duration": 2}
    assert " y " in advice(plan("planar-4", task), "another path")


def test_carriers_on_the_ground_are_not_to_be_moved():
    task = {"path": {"kind": "line", "start": [0, 0, 2], "end": [9, 0, 2]}, "duration": 5}
    assert "moving carriers" not in plan("cogiro", task).report()


def test_numbers_in_another_unit_come_first_and_nothing_else_is_tried():
    found = plan(
        "ipanema-2", {"path": {"kind": "line", "start": [0, 0, 2500], "end": [1000, 500, 2500]}, "duration": 4}
    )
    assert "are these millimetres?" in advice(found, "other units")
    assert "no single change" not in found.report()


def test_a_geometry_that_cannot_balance_a_moment_is_what_must_change():
    """All cables end in a point beside the CoM: no tensions give a moment about it."""
    still = {"path": {"kind": "rest", "pose": [0, 0, 2]}, "duration": 1}
    found = plan(with_cables("cogiro", attachment=[0.3, 0, 0]), still)
    assert found.certificate.singular
    assert "platform.dof" in advice(found, "another geometry")


def test_carriers_that_are_too_weak_for_the_weight_have_the_factor_with_which_they_are_not():
    data = load("multi-quadrotor-3").model_dump()
    for carrier in data["carriers"]:
        carrier["thrust_max"] = 19.0
    task = {"path": {"kind": "line", "start": [0, 0, 1], "end": [1, 0, 1.3]}, "duration": 4}
    task |= {"base": {"kind": "free", "ends": "rest"}, "steps": 10}
    found = plan(Robot.model_validate(data), task)
    assert found.status == "infeasible"
    factor = float(advice(found, "a larger thrust_max").split()[0])
    held = plan(Robot.model_validate(data), {"path": {"kind": "rest", "pose": [0, 0, 0]}, "duration": 1})
    assert advice(held, "a larger thrust_max") == advice(found, "a larger thrust_max")
    assert "moving carriers" not in held.report()  # they would not help
    for carrier in data["carriers"]:
        carrier["thrust_max"] *= factor
    assert plan(Robot.model_validate(data), task).feasible


def test_a_team_in_a_storm_learns_the_force_of_its_wind():
    data = load("multi-quadrotor-3").model_dump()
    data["platform"]["aero"] = {"air_density": 1.2, "drag": 1.0, "lift": 0.0, "area": 0.1}
    robot = Robot.model_validate(data)
    task = {"path": {"kind": "line", "start": [0, 0, 1], "end": [1, 0, 1.3]}, "duration": 4}
    task |= {"base": {"kind": "free", "ends": "rest"}, "steps": 20, "wind": [40, 0, 0]}
    text = advice(plan(robot, task | {"time_limit": 1e-9}), "a weaker wind")  # before any program
    force, weight = 0.5 * 1.2 * 0.1 * 40**2, 2.4 * 9.81
    assert text.startswith(f"this one exerts {force:g} N on a platform that weighs {weight:.4g} N")
    assert "(20, 0, 0) m/s exerts a quarter" in text


@pytest.mark.parametrize(("key", "timing"), [("final", "smooth"), ("initial", "uniform")], ids=lambda it: it)
def test_lines_whose_ends_are_given_as_states_too_have_nearer_ends_and_other_yaws(key, timing):
    """The state given at an end moves with it: it was refused as one that the path does not have."""
    robot, seconds = load("the-cable-robot-simulator"), 8.0
    start, way = np.array(robot.home), np.array([0.1, 0, 0, 0, 0, -1.2])
    state = {"pose": (start + way if key == "final" else start).tolist()}
    state["velocity"] = (way / seconds if timing == "uniform" else 0 * way).tolist()
    path = {"kind": "line", "start": start.tolist(), "end": (start + way).tolist(), "timing": timing}
    found = plan(robot, {"path": path, "duration": seconds, key: state})
    named = {each.name: each.plan for each in found.relaxations}
    assert {"length of the line", "yaw at path.end"} <= set(named)
    for each in named.values():
        assert each.feasible
        row = -1 if key == "final" else 0
        own = getattr(each.scenario.task, key)
        assert own.pose == pytest.approx(each.trajectory["pose"].values[row], abs=1e-9)
        assert own.velocity == pytest.approx(each.trajectory["velocity"].values[row], abs=1e-9)


def test_the_largest_circle_that_is_feasible_is_offered():
    """Its plan is feasible, and with a radius three percent larger there is none."""
    circle = {"kind": "circle", "centre": [0, 0, 1], "radius": 8, "rate": 0.3}
    (offer,) = [each for each in plan("cogiro", {"path": circle, "duration": 5}).relaxations if "radius" in each.name]
    for radius, feasible in ((offer.possible, True), (1.03 * offer.possible, False)):
        assert plan("cogiro", {"path": circle | {"radius": radius}, "duration": 5}).feasible == feasible


def test_a_path_that_leaves_the_frame_on_both_sides_is_drawn_in_towards_home():
    start, end, home = np.array([-3, 0.2, 1.0]), np.array([3, 0.1, 1.4]), np.array(load("ipanema-1").home[:3])

    def task(share):
        ends = (home + share * (end - home)).tolist(), (home + share * (start - home)).tolist()
        return {"path": {"kind": "line", "start": ends[1], "end": ends[0]}, "duration": 8}

    (offer,) = plan("ipanema-1", task(1.0)).relaxations
    assert offer.name == "size of the path"
    named = [[float(number) for number in point.split(", ")] for point in re.findall(r"\(([^)]*)\)", offer.detail)]
    assert np.allclose(named, offer.plan.trajectory["pose"].values[[0, -1], :3], atol=1e-4)
    assert plan("ipanema-1", task(offer.possible / 100)).feasible
    assert not plan("ipanema-1", task(1.05 * offer.possible / 100)).feasible


def test_a_disc_of_winds_is_offered_a_speed_that_is_feasible_from_every_side():
    task = {"path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 0.5}
    (offer,) = plan("wang-flying", task | {"wind": {"speed": 40}}).relaxations
    assert offer.name == "wind"
    assert not plan("wang-flying", task | {"wind": {"speed": 1.05 * offer.possible}}).feasible
    for side in np.linspace(0, 2 * np.pi, 5):
        wind = offer.possible * np.array([np.cos(side), np.sin(side), 0])
        assert plan("wang-flying", task | {"wind": wind.tolist()}).feasible


def test_a_variation_that_the_task_refuses_is_not_offered():
    """With other yaws the rounded legs turn, and miss exact waypoints by more than an attitude tube of 0 permits."""
    points = [[0, 0, 2, 0, 0, 1], [5, 3, 1.5, 0, 0, 1], [0, 2, 2, 0, 0, 1]]
    task = {"path": {"kind": "waypoints", "points": points}, "duration": 8}
    for tube, names in (({}, ["yaw at path.points[1]"]), ({"position": 0.3, "waypoints": "exact"}, [])):
        scenario = Planner("cogiro", task | {"tube": tube}).scenario
        assert [each.name for each in largest_share(Search(scenario, {}, None), other_yaws(scenario))] == names


def test_the_share_of_t_min_at_which_a_team_rests_is_that_of_its_only_tensions():
    """Three cables from one ring to another hold the platform in one way: each with W / (3 cos) of its angle."""
    data = load("multi-quadrotor-3").model_dump()
    for cable in data["cables"]:
        cable["t_min"] = 20.0
    robot = Robot.model_validate(data)
    task = {"path": {"kind": "line", "start": [0, 0, 0], "end": [0.1, 0, 0]}, "duration": 3}
    scenario = lay_out(robot, read_task(task | {"base": {"kind": "free", "ends": "rest"}}))
    change = smaller_t_min(scenario)
    share = _largest(Search(scenario, {}, None), lambda share: change.at(share)[0])
    own = tensions(load("multi-quadrotor-3"), robot.home).tensions.min()
    missed = 0.1 * robot.weight  # is what rest may miss of the force of few cables, which a program finds
    assert 20 * share == pytest.approx(own, abs=missed / 3 + 20 / 50)


def test_a_region_between_points_has_further_points_and_one_about_a_point_has_another_point():
    points = [[-0.5, -0.3, 1], [-0.5, 0.3, 1], [0.5, 0.3, 1]]
    path = {"kind": "feed", "points": points, "feed": 0.2, "acceleration": 1.0}
    post = {"kind": "sphere", "name": "post", "centre": [0, 0.3, 1], "radius": 0.12, "cables": None}
    drum = post | {"centre": [0.5, 0.32, 1], "radius": 0.08}
    for region, name in ((post, "length of a way round"), (drum, "shift of path.points[2]")):
        (offer,) = plan(without_attitude(), {"path": path, "limits": {"keep_out": [region]}}).relaxations
        assert offer.name == name
        followed = again(offer)
        assert followed.feasible
        position = followed.trajectory["pose"].values[:, :3]
        assert np.linalg.norm(position - region["centre"], axis=1).min() > region["radius"] - 1e-6
        kept = [np.linalg.norm(position - point, axis=1).min() for point in points[: 3 - (region is drum)]]
        assert max(kept) < 0.02  # of a span of 1.2 m 1 % is rounded off at most


def test_a_path_below_the_floor_with_cables_that_pull_too_hard_is_shifted_and_has_asmaller_t_min():
    robot = without_attitude(t_min=600).model_copy(update={"floor": 1.05})
    task = {"path": {"kind": "line", "start": [-0.3, 0, 1], "end": [0.3, 0.2, 1.2]}, "duration": 5}
    found = plan(robot, task)
    t_min, shift = found.relaxations
    assert (t_min.name, shift.name) == ("cables.t_min", "shift of the path")
    assert shift.possible == pytest.approx(0.05, rel=2e-3)
    assert again(shift).feasible
    assert again(shift).scenario.robot.t_min.max() == pytest.approx(t_min.possible, rel=1e-3)


def test_a_way_round_leads_a_cycle_past_a_ball():
    """Only the whole path ends where it starts, not each of its legs; a corner that moves is both its ends."""
    x, y, z, *level = load("planar-4").home.tolist()
    corners = [[x + dx, y, z + dz, *level] for dx, dz in ((0.2, 0.1), (-0.2, 0.1), (0, -0.1), (0.2, 0.1))]
    ball = {"kind": "sphere", "name": "ball", "radius": 0.02, "cables": None}
    task = {"path": {"kind": "waypoints", "points": corners}, "duration": 6, "tube": {"ends": "periodic"}}
    for dx in (0.0, 0.2):
        its = task | {"limits": {"keep_out": [ball | {"centre": [x + dx, y, z + 0.1]}]}}
        first = plan("planar-4", its).relaxations[0]
        assert first.name == ("shift of path.points[0]" if dx else "length of a way round")
        assert first.plan.feasible
        points = first.plan.scenario.task.path.points
        assert points[0] == points[-1]
        assert (points[0] == tuple(corners[0])) == (dx == 0)
