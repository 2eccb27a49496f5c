"""Robots posed by hand: sliders and handles agree, cables keep their lengths, and the nearest feasible pose."""

import re
import sys
import time
from urllib.request import urlopen

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.figures import style
from towline.models import Dynamics, available, load
from towline.solvers import capacity_margin
from towline.statics.distribution import pose_problem, tensions
from towline.viewer import Subject, read, serve
from towline.viewer.geometry import Geometry
from towline.viewer.posing import at_rest_with, home_at_rest, opening_pose
from towline.viewer.sliders import sliders, whole_steps
from towline.viewer.stage import Stage
from towline.workspace import Condition, Places, StaticEquilibrium, sample, save
from towline.workspace.region import nearest_feasible
from towline.workspace.surface import surface

from .viewer_wire import CAMERA, Wire


@pytest.fixture
def wire(request):
    with serve(read(request.param), port=0) as url:
        opened = Wire(url)
        yield opened
        opened.close()


def settle(wire):
    while wire.read(0.4):
        pass


def pose(wire):
    numbers = re.search(r"yaw\) = \(([^)]*)\)", wire.readout())[1].split(",")
    return np.array([float(number) for number in numbers])


def drag(wire, name, position, turned):
    wxyz = turned.as_quat(scalar_first=True).tolist()
    place = np.asarray(position, dtype=float).tolist()
    owner = wire.scene[name].get("owner") or ""
    wire.send(type="TransformControlsUpdateMessage", name=name, wxyz=wxyz, position=place, owner=owner)
    wire.send(type="TransformControlsDragEndMessage", name=name, owner=owner)


@pytest.mark.parametrize("wire", ["cogiro"], indirect=True)
def test_a_handle_and_the_sliders_agree_and_change_the_tensions(wire):
    robot = load("cogiro")
    settle(wire)
    wanted = robot.home + np.array([0.5, -0.3, 0.2, 0.1, -0.05, 0.2])
    drag(wire, "/handles/platform", wanted[:3], Rotation.from_euler("ZYX", wanted[:2:-1]))
    settle(wire)
    np.testing.assert_allclose(pose(wire), wanted, atol=6e-4)
    np.testing.assert_allclose(wire.scene["/platform"]["position"], wanted[:3], atol=1e-6)
    for name, value in zip(("x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]"), wanted, strict=True):
        assert wire.element(label=name)[1]["value"] == pytest.approx(value, abs=1e-6)
    shown = [float(text) for text in re.findall(r">([\d.]+) N<", wire.readout())]
    np.testing.assert_allclose(shown, tensions(robot, wanted).tensions, atol=0.0051)
    wire.set(1.0, label="x [m]")
    settle(wire)
    np.testing.assert_allclose(wire.scene["/handles/platform"]["position"], [1.0, *wanted[1:3]], atol=1e-6)
    drag(wire, "/handles/platform", [1e9, 0, 0], Rotation.identity())
    settle(wire)
    assert pose(wire)[0] == pytest.approx(next(v["max"] for v in wire.panel.values() if v.get("label") == "x [m]"))


@pytest.mark.parametrize("wire", ["cogiro"], indirect=True)
def test_sliders_agree_with_a_handle_at_a_pose_that_cannot_be_shown(wire, monkeypatch):
    def nowhere(*_):
        raise InputError("no cable is tangent to its pulley there")

    settle(wire)
    monkeypatch.setattr("towline.viewer.posing.at_rest", nowhere)
    drag(wire, "/handles/platform", [0.5, -0.3, 2.2], Rotation.identity())
    settle(wire)
    assert "no cable is tangent" in wire.readout()
    assert [wire.element(label=f"{name} [m]")[1]["value"] for name in "xyz"] == pytest.approx([0.5, -0.3, 2.2])


@pytest.mark.parametrize("wire", ["wang-ctmrts"], indirect=True)
def test_with_three_cables_the_platform_rests_and_follows_its_carriers(wire):
    """With fixed lengths: where the carriers go together, the platform goes."""
    robot = load("wang-ctmrts")
    settle(wire)
    assert "optimal" in wire.readout()
    before = pose(wire)
    lengths, moved = Dynamics(robot).cable_lengths(before, robot.carrier_home), np.array([0.05, 0.03, 0.02, 0, 0, 0])
    for index in range(3):
        at = (robot.carrier_home[index] + moved)[:3]
        drag(wire, f"/handles/{index + 1}", at, Rotation.identity())
        settle(wire)
        assert "optimal" in wire.readout()
    np.testing.assert_allclose(pose(wire), before + moved, atol=2e-3)
    kept = Dynamics(robot).cable_lengths(pose(wire), robot.carrier_home + moved)
    np.testing.assert_allclose(kept, lengths, atol=5e-3)


