"""A cable robot in MuJoCo that is not as its controller believes: `Hardware`, what differs, and `World`, the robot.

The model is written here from the numbers of a robot's file. Nothing of towline's plant, mechanics or export is used,
so that a controller meets equations that are not its own. Cables pull at both of their ends. Their tensions come from
one of three winches:

    source    t' = (gain u - t) / lag                                             whatever the cable does
    loop      t  = max(0, EA (l - L0) / L0 + C (dl/dt - dL0/dt)),  dL0/dt = (dl/dt, 2 ms late) + (t - u) L0 / (EA_n lag)
    lengths   t  as for the loop,  dL0/dt = (l / (1 + u / EA_n) - L0) / lag, or from commanded lengths in place of those

with the commanded tension u, and the stiffness EA_n that the winch takes for EA. Cables of a fixed length are the loop
with dL0/dt = 0. Friction adds F tanh(dl/dt / 1 cm/s) where the cable meets the platform. A tension sensor reports what
pulls at the platform, its mean over the last period; the command acts from when it is sent on.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from towline.control import Command, State
from towline.models import Robot

__all__ = ["Hardware", "World"]

STEP = 2.5e-4  # [s] of MuJoCo
RATE_LAG = 2e-3  # [s] of the cable's rate in a winch
CREEP = 0.01  # [m/s] at which friction is nearly all there


@dataclass(frozen=True)
class Hardware:
    """Differences from the robot's file, and errors of sensors.

    Attributes:
        winch: "source", "loop" or "lengths".
        mass: Of the platform with its inertia, over that of the file.
        stiffness, damping: E A [N] and C [N s/m] of the cables.
        stretch: Their stiffness over that which winches take for it.
        gain, lag: Of tensions: over their commands, and how late they follow [s].
        friction: Of each cable [N].
        sensor: What a tension sensor reports over what pulls; None without sensors.
        delay, held: How late all sensors are [s], and how long each report is held [s].
        stamped: Whether reports come with the time at which they were made.
        resolution: Of the measured position [m] and attitude [rad]: steps, with the rates as differences over 10 ms;
            zeros: exact.
        noise: Standard deviation of the measured position [m] and attitude [rad], with rates by differences over 10 ms.
        rotor_lag: Of thrusts and torques [s].
        lost: A carrier without thrust from a time on: its number and the time [s].
    """

    winch: str = "source"
    mass: float = 1.0
    stiffness: float = 2e4
    damping: float = 0.0
    stretch: float = 1.0
    gain: float = 1.0
    lag: float = 0.0
    friction: float = 0.0
    sensor: float | None = 1.0
    delay: float = 0.0
    held: float = 0.0
    stamped: bool = False
    resolution: tuple[float, float] = (0.0, 0.0)
    noise: tuple[float, float] = (0.0, 0.0)
    rotor_lag: float = 0.0
    lost: tuple[int, float] | None = None


class World:
    """A robot in MuJoCo, from a motion on, with sensors.

    Args:
        robot, hardware: The robot as its file has it, and what differs.
        motion: (1 + c, 12), poses and velocities at the beginning, the platform's first.
        tensions: At the beginning, (m,) [N].
        period: Of the controller [s].
        seed: Of the noise.
    """

    def __init__(
        self, robot: Robot, hardware: Hardware, motion: np.ndarray, tensions: np.ndarray, period: float, seed: int = 0
    ):
        mujoco: Any = import_module("mujoco")
        self._mj, self._robot, self._is = mujoco, robot, hardware
        self._period, self._substeps = period, max(1, round(period / STEP))
        self._model: Any = mujoco.MjModel.from_xml_string(mjcf(robot, hardware, period / self._substeps))
        self._data: Any = mujoco.MjData(self._model)
        self._flies = np.array([carrier.body is not None for carrier in robot.carriers])
        self._mocaps, self._flying = np.flatnonzero(~self._flies), np.flatnonzero(self._flies)
        self._poses = motion[1:, :6].copy()  # of the carriers that are put where they are commanded
        self._put(0, motion[0])
        for number, index in enumerate(self._flying, start=1):
            self._put(number, motion[1 + index])
        self._put_mocaps(motion[1:, :6])
        mujoco.mj_forward(self._model, self._data)
        self._pull = np.array(tensions, dtype=float)  # behind the winch
        self._length = self._data.ten_length.copy()
        own = robot.fixed_lengths
        self._own = self._length / (1 + self._pull / hardware.stiffness) if own is None else own.copy()
        self._rate, self._late_rate = np.zeros(robot.m), np.zeros(robot.m)
        self._rotors = np.zeros((len(robot.carriers), 4))
        self._started, self._time = False, 0.0
        self.pulls = self._pull.copy()  # mean of the last period at the platform [N]
        self._rng = np.random.default_rng([seed, 11])
        self._reports: deque[tuple[np.ndarray, np.ndarray, float]] = deque()
        self._window: deque[np.ndarray] = deque(maxlen=max(2, round(0.01 / period) + 1))
        self._kept: tuple[np.ndarray, np.ndarray, float] | None = None
        self._next = 0.0

    def _put(self, body: int, motion: np.ndarray) -> None:
        """Put a free body to a pose and a velocity (12,)."""
        q, v = 7 * body, 6 * body
        self._data.qpos[q : q + 3] = motion[:3]
        self._data.qpos[q + 3 : q + 7] = quaternion(*motion[3:6])
        (roll, pitch), (dr, dp, dy) = motion[3:5], motion[9:12]
        sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
        self._data.qvel[v : v + 3] = motion[6:9]
        self._data.qvel[v + 3 : v + 6] = dr - sp * dy, cr * dp + sr * cp * dy, cr * cp * dy - sr * dp

    def _put_mocaps(self, poses: np.ndarray) -> None:
        for number, index in enumerate(self._mocaps):
            self._data.mocap_pos[number] = poses[index, :3]
            self._data.mocap_quat[number] = quaternion(*poses[index, 3:].tolist())
        self._poses = poses

    def motions(self) -> np.ndarray:
        """Return poses and velocities of the platform and of all carriers, (1 + c, 12) [m, rad, s]."""
        result = np.zeros((1 + len(self._robot.carriers), 12))
        result[1:, :6] = self._poses
        if self._started:
            result[1:, 6:] = self._moving
        for number, body in enumerate([0, *(1 + self._flying)]):
            q = self._data.qpos[7 * number : 7 * number + 7].tolist()
            v = self._data.qvel[6 * number : 6 * number + 6].tolist()
            w, x, y, z = q[3:]
            roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
            pitch = math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
            yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
            sr, cr, cp = math.sin(roll), math.cos(roll), max(math.cos(pitch), 1e-6)
            turn = (v[4] * sr + v[5] * cr) / cp
            rates = v[3] + math.sin(pitch) * turn, v[4] * cr - v[5] * sr, turn
            result[body] = [*q[:3], roll, pitch, yaw, *v[:3], *rates]
        return result

    def state(self) -> State:
        """Return what the sensors report now. To be called once in each period."""
        exact, has = self.motions(), self._is
        motion = exact.copy()
        step, noise = np.repeat(has.resolution, 3), np.repeat(has.noise, 3)
        if step.any() or noise.any():
            seen = exact[0, :6] + noise * self._rng.normal(size=6)
            rounded = step > 0
            seen[rounded] = step[rounded] * np.rint(seen[rounded] / step[rounded])
            self._window.append(seen)
            motion[0, :6] = seen
            if len(self._window) == self._window.maxlen:
                change = seen - self._window[0]
                change[3:] -= 2 * np.pi * np.rint(change[3:] / (2 * np.pi))
                motion[0, 6:] = change / (self._period * (len(self._window) - 1))
        pulls = self.pulls * (1.0 if has.sensor is None else has.sensor)
        self._reports.append((motion, pulls.copy(), self._time))
        late = round(has.delay / self._period)
        while len(self._reports) > late + 1:
            self._reports.popleft()
        report = self._reports[0]
        if has.held > 0:
            if self._kept is None or self._time >= self._next - 1e-9:
                self._kept, self._next = report, self._time + has.held
            report = self._kept
        motion, pulls, made = report
        return State(
            motion[0, :6].copy(), motion[0, 6:].copy(), motion[1:, :6].copy(), motion[1:, 6:].copy(),
            None if has.sensor is None else pulls.copy(), made if has.stamped else None,
        )  # fmt: skip

    def run(self, command: Command, wrench: np.ndarray, forces: np.ndarray | None = None) -> None:
        """Let a period pass under a command, with a wrench about the platform's CoM (6,), and forces on carriers."""
        data, has, h = self._data, self._is, self._period / self._substeps
        self._lengths = command.lengths
        wanted = np.asarray(command.tensions)
        data.xfrc_applied[1, :] = wrench  # the platform is the first body
        actuation = None if command.actuation is None else np.asarray(command.actuation).copy()
        if actuation is not None:
            if has.lost is not None and self._time >= has.lost[1] - 1e-9:
                actuation[has.lost[0]] = 0.0
            if not self._started:
                self._rotors = actuation.copy()
        flying = self._flying
        if forces is not None:
            for number, index in enumerate(flying):
                data.xfrc_applied[2 + number, :3] = forces[index]
        self._started, mean = True, np.zeros_like(self.pulls)
        poses, rates = np.asarray(command.carrier_pose), np.asarray(command.carrier_velocity)
        bends = np.asarray(command.carrier_acceleration)
        m = self._robot.m
        for k in range(self._substeps):
            s = k * h
            self._put_mocaps(poses + s * rates + s * s / 2 * bends)
            self._mj.mj_step1(self._model, data)  # lengths of now
            ends = self._tensions(wanted, h)
            if command.released is not None:
                ends = np.where(command.released, 0.0, ends)
            mean += ends / self._substeps
            data.ctrl[:m] = ends
            if actuation is not None:
                share = 1.0 if has.rotor_lag == 0 else 1 - np.exp(-h / has.rotor_lag)
                self._rotors += share * (actuation - self._rotors)
                if has.lost is not None and self._time >= has.lost[1] - 1e-9:
                    self._rotors[has.lost[0]] = 0.0
                data.ctrl[m:] = self._rotors[flying].ravel()
            self._mj.mj_step2(self._model, data)
        self._put_mocaps(poses + self._period * rates + self._period**2 / 2 * bends)
        self._moving = rates + self._period * bends
        self.pulls, self._time = mean, self._time + self._period

    def _tensions(self, wanted: np.ndarray, h: float) -> np.ndarray:
        """Return the tensions at the platform during a step of MuJoCo, and let winches turn."""
        has, length = self._is, self._data.ten_length
        if self._time > 0:
            self._rate = (length - self._length) / h
        self._length = length.copy()
        rubs = has.friction * np.tanh(self._rate / CREEP)
        fixed = self._robot.fixed_lengths is not None
        if has.winch == "source" and not fixed:
            share = 1.0 if has.lag == 0 else 1 - np.exp(-h / has.lag)
            self._pull += share * (has.gain * wanted - self._pull)
            return np.maximum(self._pull + rubs, 0.0)
        taken = has.stiffness / has.stretch  # by the winch
        if fixed:
            turning = np.zeros_like(length)
        elif has.winch == "loop":
            self._late_rate += (1 - np.exp(-h / RATE_LAG)) * (self._rate - self._late_rate)
            turning = self._late_rate + (self._pull - has.gain * wanted) * self._own / (taken * has.lag)
        else:
            aim = length / (1 + wanted / taken) if self._lengths is None else self._lengths
            turning = (aim - self._own) / max(has.lag, h)
        pulls = has.stiffness * (length - self._own) / self._own + has.damping * (self._rate - turning)
        self._pull = np.where(length > self._own, np.maximum(pulls, 0.0), 0.0)
        self._own = self._own + h * turning
        return np.maximum(self._pull + rubs * (self._pull > 0), 0.0)


