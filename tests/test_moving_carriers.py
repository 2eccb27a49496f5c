"""Logs of a load under three quadrotors, whose motion plain NumPy computes: calibration and poses."""

import json
import re

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from towline import InputError, load
from towline.estimation.calibration import Measurements, calibrate, corrected
from towline.estimation.calibration.carrier_clocks import CarrierClocks
from towline.estimation.calibration.enough import usual
from towline.estimation.calibration.plausibility import mistake
from towline.estimation.logs import read_log, read_measurements

from .warm import towline as run

NAME, MORE, MASS, GRAVITY = "multi-quadrotor-3", np.array([0.03, -0.02, 0.01]), 2.2, np.array([0, 0, 9.81])


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """12 s at 50 Hz of a load of 2.2 kg, 2.4 kg in the file, on cables of other lengths than in the file."""
    robot, draw = load(NAME), np.random.default_rng(0)
    t = np.arange(0, 12, 0.02)
    waves = np.sin(2 * np.pi * draw.uniform(0.1, 0.3, (6, 2, 1)) * t + draw.uniform(0, 6, (6, 2, 1))).sum(axis=1)
    curve, h = CubicSpline(t, (np.array([0.5, 0.4, 0.2, 0.1, 0.1, 0.2])[:, None] * waves).T), 1e-3

    def turned(at):
        return Rotation.from_euler("xyz", curve(at)[:, 3:])

    def spin(at):
        return (turned(at + h) * turned(at - h).inv()).as_rotvec() / (2 * h)

    R, w, dw = turned(t).as_matrix(), spin(t), (spin(t + h) - spin(t - h)) / (2 * h)
    inertia = R @ robot.inertia @ R.transpose(0, 2, 1)
    force = MASS * (curve(t, 2)[:, :3] + GRAVITY)
    moment = np.einsum("nij,nj->ni", inertia, dw) + np.cross(w, np.einsum("nij,nj->ni", inertia, w))
    arms = np.einsum("nij,mj->nmi", R, robot.attachments)
    both = np.zeros((len(t), 6, 9))
    for i in range(3):
        both[:, :3, 3 * i : 3 * i + 3] = np.eye(3)
        both[:, 3:, 3 * i : 3 * i + 3] = -np.cross(np.eye(3), arms[:, i, None]).transpose(0, 2, 1)
    outward = robot.home_anchors - robot.home_attachments
    level = (5 * outward / np.linalg.norm(outward, axis=1)[:, None]).ravel()
    wrench = np.concatenate([force, moment], axis=1)
    pulls = level + np.einsum("nij,nj->ni", np.linalg.pinv(both), wrench - both @ level)
    pulls = pulls.reshape(-1, 3, 3)
    np.testing.assert_allclose(np.cross(arms, pulls).sum(axis=1), moment, atol=1e-9)
    u = pulls / np.linalg.norm(pulls, axis=2, keepdims=True)
    quads = curve(t)[:, None, :3] + arms + (robot.fixed_lengths + MORE)[:, None] * u
    thrusts = pulls + 1.5 * (CubicSpline(t, quads)(t, 2) + GRAVITY)
    columns = {"t [s]": t}
    seen = curve(t) + draw.normal(0, 1e-3, (len(t), 6))
    columns |= dict(zip(("x [m]", "y [m]", "z [m]", "roll [rad]", "pitch [rad]", "yaw [rad]"), seen.T, strict=True))
    for i in range(3):
        size = np.linalg.norm(thrusts[:, i], axis=1)
        up = thrusts[:, i] / size[:, None]
        across = np.cross(up, [1.0, 0, 0])
        across /= np.linalg.norm(across, axis=1)[:, None]
        turn = Rotation.from_matrix(np.stack([np.cross(across, up), across, up], axis=2)).as_quat()
        there = quads[:, i] + draw.normal(0, 1e-3, (len(t), 3))
        columns |= {f"quad{i + 1}_{axis} [m]": there[:, k] for k, axis in enumerate("xyz")}
        columns |= {f"quad{i + 1}_q{axis}": turn[:, k] for k, axis in enumerate("xyzw")}
        columns[f"quad{i + 1}_thrust [N]"] = size * (1 + draw.normal(0, 0.02, len(t)))
    return write(tmp_path_factory.mktemp("log") / "flight.csv", columns), columns