@pytest.mark.parametrize("name", ["wang-ctmrts", "wang-ctmrts-4", "multi-quadrotor-3"])
def test_home_of_a_robot_with_few_cables_is_a_pose_at_rest(name):
    robot = load(name)
    rest = home_at_rest(robot)
    answer = tensions(robot, rest)
    assert answer.feasible
    A = Dynamics(robot).wrench_matrix(rest, robot.carrier_home)
    np.testing.assert_allclose(A @ answer.tensions, [0, 0, robot.weight, 0, 0, 0], atol=1e-5 * robot.weight)
    away = rest + np.array([0.02, 0.01, 0, 0.05, -0.05, 0.1])
    lengths = Dynamics(robot).cable_lengths(away, robot.carrier_home)
    hung = at_rest_with(robot, lengths, away, robot.carrier_home)
    np.testing.assert_allclose(Dynamics(robot).cable_lengths(hung, robot.carrier_home), lengths, atol=1e-6)


@pytest.mark.parametrize("name", available())
def test_every_robot_of_the_library_opens_at_a_pose_that_tensions_inside_its_limits_hold(name):
    robot = load(name)
    pose = opening_pose(robot, Geometry(robot))
    t = tensions(robot, pose).tensions
    assert ((t >= robot.t_min * (1 - 1e-9)) & (t <= robot.t_max * (1 + 1e-9))).all()
    held = robot.dof_mask.astype(bool)
    wrench = Dynamics(robot).wrench_matrix(pose, robot.carrier_home) @ t
    weight = Dynamics(robot).required_wrench(pose, np.zeros(6), np.zeros(6), robot.carrier_home)
    np.testing.assert_allclose(wrench[held], np.asarray(weight)[held], atol=1e-5 * max(robot.weight, 1.0))


@pytest.mark.parametrize("wire", ["fast"], indirect=True)
def test_a_robot_that_cannot_rest_at_home_opens_level_above_it(wire):
    """FAST balances only above 138 m, where its smallest tensions lift no more than its weight."""
    robot = load("fast")
    assert not tensions(robot, robot.home).feasible
    settle(wire)
    assert "optimal" in wire.readout()
    np.testing.assert_allclose(pose(wire), [0, 0, 138, 0, 0, 0], atol=0.5)
    wire.set(True, label="Home")
    settle(wire)
    assert "infeasible" in wire.readout()
    np.testing.assert_array_equal(pose(wire), robot.home)


def test_the_nearest_feasible_pose_is_on_the_edge_and_no_other_is_much_nearer():
    robot = load("cogiro")
    start = robot.home + np.array([9.0, 0, 0, 0, 0, 0])
    assert not tensions(robot, start).feasible
    found = nearest_feasible(robot, StaticEquilibrium(), start, robot.carrier_home, 20.0)
    assert tensions(robot, found).feasible

    def distance(poses):
        return np.linalg.norm((poses - start) * [1, 1, 1, *(robot.length,) * 3], axis=-1)

    rng = np.random.default_rng(5)
    others = start + 0.9 * distance(found) * rng.uniform(-1, 1, (20_000, 6)) / [1, 1, 1, *(robot.length,) * 3]
    others = others[distance(others) < 0.9 * distance(found)]
    assert len(others) > 1000
    assert not StaticEquilibrium().evaluate(robot, Places.at_home(robot, others)).any()
    feasible_already = nearest_feasible(robot, StaticEquilibrium(), robot.home, robot.carrier_home, 20.0)
    np.testing.assert_array_equal(feasible_already, robot.home)


