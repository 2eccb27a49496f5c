"""What makes a figure legible in a column: the size of its letters, room for its texts, curves that differ in grey."""

import itertools

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.text import Text
from mpl_toolkits.mplot3d.art3d import Text3D
from mpl_toolkits.mplot3d.proj3d import proj_transform

COLUMN_MM = 88.0
LEAST_LETTERS = 6.0  # points: what journals accept
LEAST_RATIO = 2.0  # between the widths of two lines that differ by nothing else
LEAST_STEP = 12.0  # of CIE lightness, 0 to 100, between two lines of the same dashes
TOUCH = 0.5  # pixels by which boxes of letters, which hold their descenders, may meet


def renderer_of(figure):
    """Lay a figure out as it is drawn, without colouring pixels, and return the renderer that knows its boxes."""
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    return canvas.get_renderer()


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


def check_size(figure, renderer):
    """Check the width of a column, and the letters."""
    assert figure.get_figwidth() * 25.4 == pytest.approx(COLUMN_MM)
    assert figure.get_figheight() * 25.4 < 230, "higher than a page"
    assert min(text.get_fontsize() for text in written(figure, renderer)) >= LEAST_LETTERS


def check_texts(figure, renderer):
    """Check that no text is cut or lies on another."""
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


def check_grey(figure):
    """Check that the curves of a panel differ in grey."""
    for panel in figure.axes:
        named = [
            line for line in panel.lines if not line.get_label().startswith("_") and line.get_linestyle() != "None"
        ]
        for one, other in itertools.combinations(named, 2):
            step = abs(lightness(one.get_color()) - lightness(other.get_color()))
            widths = sorted(line.get_linewidth() for line in (one, other))
            apart = not same_dashes(one, other) or step >= LEAST_STEP or widths[1] >= LEAST_RATIO * widths[0]
            assert apart, f"{one.get_label()} looks like {other.get_label()}"
