"""The plant against MuJoCo: the same robot, the same Runge-Kutta steps, with cables that get slack and taut."""

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Dynamics, load
from towline.export.mjcf import to_mjcf
from towline.plant import Plant

mujoco = pytest.importorskip("mujoco", reason="the extra 'mujoco' is not installed")

STEP, BLOCK, BLOCKS = 1e-5, 2500, 6  # 0.15 s
ROBOTS = {
    "wang-flying": 13_000.0,  # a prescribed base
    "wang-flying-quadrotor": 13_000.0,
    "cogiro": 2e5,  # suspended
    "ipanema-1": 2e5,  # fully constrained
    "wang-ctmrts": 2e4,  # three robot-ends
    "multi-quadrotor-4": 2e4,
}


def mujoco_model(robot, lengths, stiffness):
    """Return MuJoCo's model with springs that only pull, and without the motors of cables and their limits."""
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))
    model.opt.timestep, model.opt.integrator = STEP, mujoco.mjtIntegrator.mjINT_RK4
    for i, length in enumerate(lengths):
        tendon = model.tendon(f"cable{i + 1}").id
        model.tendon_stiffness[tendon] = stiffness / length
        model.tendon_lengthspring[tendon] = 0, length
        model.actuator_gainprm[model.actuator(f"cable{i + 1}").id, 0] = 0
    model.actuator_ctrllimited[:] = 0
    return model


@pytest.mark.parametrize("name", ROBOTS)
def test_the_same_motion_at_least_eight_times_as_fast(name):
    robot, stiffness = load(name), ROBOTS[name]
    rng = np.random.default_rng(1)
    lengths = Dynamics(robot).cable_lengths(robot.home)
    lengths = lengths * (1 + rng.uniform(-3 * robot.weight / stiffness, 0.002, robot.m))
    velocity = 0.2 * rng.normal(size=6)
    plant = Plant(robot, contacts="sampled", stiffness=stiffness, damping=0)
    state = plant.start(velocity=velocity, lengths=lengths)

    model = mujoco_model(robot, lengths, stiffness)
    data = mujoco.MjData(model)
    platform = model.jnt_dofadr[model.joint("platform").id]
    data.qvel[platform : platform + 6] = np.concatenate([velocity[:3], plant.read(state).rate])
    commanded = {}
    flying = [i for i, carrier in enumerate(robot.carriers) if carrier.body is not None]
    if flying:
        lift = robot.weight / len(flying)
        commanded["actuation"] = [[1.1 * (c.mass * 9.81 + lift), 0.01, -0.02, 0.005] for c in robot.carriers]
        for i in flying:
            for actuator, value in zip(robot.carriers[i].actuators, commanded["actuation"][i], strict=True):
                data.actuator(f"{robot.carriers[i].name} {actuator.name}").ctrl = value
    prescribed = [i for i, carrier in enumerate(robot.carriers) if carrier.kind == "prescribed"]

    apart, slack, times = 0.0, [], np.empty((2, BLOCKS))
    poses = robot.carrier_home.copy()
    plant.step(state, plant.command(lengths), STEP)  # loads the kernel
    for block in range(BLOCKS):
        for i in prescribed:  # MuJoCo's mocap bodies stand still in a step
            poses[i] += 1e-3 * rng.normal(size=6)
            mocap = model.body_mocapid[model.body(robot.carriers[i].name).id]
            data.mocap_pos[mocap] = poses[i, :3]
            data.mocap_quat[mocap] = Rotation.from_euler("ZYX", poses[i, 5:2:-1]).as_quat(scalar_first=True)
        command = plant.command(lengths, carrier_pose=poses, **commanded)
        begun = time.process_time()
        run = plant.run(state, command[None], STEP * BLOCK, substeps=BLOCK)
        times[0, block] = time.process_time() - begun
        begun = time.process_time()
        mujoco.mj_step(model, data, BLOCK)
        times[1, block] = time.process_time() - begun
        state = run.states[-1]
        slack.append(run.tensions[-1] == 0)
        now = plant.read(state)
        at = model.jnt_qposadr[model.joint("platform").id]
        apart = max(apart, np.abs(now.pose[:3] - data.qpos[at : at + 3]).max())
        for i in flying:
            at = model.jnt_qposadr[model.joint(robot.carriers[i].name).id]
            apart = max(apart, np.abs(now.carrier_pose[i, :3] - data.qpos[at : at + 3]).max())
    assert 0.1 < np.mean(slack) < 0.95
    assert apart < 1e-10
    ours, theirs = times.min(axis=1)
    assert theirs / ours > 8