@pytest.mark.parametrize(("turn", "nearest"), [(0.2, "turned"), (0.4, "moved")])
def test_the_nearest_pose_counts_a_turn_by_the_length_of_the_robot(turn, nearest):
    """Feasible are 0.3 m to the side, and a turn of which a length away from the axis moves by `turn` [m]."""
    robot = load("cogiro")

    class Either(Condition):
        def evaluate(self, robot, places):
            off = places.pose - robot.home
            return (off[:, 0] >= 0.3) | (off[:, 5] * robot.length >= turn)

    start = robot.home + np.array([0, 0, 0.5, 0, 0, 0])
    off = nearest_feasible(robot, Either(), start, robot.carrier_home, 5.0) - start
    assert (off[5] * robot.length >= turn) == (nearest == "turned")
    assert np.linalg.norm([*off[:3], *off[3:] * robot.length]) < 1.1 * min(0.3, turn)


def test_a_feasible_set_of_one_pose_is_found_whatever_the_rounding():
    robot = load("cogiro")

    class Home(Condition):
        def evaluate(self, robot, places):
            return (places.pose == robot.home).all(axis=1)

    start = np.array([0.1, -0.7, -3.9, 0.1, 0.2, 0.7])
    assert (start + (robot.home - start) != robot.home).any()
    found = nearest_feasible(robot, Home(), start, robot.carrier_home, 20.0)
    np.testing.assert_array_equal(found, robot.home)


@pytest.mark.parametrize("wire", ["planar-4"], indirect=True)
def test_the_button_goes_to_the_nearest_feasible_pose(wire):
    settle(wire)
    z = wire.element(label="z [m]")[1]
    wire.set(z["max"], label="z [m]")
    settle(wire)
    assert "infeasible" in wire.readout()
    wire.set(True, label="Nearest feasible pose")
    settle(wire)
    assert "optimal" in wire.readout()
    assert wire.element(label="z [m]")[1]["value"] < z["max"]


@pytest.mark.parametrize("name", ["cogiro", "wang-ctmrts", "multi-quadrotor-4", "fast"])
def test_on_a_phone_the_whole_robot_is_above_the_panel(name):
    """By a pinhole camera of its own: the panel covers the lower 45 % of 400 x 800 pixels."""
    robot = load(name)
    with serve(read(name), port=0) as url:
        wire = Wire(url, width=400, height=800)
        settle(wire)
        # The browser applies the initial camera late.
        middle = ((geometry := Geometry(robot).extent).low + geometry.high) / 2
        wire.send(**CAMERA | {"look_at": middle.tolist()}, image_width=400, image_height=800)
        got = {}
        while wire.read(0.5):
            got |= {message["type"]: message for message in wire.messages}
        wire.close()
    eye = np.array(got["SetCameraPositionMessage"]["position"])
    to = np.array(got["SetCameraLookAtMessage"]["look_at"]) - eye
    fov = CAMERA["fov"]
    ahead = to / np.linalg.norm(to)
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    points = np.vstack([robot.home_anchors, robot.home_attachments]) - eye
    pixels = points @ np.stack([right, np.cross(ahead, right)]).T / (points @ ahead)[:, None]
    pixels = [200, 400] + pixels * 400 / np.tan(fov / 2)
    assert (pixels > 0).all()
    assert (pixels < [400, 440]).all()
    assert np.ptp(pixels, axis=0).max() > 100


def test_a_phone_that_is_turned_while_robots_are_switched_shows_the_robot_in_the_middle():
    """The camera is pointed above the panel of the upright screen, the only one that was known."""
    extent = Geometry(load("planar-4")).extent
    with serve(read("cogiro"), port=0) as url:
        wire = Wire(url, width=400, height=800)
        settle(wire)
        wire.set("planar-4", label="robot")
        below = looked_at(wire)
        assert below[2] < extent.centre[2] - 0.05 * extent.size
        wire.send(**CAMERA | {"look_at": below}, image_width=800, image_height=400)
        np.testing.assert_allclose(looked_at(wire), extent.centre, atol=1e-9)
        wire.close()


def looked_at(wire):
    """Return what a camera is pointed at last."""
    found = []
    while wire.read(0.5):
        found += [one for one in wire.messages if one["type"] == "SetCameraLookAtMessage" and not one["initial"]]
    return found[-1]["look_at"]


