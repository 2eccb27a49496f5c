"""Every figure is legible in a journal's column: no text is cut or lies on another, and in grey all curves differ."""

import itertools

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb

from towline import InputError
from towline.figures import limits, style, sweep
from towline.figures.curves import Panel, curves
from towline.figures.style import together
from towline.figures.workspace import metric_map

from .figure_cases import FIGURES
from .legible import COLUMN_MM, LEAST_STEP, check_grey, check_size, check_texts, lightness, renderer_of


@pytest.fixture(scope="module")
def figures():
    """All figures, drawn, with the renderer that knows their boxes."""
    drawn = {name: draw() for name, draw in FIGURES.items()}
    return {name: (figure, renderer_of(figure)) for name, figure in drawn.items()}


@pytest.mark.parametrize("name", FIGURES)
def test_figures_have_the_width_of_a_column_and_legible_letters(name, figures):
    check_size(*figures[name])


@pytest.mark.parametrize("name", FIGURES)
def test_no_text_is_cut_or_lies_on_another(name, figures):
    check_texts(*figures[name])


@pytest.mark.parametrize("name", FIGURES)
def test_in_grey_the_curves_of_a_panel_differ(name, figures):
    check_grey(figures[name][0])


def test_sixteen_series_differ_in_grey_and_from_the_paper():
    looks = [style.look(index) for index in range(16)]
    for one, other in itertools.combinations(looks, 2):
        step = abs(lightness(one["color"]) - lightness(other["color"]))
        assert one["linestyle"] != other["linestyle"] or step >= LEAST_STEP
    assert max(lightness(look["color"]) for look in looks) < 75  # of 100: the paper


def test_a_curve_stays_visible_below_one_that_coincides(figures):
    """Cables 1 and 2 have equal tensions: both colours are in the picture, each in a good part of it."""
    from towline.figures import plan

    from .figure_cases import planned

    figure = plan.tensions(planned(cables=2))
    figure.set_dpi(300)
    canvas = FigureCanvasAgg(figure)
    figure.legends[0].set_visible(False)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].astype(float) / 255
    shares = [(np.abs(pixels - to_rgb(style.colour(index))).max(axis=2) < 0.1).sum() for index in range(2)]
    assert min(shares) > 0.2 * sum(shares)


def test_a_constant_curve_is_a_straight_line():
    """Rounding of 1e-8 m in a length of 1.2 m is not what the panel shows."""
    panels = [Panel("length [m]", {"": 1.2 + 1e-8 * np.sin(np.arange(100.0))}), Panel("force [N]", {"": np.zeros(100)})]
    length, force = curves(np.arange(100.0), "time [s]", panels).axes
    assert np.ptp(length.get_ylim()) == pytest.approx(1.2e-3, rel=1e-3)
    assert np.ptp(force.get_ylim()) > 0


def test_panels_share_their_axes(figures):
    two = figures["tensions-two"][0].axes
    assert two[0].get_shared_x_axes().joined(*two)
    assert two[0].get_shared_y_axes().joined(*two)
    above, front, side = figures["projections"][0].axes
    assert above.get_shared_x_axes().joined(above, front)
    assert front.get_shared_y_axes().joined(front, side)


@pytest.mark.parametrize("name", ["views", "views-high", "projections", "reached"])
def test_views_of_one_object_have_one_scale(name, figures):
    figure, renderer = figures[name]
    scales = []
    for panel in figure.axes:
        if panel.get_aspect() == 1.0:
            box = panel.get_window_extent(renderer)
            scales += [box.width / np.ptp(panel.get_xlim()), box.height / np.ptp(panel.get_ylim())]
    assert len(scales) >= 4
    np.testing.assert_allclose(scales, scales[0], rtol=0.02)


def test_an_infeasible_stretch_states_what_its_thin_curves_are(figures):
    figure, _ = figures["tensions-infeasible"]
    labels = " ".join(text.get_text().replace("\n", " ") for text in figure.legends[0].get_texts())
    assert "no tensions inside the limits: shortfall up to 2.13 N; thin lines: tensions without limits" in labels
    assert "t_max = 60 N, above the plot" in labels
    assert not any(panel.get_title(loc=loc) for panel in figure.axes for loc in ("left", "center", "right"))


def test_carriers_are_drawn_where_they_start_and_end(figures):
    from .figure_cases import scene

    drawn = scene()
    (above, _) = figures["views"][0].axes
    corners = [np.asarray(patch.get_xy()) for patch in above.patches]
    for instant in (0, -1):
        for cables in drawn.bodies:
            body = drawn.anchors[instant, cables, :2]
            assert any(all(np.isclose(shape, point).all(axis=1).any() for point in body) for shape in corners)


@pytest.mark.parametrize("suffix", style.FORMATS)
def test_files_are_as_wide_as_a_column(suffix, tmp_path):
    figure = FIGURES["tensions"]()
    content = style.save(figure, tmp_path / f"figure.{suffix}").read_bytes()
    for same in (FIGURES["tensions"](), figure):
        assert style.save(same, tmp_path / f"again.{suffix}").read_bytes() == content
    if suffix == "png":
        assert int.from_bytes(content[16:20], "big") == pytest.approx(COLUMN_MM / 25.4 * style.DPI, abs=1)
    elif suffix == "svg":
        assert f'width="{COLUMN_MM / 25.4 * 72:.6f}'[:12].encode() in content
        assert b"<text" not in content  # letters are shapes: no font is needed
    else:
        assert b"/FontFile2" in content  # TrueType, embedded
        assert b"/Type3" not in content


def test_another_format_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"one of \.png, \.pdf, \.svg, got .*figure\.jpg"):
        style.save(style.figure(), tmp_path / "figure.jpg")
    assert not list(tmp_path.iterdir())


