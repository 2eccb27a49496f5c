"""Load cells that are dead or saturated, in recordings of a planar robot whose forces are balanced here."""

import numpy as np
import pytest

from towline import load
from towline.estimation.calibration import calibrate
from towline.estimation.logs import read_log
from towline.estimation.logs.load_cells import unreadable
from towline.estimation.logs.recorded import read_recorded
from towline.models import Robot

from . import user_recordings as user

ANCHORS = np.array([[-1.5, 0, 2.2], [1.5, 0, 2.2], [1.5, 0, 0], [-1.5, 0, 0]])
ATTACHMENTS = np.array([[-0.15, 0, -0.08], [0.15, 0, -0.08], [0.15, 0, 0.08], [-0.15, 0, 0.08]])  # crossed cables


def recording(count=800, mass=6.0):
    """Rows of time, lengths, x, z, pitch, and tensions (N, 4) [N] of at least 20 N with 2 % of noise."""
    draw, t = np.random.default_rng(3), 0.02 * np.arange(count)
    x, z = 0.8 * np.sin(1.1 * t), 1.1 + 0.5 * np.sin(0.83 * t)
    bends = np.column_stack([-(1.1**2) * x, -(0.83**2) * (z - 1.1)])
    lines = ANCHORS - np.column_stack([x, 0 * x, z])[:, None] - ATTACHMENTS
    lengths = np.linalg.norm(lines, axis=2)
    u = lines / lengths[..., None]
    moments = ATTACHMENTS[:, 2] * u[..., 0] - ATTACHMENTS[:, 0] * u[..., 2]
    W = np.stack([u[..., 0], u[..., 2], moments], axis=1)
    needed = np.column_stack([mass * (bends + np.array([0, 9.81])), 0 * x])
    pull = (np.linalg.pinv(W) @ needed[..., None])[..., 0]
    inner = np.linalg.svd(W)[2][:, 3]
    inner *= np.sign(inner.sum(axis=1, keepdims=True))
    pull += (((20 - pull) / inner).max(axis=1) + 30)[:, None] * inner
    readings = lengths + draw.normal(0, 3e-4, lengths.shape)
    rows = np.column_stack([t, readings, x, z, 0 * x]) + 0.0
    rows[:, 5:7] += draw.normal(0, 3e-4, (count, 2))
    return rows, pull * (1 + draw.normal(0, 0.02, pull.shape))


def saved(folder, rows, tensions):
    header = ["t", *(f"l{i}" for i in range(4)), "x", "z", "pitch [rad]", *(f"tension{i} [N]" for i in range(4))]
    return user.write(folder / "log.csv", header, np.hstack([rows, tensions]))


def planar(folder):
    """The robot with 5 kg, whose file says that ends of cables are exact: usual errors of ends count for the mass."""
    home, dof = [0, 0, 1.1, 0, 0, 0], "  dof: [x, z, pitch]\n"
    robot = load(user.robot_file(folder / "r.yaml", ANCHORS, ATTACHMENTS, home, 5.0, extra=dof))
    names = [f"cables[{i}].{end}.{axis}" for i in range(4) for end in ("anchor", "attachment") for axis in "xyz"]
    stated = {"parameters": names, "covariance": (1e-12 * np.eye(24)).tolist()}
    return Robot.model_validate(robot.model_dump() | {"uncertainty": stated})


@pytest.mark.parametrize("fault", ["none", "dead", "saturated"])
def test_the_mass_by_load_cells_of_which_some_measure_nothing(fault, tmp_path):
    robot = planar(tmp_path)
    rows, tensions = recording()
    if fault == "dead":
        tensions[:, 2] = 0.0
    top = np.quantile(tensions, 0.6)
    tensions = np.minimum(tensions, top) if fault == "saturated" else tensions
    log = read_log(saved(tmp_path, rows, tensions), robot=robot)
    said = [note for note in log.notes if "not measured" in note]
    if fault == "dead":
        assert said == ["tensions of cables[2] never change, so they are treated as not measured"]
    elif fault == "saturated":
        assert len(said) == (tensions >= top).any(axis=0).sum()
        assert f"the tension of cables[0] seems saturated at {top:.3g} N" in said[0]
    else:
        assert not said
    replayed = read_recorded(robot, tmp_path / "log.csv")
    assert (replayed.tensions is None) == (fault != "none")  # a plant driven by them would fall
    found = calibrate(robot, log.measurements, free="mass")
    sigma = float(np.sqrt(found.covariance[0, 0]))
    assert abs(found.robot.platform.mass - 6.0) < 4 * sigma
    assert sigma < 0.06