def test_a_workspace_is_cut_along_each_axis(tmp_path):
    robot = load("planar-4")
    low, high = robot.home_anchors.min(axis=0), robot.home_anchors.max(axis=0)
    region = {"position": {"min": low.tolist(), "max": high.tolist()}}
    save(sample(robot, StaticEquilibrium(), region, samples=2000, keep="all"), tmp_path / "space.nc")
    subject = read(str(tmp_path / "space.nc"))
    positions = subject.cloud.positions
    with serve(subject, port=0) as url:
        wire = Wire(url)
        settle(wire)
        cut = float(np.median(positions[:, 0]))
        wire.set(cut, label="x up to [m]")
        settle(wire)
        shown = wire.array(wire.scene["/workspace"]["points"]).reshape(-1, 3)
        assert len(shown) == (positions[:, 0] <= cut).sum() == len(wire.array(wire.scene["/workspace"]["colors"])) // 3
        assert shown[:, 0].max() <= cut + 1e-6
        top = wire.element(label="x up to [m]")[1]["max"]
        wire.set(top, label="x up to [m]")
        settle(wire)
        assert len(wire.array(wire.scene["/workspace"]["points"])) == 3 * len(positions)
        wire.set(False, label="points")
        settle(wire)
        assert wire.scene["/workspace"]["visible"] is False
        wire.close()


def test_cuts_are_drawn_one_after_the_other_and_the_last_one_stays(tmp_path, monkeypatch):
    """A slider that is dragged calls from many threads at once."""
    save(sample(load("planar-4"), StaticEquilibrium(), samples=2000), tmp_path / "space.nc")
    drawn, inside, together = [], [], []

    def show_cloud(self, shown, most):
        inside.append(most)
        time.sleep(0.05)
        together.append(len(inside))
        drawn.append(inside.pop()[0])

    monkeypatch.setattr(Stage, "show_cloud", show_cloud)
    with serve(read(str(tmp_path / "space.nc")), port=0) as url:
        wire = Wire(url)
        settle(wire)
        drawn.clear()
        together.clear()
        ends = wire.element(label="x up to [m]")[1]
        for share in np.linspace(0.1, 0.9, 9).tolist():
            wire.set(ends["min"] + share * (ends["max"] - ends["min"]), label="x up to [m]")
        settle(wire)
        wire.close()
    assert set(together) == {1}
    assert len(drawn) < 9
    assert drawn[-1] == pytest.approx(ends["min"] + 0.9 * (ends["max"] - ends["min"]))


@pytest.fixture(scope="module")
def space():
    """The workspace of cogiro below 5.5 m, and the robot."""
    robot = load("cogiro")
    region = {"position": {"min": [-7, -5, 0.5], "max": [7, 5, 5.5]}}
    return sample(robot, StaticEquilibrium(), region, samples=20_000, keep="all"), robot


def test_the_surface_of_a_workspace_holds_its_volume_and_separates_its_samples(space):
    dataset, robot = space
    found = surface(dataset, robot)
    assert found.mesh.volume == pytest.approx(float(dataset["volume"]), rel=0.03)
    uncut = found.bands(np.full(3, 100.0))
    triangles = np.concatenate([vertices[faces] for vertices, faces in uncut if len(faces)])
    assert len(triangles) == len(found.mesh.faces)
    # Above a level, the area of the plane that cuts it is the share of the accepted samples beside it.
    level, thick = 2.0, 0.4
    cut = found.bands(np.array([100.0, 100.0, level]))
    triangles = np.concatenate([vertices[faces] for vertices, faces in cut if len(faces)])
    assert triangles[..., 2].max() <= level + 1e-9
    flat = triangles[np.abs(triangles[..., 2] - level).max(axis=1) < 1e-9]
    area = np.linalg.norm(np.cross(flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]), axis=1).sum() / 2
    beside = np.abs(dataset["position"].to_numpy()[:, 2] - level) < thick / 2
    assert area == pytest.approx(140 * dataset["accepted"].to_numpy()[beside].mean(), rel=0.1)


def test_the_surface_is_coloured_by_the_margins_of_its_places(space):
    """By margins that are computed anew, in places of the plane of a cut."""
    dataset, robot = space
    found = surface(dataset, robot)
    cut = found.bands(np.array([100.0, 100.0, 2.0]))
    checked = 0
    for number, (vertices, _) in enumerate(cut):
        inside = vertices[(np.abs(vertices[:, 2] - 2.0) < 1e-9) & (np.abs(vertices[:, :2]) < [4, 2]).all(axis=1)][::40]
        for place in inside:
            at = np.array([*place, *robot.home[3:]])
            margin = capacity_margin(pose_problem(Dynamics(robot), at)).value
            assert 8 * margin / found.largest == pytest.approx(number + 0.5, abs=1.0)
            checked += 1
    assert checked > 10


