"""The fit reaches the minimum that MINPACK reaches, in about as many steps, or says that it did not."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from towline.estimation.calibration import Measurements, calibrate, cross_validation, starts
from towline.estimation.calibration.curvature import curvature
from towline.estimation.calibration.fit import fit
from towline.estimation.calibration.parameters import OF_CABLE
from towline.estimation.calibration.solving import length_of, model_of
from towline.models import Dynamics, load

from .robots_as_built import as_built, moved_anchors

EACH = ("anchors", "attachments", "offsets", "scales")


def far_from_the_file(name, seed, moves, size, systematic=0.0):
    """A robot whose anchors are `size` [m] off, and poses along some coordinates alone."""
    draw, robot = np.random.default_rng(seed), load(name)
    built = moved_anchors(robot, draw, size)
    poses = robot.home + draw.uniform(-1, 1, (200, 6)) * moves * robot.dof_mask
    readings = Dynamics(built).cable_lengths(poses) - draw.normal(0, 0.05, robot.m)
    readings += systematic * np.sin(2 * poses[:, :1] + draw.uniform(0, 6, robot.m)) + draw.normal(
        0, 1e-3, readings.shape
    )
    return robot, Measurements(readings, poses)


def by_minpack(model):
    """Twice the cost of scipy's `lm`, from the same start, by the same residuals and derivatives."""
    varies, state, m = model.parameters.varies, model.begin(), model.robot.m

    def at(z):
        x = model.parameters.first.copy()
        x[varies] += z
        return state._replace(x=x)

    def derivatives(z):
        parts = model.linearised(at(z))[1]
        J = np.zeros((m, parts.cables.shape[1], model.parameters.count))
        for i in range(m):
            J[i, :, i * OF_CABLE : (i + 1) * OF_CABLE] = parts.cables[i]
        return J.reshape(-1, model.parameters.count)[:, varies]

    start = np.zeros(int(varies.sum()))
    return 2 * least_squares(lambda z: model.residuals(at(z)).readings.ravel(), start, derivatives, method="lm").cost


@pytest.mark.parametrize("free", [("anchors", "attachments", "offsets"), EACH])
@pytest.mark.parametrize("systematic", [0.0, 4e-3])
@pytest.mark.parametrize("seed", [3, 6, 7, 8])
def test_anchors_in_the_plane_of_motion(seed, systematic, free):
    """The derivative by how far an anchor is off the plane is nearly zero at first, and grows on the way."""
    robot, log = far_from_the_file("planar-4", seed, [0.3, 0, 0.3, 0, 0.2, 0], 0.7, systematic)
    model = model_of(robot, log, free, {})
    found = fit(model, model.begin(), length_of(robot))
    assert found.converged
    assert found.steps <= 130
    assert found.cost == pytest.approx(by_minpack(model), rel=1e-3)


@pytest.mark.parametrize(
    ("name", "moves"),
    [
        ("cogiro", [3, 1, 0.5, 0, 0, 0]),
        ("wang-flying", [0.5, 0.5, 0, 0, 0, 0]),
        ("wang-ctmrts-4", [0.5, 0.5, 0, 0, 0, 0]),
    ],
)
def test_poses_in_a_plane(name, moves):
    for seed in range(4):
        robot, log = far_from_the_file(name, seed, moves, 0.3)
        model = model_of(robot, log, ("anchors", "attachments", "offsets"), {})
        found = fit(model, model.begin(), length_of(robot))
        assert found.converged
        assert found.steps <= 130
        assert found.cost == pytest.approx(by_minpack(model), rel=1e-3)


def test_a_fit_that_is_not_finished_is_no_candidate(monkeypatch):
    built = as_built(60, 0)
    whole = calibrate("cogiro", built.measurements(), EACH, outliers=False)
    assert np.isfinite([one.left_out for one in whole.held_out.sets]).all()
    for module in (starts, cross_validation):
        monkeypatch.setattr(module, "fit", lambda *model, enough=0.0: fit(*model[:3], steps=2, enough=enough))
    cut = calibrate("cogiro", built.measurements(), EACH, outliers=False)
    assert not cut.converged
    assert "NOT CONVERGED" in cut.report()
    assert all(one.left_out == np.inf for one in cut.held_out.sets if "anchors" in one.free)


@pytest.mark.parametrize("seed", range(2))
def test_unknown_poses_take_few_steps(seed):
    """Poses follow the parameters through the curved valley of anchors and attachments."""
    readings = as_built(200, seed).readings
    result = calibrate("cogiro", Measurements(readings), ("anchors", "attachments", "offsets"), outliers=False)
    assert result.converged
    assert result._solved.fit.steps <= 15


def test_second_derivatives_of_lengths_by_poses():
    built = as_built(20, 0)
    model = model_of(load("cogiro"), Measurements(built.readings), ("anchors",), {})
    state, h = model.begin(), 1e-6

    def gradient(at):
        residuals, derivatives = model.linearised(at)
        return np.einsum("mn,mni->ni", residuals.readings, derivatives.poses)

    residuals, derivatives = model.linearised(state)
    first = np.einsum("mni,mnj->nij", derivatives.poses, derivatives.poses)
    moves = h * np.repeat(np.eye(6)[:, None], 20, axis=1)  # (6, 20, 6)
    ends = [[gradient(model.moved(state, 0 * state.x, sign * move)) for sign in (1, -1)] for move in moves]
    numeric = np.stack([(after - before) / (2 * h) for after, before in ends], axis=2)
    found = first + curvature(residuals, derivatives)
    np.testing.assert_allclose(found, (numeric + np.swapaxes(numeric, 1, 2)) / 2, atol=1e-7 * np.abs(found).max())
