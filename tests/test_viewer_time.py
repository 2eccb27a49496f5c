"""Time in the viewer: every update has one instant in scene, panel, charts and time line; steps, loop, curves."""

import io
import re
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from towline.base.errors import InputError
from towline.figures.animation import timing
from towline.models import load
from towline.ocp import plan
from towline.statics.scene import scene
from towline.viewer import read, serve
from towline.viewer.charts import Curves, curves
from towline.viewer.replay import Replay

from .viewer_wire import Wire

CIRCLE = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.5, "rate": 0.6}
LINE = {"kind": "line", "start": [0, 0, -1], "end": [0.05, 0, -0.9]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A plan that cannot be, and one that can."""
    place, robot = tmp_path_factory.mktemp("time"), load("wang-flying")
    for name, task in (("hover", {"path": CIRCLE}), ("line", {"path": LINE, "duration": 2})):
        plan(robot, task | {"base": {"kind": "hold"}, "output_rate": 20}).save(place / f"{name}.nc")
    return place


@pytest.fixture
def wire(request, folder):
    with serve(read(str(folder / f"{request.param}.nc")), port=0) as url:
        opened = Wire(url)
        yield opened
        opened.close()


@pytest.mark.parametrize("wire", ["hover"], indirect=True)
def test_scene_panel_charts_and_time_line_agree_in_every_update(wire):
    """A page draws after each update: none may have the shortfall of one instant and the pose of another."""
    shown = set()
    for _ in range(50):
        wire.set("next", label="step")
        assert wire.read()
        readout = wire.readout()
        instant = float(re.search(r"t = ([\d.]+) s", readout)[1])
        assert f"short by {wire.scene['/shortfall']['text'].removeprefix('short by ')}" in readout
        pose = [float(number) for number in re.search(r"yaw\) = \(([^)]*)\)", readout)[1].split(",")]
        np.testing.assert_allclose(wire.scene["/platform"]["position"], pose[:3], atol=6e-4)
        assert wire.element(label="time [s]")[1]["value"] == pytest.approx(instant, abs=0.0051)
        for title in ("tensions [N]", "tension margin [N]"):
            times, *_, cursor = (wire.array(column) for column in wire.element(title=title)[1]["data"])
            assert times[cursor.argmax()] == pytest.approx(instant, abs=0.051)
            assert cursor.sum() == 1
        shown.add(instant)
    assert len(shown) == 50


@pytest.mark.parametrize("wire", ["line"], indirect=True)
def test_steps_and_ends_and_playing_once_or_again_and_again(wire, folder):
    saved = xr.load_dataset(folder / "line.nc")["time"].to_numpy()

    def shown():
        while wire.read(0.3):
            pass
        return wire.element(label="time [s]")[1]["value"]

    steps = (("last", -1), ("next", -1), ("back", -2), ("first", 0), ("back", 0), ("next", 1))
    for word, index in steps:
        wire.set(word, label="step" if word in ("back", "next") else "go to")
        assert shown() == pytest.approx(saved[index], abs=1e-6), word
    wire.set(False, label="loop")
    took = []
    for speed in ("1x", "4x"):
        wire.set(speed, label="speed")
        wire.set("first", label="go to")
        wire.set(True, label="Play")
        began, seen = time.monotonic(), []
        while time.monotonic() < began + 20 and not (seen and seen[-1] == pytest.approx(2.0)):
            wire.read()
            seen.append(wire.element(label="time [s]")[1]["value"])
        took.append(time.monotonic() - began)
        assert (np.diff(seen) >= 0).all()
        assert shown() == pytest.approx(2.0)
    assert took[0] > 1.5  # the motion lasts 2 s
    assert took[1] < took[0]
    wire.set(True, label="loop")
    wire.set(True, label="Play")
    for _ in range(40):
        wire.read()
        if wire.element(label="time [s]")[1]["value"] < 1.5:
            return
    pytest.fail("it does not begin again")


@pytest.mark.parametrize("wire", ["hover"], indirect=True)
def test_the_worst_instant_is_marked_and_one_click_away(wire, folder):
    """By the file alone: one without tensions, here the first of those."""
    with xr.open_dataset(folder / "hover.nc") as saved:
        missing = saved["tensions"].isnull().any("cable").to_numpy()
        worst = float(saved["time"].to_numpy()[missing.argmax()])
    assert missing.any()
    mark = wire.element(label="time [s]")[1]["_marks"][0]
    assert (mark["value"], mark["label"]) == (pytest.approx(worst), "worst")
    bar = next(found["content"] for found in wire.panel.values() if "towline-timeline" in str(found.get("content")))
    spans = [float(percent) for percent in re.findall(r",#D55E00 ([\d.]+)%", bar)]
    with xr.open_dataset(folder / "hover.nc") as saved:
        share = (worst - float(saved["time"][0])) / float(saved["time"][-1] - saved["time"][0])
    assert spans[0] == pytest.approx(100 * share, abs=1.0)  # orange from there on
    assert len(spans) % 2 == 0
    wire.set("last", label="go to")
    wire.set("worst", label="go to")
    while wire.read(0.3):
        pass
    assert f"t = {worst:.2f} s" in wire.readout()


@pytest.mark.parametrize("wire", ["line"], indirect=True)
@pytest.mark.parametrize(
    ("view", "along"), [("top", [0, 0, 1]), ("front", [0, -1, 0]), ("side", [1, 0, 0]), ("all", [0.38, -0.84, 0.38])]
)
def test_the_camera_looks_at_the_middle_from_each_side(wire, folder, view, along):
    moved = {}
    wire.set(view, label="view")
    while wire.read(0.3):
        moved |= {part["type"]: part for part in wire.messages if part["type"].startswith("SetCamera")}
    arm = np.subtract(moved["SetCameraPositionMessage"]["position"], moved["SetCameraLookAtMessage"]["look_at"])
    np.testing.assert_allclose(arm / np.linalg.norm(arm), along, atol=0.01)
    extent = read(str(folder / "line.nc")).replay.extent
    np.testing.assert_allclose(moved["SetCameraLookAtMessage"]["look_at"], extent.centre, atol=1e-6)


@pytest.mark.parametrize("wire", ["line"], indirect=True)
def test_charts_have_the_limits_that_tensions_come_near(wire):
    wire.set("next", label="step")
    assert wire.read()
    chart, robot = wire.element(title="tensions [N]")[1], load("wang-flying")
    at = [series["label"] for series in chart["series"]].index("limit")
    assert set(wire.array(chart["data"][at]).tolist()) == set(robot.t_min)


@pytest.mark.parametrize("wire", ["line"], indirect=True)
def test_a_film_of_the_saved_instants_is_sent_while_the_view_goes_on(wire, folder):
    wire.set(True, label="Save film")
    content, moved = b"", None
    for _ in range(200):
        wire.read(0.3)
        if moved is None and any(found.get("label") == "Drawing a film ..." for found in wire.panel.values()):
            wire.set("last", label="go to")
            moved = False
        drawing = any(found.get("label") == "Drawing a film ..." for found in wire.panel.values())
        moved = moved or (drawing and "t = 2.00 s" in wire.readout())
        content += b"".join(part["content"] for part in wire.messages if part["type"] == "FileTransferPart")
        if content and any(found.get("label") == "Save film" for found in wire.panel.values()):
            break
    assert moved
    with Image.open(io.BytesIO(content)) as picture:
        assert picture.n_frames == int(2 * 12.5) + 1
        assert picture.info["duration"] == 80
    replay = read(str(folder / "line.nc")).replay
    drawn = scene(replay.robot, replay.dataset, timing(Path("x.gif"), 2.0, 1.0, 12.5).times)
    saved = xr.load_dataset(folder / "line.nc").sel(time=drawn.path_times[0] + np.arange(26) * 0.08, method="nearest")
    np.testing.assert_allclose(drawn.tensions, saved["tensions"])


def test_curves_have_the_worst_of_every_part(folder):
    replay = read(str(folder / "line.nc")).replay
    replay.tensions[23] = np.nan
    few = curves(replay, points=8)
    assert len(few.times) <= 10
    assert (few.times[0], few.times[-1]) == (replay.times[0], replay.times[-1])
    assert few.infeasible.sum() == 1
    assert few.times[few.infeasible] == replay.times[23]
    saved = xr.load_dataset(folder / "line.nc")
    known = ~few.infeasible
    slack = np.minimum(saved["tensions"] - saved["t_min"], saved["t_max"] - saved["tensions"]).min("cable")
    np.testing.assert_allclose(few.margins[known], slack.sel(time=few.times[known]), atol=1e-12)
    assert len(curves(replay, points=10_000).times) == len(replay.times)


def test_a_margin_that_is_rounding_is_drawn_as_none(folder):
    replay = read(str(folder / "line.nc")).replay
    lowest = replay.margins.min()
    vars(replay)["margins"] = replay.margins - lowest + 1e-12
    assert (replay.margins > 0).all()
    assert curves(replay).margins.min() == 0
    assert curves(replay).margins.max() > 0


def test_curves_at_other_times_end_where_the_motion_ends():
    two = Curves(np.array([0.0, 2.0]), np.array([[1.0, 5.0], [3.0, 7.0]]), np.array([0.0, 1.0]))
    other = two.on(np.array([-1.0, 1.0, 2.0, 3.0]))
    np.testing.assert_allclose(other.tensions, [[np.nan, np.nan], [2, 6], [3, 7], [np.nan, np.nan]])
    np.testing.assert_allclose(other.margins, [np.nan, 0.5, 1, np.nan])


def test_paths_are_those_of_carriers_that_move(folder, tmp_path):
    saved = xr.load_dataset(folder / "line.nc")
    assert read(str(folder / "line.nc")).replay.carrier_paths == []
    saved["carrier_pose"][:, 0, 1] += np.linspace(0, 0.3, saved.sizes["time"])
    saved.to_netcdf(tmp_path / "moves.nc", engine="h5netcdf")
    (path,) = read(str(tmp_path / "moves.nc")).replay.carrier_paths
    np.testing.assert_allclose(path, saved["carrier_pose"][:, 0, :3])


def test_the_cursor_of_curves_is_at_the_nearest_instant():
    times = np.array([0.0, 0.4, 1.0, 3.0])
    some = Curves(times, np.ones((4, 2)), np.ones(4))
    assert [some.nearest(time) for time in (-1, 0.1, 0.3, 0.6, 2.1, 9)] == [0, 0, 1, 1, 3, 3]


@pytest.fixture(scope="module")
def compared(folder):
    """Another plan, slower and elsewhere, beside `line`."""
    path = {"kind": "line", "start": [0, 0, -1], "end": [-0.05, 0.02, -0.9]}
    task = {"path": path, "duration": 3, "base": {"kind": "hold"}, "output_rate": 20}
    plan(load("wang-flying"), task).save(folder / "slow.nc")
    return read(str(folder / "line.nc"), other=str(folder / "slow.nc"))


def test_two_plans_are_compared_at_the_same_time(compared, folder):
    slow = xr.load_dataset(folder / "slow.nc")
    with serve(compared, port=0) as url:
        wire = Wire(url)
        wire.set(1.2, label="time [s]")
        while wire.read(0.4):
            pass
        saved = slow.sel(time=1.2, method="nearest")
        np.testing.assert_allclose(wire.scene["/other/platform"]["position"], saved["pose"][:3], atol=1e-6)
        beside = [float(text) for text in re.findall(r'towline-other"[^>]*>([\d.]+) N', wire.readout())]
        np.testing.assert_allclose(beside, saved["tensions"], atol=0.0051)
        own = np.array(wire.scene["/platform"]["position"])
        apart = float(re.search(r"platforms ([\d.]+) m apart", wire.readout())[1])
        assert apart == pytest.approx(np.linalg.norm(own - saved["pose"][:3].to_numpy()), rel=1e-3)
        # Its curve, dashed, in the same chart.
        _, chart = wire.element(title="tensions [N]")
        labels = [series["label"] for series in chart["series"]]
        times, curve = (wire.array(chart["data"][k]) for k in (0, labels.index("cable 3, other")))
        expected = np.interp(times, slow["time"], slow["tensions"][:, 2])
        np.testing.assert_allclose(curve, expected, atol=1e-6)
        wire.close()


def test_only_motions_of_one_robot_are_compared(folder):
    for other, words in (("cogiro", "must be plans or simulations, got the robot cogiro"),):
        with pytest.raises(InputError, match=words):
            read(str(folder / "line.nc"), other=other)
        with pytest.raises(InputError, match=words):
            read(other, other=str(folder / "line.nc"))
    saved = xr.load_dataset(folder / "line.nc")
    saved.attrs["robot"] = saved.attrs["robot"].replace("wang-flying", "another")
    saved.to_netcdf(folder / "another.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"another.nc must be of wang-flying with 6 cables, got another"):
        read(str(folder / "line.nc"), other=str(folder / "another.nc"))


@pytest.mark.parametrize("wire", ["line"], indirect=True)
def test_playing_that_is_paused_while_it_waits_for_a_drag_moves_nothing(wire, monkeypatch):
    at, go_on = Replay.at, threading.Event()

    def slow(self, index, prove=True):
        go_on.wait(5)
        return at(self, index, prove)

    monkeypatch.setattr(Replay, "at", slow)
    wire.set(1.0, label="time [s]")  # its drawing takes a while
    time.sleep(0.2)
    play = wire.element(label="Play")[0]
    for _ in range(2):
        wire.send(type="GuiUpdateMessage", uuid=play, updates={"value": True})
        time.sleep(0.2)
    go_on.set()
    while wire.read(0.4):
        pass
    assert wire.element(label="Play")[0] == play
    assert "t = 1.00 s" in wire.readout()


@pytest.mark.parametrize("wire", ["line"], indirect=True)
def test_two_clicks_at_once_draw_one_film(wire, monkeypatch):
    drawn = []

    def film(replay):
        drawn.append(replay)
        time.sleep(0.3)
        return b"GIF"

    monkeypatch.setattr("towline.viewer.panel.film", film)
    for _ in range(2):
        wire.set(True, label="Save film")
    while wire.read(0.6):
        pass
    assert len(drawn) == 1
    wire.set(True, label="Save film")
    while wire.read(0.6):
        pass
    assert len(drawn) == 2