@pytest.mark.parametrize("name", ["tried", "x"])
@pytest.mark.parametrize("value", [np.nan, np.inf, "many"])
def test_counts_and_cells_of_a_file_that_are_no_numbers_are_no_surface(space, name, value):
    dataset, robot = space
    values = dataset[name].to_numpy().astype(object if isinstance(value, str) else float)
    values[(1,) * values.ndim] = value
    assert surface(dataset.assign({name: (dataset[name].dims, values)}), robot) is None
    assert surface(dataset.drop_vars(name), robot) is None


def test_a_workspace_that_no_picture_can_show_is_no_surface(space):
    dataset, robot = space
    farthest = max(float(np.abs(dataset[name]).max()) for name in "xyz")
    assert surface(dataset, robot, within=farthest) is not None
    assert surface(dataset, robot, within=0.999 * farthest) is None


def test_without_samples_in_a_file_its_region_states_that_attitudes_vary():
    """Each sample of a cell has another attitude, so the share of them that is accepted is not that of the cell."""
    robot = load("cogiro")
    region = {
        "position": {"min": [-7, -5, 0.5], "max": [7, 5, 5.5]},
        "attitude": {"min": [-0.6, -0.6, -0.6], "max": [0.6, 0.6, 0.6]},
    }
    without, having = (sample(robot, StaticEquilibrium(), region, 10_000, keep=keep) for keep in ("none", "all"))
    found = surface(without, robot)
    np.testing.assert_array_equal(found.shares, surface(having, robot).shares)
    assert set(np.unique(found.shares)) == {0.0, 1.0}
    share = having["accepted"].to_numpy().mean()
    assert found.mesh.volume > 1.1 * share * 14 * 10 * 5
    for wrong in ("{", "[]", '{"attitude": 3}', 5):
        assert surface(without.assign_attrs(region=wrong), robot) is not None


def test_the_surface_ends_with_the_box_of_the_samples_whatever_the_number_of_cells():
    """With few samples three cells are a block, and 32 are no whole blocks."""
    robot = load("cogiro")
    low, high = np.array([-3, -2, 1.0]), np.array([3, 2, 3.0])
    region = {"position": {"min": low.tolist(), "max": high.tolist()}}
    dataset = sample(robot, StaticEquilibrium(), region, samples=5000, keep="none")
    found = surface(dataset, robot)
    assert len(found.axes[0]) == 11
    assert dataset.attrs["accepted"] == 5000
    np.testing.assert_allclose(found.mesh.vertices.min(axis=0), low, atol=1e-9)
    np.testing.assert_allclose(found.mesh.vertices.max(axis=0), high, atol=1e-9)
    assert found.mesh.volume == pytest.approx(6 * 4 * 2, rel=0.02)


def test_without_samples_or_blocks_that_are_half_inside_there_is_no_surface(space):
    """It would hide the points, and show nothing."""
    dataset, robot = space
    assert surface(dataset.assign(tried=0 * dataset["tried"]), robot) is None
    one = np.zeros_like(dataset["reached"].to_numpy())
    one[16, 16, 16] = 1
    tried = dataset["tried"] + 3
    assert surface(dataset.assign(reached=(tried.dims, one), tried=tried), robot) is None


def test_without_scikit_image_the_points_stay_and_a_line_names_the_extra(space, monkeypatch, tmp_path):
    save(space[0], tmp_path / "space.nc")
    monkeypatch.setitem(sys.modules, "skimage.measure", None)
    with serve(read(str(tmp_path / "space.nc")), port=0) as url:
        wire = Wire(url)
        settle(wire)
        assert any("pip install" in str(found.get("content")) for found in wire.panel.values())
        assert wire.element(label="surface")[1]["disabled"]
        assert wire.scene["/workspace"]["visible"] is not False
        wire.close()


