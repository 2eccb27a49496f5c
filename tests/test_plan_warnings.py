"""Plans warn of what no limit forbids, in true sentences, and of nothing else."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Robot, Task, available, load, plan, time_along
from towline.errors import InputError
from towline.models import Dynamics
from towline.models.diagnosis import diagnose
from towline.ocp.tasks.paths import LinePath
from towline.ocp.tasks.task import read_task
from towline.ocp.warnings.positions import Instants
from towline.ocp.warnings.values import fixed_cables, long_turns, slipped_units, weak_formation

from .framed import framed
from .told import told
from .warm import towline as run

COGIRO = load("cogiro")


def line(start, end, **more):
    return {"path": {"kind": "line", "start": start, "end": end}, "duration": 8, **more}


DIVE = line([-1, 0, 1.5], [1, 0, -0.3])


def hanging(anchors, mass_at=(0, 0, 1), dof=("x", "y", "z"), **more):
    """A point mass under ground anchors."""
    home = {} if mass_at is None else {"home": [*mass_at, 0, 0, 0]}
    ends = [(anchor, (0, 0, 0)) for anchor in anchors]
    return framed(ends, {"mass": 2, "dof": list(dof), **home}, more, t_max=500)


def square(z, half=2.0):
    return [[x, y, z] for x in (-half, half) for y in (-half, half)]


def lowest(found):
    """The lowest attachment or CoM of a saved motion [m], and when [s]."""
    robot, pose = found.scenario.robot, found.trajectory.pose.values
    turned = Rotation.from_euler("ZYX", pose[:, 5:2:-1]).as_matrix()
    points = np.vstack([robot.platform.com, robot.attachments])
    z = pose[:, None, 2] + np.einsum("nj,kj->nk", turned[:, 2], points)
    return z.min(), found.trajectory.time.values[z.min(axis=1).argmin()]


def test_a_dive_below_the_floor_is_warned_of_with_depth_place_and_time(tmp_path):
    found = plan(COGIRO, DIVE)
    assert found.feasible
    (sentence,) = found.warnings
    depth, time = lowest(found)
    said = re.search(r"is ([\d.]+) m below the floor .* at t = ([\d.]+) s, at \((.+), (.+), (.+)\) m", sentence)
    assert float(said[1]) == pytest.approx(-depth, abs=1e-3)
    assert float(said[2]) == pytest.approx(time, abs=0.02)
    assert float(said[5]) == pytest.approx(depth, abs=1e-3)
    assert sentence in found.report()
    assert "below the floor (z\u00a0=\u00a00 of {G})" in found.save_report(tmp_path / "report.html").read_text()
    assert found.to_dict()["warnings"] == [sentence]
    timing = time_along(COGIRO, DIVE)
    assert "below the floor" in timing.report()
    assert len(timing.to_dict()["warnings"]) == 1


def test_the_command_line_prints_warnings(tmp_path):
    (tmp_path / "dive.yaml").write_text(json.dumps(DIVE))
    done = run("plan", "cogiro", "dive.yaml", "--json", cwd=tmp_path)
    assert "below the floor" in json.loads(done.stdout)["warnings"][0], done.stderr
    done = run("plan", "cogiro", "dive.yaml", cwd=tmp_path)
    assert re.search(r"Warnings\n +warning +the platform leaves the frame", done.stdout)


@pytest.mark.parametrize(
    ("robot", "task", "words"),
    [
        (COGIRO, line([0, 0, 2], [0, 0, 4.9]), ["above the highest anchor (z = 5.42 m)"]),  # its upper attachments
        (COGIRO, line([0, 0, 2], [9, 0, 2]), ["beyond the anchor with the largest x (x = 7.521 m)"]),
        (COGIRO, line([0, 0, 2], [2000, 0, 1500]), ["largest x", "above the highest"]),  # millimetres
        (hanging(square(3)), line([0, 0, 1], [0, -2.5, 1]), ["beyond the anchor with the smallest y (y = -2 m)"]),
        (hanging(square(3), None), line([0, 0, 1], [0, 0, -0.5]), ["below the floor"]),
        (hanging(square(3) + square(-2)), line([0, 0, 1], [0, 0, -3]), ["below the lowest anchor (z = -2 m)"]),
        (load("planar-4"), line([0, 0, 0.75], [0.5, 0, 0]), ["below the floor"]),
        (load("planar-4"), line([0, 0, 0.75], [0.95, 0, 0.75]), ["largest x"]),
        (load("wang-ctmrts"), line([1.26, 0.96, 0.4], [1.26, 0.96, -0.2]), ["below the floor"]),
    ],
)
def test_each_side_of_a_frame_is_known(robot, task, words):
    found = plan(robot, {**task, "time_limit": 1})
    said = [sentence for sentence in found.warnings if "leaves the frame" in sentence]
    assert len(said) == len(words), said
    for sentence, word in zip(said, words, strict=True):
        assert word in sentence


@pytest.mark.parametrize(
    ("robot", "task"),
    [
        (hanging(square(0), (0, 0, -2)), line([0, 0, -2], [0.5, 0, -5])),  # {G} lies in the ceiling
        (hanging(square(0), None), line([0, 0, -2], [0.5, 0, -5])),
        (hanging(square(3), (0, 0, -0.5)), line([0, 0, 0], [0.5, 0, -1])),  # {G} lies at the workspace's middle
        (hanging(square(3) + square(-2)), line([0, 0, 1], [0.5, 0, -1.5])),  # in a pit
        (hanging(square(0), (0, 0, 2), gravity=[0, 0, 9.81]), line([0, 0, 2], [0, 0, 4])),  # a balloon
        (hanging([[0, 0, 3]]), line([0, 0, 1], [0.2, 0.1, 1.2])),  # a pendulum
        (hanging([[-1, 0, 3], [1, 0, 3]]), line([0, 0, 1], [0.1, 0.3, 1])),  # it swings across its plane
        (hanging(square(3) + square(-1), (0, 0, 1), gravity=[0, 0, 0]), line([0, 0, 1], [0.1, 0.3, -0.5])),
        (load("planar-4"), line([0, 0, 0.75], [0.3, 0, 0.5])),
        (load("multi-quadrotor-3"), line([0, 0, 0], [0, 0, -1])),  # it flies
        (load("wang-flying"), line([0, 0, -1], [0, 0, -1.2])),
        (load("wang-ctmrts"), line([1.26, 0.96, 0.4], [1.2, 0.96, 0.6])),
    ],
)
def test_no_frame_is_left_where_there_is_none(robot, task):
    assert not plan(robot, {**task, "time_limit": 1}).warnings


@pytest.mark.parametrize("name", available())
def test_a_robot_at_home_is_inside_its_frame(name):
    robot = load(name)
    assert plan(robot, {"path": {"kind": "rest", "pose": robot.home.tolist()}, "duration": 1}).warnings == ()


LINE = {"kind": "line", "start": [-2, 0, 1.5], "end": [2, 1, 2]}
SLIPPED = {
    "millimetres": [
        {"path": LINE | {"start": [-2000, 0, 1500], "end": [2000, 1000, 2000]}},
        {"path": {"kind": "circle", "centre": [0, 0, 1.5], "radius": 800, "rate": 0.5}},
        {"limits": {"keep_out": [{"kind": "sphere", "centre": [0, 500, 1700], "radius": 300}]}},
        {"limits": {"keep_out": [{"kind": "box", "min": [500, 500, 300], "max": [900, 700, 600]}]}},
        {"final": {"pose": [2000, 1000, 2000]}, "tube": {"position": "free"}},
    ],
    "centimetres": [{"path": LINE | {"start": [-200, 0, 150], "end": [200, 100, 200]}}],
    "degrees": [
        {"path": LINE | {"end": [2, 1, 2, 0, 0, 45]}},
        {"tube": {"position": "free", "attitude": 20}},
        {"tube": {"attitude": 5}},
        {"path": {"kind": "waypoints", "points": [[0, 0, 1, 0, 0, 0], [1, 0, 1, 0, 0, 90], [1, 1, 1, 0, 0, 180]]}},
    ],
    "degrees per second": [{"path": {"kind": "circle", "centre": [0, 0, 1.5], "radius": 0.8, "rate": 60}}],
    "millimetres per second": [{"limits": {"platform_speed": 1500}}],
    "millimetres per second squared": [{"limits": {"platform_acceleration": 2000}}],
    "grams": [
        {"path": None, "duration": None, "phases": [{"name": "a", "path": LINE, "duration": 6, "load": {"mass": 5e4}}]}
    ],
    "tonnes": [
        {"path": None, "duration": None, "phases": [{"name": "a", "path": LINE, "duration": 6, "load": {"mass": 0.1}}]}
    ],
    "kilonewtons": [{"margin": 0.15}],
    "kilonewtons per second": [{"limits": {"tension_rate": 0.5}}],
    "kilowatts": [{"limits": {"winch_power": 0.8}}],
    "minutes": [{"duration": 0.08}],
    "milliseconds": [{"duration": 30000.0}],
}


@pytest.mark.parametrize(("unit", "changes"), [(unit, each) for unit, all_of in SLIPPED.items() for each in all_of])
def test_units_that_slipped_are_named(unit, changes):
    task = {"path": LINE, "duration": 6} | changes
    task = Task.model_validate({key: value for key, value in task.items() if value is not None})
    said = slipped_units(COGIRO, task)
    assert len(said) == 1
    assert f"are these {unit}?" in said[0]


def scaled(part, **factors):
    """The fields of a part of a robot file with numbers that many times as large."""
    return part | {name: (factor * np.array(part[name])).tolist() for name, factor in factors.items()}


@pytest.mark.parametrize(
    ("unit", "cables", "platform"),
    [
        ("grams", {}, {"mass": 1e3}),
        ("tonnes", {}, {"mass": 1e-3}),
        ("kilonewtons", {"t_min": 1e-3, "t_max": 1e-3}, {}),
        ("millimetres", {"anchor": 1e3}, {}),
        ("millimetres", {"attachment": 1e3}, {}),
        ("millimetres", {"anchor": 1e3, "attachment": 1e3}, {"home": 1e3}),
        ("millimetres", {}, {"home": 1e3}),
        ("kilogram square millimetres", {}, {"inertia": 1e6}),
    ],
)
def test_units_that_slipped_in_a_robot_file_are_named(unit, cables, platform):
    data = COGIRO.model_dump()
    data["cables"] = [scaled(cable, **cables) for cable in data["cables"]]
    data["platform"] = scaled(data["platform"], **platform)
    said = slipped_units(Robot.model_validate(data), Task.model_validate({"path": LINE, "duration": 6}))
    assert any(f"are these {unit}?" in sentence for sentence in said)


def test_the_same_robot_in_other_sizes_is_not_doubted():
    """Lengths, and times with them, 1/20 to 20 times as large: all accelerations and tensions stay."""
    for size in (0.05, 1.0, 20.0):
        data = COGIRO.model_dump()
        data["cables"] = [scaled(cable, anchor=size, attachment=size) for cable in data["cables"]]
        data["platform"] = scaled(data["platform"], home=size, inertia=size**2)
        line = {name: (size * np.array(LINE[name])).tolist() for name in ("start", "end")}
        task = {
            "path": {"kind": "line", **line},
            "duration": 6 * size**0.5,
            "margin": 10,
            "tube": {"position": 0.2 * size},
        }
        assert not slipped_units(Robot.model_validate(data), Task.model_validate(task))


def test_a_crane_may_hoist_by_many_times_the_distance_of_its_cables():
    cables = [{"carrier": "frame", "anchor": [x, 0, 12], "attachment": [x, 0, 0.3]} for x in (-0.5, 0.5)]
    crane = {
        "name": "crane",
        "source": "test",
        "platform": {"mass": 500, "dof": ["z"], "home": [0, 0, 5, 0, 0, 0]},
        "carriers": [{"name": "frame", "kind": "ground"}],
        "cables": [cable | {"t_min": 100, "t_max": 6000} for cable in cables],
    }
    hoist = {"path": {"kind": "line", "start": [0, 0, 2], "end": [0, 0, 8]}, "duration": 6}
    assert not slipped_units(Robot.model_validate(crane), Task.model_validate(hoist))
    hoist["path"]["end"] = [0, 0, 800]
    assert "centimetres" in " ".join(slipped_units(Robot.model_validate(crane), Task.model_validate(hoist)))


WEEK = sorted((Path(__file__).parents[1] / "examples/week").glob("*.yaml"))


@pytest.mark.parametrize("file", WEEK, ids=lambda file: file.stem)
def test_units_of_ordinary_tasks_are_not_doubted(file):
    try:
        task = read_task(file)
    except InputError:
        pytest.skip("a robot or a list of events")
    assert not slipped_units(COGIRO, task)


def test_a_wind_in_kilometres_per_hour_is_named_in_the_report():
    task = Task.model_validate(
        {"path": {"kind": "line", "start": [0, 0, -1], "end": [0.1, 0, -1]}, "duration": 2, "wind": [90, 0, 0]}
    )
    assert "are these kilometres per hour?" in " ".join(slipped_units(load("wang-flying"), task))
    found = plan("cogiro", {"path": SLIPPED["millimetres"][0]["path"], "duration": 6})
    assert "are these millimetres? towline reads metres" in told(found)


def test_a_line_across_the_seam_of_yaw_has_a_shorter_way():
    """From 3.05 to -3.05 rad a line turns by 6.1 rad, the longer way: to -3.05 + 2 pi it would turn by 0.18 rad."""
    start, end = [0, 0, 1.2, 0, 0, 3.05], [0.3, 0.2, 1.2, 0, 0, -3.05]
    refused = plan("ipanema-1", {"path": {"kind": "line", "start": start, "end": end}, "duration": 4})
    assert not refused.feasible
    assert "to a yaw of 3.23319 rad" in told(refused)
    shorter = {"kind": "line", "start": start, "end": [*end[:5], -3.05 + 2 * np.pi]}
    found = plan("ipanema-1", {"path": shorter, "duration": 4})
    assert found.feasible
    assert not found.warnings
    whole = {"kind": "line", "start": [0, 0, 1.2], "end": [0, 0, 1.2, 0, 0, 2 * np.pi]}  # a whole turn is meant
    assert long_turns(LinePath.model_validate(whole)) == []


@pytest.mark.parametrize("out", [0.0, 1e-5, 0.02, 0.2])
def test_three_cables_nearly_in_one_plane_are_warned_of(out):
    """Carriers above a line along (0.6, 0.8, 0), the middle one off it by `out`: across it the cables hardly pull.

    At home, with unit vectors (s cos a, s sin a, c) at 120 degrees, the smaller singular value is s sqrt(3 / 2).
    """
    lean = np.arctan2(2.0, 2.0)
    carriers, cables = [], []
    for i, angle in enumerate(np.radians([0, 120, 240])):
        home = [2 * np.cos(angle), 2 * np.sin(angle), 3, 0, 0, 0]
        limits = {"reach": {"min": [-5] * 3, "max": [5] * 3}, "speed_max": 1, "acceleration_max": 1}
        carriers.append({"name": f"r{i}", "kind": "mobile", "home": home, **limits})
        cables.append({"carrier": f"r{i}", "anchor": [0] * 3, "attachment": [0] * 3, "t_min": 0, "t_max": 99})
    platform = {"mass": 2, "dof": ["x", "y", "z"], "home": [0, 0, 1, 0, 0, 0]}
    robot = Robot.model_validate(
        {"name": "three", "source": "a test", "platform": platform, "carriers": carriers, "cables": cables}
    )
    along, across, up = np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]])
    places = np.zeros((1, 3, 6))
    places[0, :, :3] = [1.5 * along + 3 * up, out * across + 3 * up, -1.5 * along + 3 * up]
    seen = Instants(Dynamics(robot), np.array([1.25]), robot.home[None], robot.carrier_home[None])
    assert weak_formation(seen) == []
    flat = [one.model_copy(update={"home": tuple(place)}) for one, place in zip(robot.carriers, places[0], strict=True)]
    singular = robot.model_copy(update={"carriers": tuple(flat)})
    lost = weak_formation(Instants(Dynamics(singular), seen.times, seen.pose, places))
    assert any("as at home, the cables cannot pull along force (" in text for text in lost) == (out < 1e-3)
    assert diagnose(singular).rank == (2 if out < 1e-3 else 3)  # as `towline robots` says
    found = weak_formation(replace(seen, carriers=places))
    pulls = places[0, :, :3] - [0, 0, 1]
    pulls /= np.linalg.norm(pulls, axis=1, keepdims=True)
    share = np.sqrt(np.linalg.eigvalsh(pulls.T @ pulls)[0].clip(0)) / (np.sin(lean) * np.sqrt(1.5))
    assert (share > 0.05) == (found == []) == (out == 0.2)
    if found:
        assert "such as 0.85 m, keeps" in found[0]  # 0.3 times the length of the cables, sqrt(8) m
        said = re.search(
            r"at t = 1\.250 s, the cables pull along force \((.+), (.+), (.+)\) with (less than )?([\d.]+) %", found[0]
        )
        assert abs(np.array([float(said[k]) for k in (1, 2, 3)]) @ across) > 0.99
        assert 100 * share <= 0.01 if said[4] else float(said[5]) == pytest.approx(100 * share, rel=0.05)


def test_fixed_lengths_share_a_load_by_their_stiffness_and_not_as_planned():
    """Two vertical cables on one carrier, 1 m and 2 m long: of a lighter load the short one loses two thirds."""
    cables = [
        {"carrier": "r", "anchor": [0, 0, z], "attachment": [0, 0, 0], "t_min": 0, "t_max": 99, "stiffness": 5e3}
        for z in (0, 1)
    ]
    carrier = {"name": "r", "kind": "mobile", "home": [0, 0, 1, 0, 0, 0], "reach": {"min": [-5] * 3, "max": [5] * 3}}
    carrier |= {"speed_max": 1, "acceleration_max": 1}
    robot = Robot.model_validate(
        {
            "name": "two",
            "source": "a test",
            "platform": {"mass": 2, "dof": ["z"], "home": [0] * 6},
            "carriers": [carrier],
            "cables": cables,
            "drive": "fixed-length",
        }
    )
    still = np.zeros((2, 6)), np.tile(robot.carrier_home, (2, 1, 1))
    seen = Instants(Dynamics(robot), np.array([0.0, 1.25]), *still)
    for lost, slack in ((8.9, False), (9.1, True)):  # of the short one, with 6 N first: 2 / 3 of that
        found = fixed_cables(seen, np.array([[6.0, 14.0], [9.0, 11.0 - lost]]))
        assert [text[:44] for text in found] == ["cable 1 can go slack at t = 1.250 s, where 9"] * slack
    assert fixed_cables(seen, np.array([[6.0, 14.0], [9.0, np.nan]])) == []
