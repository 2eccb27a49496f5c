"""The page on adding a carrier: its example runs, and what it prints and plans is what a trolley on a rail may do."""

import importlib.util
import re
import sys
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from towline import Task, load, plan
from towline.base.errors import InputError
from towline.export.mjcf import to_mjcf
from towline.models import carriers
from towline.models.carriers import Carrier, GroundCarrier
from towline.models.parsing import json_schema, parse_yaml, to_yaml
from towline.models.robot import Robot
from towline.ocp import time_along
from towline.ocp.reports.trajectory import drawings
from towline.viewer.geometry import Geometry
from towline.viewer.sliders import sliders

PAGE = (Path(__file__).parent.parent / "docs" / "adding-a-carrier.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Import the example as a module; other tests know nothing of its kind afterwards."""
    file = tmp_path_factory.mktemp("page") / "trolley_of_the_page.py"
    file.write_text("\n".join(BLOCKS))
    known = dict(carriers._KINDS)
    carriers._KINDS.pop("trolley", None)  # of the test that runs all pages, if this process has run it
    specification = importlib.util.spec_from_file_location(file.stem, file)
    module = sys.modules[file.stem] = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    yield vars(module)
    del sys.modules[file.stem]
    carriers._KINDS.clear()
    carriers._KINDS.update(known)
    json_schema.cache_clear()


def test_the_class_and_its_carriers_take_at_most_30_lines():
    assert len(BLOCKS[0].splitlines()) <= 30


def test_the_plan_moves_the_trolleys_along_their_rails_only(page):
    motion = page["motion"]
    assert motion.feasible
    poses = motion.trajectory["carrier_pose"].values
    times = motion.trajectory["time"].values
    assert np.ptp(poses[:, :, 0], axis=0).min() > 1.0  # they do follow the load
    assert not np.ptp(poses[:, :, 1:], axis=0).any()
    assert np.abs(poses[:, :, 0]).max() <= 3.0 + 1e-9
    # By differences, which share nothing with the program.
    speed = np.gradient(poses[:, :, 0], times, axis=0)
    acceleration = np.diff(poses[:, :, 0], 2, axis=0) / np.diff(times)[0] ** 2
    assert np.abs(speed).max() <= 0.8 * (1 + 1e-4)
    assert np.abs(acceleration).max() <= 0.5 * (1 + 1e-4)
    tensions = motion.trajectory["tensions"].values
    assert ((tensions >= 5 - 1e-6) & (tensions <= 80 + 1e-6)).all()


def test_the_tensions_of_the_plan_carry_the_load(page):
    """Two cables in a plane, by Newton and Euler on paper."""
    motion = page["motion"].trajectory
    away = motion["carrier_pose"].values[:, :, :3] - motion["pose"].values[:, None, :3]
    pull = (motion["tensions"].values[:, :, None] * away / np.linalg.norm(away, axis=2, keepdims=True)).sum(axis=1)
    needed = 5 * (motion["acceleration"].values[:, :3] + [0, 0, 9.81])
    assert np.abs(pull - needed).max() < 1e-6


@pytest.mark.parametrize(("limit", "value"), [("speed_max", 0.4), ("acceleration_max", 0.2)])
def test_a_limit_of_its_own_binds(page, limit, value):
    """With the trolleys' limits lower, the same load moves with them at their limits, or the planner gives up."""
    slow = [{**trolley, limit: value} for trolley in page["trolleys"]]
    robot = Robot(name="slow", source="a test", platform=page["load"], carriers=slow, cables=page["cables"])
    task = {"name": "along", "path": page["line"], "duration": 6, "base": {"kind": "free", "ends": "rest"}}
    motion = plan(robot, task)
    motion_of = {"speed_max": "carrier_velocity", "acceleration_max": "carrier_acceleration"}[limit]
    reached = np.abs(motion.trajectory[motion_of].values[:, :, 0]).max()
    assert motion.feasible
    assert reached == pytest.approx(value, rel=1e-3)


def test_the_workspace_lies_between_the_ends_of_the_rails(page):
    positions = page["space"]["position"].values
    assert 0 < len(positions) < 300
    assert np.abs(positions[:, 0]).max() < 3.0
    assert np.abs(positions[:, 0]).max() > 1.5  # beyond what the trolleys reach at home


def test_a_robot_file_has_it(page):
    crane = page["crane"]
    text = to_yaml(crane)
    again = parse_yaml(text, Robot, "crane.yaml")
    assert again == crane
    assert type(again.carriers[0]) is page["Trolley"]
    assert "Trolley" in Robot.model_json_schema()["$defs"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "troley"}, "carriers[0].kind must be one of ground, mobile, prescribed, quadrotor, trolley"),
        ({"kind": "troley"}, "did you mean 'trolley'?"),
        ({"rial": [0, 1]}, "carriers[0].rial is not a known key, did you mean 'rail'?"),
        ({"speed_max": -1}, "carriers[0].speed_max must be greater than 0, got -1"),
    ],
)
def test_errors_in_its_file_read_like_those_of_other_kinds(page, change, message):
    data = page["crane"].model_dump(mode="json", exclude_none=True)
    data["carriers"][0] |= change
    with pytest.raises(InputError, match=re.escape(message)):
        Robot.model_validate(data)


def test_a_plan_with_it_is_saved_and_drawn(page, tmp_path):
    page["motion"].save(tmp_path / "plan.nc")
    assert (tmp_path / "plan.nc").exists()
    assert {"path", "views", "base"} <= set(drawings(page["motion"], page["motion"].trajectory))


def test_the_viewer_moves_it_along_its_rail(page):
    of_trolleys = [each for each in sliders(page["crane"], Geometry(page["crane"])) if each.carrier is not None]
    assert [(each.carrier, each.coordinate, each.low, each.high) for each in of_trolleys] == [
        (0, 0, -3.0, 3.0),
        (1, 0, -3.0, 3.0),
    ]


def test_mujoco_gets_it_as_a_body_whose_motion_is_imposed(page):
    assert to_mjcf(page["crane"]).count('mocap="true"') == 2


def test_a_path_off_its_rail_is_refused(page):
    """To time a path, a trolley may be given a motion along its rail, and no other."""
    pytest.importorskip("toppra")
    aside = {"kind": "line", "start": [-1, 0, 3], "end": [-1, 1, 3]}
    limits = {"platform_speed": 1.0}
    task = {"name": "t", "path": page["line"], "base": {"kind": "given", "paths": {"left": aside}}, "limits": limits}
    with pytest.raises(InputError, match="must keep carrier 'left' inside its reach box"):
        time_along(page["crane"], Task.model_validate({**task, "duration": 5}))


def test_a_kind_that_is_taken_is_refused():
    with pytest.raises(InputError, match="kind must differ from the kind of GroundCarrier, got 'ground'"):

        class Ground(Carrier):
            kind: Literal["ground"]

    assert load("planar-4").carriers[0].__class__ is GroundCarrier
