"""Sensors that fail while they record: stuck encoders, counters that begin again, clocks that are set, slack cables."""

import re
from time import process_time

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from towline import calibrate, read_measurements
from towline.base.errors import InputError
from towline.estimation.calibration import Measurements, corrected, left_out as module
from towline.estimation.calibration.left_out import left_out
from towline.estimation.calibration.plausibility import mistake
from towline.estimation.calibration.restarts import restarts
from towline.estimation.calibration.solving import model_of
from towline.estimation.logs import read_log
from towline.estimation.logs.encoders import unrolled
from towline.models import Dynamics, load

from . import user_recordings as user
from .framed import framed
from .test_calibration_mistakes import a_log, seen
from .user_recordings import FRAME, PLATFORM, robot_file, write

ANCHORS = np.add(
    FRAME, [[0.6, -0.4, -0.3], [0.1, 0.1, -0.5], [-0.2, 0.2, -0.2], [0.1, -0.2, -0.4]]
)  # lines that do not meet
REASON = "cables that hardly pull, which may be slack"
TIMES = np.arange(0, 20, 0.05)
POSE = [f"l{i}" for i in range(8)], ["x", "y", "z", "roll", "pitch", "yaw"]


def a_motion(seed=0):
    """Robot, poses (N, 6) at `TIMES`, readings, and anchors (8, 3) of a robot whose anchors are 2 cm off."""
    robot, draw = load("cogiro"), np.random.default_rng(seed)
    rates, phases = draw.uniform(0.4, 1.2, 6), draw.uniform(0, 6, 6)
    poses = robot.home + [2, 1.5, 0.8, 0.15, 0.15, 0.2] * np.sin(np.outer(TIMES, rates) + phases)
    anchors = np.asarray(robot.anchors) + draw.normal(0, 0.02, (8, 3))
    ends = poses[:, None, :3] + robot.attachments @ Rotation.from_euler("xyz", poses[:, 3:]).as_matrix().swapaxes(1, 2)
    y = np.linalg.norm(ends - anchors, axis=2) + draw.normal(0, 3e-4, (len(TIMES), 8)) - 0.05
    return robot, poses, y, anchors


@pytest.mark.parametrize("part", [slice(120, 240), slice(None)], ids=["for a while", "always"])
def test_a_stuck_encoder_spoils_no_anchor(part):
    robot, poses, y, anchors = a_motion()
    y[part, 2] = y[part, 2][0]
    result = calibrate(robot, Measurements(y, poses, times=TIMES), ["anchors", "offsets"])
    assert result.refused is None
    assert "encoders that stand still while their cables move: cables[2]" in result.report()
    others = np.delete(np.arange(8), 2) if part == slice(None) else np.arange(8)
    off = np.linalg.norm(np.asarray(result.robot.anchors) - anchors, axis=1)
    assert off[others].max() < 0.01
    if part == slice(None):  # the file's values are kept
        np.testing.assert_array_equal(result.robot.anchors[2], robot.anchors[2])


def test_winches_locked_at_several_settings_are_no_stuck_encoders():
    """Who pushes the platform makes cables slack by decimetres; encoders that all stop during a motion are stuck."""
    robot, poses, y, _ = a_motion()
    of_setting = np.repeat(np.arange(8), 50)
    for rows, stuck in ((of_setting >= 0, False), (of_setting == 3, True)):
        held = np.where(rows[:, None], y[50 * of_setting], y)
        left = left_out(robot, Measurements(held, poses, times=TIMES))
        found = left["encoders that stand still while their cables move"]
        assert found.any() == stuck
        assert not found[~rows].any()


def test_counters_that_begin_again():
    times = np.linspace(0, 9, 400)
    whole = np.stack([40_000 * np.sin(times), 70_000 * np.cos(times), 900 * times], axis=1).round()
    counted = whole.copy()
    counted[:, :2] = (counted[:, :2] + 32_768) % 65_536 - 32_768
    found, rolled = unrolled(counted)
    assert rolled == [0, 1]
    np.testing.assert_allclose(found - found[0], whole - whole[0])
    lost = whole[:, [1]]
    lost[100:120] = 0  # readings that are missing
    np.testing.assert_array_equal(unrolled(lost)[0], lost)