def write(path, columns):
    np.savetxt(path, np.column_stack(list(columns.values())), "%.8g", ",", header=",".join(columns), comments="")
    return path


def test_lengths_and_mass_of_a_flown_load(recording, tmp_path):
    out, sigma = tmp_path / "built.yaml", "lengths=0.001,position=0.001,rotation=0.001"
    done = run("calibrate", NAME, recording[0], "--free", "offsets,mass", "--sigma", sigma, "--json", "--out", out)
    data, built = json.loads(done.stdout), load(out)
    assert data["notes"] == ["tensions are computed from thrusts, weights and accelerations of the carriers"]
    assert built.platform.mass == pytest.approx(MASS, rel=0.01)
    assert all(cable.encoder is None for cable in built.cables)
    off = built.fixed_lengths - load(NAME).fixed_lengths - MORE
    assert np.abs(off).max() < 1e-3
    sigmas = [one["sigma"] for one in data["parameters"][:3]]
    assert (np.abs(off) < 4 * np.array(sigmas)).all()
    assert max(sigmas) < 3e-4


@pytest.mark.parametrize("apart", [5, 8])
def test_mass_from_slow_recordings(recording, apart):
    """At 10 and 6.25 Hz a load is still in motion: taken as at rest, its mass was wrong by up to 40 %."""
    log = read_measurements(recording[0], robot=NAME).only(slice(0, None, apart))
    result = calibrate(NAME, log, ("offsets", "mass"))
    mass = result.parameters[-1]
    assert abs(mass.value - MASS) < 4 * mass.sigma < 0.1


def test_what_a_log_of_carriers_can_be_used_for(recording, tmp_path):
    listed = run("log", recording[0], code=1)
    assert "or give the robot (--robot)" in listed.stdout
    listed = run("log", recording[0], "--robot", NAME, "--json")
    data = json.loads(listed.stdout)
    assert data["fields"]["quad2"][-1] == "quad2_thrust [N]"
    assert data["uses"]["calibration with poses"] is None
    poses = run("pose", NAME, "--log", recording[0], "--out", tmp_path / "poses.csv")
    assert "lengths do not determine the pose: poses are those at rest" in poses.stdout


def test_carriers_that_were_not_recorded_are_named(recording, tmp_path):
    few = {name: column for name, column in recording[1].items() if not name.startswith("quad3")}
    done = run("calibrate", NAME, write(tmp_path / "few.csv", few), "--free", "offsets", "--out", tmp_path / "few.yaml")
    assert "the log has no poses of quad3: assumed to be at home" in done.stdout


def test_poses_of_carriers_are_saved_and_checked(recording, tmp_path):
    log = read_measurements(recording[0], robot=NAME)
    again = read_measurements(log.save(tmp_path / "log.nc"), robot=NAME)
    np.testing.assert_allclose(again.carrier_poses, log.carrier_poses, atol=1e-12)
    np.testing.assert_array_equal(log.only(slice(0, 5)).carrier_poses, log.carrier_poses[:5])
    with pytest.raises(InputError, match=r"carrier_poses must have the shape \(2, c, 6\), got \(2, 6\)"):
        Measurements(np.ones((2, 3)), carrier_poses=np.zeros((2, 6)))
    with pytest.raises(InputError, match=r"carrier_poses must have the shape \(N, 3, 6\) of the carriers"):
        calibrate(NAME, Measurements(np.ones((2, 3)), carrier_poses=np.zeros((2, 1, 6))), "offsets")
    with pytest.raises(InputError, match="carrier_poses must be finite"):
        Measurements(np.ones((2, 3)), carrier_poses=np.full((2, 3, 6), np.nan))