@pytest.mark.parametrize("decided", [True, False])
def test_the_mass_by_load_cells_with_zeros(decided, tmp_path):
    """Zeros of up to 9 N, where tensions are 70 N: a motion shows them, and a platform at one place does not."""
    robot = planar(tmp_path)
    rows, tensions = recording()
    zeros = np.array([8.0, -6.0, 9.0, -7.0])
    log = read_log(saved(tmp_path, rows, tensions + zeros), robot=robot).measurements
    log = log if decided else log.only(slice(100, 110))
    found = calibrate(robot, log, free="mass")
    assert found.free == ("mass", "zeros")
    of = {one.name: one for one in found.parameters}
    assert abs(of["mass"].value - 6.0) < 4 * of["mass"].sigma
    if decided:
        assert of["mass"].sigma < 0.15
        assert all(abs(of[f"cables[{i}].zero"].value - zero) < 1.0 for i, zero in enumerate(zeros))
        assert "mass, zeros from" in str(found.report())
    else:
        assert of["mass"].sigma > 0.3  # two zeros of 7 N, almost vertically


def test_the_mass_by_load_cells_with_small_zeros(tmp_path):
    """Zeros of 0.5 N, less than a hundredth of the tensions, shift the mass by five sigma if they are not estimated."""
    robot = planar(tmp_path)
    rows, tensions = recording(2000)
    log = read_log(saved(tmp_path, rows, tensions + np.array([0.1, -0.5, 0.5, -0.05])), robot=robot).measurements
    found = calibrate(robot, log, free="mass")
    (mass,) = (one for one in found.parameters if one.name == "mass")
    assert abs(mass.value - 6.0) < 4 * mass.sigma


def test_sound_sensors_are_not_saturated():
    """Sensors with coarse steps, a platform that waits at its largest tension, and cables without any tension."""
    rows, tensions = recording(400)
    lengths = rows[:, 1:5]
    for step in (0.1, 1.0, 5.0):
        assert not unreadable(np.round(tensions / step) * step, lengths).any()
    waits = np.argmax(tensions[:, 0])
    still = np.r_[:waits, [waits] * 300, waits:400]
    assert not unreadable(tensions[still], lengths[still]).any()
    assert not unreadable(np.maximum(tensions - np.quantile(tensions, 0.4), 0.0), lengths).any()
    assert not unreadable(np.ones((50, 4)), lengths[:50]).any()


def test_offsets_without_a_camera_by_load_cells_that_are_saturated(tmp_path):
    """Standard deviations grow with the number of tensions that are lost; they shrank because residuals did."""
    robot, offsets = load(user.hanging_robot(tmp_path)), np.array([0.06, 0.006, -0.02, -0.01])
    user.statics(tmp_path, offsets, 24)
    head, *rows = (tmp_path / "statics.csv").read_text().splitlines()
    values = np.array([row.split(",") for row in rows], dtype=float)
    sigmas = []
    for share in (1.0, 0.4):
        values[:, 7:] = np.minimum(values[:, 7:], np.quantile(values[:, 7:], share))
        log = read_log(user.write(tmp_path / "some.csv", head.split(","), values), robot=robot)
        found = calibrate(robot, log.measurements, free="offsets", outliers=False)
        sigmas.append(np.sqrt(np.diag(found.covariance)))
        moved = [cable.encoder.offset for cable in found.robot.cables]
        assert (np.abs(moved - offsets) < 4 * sigmas[-1]).all()
    assert (sigmas[1] > 1.3 * sigmas[0]).all()