@pytest.mark.parametrize("moved", [[1.0, -0.7, 0.4], [6.3, 5.0, -2.0], [1.3, 0.0, 0.0]])
def test_a_platform_that_moved_between_two_rests_is_no_counter(moved):
    """Readings at two rests, or with a gap: each goes from one end of its range to the other in one step."""
    noise = 1e-3 * np.random.default_rng(0).normal(size=(60, 3))
    readings = np.array([9.0, 8.0, 7.0]) + noise + np.outer(np.arange(60) >= 30, moved)
    found, rolled = unrolled(readings)
    assert rolled == []
    np.testing.assert_array_equal(found, readings)


@pytest.mark.parametrize("jump", [0.8, 0.3])
def test_a_clock_that_was_set_is_named(jump, tmp_path):
    _, poses, y, _ = a_motion()
    write(tmp_path / "winches.csv", ["t", *POSE[0]], np.column_stack([TIMES, y]))
    at = 7.5 + TIMES + jump * (TIMES > 10)
    write(tmp_path / "mocap.csv", ["t", *POSE[1]], np.column_stack([at, poses]))
    with pytest.raises(InputError, match=rf"one that seems to jump by {jump} s at 17.5\d+ s; cut the log there"):
        read_measurements(tmp_path / "winches.csv", poses=tmp_path / "mocap.csv", robot="cogiro")
    kept = np.abs(TIMES - 10) > 0.5  # a gap of the same clock is none
    write(tmp_path / "mocap.csv", ["t", *POSE[1]], np.column_stack([7.5 + TIMES, poses])[kept])
    found = read_measurements(tmp_path / "winches.csv", poses=tmp_path / "mocap.csv", robot="cogiro")
    assert len(found) > 300


@pytest.mark.parametrize("loose", range(4))
def test_cables_that_are_slack_by_the_weight(loose, tmp_path, monkeypatch):
    """Three cables carry the platform, whose CoM is on the line of their pull: the fourth must be slack."""
    others, place = np.delete(np.arange(4), loose), np.array([0.1, -0.1, 1.0])

    def directions(yaw):
        d = ANCHORS[others] - place - PLATFORM[others] @ Rotation.from_euler("z", yaw).as_matrix().T
        return d / np.linalg.norm(d, axis=1)[:, None]

    def moment(yaw):
        arms, d = PLATFORM[others] @ Rotation.from_euler("z", yaw).as_matrix().T, directions(yaw)
        return np.cross(arms, (d.T * np.linalg.solve(d.T, [0, 0, 5 * 9.81])).T).sum(axis=0)

    yaw = brentq(lambda angle: moment(angle)[2], -1, 1)
    of = Rotation.from_euler("z", -yaw).apply([-moment(yaw)[1], moment(yaw)[0], 0]) / (5 * 9.81)
    robot = load(robot_file(tmp_path / "robot.yaml", ANCHORS, PLATFORM, [*place, 0, 0, yaw], com=of.tolist()))
    log = Measurements(np.linspace(3, 4, 2)[:, None] + np.zeros(4), np.tile(robot.home, (2, 1)))
    monkeypatch.setattr(module, "MOST_SLACK", 2.0)
    pull = np.insert(np.linalg.solve(directions(yaw).T, [0, 0, 5 * 9.81]), loose, 0.0)
    found = left_out(robot, log)[REASON]
    np.testing.assert_array_equal(found[0], pull < 0.1 * np.abs(pull).mean())
    assert not left_out(robot, Measurements(log.lengths, log.poses, tensions=np.full((2, 4), 9.0)))[REASON].any()


def test_cables_in_another_order_in_a_turned_frame():
    """Neither explains the log without the other; one frame is simpler than two, with which other orders fit too."""
    robot, poses, y = a_log("cogiro", count=60)
    frame = np.array([1.0, -2.0, 0.3]), Rotation.from_euler("z", 90, degrees=True)
    found, texts = corrected(robot, Measurements(np.roll(y, 1, axis=1), seen(poses, frame)))
    assert "in this order, and the poses seem to be measured in a frame" in texts[0]
    np.testing.assert_array_equal(found.lengths, y)
    assert np.abs(found.poses[:, :3] - poses[:, :3]).max() < 0.1


