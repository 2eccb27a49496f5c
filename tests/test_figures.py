"""Every figure is legible in a journal's column: no text is cut or lies on another, and in grey all curves differ."""

import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.text import Text
from mpl_toolkits.mplot3d.art3d import Text3D
from mpl_toolkits.mplot3d.proj3d import proj_transform

from towline import InputError
from towline.figures import style

from .figure_cases import FIGURES

COLUMN_MM = 88.0
LEAST_LETTERS = 6.0  # points: what journals accept
LEAST_RATIO = 2.0  # between the widths of two lines that differ by nothing else
LEAST_STEP = 12.0  # of CIE lightness, 0 to 100, between two lines of the same dashes
TOUCH = 0.5  # pixels by which boxes of letters, which hold their descenders, may meet


@pytest.fixture(scope="module")
def figures():
    """All figures, drawn, with the renderer that knows their boxes."""
    drawn = {}
    for name, draw in FIGURES.items():
        figure = draw()
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        drawn[name] = figure, canvas.get_renderer()
    return drawn


def written(figure, renderer):
    """Return the boxes of the texts that are drawn; ticks outside the limits are not."""
    ticks = {}
    for panel in figure.axes:
        for axis in (panel.xaxis, panel.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                ticks |= dict.fromkeys((id(tick.label1), id(tick.label2)), low <= tick.get_loc() <= high)
    boxes = {}
    for text in figure.findobj(Text):
        if text.get_text().strip() and text.get_visible() and ticks.get(id(text), True):
            box = Text.get_window_extent(text, renderer)  # without the arrow of an annotation
            boxes[text] = box.translated(*_moved(text)) if isinstance(text, Text3D) else box
    return {text: box for text, box in boxes.items() if box.width > 1}


def _moved(text):
    """Return by how much the box of a text in space is moved as it is drawn [pixels]."""
    places = np.array([proj_transform(*text.get_position_3d(), text.axes.get_proj())[:2], text.get_position()])
    at, beside = text.axes.transData.transform(places)
    return at - beside


@pytest.mark.parametrize("name", FIGURES)
def test_figures_have_the_width_of_a_column_and_legible_letters(name, figures):
    figure, renderer = figures[name]
    assert figure.get_figwidth() * 25.4 == pytest.approx(COLUMN_MM)
    assert figure.get_figheight() * 25.4 < 230, "higher than a page"
    assert min(text.get_fontsize() for text in written(figure, renderer)) >= LEAST_LETTERS


@pytest.mark.parametrize("name", FIGURES)
def test_no_text_is_cut_or_lies_on_another(name, figures):
    figure, renderer = figures[name]
    boxes = written(figure, renderer)
    assert len(boxes) >= 5
    for text, box in boxes.items():
        inside = min(box.x0, box.y0) >= -TOUCH and box.x1 <= figure.bbox.x1 + TOUCH and box.y1 <= figure.bbox.y1 + TOUCH
        assert inside, f"{text.get_text()!r} is cut"
    for one, other in itertools.combinations(boxes, 2):
        across = min(boxes[one].x1, boxes[other].x1) - max(boxes[one].x0, boxes[other].x0)
        up = min(boxes[one].y1, boxes[other].y1) - max(boxes[one].y0, boxes[other].y0)
        assert min(across, up) <= TOUCH, f"{one.get_text()!r} lies on {other.get_text()!r}"


def lightness(colour):
    """Return the CIE lightness of a colour, 0 to 100: what is left of it in grey."""
    parts = np.array(to_rgb(colour))
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    luminance = float(linear @ [0.2126, 0.7152, 0.0722])
    return 116 * np.cbrt(luminance) - 16 if luminance > 0.008856 else 903.3 * luminance


def same_dashes(one, other):
    """Return whether two lines have the same pattern, whatever their widths."""
    patterns = [np.array(line._unscaled_dash_pattern[1] or []) for line in (one, other)]
    return patterns[0].shape == patterns[1].shape and np.allclose(*patterns)


@pytest.mark.parametrize("name", FIGURES)
def test_in_grey_the_curves_of_a_panel_differ(name, figures):
    figure, _ = figures[name]
    for panel in figure.axes:
        named = [
            line for line in panel.lines if not line.get_label().startswith("_") and line.get_linestyle() != "None"
        ]
        for one, other in itertools.combinations(named, 2):
            step = abs(lightness(one.get_color()) - lightness(other.get_color()))
            widths = sorted(line.get_linewidth() for line in (one, other))
            apart = not same_dashes(one, other) or step >= LEAST_STEP or widths[1] >= LEAST_RATIO * widths[0]
            assert apart, f"{one.get_label()} looks like {other.get_label()}"


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
    assert "no tensions inside the limits: shortfall up to 2.13 N; thin lines: needed without limits" in labels
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
    again = style.save(FIGURES["tensions"](), tmp_path / f"again.{suffix}").read_bytes()
    assert content == again
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


def test_powers_are_raised():
    assert style.typeset("acceleration [m/s^2, rad/s^2], jerk [m/s^3]") == "acceleration [m/s², rad/s²], jerk [m/s³]"
    labels = [panel.get_ylabel() for panel in FIGURES["limits"]().axes]
    assert labels[:2] == ["[m/s²]", "[m/s²]"]