@pytest.mark.parametrize("wire", ["wang-flying"], indirect=True)
def test_sliders_are_shaded_where_the_platform_can_rest(wire):
    """By one tension problem at a time, for the slider of x and that of a carrier, at a pose away from home."""
    robot = load("wang-flying")

    def strips(unlike):
        """Return the strips when they have changed, and are complete."""
        for _ in range(40):
            wire.read(0.5)
            found = [value["content"] for value in wire.panel.values() if "towline-strip" in str(value.get("content"))]
            if found and found != unlike:
                return found
        pytest.fail("no strips")

    before = strips([])
    wire.set(0.1, label="y [m]")
    found = strips(before)
    settings = sliders(robot, Geometry(robot))
    assert len(found) == len(settings) == 12
    at = robot.home + np.array([0, 0.1, 0, 0, 0, 0])
    for number in (0, 6):
        setting, green = settings[number], []
        for start, end in re.findall(rf"{style.colour(2)} ([\d.]+)% ([\d.]+)%", found[number]):
            green.append((float(start), float(end)))
        assert green
        for share in np.arange(48) / 47:
            pose, carriers = at.copy(), robot.carrier_home.copy()
            owner = pose if setting.carrier is None else carriers[setting.carrier]
            owner[setting.coordinate] = setting.low + share * (setting.high - setting.low)
            shaded = any(start <= 100 * (share * 47 + 0.5) / 48 <= end for start, end in green)
            assert shaded == tensions(robot, pose, carrier_pose=carriers).feasible
    wire.set(True, label="let it hang")
    settle(wire)
    assert not any("towline-strip" in str(value.get("content")) for value in wire.panel.values())


@pytest.mark.parametrize(("low", "high"), [(-1.23456, 7.7), (0.0, 0.0), (999_999.0, 1e6), (-3e-4, 2e-4), (5.0, 5.0)])
def test_ends_of_a_slider_are_whole_steps_around_its_range(low, high):
    start, end, step = whole_steps(low, high)
    assert start <= low
    assert end >= high
    assert end > start
    assert start - low > -1.0001 * step
    assert end - high < 1.0001 * step
    assert end / step == pytest.approx(round(end / step), abs=1e-3)


def shown(url, cables, numbers):
    """Wait until a new page has a pose of a robot with so many cables; return its panel."""
    for _ in range(60):
        opened = Wire(url)
        try:
            panel = str([found.get("content") for found in opened.panel.values()])
            if panel.count("</tr>") == cables + 1 and np.allclose(pose(opened), numbers, atol=6e-4):
                return panel
        finally:
            opened.close()
        time.sleep(0.1)
    pytest.fail("it is not shown")


def test_a_list_switches_robots_and_a_link_keeps_robot_and_pose():
    """Everything else that an address may have is ignored."""
    planar, wanted = load("planar-4"), [0.5, 0.4, 2.7, 0.0, 0.0, 0.1]
    with serve(read("cogiro"), port=0) as url:
        opened = Wire(url)
        assert set(opened.element(label="robot")[1]["options"]) == set(available())
        opened.set("planar-4", label="robot")
        opened.close()
        panel = shown(url, 4, planar.home)
        for t in tensions(planar, planar.home).tensions:
            assert f"{t:.2f} N" in panel
        address = re.search(r'href="(/[^"]*)"', panel)[1].replace("&amp;", "&")
        assert address == "/?robot=planar-4&pose=" + ",".join(f"{x:.6g}" for x in planar.home)
        assert urlopen(f"{url}/?robot=ipanema-2&pose={','.join(map(str, wanted))}").status == 200
        shown(url, 8, wanted)
        for query in ("pose=nan,0,0,0,0,0", "robot=ipanema-2&pose=nan,0,0,0,0,0", "robot=ipanema-2&pose=inf,0,0,0,0,0",
                      "robot=ipanema-2&pose=1,2", "robot=../../x&pose=1", "robot=ipanema-2&pose=" + "1," * 2000,
                      "robot=ipanema-2&pose=%00", "robot", "&=&;"):  # fmt: skip
            assert urlopen(f"{url}/?{query}").status == 200
        time.sleep(0.5)
        shown(url, 8, wanted)
        urlopen(f"{url}{address}")
        shown(url, 4, planar.home)
    with serve(Subject("mine", planar.model_copy(update={"name": "mine"})), port=0) as url:
        opened = Wire(url)
        assert opened.element(label="robot")[1]["value"] == "mine"
        opened.close()
        for name, cables in (("cogiro", 8), ("mine", 4)):  # the robot of a file stays in the list
            urlopen(f"{url}/?robot={name}&pose=0,0,{1.5 if name == 'cogiro' else 0.8},0,0,0")
            shown(url, cables, [0, 0, 1.5 if name == "cogiro" else 0.8, 0, 0, 0])