def test_the_reverse_order_of_cables_is_not_taken_for_a_body_upside_down():
    """Both explain the log of a nearly symmetric robot; who recorded it must say which is right."""
    robot, poses, y = a_log("caroca", count=60)
    frame = np.array([1.0, -2.0, 0.3]), Rotation.from_euler("z", 90, degrees=True)
    found = mistake(robot, Measurements(y[:, ::-1], seen(poses, frame)))
    assert found.corrected is None
    assert "a body whose frame is" in found.text
    assert found.text.endswith(
        "; or the cables look like columns l7, l6, l5, l4, l3, l2, l1, l0 of the log, in this order, "
        "in other frames that are simpler or fit better"
    )


@pytest.mark.parametrize("taken", [30, 0], ids=["taken up in the middle", "none, but friction of 10 %"])
def test_a_load_that_is_taken_up(taken):
    robot, poses, _, _ = a_motion()
    poses[:, 2] = robot.home[2] - 0.8 * np.cos(2 * np.pi * TIMES / TIMES[-1])  # up, and down again
    y = np.asarray(Dynamics(robot).cable_lengths(poses))
    masses = robot.platform.mass + np.where(np.abs(TIMES - 10) < 3, taken, 0)
    wrench = np.array([0, 0, 9.81, 0, 0, 0]) * masses[:, None]
    tensions = (np.linalg.pinv(Dynamics(robot).wrench_matrix(poses)) @ wrench[..., None])[..., 0]
    tensions *= 1 - 0.1 * np.sign(np.gradient(y, axis=0))
    log = Measurements(y[::5], poses[::5], tensions=tensions[::5], times=TIMES[::5])
    result = calibrate(robot, log, ["offsets", "mass"])
    sentence = r"the mass changes .*: (\S+) kg from sample 0 on, (\S+) kg from sample (28|29) on, .*"
    named = re.fullmatch(sentence, str(result.refused))
    assert bool(named) == (taken > 0), result.refused
    assert named is None or float(named[2]) - float(named[1]) == pytest.approx(taken, rel=0.2)


def test_three_components_of_a_quaternion_are_no_angles(tmp_path):
    _, poses, y, _ = a_motion()
    write(tmp_path / "log.csv", ["ms", *POSE[0], "x", "y", "z", "qx", "qy", "qz"], np.column_stack([TIMES, y, poses]))
    with pytest.raises(InputError, match="must have all columns qx, qy, qz, qw or none of them, got qx, qy, qz"):
        read_measurements(tmp_path / "log.csv", robot="cogiro")


def test_a_table_of_a_spreadsheet(tmp_path):
    """Its text is in the code page of Western Europe, and missing numbers have words; milliseconds are times."""
    _, _, y, _ = a_motion()
    rows = [";".join([f"{1e3 * t:.0f}", *(f"{length:.4f}" for length in row)]) for t, row in zip(TIMES, y, strict=True)]
    rows[7] = f"350;{';'.join(['#N/A'] * 8)}"
    names = ";".join(["ms", *(f"Seillänge {i + 1}" for i in range(8))])
    (tmp_path / "log.csv").write_bytes("\n".join([names, *rows]).encode("cp1252"))
    found = read_measurements(tmp_path / "log.csv")
    assert found.m == 8
    np.testing.assert_allclose(found.times, np.delete(TIMES, 7))


def test_a_platform_that_swings_on_locked_winches_makes_cables_slack():
    """A mass is pushed towards the anchor of its third cable, swings on the others, and is caught when it returns."""
    anchors, draw = np.array([[-2.0, 0, 0], [2, 0, 0], [0, 3, 0]]), np.random.default_rng(3)
    robot = framed(
        [(list(one), [0, 0, 0]) for one in anchors], {"mass": 4, "home": [0, 0.4, -2, 0, 0, 0], "dof": ["x", "y", "z"]}
    )
    radius, angles, rest = np.hypot(0.4, 2), [], np.arctan2(0.4, 2)  # about the line through the first two anchors
    for speed in (0.7, 0.5, 0.9, 0.6, 0.8):
        pushed = [rest, speed], np.arange(0, 3, 0.02)  # [rad, rad/s], [s]
        arc = solve_ivp(
            lambda _, s: [s[1], -9.81 / radius * np.sin(s[0])], (0, 3), pushed[0], t_eval=pushed[1], rtol=1e-9
        ).y[0]
        angles += [np.full(75, rest), arc[: np.argmax(np.append(arc, 0)[1:] < rest) + 1]]
    angle = np.concatenate(angles)
    poses = np.zeros((len(angle), 6))
    poses[:, 1], poses[:, 2] = radius * np.sin(angle), -radius * np.cos(angle)
    loose = angle > rest + 0.02
    assert 0.1 < loose.mean() < 0.4
    offsets = draw.normal(0, 0.03, 3)
    held = np.linalg.norm(poses[0, :3] - anchors, axis=1) - offsets
    seen = poses + draw.normal(0, 2e-4, poses.shape) * [1, 1, 1, 0, 0, 0]
    log = Measurements(np.tile(held, (len(seen), 1)), seen, times=0.02 * np.arange(len(seen)), sigma=3e-4)
    result = calibrate(robot, log, ["offsets"])
    assert result.refused is None
    count = re.search(rf"{REASON}: cables\[2\] \((\d+)\)\n", result.report())
    # Just after a push and before an impact, smoothed accelerations do not show it: these few are outliers.
    assert count
    assert 0.7 * loose.sum() < int(count[1]) < loose.sum() + 10
    assert len(result.outliers) < 0.3 * loose.sum()
    np.testing.assert_allclose([one.value for one in result.parameters], offsets, atol=1e-3)
    assert max(one.sigma for one in result.parameters) < 0.01  # by lengths of slack cables 0.1