def test_directions_of_some_cables_move_with_their_carriers_clocks(recording):
    """Of one cable for a while, of one horizontally, of one never: the rest of them is where it was recorded."""
    log = read_measurements(recording[0], robot=NAME)
    t, late = log.times, np.array([0.05, -0.08, 0.06])
    swing = 0.3 * np.sin(np.outer(t, [1.0, 1.3, 1.7]))
    true = np.stack([np.cos(swing), np.sin(swing), 0 * swing], axis=2)
    seen = np.stack([CubicSpline(t, true[:, i])(t - by) for i, by in enumerate(late)], axis=1)
    for directions in (true, seen):
        directions[200:240, 0], directions[:, 1, 2], directions[:, 2] = np.nan, np.nan, np.nan
    there = CarrierClocks(load(NAME), log.changed(directions=seen)).at(late).directions
    expected = log.changed(directions=true).directions
    np.testing.assert_array_equal(np.isnan(there), np.isnan(expected))
    inner = np.r_[20:190, 250:580]  # without ends and gaps, across which curves bend
    np.testing.assert_allclose(there[inner], expected[inner], atol=1e-3)


@pytest.mark.parametrize(("poses", "apart"), [(6, 1), (3, 2)])
def test_clocks_of_carriers_are_fitted_and_part_of_the_sigmas(recording, poses, apart):
    """Each carrier has a computer; of the load, poses or only positions are known, so its attitude may be unknown."""
    log = read_measurements(recording[0], robot=NAME)
    t, late, carriers, pulls = log.times, np.array([0.013, -0.021, 0.03]), log.carrier_poses.copy(), log.tensions.copy()
    for i, by in enumerate(late):
        carriers[:, i], pulls[:, i] = (CubicSpline(t, of[:, i])(t - by) for of in (carriers, pulls))
    sigma = {"lengths": 1e-3, "position": 1e-3, "rotation": 1e-3, "clocks": 0.1}
    given = {"tensions": pulls, "times": t, "carrier_poses": carriers, "sigma": sigma}
    given = Measurements(log.lengths, log.poses[:, :poses], **given).only(slice(50, 350 - 100 * (apart > 1), apart))
    result = calibrate(NAME, given, ("offsets", "mass"), outliers=False)
    clocks = result.carrier_clocks
    assert [one.name for one in clocks] == ["quad1.clock", "quad2.clock", "quad3.clock"]
    found = np.array([[one.value, one.sigma] for one in clocks])
    assert (np.abs(found[:, 0] - late) < 4 * found[:, 1]).all()
    assert (found[:, 1] < (0.015 if poses == 3 else 1e-3)).all()
    assert all(abs(one.correction - true) < 4 * one.sigma for one, true in zip(result.parameters, MORE, strict=False))
    if poses == 6:  # an unknown attitude follows wrong clocks
        known = calibrate(NAME, given.changed(sigma={**sigma, "clocks": 0.0}), ("offsets", "mass"), outliers=False)
        assert known.noise > 3 * result.noise
        assert "quad2.clock" in str(result.report())