def mjcf(robot: Robot, hardware: Hardware, step: float) -> str:
    """Return the model: free bodies for the platform, then for carriers that fly, mocap bodies for the others."""
    platform, mass = robot.platform, hardware.mass
    parts, motors, tendons = [], [], []
    attachments = "".join(
        f'<site name="b{i}" pos="{_text(cable.attachment)}"/>' for i, cable in enumerate(robot.cables)
    )
    parts.append(
        f'<body name="load"><freejoint/><inertial pos="{_text(platform.com)}" mass="{mass * platform.mass}" '
        f'fullinertia="{_text(mass * np.array(platform.inertia))}"/>{attachments}</body>'
    )
    others = []
    for index, carrier in enumerate(robot.carriers):
        sites = "".join(
            f'<site name="a{i}" pos="{_text(cable.anchor)}"/>'
            for i, cable in enumerate(robot.cables)
            if cable.carrier == carrier.name
        )
        body: Any = carrier.body
        if body is None:
            others.append(f'<body name="c{index}" mocap="true">{sites}</body>')
            continue
        parts.append(
            f'<body name="c{index}"><freejoint/><inertial pos="0 0 0" mass="{body.mass}" '
            f'fullinertia="{_text(body.inertia)}"/><site name="r{index}"/>{sites}</body>'
        )
        motors += [f'<motor site="r{index}" gear="{gear}"/>' for gear in ("0 0 1 0 0 0", *_torques())]
    pulls = []
    for i in range(robot.m):
        tendons.append(f'<spatial name="t{i}"><site site="a{i}"/><site site="b{i}"/></spatial>')
        pulls.append(f'<motor tendon="t{i}" gear="-1"/>')
    return (
        f'<mujoco><compiler angle="radian"/><option timestep="{step}" gravity="{_text(robot.gravity)}"/>'
        f"<worldbody>{''.join(parts + others)}</worldbody><tendon>{''.join(tendons)}</tendon>"
        f"<actuator>{''.join(pulls + motors)}</actuator></mujoco>"
    )


def _torques() -> tuple[str, str, str]:
    return "0 0 0 1 0 0", "0 0 0 0 1 0", "0 0 0 0 0 1"


def quaternion(roll: float, pitch: float, yaw: float) -> list[float]:
    """Return (w, x, y, z) of Rz(yaw) Ry(pitch) Rx(roll)."""
    a, b, c = roll / 2, pitch / 2, yaw / 2
    sa, ca, sb, cb, sc, cc = math.sin(a), math.cos(a), math.sin(b), math.cos(b), math.sin(c), math.cos(c)
    return [
        ca * cb * cc + sa * sb * sc,
        sa * cb * cc - ca * sb * sc,
        ca * sb * cc + sa * cb * sc,
        ca * cb * sc - sa * sb * cc,
    ]


def _text(numbers: Any) -> str:
    return " ".join(f"{number:.17g}" for number in numbers)