@pytest.mark.parametrize("cables", [slice(None), [2, 5]], ids=["all", "two"])
@pytest.mark.parametrize("pause", [0, 40], ids=["at once", "after two seconds"])
def test_readings_begin_anew_when_a_controller_restarts(cables, pause):
    for seed in range(3):
        robot, poses, y, anchors = a_motion(seed)
        begin = 150 + 30 * seed
        of_start = y[begin - 1, cables] + 0.1
        y[begin:, cables] -= of_start
        kept = np.delete(np.arange(len(y)), slice(begin, begin + pause))
        result = calibrate(robot, Measurements(y[kept], poses[kept], times=TIMES[kept]))
        assert result.refused is None
        ends = [(one.value, one.sigma) for one in result.parameters if "anchor" in one.name]
        errors, sigmas = np.abs(np.transpose(ends)[0] - anchors.ravel()), np.transpose(ends)[1]
        assert (errors < 4 * sigmas).all()
        assert np.median(sigmas) < 8e-3
        assert [(one.cable, one.sample) for one in result.slips] == [(i, begin) for i in np.arange(8)[cables]]
        np.testing.assert_allclose([one.size for one in result.slips], of_start, atol=5e-3)


def test_a_platform_that_jumps_restarts_no_winch():
    """A frame of the motion capture that is set anew moves all poses, and no reading."""
    robot, poses, y, _ = a_motion()
    poses[200:, :2] += 1.0
    model = model_of(robot, Measurements(y, poses, times=TIMES), ("anchors", "offsets"), {})
    assert restarts(model, 10.0) == {}
    y[300:310, 4] += 0.5  # wrong readings return
    assert restarts(model_of(robot, Measurements(y, poses, times=TIMES), ("anchors", "offsets"), {}), 10.0) == {}


def test_a_cable_with_mostly_wrong_readings_is_refused():
    robot, poses, y, _ = a_motion()
    wrong = np.random.default_rng(1).random(len(y)) < 0.7
    y[wrong, 3] += np.random.default_rng(2).uniform(-2, 2, wrong.sum())
    result = calibrate(robot, Measurements(y, poses, times=TIMES), ["anchors", "offsets"])
    assert re.match(r"[67]\d % of the readings of cables\[3\] do not fit the others", result.refused)


@pytest.mark.parametrize("seed", [1, 3, 5])
def test_cables_that_are_slack_while_the_platform_stands_on_the_floor(seed):
    """It stands for 16 s before and after a motion of 20 s, with cables that are 2 to 15 cm longer than the way."""
    robot, poses, y, anchors = a_motion(seed)
    draw, rest, winding = np.random.default_rng(seed), 320, 20
    slack = draw.uniform(0.02, 0.15, 8)
    stood, wound = np.repeat([0, len(y) - 1], rest), np.linspace(1, 0, winding)[:, None]
    y[:winding] += wound * slack
    y[-winding:] += wound[::-1] * slack
    still = y[stood] + draw.normal(0, 3e-4, (2 * rest, 8))
    y, poses = (np.concatenate([a[:rest], b, a[rest:]]) for a, b in ((still, y), (poses[stood], poses)))
    poses += draw.normal(0, [*[5e-4] * 3, *[1e-4] * 3], poses.shape)
    result = calibrate(robot, Measurements(y, poses, times=0.05 * np.arange(len(y))))
    assert result.refused is None
    ends = [(one.value, one.sigma) for one in result.parameters if "anchor" in one.name]
    errors, sigmas = np.abs(np.transpose(ends)[0] - anchors.ravel()), np.transpose(ends)[1]
    assert (errors < 4 * sigmas).all()
    assert np.median(sigmas) < 5e-3
    assert result.residual_after < 6e-4  # a reading at the end of the poses is no exception
    wrong = np.zeros(y.shape, dtype=bool)
    wrong[[one.sample for one in result.outliers], [one.cable for one in result.outliers]] = True
    assert wrong[rest + 2 * winding : -rest - 2 * winding].mean() < 0.02