def two_clocks(folder, offset):
    """A platform under six winches of a quadrotor, both in motion: readings, and poses of both by another clock.

    Two files, or one if the offset is small: as if there were one clock.
    """
    robot, draw = load("wang-flying-quadrotor"), np.random.default_rng(4)
    moved, offsets = draw.normal(0, 0.01, (6, 3)), draw.normal(0, 0.03, 6)
    waves = draw.uniform(0.3, 1.2, (2, 12)), draw.uniform(0, 6, (2, 12))
    size = np.array([0.06, 0.05, 0.04, 0.12, 0.1, 0.15, 0.8, 0.6, 0.3, 0.1, 0.1, 0.5])

    def at(t):
        values = size * (np.sin(2 * np.pi * np.outer(t, waves[0][0]) + waves[1][0]))
        drone = robot.carrier_home[0] + values[:, 6:]
        R = Rotation.from_euler("xyz", drone[:, 3:])
        own = robot.home - robot.carrier_home[0] + values[:, :6]  # of the platform, seen from the drone
        place = drone[:, :3] + R.apply(own[:, :3])
        return drone, place, R, R * Rotation.from_euler("xyz", own[:, 3:])

    t = np.arange(0, 20, 0.02)
    drone, place, R, turn = at(t)
    anchors = drone[:, None, :3] + np.einsum("nij,mj->nmi", R.as_matrix(), robot.anchors + moved)
    ends = place[:, None] + np.einsum("nij,mj->nmi", turn.as_matrix(), robot.attachments)
    readings = np.linalg.norm(ends - anchors, axis=2) - offsets + draw.normal(0, 5e-4, (len(t), 6))
    winches = {"t [s]": t, **{f"l{i} [m]": readings[:, i] for i in range(6)}}
    s = np.arange(0.4, 19, 0.01) if offset > 1 else t - offset
    drone, place, R, turn = at(s)
    columns = {"t [s]": s + offset} if offset > 1 else winches
    bodies = {"platform_": (place, turn), f"{robot.carriers[0].name}_": (drone[:, :3], R)}
    for name, (position, rotation) in bodies.items():
        columns |= {f"{name}{axis} [m]": position[:, k] for k, axis in enumerate("xyz")}
        columns |= {f"{name}q{axis} [1]": rotation.as_quat()[:, k] for k, axis in enumerate("xyzw")}
    write(folder / "winches.csv", winches)
    write(folder / "mocap.csv", columns)
    return robot, robot.anchors + moved, offsets


@pytest.mark.parametrize("offset", [0.025, 7200.3])
def test_clocks_of_moving_carriers(offset, tmp_path):
    """Of one file by the fit alone, of two by cable speeds before."""
    robot, anchors, offsets = two_clocks(tmp_path, offset)
    log = read_log(tmp_path / "winches.csv", None, tmp_path / "mocap.csv" if offset > 1 else None, robot)
    assert usual(robot, log.measurements) == ("anchors", "offsets", "clock")
    result = calibrate(robot, log.measurements)
    before = log.clock.offset if log.clock else 0.0
    assert before + result.clock == pytest.approx(offset, abs=1e-3)
    assert result.noise < 7e-4
    for i in range(6):
        one = result.parameters[4 * i : 4 * i + 4]
        truth = [*anchors[i], offsets[i]]
        assert all(abs(part.value - true) < 4.5 * part.sigma + 2e-4 for part, true in zip(one, truth, strict=True))


WRONG = {
    "sound": (str, None),
    "order": (lambda head: head.replace("l0 [m],l1 [m]", "l1 [m],l0 [m]"), "l0 and l1 look exchanged"),
    "unit": (lambda head: re.sub(r"_([xyz]) \[m\]", r"_\1 [cm]", head), "metres read as centimetres"),
    "w first": (
        lambda head: re.sub("_q([xyzw])", lambda one: "_q" + dict(zip("xyzw", "wxyz", strict=True))[one[1]], head),
        r"(x, y, z, w) read as (w, x, y, z)",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_input_errors_are_found_where_carriers_move(what, tmp_path):
    robot, _, offsets = two_clocks(tmp_path, 1e-6)
    head, rest = (tmp_path / "winches.csv").read_text().split("\n", 1)
    change, text = WRONG[what]
    (tmp_path / "log.csv").write_text(change(head) + "\n" + rest)
    log = read_log(tmp_path / "log.csv", None, None, robot).measurements
    found = mistake(robot, log)
    assert (found is None) == (text is None)
    if found is not None:
        assert text in found.text
        result = calibrate(robot, corrected(robot, log)[0], "offsets", outliers=False)
        assert result.noise < 0.015  # of anchors that are 10 mm off
        assert np.abs([one.value for one in result.parameters] - offsets).max() < 0.03