def test_shares_of_limits():
    """By hand: 3 of 4 m/s is 75 %, 0.2 m where 0.1 m are kept 50 %, and the middle of a range 50 %."""
    speed = limits.Limited("speed", "m/s", ["a", "b"], np.array([[1.0, -3.0], [2.0, np.nan]]), -4.0, 4.0)
    np.testing.assert_allclose(speed.used(), [0.75, 0.5])
    clearance = limits.Limited("clearance", "m", ["a"], np.array([[0.2], [0.05], [0.0]]), 0.1, np.inf)
    np.testing.assert_allclose(clearance.used(), [0.5, 2.0, 10.0])
    thrust = limits.Limited("thrust", "N", ["a"], np.array([[10.0], [20.0], [5.0], [25.0]]), 0.0, 20.0)
    np.testing.assert_allclose(thrust.used(), [0.5, 1.0, 0.75, 1.25])
    endless = limits.Limited("speed", "m/s", ["a", "b"], np.array([[np.inf, 1.0]]), -4.0, 4.0)
    np.testing.assert_allclose(endless.used(), [10.0])
    assert limits.Limited("force", "N", ["a"], np.zeros((2, 1)), 0.0, 0.0).used() is None


@pytest.mark.parametrize("shape", [(3,), (3, 2), (3, 2, 2)])
def test_a_sweep_without_a_feasible_plan_is_drawn_once_and_without_a_scale(shape):
    axes = [sweep.Axis(f"field {k} [s]", [0.01 * (i + 1) for i in range(n)]) for k, n in enumerate(shape)]
    nothing = np.full(shape, np.nan)
    drawn = sweep.sweep(axes, np.full(shape, "infeasible"), {"cost": nothing, "margin [N]": nothing}, {"cost"})
    assert len(drawn.axes) == (shape[2] if len(shape) == 3 else 1)
    check_texts(drawn, renderer_of(drawn))


def test_limits_of_which_nothing_is_used_or_known_have_their_times():
    idle = limits.Limited("speed", "m/s", ["a"], np.zeros((3, 1)), -2.0, 2.0)
    unknown = limits.Limited("thrust", "N", ["a"], np.full((3, 1), np.nan), 0.0, 20.0)
    drawn = limits.limits(np.array([0.0, 1.0, 2.0]), [idle, unknown])
    assert drawn.axes[0].get_xlim() == (0.0, 2.0)
    names = [text.get_text() for text in drawn.legends[0].get_texts()]
    assert [name.split(")")[1] for name in names] == [": 0 %", ""]


def test_a_curve_of_many_cables_has_a_short_name():
    """The names of 16 cables would leave their curves no room."""
    values = np.tile([[1.0, 2.0]], (3, 16))
    shown, names = together(values, [str(i + 1) for i in range(32)], 1.0)
    np.testing.assert_array_equal(shown, np.tile([[1.0, 2.0]], (3, 1)))
    assert names == ["1, 3, 5 + 13", "2, 4, 6 + 13"]
    assert together(values[:, :10], [str(i + 1) for i in range(10)], 1.0)[1] == ["1, 3, 5, 7, 9", "2, 4, 6, 8, 10"]


def test_samples_far_apart_are_drawn_as_one_area():
    """Cells of the adaptive method may be larger than those in which samples are counted: a ball stays one disc."""
    for ax in FIGURES["reached-sparsely"]().axes:
        edge = next(each for each in ax.collections if not each.get_facecolor().size).get_paths()[0].vertices
        assert len(ax.collections[-1].get_paths()[0].to_polygons()) == 1
        np.testing.assert_allclose(np.linalg.norm(edge, axis=1), np.sqrt(2), atol=0.4)  # half of a line is inside


def test_layers_of_a_wide_robot_are_below_one_another():
    tops = [ax.get_position().y1 for ax in FIGURES["metrics-wide"]().axes[:3]]
    assert tops == sorted(tops, reverse=True)
    assert tops[0] - tops[2] > 0.1


def test_units_are_typeset():
    assert style.typeset("amplitude [um]") == "amplitude [µm]"
    assert style.typeset("acceleration [m/s^2, rad/s^2], jerk [m/s^3]") == "acceleration [m/s², rad/s²], jerk [m/s³]"
    names = [text.get_text() for text in FIGURES["limits"]().legends[0].get_texts()]
    assert any(name.startswith("carrier acceleration (at most 1.2\N{NO-BREAK SPACE}m/s²): ") for name in names)


@pytest.mark.parametrize("value", [0.0, 5.0, -3.0, 1e-7])
def test_a_map_of_one_value_says_only_that(value):
    """Also where rounding makes the values differ a little, and in a sweep."""
    rng = np.random.default_rng(0)
    position = np.c_[rng.uniform(-1, 1, (2000, 2)), np.zeros(2000)]
    margin = ("sample", value * (1 + 1e-13 * rng.random(2000)), {"units": "N"})
    centres = np.linspace(-0.9, 0.9, 10)
    result = xr.Dataset(
        {"position": (("sample", "axis"), position), "margin": margin}, {"x": centres, "y": centres, "z": [0.0]}
    )
    values = np.full((3, 2), value)
    axes = [sweep.Axis("a", [1.0, 2.0, 3.0]), sweep.Axis("b", [1.0, 2.0])]
    for figure in (
        metric_map(result, ["margin"]),
        sweep.sweep(axes, np.full((3, 2), "feasible"), {"margin [N]": values}),
    ):
        figure.canvas.draw()
        bar = figure.axes[-1]
        texts = [text.get_text() for text in (*bar.get_xticklabels(), *bar.get_yticklabels()) if text.get_text()]
        assert [float(text.replace("\N{MINUS SIGN}", "-")) for text in texts] == [value]