@pytest.mark.parametrize("written", ["late", "by a clock that was set back", "after a clock that was set back halfway"])
def test_lines_that_are_written_late_are_sorted(written, tmp_path):
    """Only those that fill a gap: where a clock was set back, there are two lines where one is usual."""
    _, poses, y, _ = a_motion()
    at, rows = TIMES.copy(), np.arange(len(TIMES))
    if written == "late":
        for first in (30, 100, 102, 390):
            rows[[first, first + 1]] = rows[[first + 1, first]]
        rows[200:204] = 201, 202, 203, 200
        rows = np.insert(rows, 50, rows[50])  # and one twice
    else:
        at[200:] -= 0.1 if written == "by a clock that was set back" else 0.125
    write(tmp_path / "log.csv", ["t", *POSE[0], *POSE[1]], np.column_stack([at, y, poses])[rows])
    if written != "late":
        with pytest.raises(InputError, match=r"times must increase .* cut the log where its clock was set back"):
            read_measurements(tmp_path / "log.csv", robot="cogiro")
        return
    found = read_log(tmp_path / "log.csv", robot=load("cogiro"))
    assert "lines sorted by their times because they were written late: 5" in found.notes
    np.testing.assert_allclose(found.measurements.lengths, y, atol=1e-8)
    np.testing.assert_allclose(found.measurements.times, TIMES, atol=1e-8)


def test_a_wrong_sign_on_four_cables_is_named_at_once(tmp_path):
    """No parameters fit such readings: neither the rate of a clock nor further parameters are worth a fit."""
    user.four_cables(tmp_path)
    robot = load(user.hanging_robot(tmp_path))
    log = read_measurements(tmp_path / "winches.csv", poses=tmp_path / "mocap.csv", robot=robot)
    y = log.lengths.copy()
    y[:, 1] *= -1
    begin = process_time()
    result = calibrate(robot, log.changed(lengths=y))
    wrong = process_time() - begin
    assert "l1 seems to have the wrong sign" in result.refused
    begin = process_time()
    assert calibrate(robot, log).refused is None
    assert wrong < 4 * (process_time() - begin)


def test_a_fit_begins_at_the_size_of_the_jumps():
    """From jumps of 0 it ended with 73 % of the readings of a cable left out, and its anchor 4.6 m away."""
    robot, draw, times = load("cogiro"), np.random.default_rng(2), np.arange(0, 60, 0.02)
    anchors = robot.anchors + draw.normal(0, 0.02, (8, 3))
    rates, phases = draw.uniform(0.3, 0.7, 6), draw.uniform(0, 6, 6)
    size = np.concatenate([0.22 * np.ptp(robot.anchors, axis=0), [0.1, 0.1, 0.15]])
    poses = robot.home + size * np.sin(rates * times[:, None] + phases)
    ends = poses[:, None, :3] + robot.attachments @ Rotation.from_euler("xyz", poses[:, 3:]).as_matrix().swapaxes(1, 2)
    y = np.linalg.norm(anchors - ends, axis=2) + draw.uniform(-0.1, 0.1, 8)
    y[935:] -= y[935] - draw.uniform(-0.1, 0.1, 8)
    seen = poses + draw.normal(0, 1, poses.shape) * np.repeat([1e-3, 3e-4], 3)
    result = calibrate(robot, Measurements(y + draw.normal(0, 3e-4, y.shape), seen, times=times))
    assert result.refused is None
    assert not result.outliers
    assert np.abs(np.asarray(result.robot.anchors) - anchors).max() < 5e-3
