"""What went wrong first: in the report, the numbers, the figures, the film and the viewer; and cut cables hang."""

import json
from string import Template

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot
from ruamel.yaml import YAML

from towline import load, simulate
from towline.cli.new import TEMPLATES
from towline.figures.robot import drawn_ends
from towline.models import Robot
from towline.statics.scene import scene
from towline.viewer import read
from towline.viewer.labels import readout

LINE = {"kind": "line", "start": [0, 0, -1], "end": [0.3, 0, -1.1]}


@pytest.fixture(scope="module")
def failed():
    return simulate("wang-flying", LINE, duration=1.5, events=["miss 0.02 at 0.3", "cut 3 at 0.8"])


def test_a_failed_flight_names_the_fault_and_what_came_after(failed):
    assert not failed.passed
    happened = failed.to_dict()["events"]
    left = 1e-3 * np.argmax(failed.error > 0.05)
    assert [(event["kind"], event["at_s"]) for event in happened] == [("fault", 0.3), ("fault", 0.8), ("error", left)]
    assert "cable 3 was cut at 0.8 s; the error exceeded 50 mm at 1." in failed.report()
    assert json.loads(json.dumps(happened)) == happened


def test_the_first_slack_cable_is_named():
    flight = simulate("multi-quadrotor-4", load("multi-quadrotor-4").home, duration=1.0, events=["lose quad1 at 0.2"])
    first = {event["kind"]: event for event in reversed(flight.to_dict()["events"])}
    row, cable = np.argwhere(flight.slack)[0]
    assert first["slack"] == {
        "at_s": flight.times[row],
        "kind": "slack",
        "what": f"cable {cable + 1} was the first to go slack",
    }
    assert first["fault"]["what"] == "the actuators of quad1 were lost"


def test_extreme_tensions_are_those_of_cables_that_are_not_cut(failed):
    """The report had "tensions 0 N to ..." and "slack 0 s" for a cable that was gone."""
    held = np.delete(failed.record.tensions, 2, axis=1)
    before = failed.record.tensions[:800, 2]
    merit = failed.to_dict()
    assert merit["tension_min"] == min(held.min(), before.min()) > 0
    assert merit["tension_max"] == max(held.max(), before.max())
    home, conditions = load("wang-flying").home, {"duration": 0.05, "events": ["cut 3 at 0.02"]}
    flight = simulate("wang-flying", home, **conditions).to_dict()
    runs = simulate("wang-flying", home, runs=2, **conditions)
    assert runs["tension_min"].values == pytest.approx(flight["tension_min"], rel=1e-9)
    assert runs["tension_max"].values == pytest.approx(flight["tension_max"], rel=1e-9)
    assert flight["tension_min"] > 0


def test_a_good_flight_has_no_events():
    flight = simulate("wang-flying", load("wang-flying").home, duration=0.05)
    assert flight.to_dict()["events"] == []
    assert "in this order" not in flight.report()
    assert "cut" not in flight.trajectory


def test_figures_mark_the_instants(failed):
    for canvas in failed.figures().values():
        for ax in canvas.axes:
            upright = {
                line.get_xdata()[0]
                for line in ax.lines
                if len(set(line.get_xdata())) == 1 and len(line.get_xdata()) == 2
            }
            assert {event["at_s"] for event in failed.to_dict()["events"]} <= upright
        words = " ".join(
            text.get_text()
            for legend in [*canvas.legends, canvas.axes[0].get_legend()]
            if legend
            for text in legend.texts
        )
        assert "0.8 s: cable 3 was cut" in words
        pyplot.close(canvas)


def test_a_cut_cable_hangs_from_its_anchor(failed):
    drawn = scene(failed.robot, failed.trajectory, np.array([0.7, 0.9]))
    assert drawn.cut.tolist() == [[False] * 6, [False, False, True, False, False, False]]
    ends = drawn_ends(drawn.anchors, drawn.attachments, drawn.cut)
    assert (ends[0] == drawn.attachments[0]).all()
    assert (ends[1, 2, :2] == drawn.anchors[1, 2, :2]).all()
    assert ends[1, 2, 2] < drawn.anchors[1, 2, 2]
    assert (np.delete(ends[1], 2, 0) == np.delete(drawn.attachments[1], 2, 0)).all()


def test_the_viewer_reads_cuts_and_events(failed, tmp_path):
    replay = read(failed.save(tmp_path / "flight.nc")).replay
    before, after = replay.at(replay.index_at(0.7)), replay.at(replay.index_at(0.9))
    assert not before.cut.any()
    assert np.flatnonzero(after.cut).tolist() == [2]
    assert after.nearest != 2
    assert before.events == ("0.3 s: the controller paused for 0.02 s",)
    assert "0.8 s: cable 3 was cut" in readout(after, replay.robot)
    assert ">cut</td>" in readout(after, replay.robot)
    with xr.open_dataset(tmp_path / "flight.nc", engine="h5netcdf") as file:
        damaged = file.load().assign_attrs(report="no JSON")
    damaged.to_netcdf(tmp_path / "damaged.nc", engine="h5netcdf")
    assert read(tmp_path / "damaged.nc").replay.at(0).events == ()


def test_a_shortfall_is_not_that_of_angles_without_meaning():
    """A load on two of three cables pitches through 90 degrees, where roll and yaw jump by half a turn."""
    text = Template((TEMPLATES / "towing.yaml").read_text()).substitute(name="tugs")
    robot = Robot.model_validate(YAML(typ="safe").load(text))
    run = simulate(robot, robot.home, duration=1.2, events=["cut 1 at 0.05"])
    poses, shortfall = run.trajectory["pose"].values, run.record.shortfall[: len(run.times)]
    weight = 9.81 * robot.platform.mass
    assert np.abs(poses[:, 4]).max() > 1.5
    assert np.abs(np.diff(poses[:, 3])).max() > 3
    assert 0.1 * weight < np.nanmax(shortfall) < weight
    assert run.figures_of_merit()["shortfall_max"] == np.nanmax(shortfall)
