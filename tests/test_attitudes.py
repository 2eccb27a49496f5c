"""Every place that computes angles, lengths, wrench matrix or required wrench agrees, also at a pitch of 90 degrees.

What holds is derived here in another way: rotations by SciPy, rates as a sum of turns about the axes as they stand,
momentum's derivative in {G}, and the tangent of a sheave by the angle at its centre.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.control import ComputedTorque, Reference, State
from towline.core._core import sense
from towline.estimation.calibration.geometry import runs
from towline.estimation.calibration.parameters import Parameters
from towline.export.step.export import mechanics
from towline.models import Dynamics, Robot, load, points, pose_from_lengths, rotation
from towline.models.part import inertia_matrix
from towline.ocp.tasks.scenario import _pose_in
from towline.plant import Plant, layout

COUNT, UPRIGHT = 2000, 400  # poses, and how many of them are at a pitch of +-90 degrees
ROBOTS = ["caroca-pulleys", "wang-flying"]


class Truth(NamedTuple):
    R: np.ndarray  # (N, 3, 3), of the platform
    lengths: np.ndarray  # (N, m)
    A: np.ndarray  # (N, 6, m)
    w: np.ndarray  # (N, 6)


class Case(NamedTuple):
    robot: Robot
    platform: np.ndarray  # (3, N, 6): pose and its two derivatives
    carriers: np.ndarray  # (N, c, 6)
    truth: Truth


def matrices(angles):
    """Return R of (roll, pitch, yaw), (N, 3, 3), as three turns about fixed axes."""
    return Rotation.from_euler("xyz", angles).as_matrix()


def test_rotation_vectors_are_those_of_scipy_up_to_half_a_turn():
    draw = np.random.default_rng(0)
    axes = draw.normal(size=(300, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    turns = np.resize([0.0, 1e-9, 0.3, 2.0, np.pi - 1e-4, np.pi - 1e-7, np.pi - 1e-9], 300)
    R = Rotation.from_rotvec(axes * turns[:, None]).as_matrix()
    found = points.rotation_vectors(R)
    np.testing.assert_allclose(found, Rotation.from_matrix(R).as_rotvec(), atol=1e-10)
    np.testing.assert_allclose(points.rotation_vectors(np.diag([1.0, -1.0, -1.0])[None]), [[np.pi, 0.0, 0.0]])


def angular_motion(angles, rates, accelerations):
    """Return angular velocity and acceleration in {G}: turns about z, the turned y and the twice turned x."""
    R = np.tile(np.eye(3), (len(angles), 1, 1))
    omega, alpha = np.zeros((2, len(angles), 3))
    for axis in (2, 1, 0):
        axes = R[:, :, axis]
        alpha = alpha + accelerations[:, axis, None] * axes + np.cross(omega, axes) * rates[:, axis, None]
        omega = omega + rates[:, axis, None] * axes
        turn = np.zeros((len(angles), 3))
        turn[:, axis] = angles[:, axis]
        R = R @ Rotation.from_rotvec(turn).as_matrix()
    return omega, alpha


def truth_of(robot, platform, carriers):
    pose, velocity, acceleration = platform
    R, com = matrices(pose[:, 3:]), np.array(robot.platform.com)
    arms = np.einsum("nij,mj->nmi", R, robot.attachments - com)
    centre = pose[:, :3] + R @ com
    ends = centre[:, None] + arms
    turned = [matrices(carriers[:, k, 3:]) for k in range(carriers.shape[1])]
    lengths, directions = np.empty((len(pose), robot.m)), np.empty((len(pose), robot.m, 3))
    for i, owner in enumerate(robot.carrier_of_cable):
        anchor = carriers[:, owner, :3] + turned[owner] @ robot.anchors[i]
        offset, radius = ends[:, i] - anchor, robot.pulley_radii[i]
        if radius == 0.0:
            lengths[:, i] = np.linalg.norm(offset, axis=1)
            directions[:, i] = -offset / lengths[:, i, None]
            continue
        k = turned[owner] @ robot.pulley_axes[i]
        up = np.einsum("ni,ni->n", offset, k)
        across = offset - up[:, None] * k
        e = across / np.linalg.norm(across, axis=1)[:, None]
        out = np.linalg.norm(across, axis=1) - radius  # from the sheave's centre
        # The centre sees the attachment at one angle from e, and the point of tangency ahead of it by acos(r / D).
        tangency = np.arctan2(up, out) + np.arccos(radius / np.hypot(up, out))
        at = radius * (np.cos(tangency)[:, None] * e + np.sin(tangency)[:, None] * k)
        straight = out[:, None] * e + up[:, None] * k - at
        free = np.linalg.norm(straight, axis=1)
        lengths[:, i] = radius * np.mod(np.pi - tangency, 2 * np.pi) + free
        directions[:, i] = -straight / free[:, None]
    A = np.concatenate([directions, np.cross(arms, directions)], axis=2).swapaxes(1, 2)
    omega, alpha = angular_motion(pose[:, 3:], velocity[:, 3:], acceleration[:, 3:])
    r = R @ com
    of_centre = acceleration[:, :3] + np.cross(alpha, r) + np.cross(omega, np.cross(omega, r))
    inertia = R @ inertia_matrix(robot.platform.inertia) @ R.swapaxes(1, 2)
    moment = np.einsum("nij,nj->ni", inertia, alpha) + np.cross(omega, np.einsum("nij,nj->ni", inertia, omega))
    force = robot.platform.mass * (of_centre - np.array(robot.gravity))
    return Truth(R, lengths, A, np.hstack([force, moment]))


@pytest.fixture(scope="module", params=ROBOTS)
def case(request):
    given = load(request.param).model_dump()
    given["platform"] |= {"com": [0.02, -0.03, 0.04], "inertia": [2.0, 1.5, 1.1, 0.1, -0.2, 0.3]}
    robot = Robot.model_validate(given)
    draw = np.random.default_rng(7)
    platform = draw.normal(size=(3, COUNT, 6))
    platform[0, :, :3] = robot.home[:3] + draw.uniform(-0.4, 0.4, (COUNT, 3))
    platform[0, :, 3:] = draw.uniform(-np.pi, np.pi, (COUNT, 3))
    platform[0, :UPRIGHT, 4] = draw.choice([-np.pi / 2, np.pi / 2], UPRIGHT)
    carriers = np.tile(robot.carrier_home, (COUNT, 1, 1))
    if any(carrier.moves for carrier in robot.carriers):
        carriers[..., :3] += draw.normal(0, 0.1, carriers[..., :3].shape)
        carriers[..., 3:] = draw.uniform(-np.pi, np.pi, carriers[..., 3:].shape)
        carriers[: UPRIGHT // 2, :, 4] = np.pi / 2
    return Case(robot, platform, carriers, truth_of(robot, platform, carriers))


def same(found, expected, tolerance=1e-11):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * max(1.0, np.abs(expected).max()))


def test_angles_are_those_of_the_attitude(case):
    """Roll and yaw may be others at 90 degrees: what counts is the rotation that the three angles are."""
    angles, R = case.platform[0][:, 3:], case.truth.R
    symbols = ca.SX.sym("R", 3, 3)
    by_casadi = ca.Function("angles", [symbols], [rotation.angles_of(symbols)]).map(COUNT)
    same(points.rotations(angles), R)
    same(matrices(points.angles(R)), R)
    same(matrices(by_casadi(np.hstack(list(R))).full().T), R)
    # What the numbers of R are after some products of rotations.
    rounded = R @ case.truth.R.swapaxes(1, 2) @ R
    same(matrices(points.angles(rounded)), R)
    same(matrices(by_casadi(np.hstack(list(rounded))).full().T), R)


def test_states_of_the_plant_have_the_poses_they_began_with(case):
    robot, (pose, velocity, _), carriers, truth = case
    plant = Plant(robot, drive="tensions")
    states = plant.start(pose, velocity, carriers, tensions=np.zeros(robot.m))
    reading = plant.read(states)
    same(reading.rotation, truth.R)
    same(matrices(reading.pose[:, 3:]), truth.R)
    same(reading.pose[:, :3], pose[:, :3])
    for k in range(carriers.shape[1]):
        same(matrices(reading.carrier_pose[:, k, 3:]), matrices(carriers[:, k, 3:]))
        same(reading.carrier_pose[:, k, :3], carriers[:, k, :3])
    # Rates of angles follow from the rate of the body where there are any; their errors grow with 1 / cos(pitch)^2.
    clear = np.abs(np.cos(pose[:, 4])) > 0.1
    turned = angular_motion(reading.pose[clear, 3:], reading.velocity[clear, 3:], np.zeros((clear.sum(), 3)))[0]
    same(turned, angular_motion(pose[clear, 3:], velocity[clear, 3:], np.zeros((clear.sum(), 3)))[0], 1e-9)


def test_sensors_report_poses_and_lengths(case):
    robot, (pose, velocity, _), carriers, truth = case
    plant = Plant(robot, drive="tensions")
    states = plant.start(pose, velocity, carriers, tensions=np.zeros(robot.m))
    motions, lengths = np.zeros((len(states), 1 + carriers.shape[1], 12)), np.zeros((len(states), 2, robot.m))
    sense(plant.record, states, motions, lengths)
    same(matrices(motions[:, 0, 3:6]), truth.R)
    same(motions[:, 0, :3], pose[:, :3])
    same(lengths[:, 0], truth.lengths)
    for k in range(carriers.shape[1]):
        same(matrices(motions[:, 1 + k, 3:6]), matrices(carriers[:, k, 3:]))


def test_lengths(case):
    robot, (pose, *_), carriers, truth = case
    dynamics = Dynamics(robot)
    same(dynamics.cable_lengths(pose, carriers), truth.lengths)
    same([dynamics.cable_lengths(*each) for each in zip(pose[::20], carriers[::20], strict=True)], truth.lengths[::20])
    if (carriers == robot.carrier_home).all():  # calibration knows no other
        parameters = Parameters(robot, ())
        same(runs(robot, parameters.table(parameters.first), pose[:, :3], truth.R).lengths.T, truth.lengths)


def test_the_pose_of_lengths_is_where_they_were_measured(case):
    robot, (pose, *_), carriers, truth = case
    estimate = pose_from_lengths(robot, truth.lengths[:UPRIGHT], pose[:UPRIGHT], carriers[:UPRIGHT])
    same(estimate.residuals, 0.0, 1e-9)
    same(matrices(estimate.pose[:, 3:]), truth.R[:UPRIGHT], 1e-9)


def test_the_wrench_matrix(case):
    robot, (pose, *_), carriers, truth = case
    dynamics = Dynamics(robot)
    same(dynamics.wrench_matrix(pose, carriers), truth.A)
    same([dynamics.wrench_matrix(*each) for each in zip(pose[::20], carriers[::20], strict=True)], truth.A[::20])


def test_the_required_wrench(case):
    robot, platform, carriers, truth = case
    dynamics = Dynamics(robot)
    same(dynamics.required_wrench(*platform, carriers), truth.w)
    some = zip(*platform[:, ::20], carriers[::20], strict=True)
    same([dynamics.required_wrench(*each) for each in some], truth.w[::20])


def test_the_wrench_relative_to_a_carrier(case):
    """The carriers of both robots are at rest, so that it is that of {G} in their axes."""
    robot, platform, carriers, truth = case
    relative, turn = Dynamics(robot).relative, matrices(carriers[:, 0, 3:])
    still = np.zeros_like(carriers[:, 0])
    pose_G, _, _ = relative.motion_in_world(*platform, carriers[:, 0], still, still)
    same(matrices(pose_G[:, 3:]), turn @ truth.R)
    same(pose_G[:, :3], carriers[:, 0, :3] + np.einsum("nij,nj->ni", turn, platform[0][:, :3]))
    back = _pose_in(carriers[:, 0], pose_G)
    same(matrices(back[:, 3:]), truth.R)
    same(back[:, :3], platform[0][:, :3])
    weight, in_A = robot.platform.mass * np.array(robot.gravity), truth.w.copy()
    in_A[:, :3] += weight - np.einsum("nji,j->ni", turn, weight)
    same(relative.required_wrench(*platform, carriers[:, 0], still, still), in_A)


def test_the_controllers_step(case):
    robot, platform, carriers, truth = case
    controller = ComputedTorque(robot)
    still = np.zeros_like(carriers)
    state = State(*platform[:2], carriers, still)
    controller.step(0.0, state, Reference(*platform, carriers, still, still, np.ones((COUNT, robot.m))))
    problem, mask = controller.problems, robot.dof_mask
    same(problem.A, truth.A * mask[:, None])
    same(problem.w, truth.w * mask)


def test_the_exported_step(case):
    robot, platform, carriers, truth = case
    function = mechanics(robot).map(COUNT)
    moving = [index for index, carrier in enumerate(robot.carriers) if carrier.moves]
    given = dict(zip(("pose", "velocity", "acceleration"), (part.T for part in platform), strict=True))
    if moving:
        given["carrier_pose"] = np.hstack([each[moving] for each in carriers])
    out = function(**given)
    same(out["A"].full().T.reshape(COUNT, robot.m, 6).swapaxes(1, 2), truth.A)
    if "wind" not in function.name_in():  # still air is a wind too, and drags
        same(out["w"].full().T, truth.w)


def test_the_plants_accelerations(case):
    """One short step changes the momentum by what cables and weight give."""
    robot, (pose, velocity, _), carriers, truth = case
    tensions, dt = np.random.default_rng(9).uniform(1, 50, (COUNT, robot.m)), 1e-7
    plant = Plant(robot, drive="tensions")
    states = plant.start(pose, velocity * [1, 1, 1, 0, 0, 0], carriers, tensions=tensions)
    after = plant.step(states, plant.command(tensions, carrier_pose=carriers), dt)
    wrench = np.einsum("nij,nj->ni", truth.A, tensions)
    spin = (after - states)[:, layout.RATE : layout.RATE + 3] / dt
    speed = (after - states)[:, layout.VELOCITY : layout.VELOCITY + 3] / dt
    moment = np.einsum("nij,jk,nk->ni", truth.R, inertia_matrix(robot.platform.inertia), spin)
    same(robot.platform.mass * (speed - robot.gravity), wrench[:, :3], 1e-5)
    same(moment, wrench[:, 3:], 1e-5)
