"""Figures of flights show what the dataset has: read back from the axes."""

import itertools

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from towline import simulate
from towline.figures import flight, style

TIME = np.arange(0, 2, 0.01)
ANSWERS = ["as_planned", "shifted_plan", "soft_wrench", "hold"]


def made(**changed):
    """A flight of two cables: cable 2 is slack from 0.5 s to 1 s, and the controller then answers otherwise."""
    slack = (TIME >= 0.5 - 1e-9) & (TIME < 1 - 1e-9)
    real = np.stack([20 + np.sin(TIME), np.where(slack, 0.0, 12.0)], axis=1)
    commanded = np.stack([20 + np.sin(TIME), np.full(len(TIME), 12.0)], axis=1)
    carrier = np.zeros((len(TIME), 2, 6))
    reference = carrier.copy()
    reference[:, 1, 0] = 0.003
    variables = {
        "tracking_error": ("time", 0.002 + 0.001 * TIME),
        "tensions": (("time", "cable"), real),
        "tensions_commanded": (("time", "cable"), commanded),
        "t_min": ("cable", [1.0, 1.0]),
        "t_max": ("cable", [30.0, 500.0]),
        "carrier_pose": (("time", "carrier", "coordinate"), carrier),
        "carrier_reference": (("time", "carrier", "coordinate"), reference),
        "answered": (
            "time",
            np.where(slack, 2, 0),
            {"flag_values": np.arange(4, dtype=np.int8), "flag_meanings": " ".join(ANSWERS)},
        ),
    }
    coordinates = {
        "time": TIME,
        "cable": [1, 2],
        "carrier": ["post", "quad"],
        "carrier_moves": ("carrier", [False, True]),
    }
    return xr.Dataset(variables | changed, coordinates, {"tolerance_m": 0.05})


def panels(figure):
    return {axes.get_ylabel() or axes.get_title(loc="left"): axes for axes in figure.axes}


def test_error_offsets_and_answers_have_a_panel_each():
    drawn = panels(flight.flight(made()))
    assert list(drawn) == ["error [mm]", "offset of\ncarriers [mm]", "status of each control step"]
    np.testing.assert_allclose(drawn["error [mm]"].lines[0].get_ydata(), 2 + TIME)
    (offset,) = drawn["offset of\ncarriers [mm]"].lines  # of the carrier that moves
    assert offset.get_label() == "quad"
    np.testing.assert_allclose(offset.get_ydata(), 3.0)
    strip = drawn["status of each control step"]
    assert [text.get_text() for text in strip.get_yticklabels()] == ["as planned", "soft wrench"]
    spans = [[path.get_extents().intervalx for path in bar.get_paths()] for bar in strip.collections]
    np.testing.assert_allclose(np.concatenate(spans), [[0, 0.5], [1, 2], [0.5, 1]], atol=1e-9)


def test_wind_has_a_panel_where_there_is_one():
    wind = np.tile([3.0, 2.0, 0.5], (len(TIME), 1))
    drawn = panels(flight.flight(made(wind=(("time", "axis"), wind))))
    assert [line.get_ydata()[0] for line in drawn["wind [m/s]"].lines] == [3.0, 2.0, 0.5]
    assert "wind [m/s]" not in panels(flight.flight(made()))


def test_a_tolerance_that_is_near_is_a_line():
    near = made()
    near.attrs["tolerance_m"] = 0.004
    (_, line) = panels(flight.flight(near))["error [mm]"].lines
    assert set(line.get_ydata()) == {4.0}
    far = panels(flight.flight(made()))["error [mm]"]
    assert [text.get_text() for text in far.figure.legends[0].get_texts()] == ["tolerance 50 mm, above the plot"]


def test_tensions_show_slack_limits_and_commands_that_differ():
    axes = flight.tensions(made()).axes[0]
    real, dashed = axes.lines[0:4:2], axes.lines[1:4:2]
    np.testing.assert_array_equal(np.stack([line.get_ydata() for line in real], axis=1), made()["tensions"])
    assert np.isnan(dashed[0].get_ydata()).all()
    there = np.isfinite(dashed[1].get_ydata())
    assert (TIME[there].min(), TIME[there].max()) == pytest.approx((0.5, 0.99))
    shown = {text.get_text() for text in axes.texts}
    assert {"t_min = 1 N", "t_max = 30 N", "cable 1", "2"} <= shown
    labels = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert labels == ["real", "commanded, where it differs", "slack: cable 2", "t_max = 500 N,\nabove the plot"]
    (shaded,) = axes.patches
    assert shaded.get_extents().transformed(axes.transData.inverted()).intervalx == pytest.approx([0.5, 1.0])


@pytest.mark.parametrize("ends", [[1, 1, 1, 1], [0, 0.01, 0.02, 0.9], [0.5, 0.5, 0.5, 0.51], np.linspace(0, 1, 8)])
def test_names_beside_curves_are_apart_and_inside(ends):
    places = style._spread(np.array(ends, dtype=float))
    assert (np.diff(places) >= style.GAP - 1e-12).all()
    assert places[0] >= -1e-12
    assert places[-1] <= style.HIGHEST + 1e-12


@pytest.mark.parametrize("draw", [flight.flight, flight.tensions])
def test_no_text_overlaps_another_or_leaves_the_figure(draw):
    wind = np.tile([3.0, 2.0, 0.5], (len(TIME), 1))
    figure = draw(made(wind=(("time", "axis"), wind)))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    axes = [axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)]
    ticks = {id(label) for axis in axes for label in axis.get_ticklabels()}  # those outside the limits are not drawn
    texts = [text for text in figure.findobj(Text) if text.get_text().strip() and id(text) not in ticks]
    boxes = {text: text.get_window_extent(canvas.get_renderer()) for text in texts}
    boxes = {text: box for text, box in boxes.items() if box.width > 1}  # others are not drawn
    assert len(boxes) >= 5
    for text, box in boxes.items():
        assert min(box.x0, box.y0) >= -1, text
        assert box.x1 <= figure.bbox.x1 + 1, text
        assert box.y1 <= figure.bbox.y1 + 1, text
    for one, other in itertools.combinations(boxes, 2):
        assert not boxes[one].overlaps(boxes[other]), (one, other)


def test_errors_of_many_flights_are_sorted():
    errors, passed = [0.004, 0.06, 0.005], [True, False, True]
    table = xr.Dataset({"error_max": ("seed", errors), "passed": ("seed", passed)}, attrs={"tolerance_m": 0.05})
    axes = flight.errors(table).axes[0]
    every, good, bad = axes.lines[:3]
    np.testing.assert_allclose(every.get_ydata(), [4, 5, 60])
    np.testing.assert_allclose(good.get_ydata(), [4, 5])
    np.testing.assert_allclose(bad.get_ydata(), [60])


@pytest.mark.parametrize("force", [1e300, 1e12])
def test_a_motion_that_no_numbers_hold_is_a_flight_that_failed(force):
    """The first force leaves no finite state after one period, the second none that has Euler angles."""
    flown = simulate("wang-flying", [0, 0, -1, 0, 0, 0], duration=0.01, disturbance=[force, 0, 0, 0, 0, 0])
    assert not flown.passed
    assert "FAILED" in flown.report().splitlines()[0]
    assert len(flown.trajectory["time"]) >= 1
    assert set(flown.figures()) == {"simulation", "tensions"}
