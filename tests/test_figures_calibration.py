"""Figures of a calibration: what is drawn is what was given, in millimetres."""

import numpy as np
import pytest
from matplotlib.patches import Ellipse

from towline import Measurements, calibrate
from towline.figures.calibration import WITHIN_95, anchors, observability, residuals

from .robots_as_built import as_built

RNG = np.random.default_rng(0)


def test_residuals_before_and_after():
    before, after = RNG.normal(0.03, 0.002, (5000, 4)), RNG.normal(0, 0.001, (5000, 4))
    top, bottom = residuals(before, after, np.arange(5000) / 100).axes
    assert top.get_title(loc="left") == "root mean square 30.1 mm"
    assert bottom.get_title(loc="left").startswith("root mean square 1")
    assert bottom.get_xlabel() == "time [s]"
    (first, *_) = top.lines
    assert len(top.lines) == 4
    assert 1000 < len(first.get_xdata()) <= 2000
    np.testing.assert_allclose(first.get_ydata()[0], 1e3 * before[0, 0])


def test_anchors_have_the_ellipses_of_their_covariances():
    """The border of an ellipse is where the Mahalanobis distance of its plane is the quantile, whatever its turn."""
    file, moved = RNG.normal(size=(6, 3)), RNG.normal(size=(6, 3)) * 0.02
    roots = RNG.normal(size=(6, 3, 3)) * 0.002
    covariances = roots @ roots.swapaxes(1, 2)
    panels = anchors(file, file + moved, covariances).axes
    assert [ax.get_title() for ax in panels] == [f"cables[{i}]" for i in range(6)]
    for ax, shift, covariance in zip(panels, moved, covariances, strict=True):
        ellipses = [patch for patch in ax.patches if isinstance(patch, Ellipse)]
        for ellipse, plane in zip(ellipses, ([0, 1], [0, 2]), strict=True):
            border = ellipse.get_patch_transform().transform(ellipse.get_path().vertices)
            off = border / 1e3 - shift[plane]
            distance = np.sqrt(np.einsum("ni,ij,nj->n", off, np.linalg.inv(covariance[np.ix_(plane, plane)]), off))
            on = np.arange(len(off)) % 3 == 0  # the others steer the curve
            np.testing.assert_allclose(distance[on], WITHIN_95, rtol=2e-3)


def test_what_is_not_determined_is_drawn_apart():
    sigmas = {"anchor x": np.array([1e-3, np.inf, 2e-3]), "offset": np.array([5e-4, 5e-4, np.nan])}
    (ax,) = observability(sigmas).axes
    full = np.concatenate(
        [line.get_ydata() for line in ax.lines if line.get_fillstyle() == "full" and line.get_label()[0] != "_"]
    )
    np.testing.assert_allclose(np.sort(full), [0.5, 0.5, 1, 2])
    (opened,) = [line for line in ax.lines if line.get_fillstyle() == "none" and len(line.get_xdata())]
    assert opened.get_ydata()[0] > 4
    assert opened.get_xdata()[0] == pytest.approx(1, abs=0.4)
    (ax,) = observability({"offset": np.full(3, np.inf)}).axes
    assert any(len(line.get_xdata()) == 3 for line in ax.lines)


def test_a_calibration_draws_its_own_numbers(tmp_path):
    built = as_built(40, 3)
    result = calibrate("cogiro", built.measurements(), free=("anchors", "offsets"))
    drawn = result.figures()
    assert list(drawn) == ["residuals", "anchors", "observability"]
    assert f"{1e3 * result.residual_after:.3g} mm" in drawn["residuals"].axes[1].get_title(loc="left")
    values = {parameter.name: parameter for parameter in result.parameters}
    moved = [1e3 * values[f"cables[2].anchor.{axis}"].correction for axis in "xyz"]
    centres = [line.get_xydata()[0] for line in drawn["anchors"].axes[2].lines if "calibrated" in str(line.get_label())]
    np.testing.assert_allclose(centres, [[moved[0], moved[1]], [moved[0], moved[2]]], atol=1e-9)
    (ax,) = drawn["observability"].axes
    (offsets,) = [line for line in ax.lines if line.get_label() == "offset"]
    np.testing.assert_allclose(offsets.get_ydata(), [1e3 * values[f"cables[{i}].offset"].sigma for i in range(8)])
    assert [path.name for path in result.plot(tmp_path / "new")] == [f"{name}.png" for name in drawn]
    assert all((tmp_path / "new" / f"{name}.png").stat().st_size > 5000 for name in drawn)
    blind = calibrate("cogiro", Measurements(as_built(120, 3).readings), free=("anchors",))
    assert "anchors" not in blind.figures()  # they are open: they have no ellipsoids


def test_wrong_readings_are_marked_at_the_edge_and_do_not_count():
    """The root mean square and the range are those of the other readings."""
    rng = np.random.default_rng(2)
    before, after = rng.normal(size=(2, 100, 3)) * [[[0.02]], [[0.001]]]
    wrong = np.zeros((100, 3), dtype=bool)
    wrong[17, 1] = True
    before[17, 1] = after[17, 1] = 0.3
    figure = residuals(before, after, wrong=wrong)
    for ax, values in zip(figure.axes, (before, after), strict=True):
        rms = 1e3 * np.sqrt(np.mean(values[~wrong] ** 2))
        assert any(f"{rms:.3g} mm" in text.get_text() for text in ax.texts) or f"{rms:.3g} mm" in ax.get_title("left")
        high = ax.get_ylim()[1]
        assert high < 1.5e3 * np.abs(values[~wrong]).max()
        (cross,) = (line for line in ax.lines if line.get_label() == "left out")
        assert cross.get_xydata().tolist() == [[17.0, high]]
