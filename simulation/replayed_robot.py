"""`Parameters`, `modelled`: the robot of a replay, its drives and load cells, and what its file may have wrong."""

from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..models.robot import Robot

QUICK = 400.0  # [rad/s]: as in core/plant/winch_forces.h
STRAIN = 1e-3  # at t_max, of cables whose stiffness is not known


class Parameters(NamedTuple):
    """Parameters that a model may have wrong."""

    delay: float = 0.0  # time by which the robot is later than its recorded commands [s]
    friction: float = 0.0  # dry friction of the winches, as a force on each cable, the mean over the cables [N]
    # mass and inertia of the platform, and stiffness of the cables, as factors of the file's
    mass: float = 1.0
    stiffness: float = 1.0
    tilt: tuple[float, ...] = (0.0, 0.0)  # rotation of gravity about x and y of {G} [rad]
    com: tuple[float, ...] = (0.0, 0.0, 0.0)  # CoM of the platform less the file's [m]
    # of load cells, (2 m,): gains minus 1, and readings without tension over the usual tension
    load_cells: tuple[float, ...] = ()
    cable_friction: tuple[float, ...] = ()  # dry friction of each cable beyond `friction`, (m,) [N]
    anchors: tuple[float, ...] = ()  # anchors less the file's, (3 m,) [m]
    thrusts: tuple[float, ...] = ()  # recorded thrusts over the carriers' thrusts, minus 1, (c,)


def modelled(robot: Robot, drive: str, flown: np.ndarray) -> Robot:
    """Return the robot of the plant.

    Carriers without recorded thrust, those not `flown`, (c,) of bool, move as recorded. All cables stretch, since
    recorded lengths fit no cables that do not. Only winches that get forces have a model.
    """
    carriers = tuple(one if thrust else one.imposed() for one, thrust in zip(robot.carriers, flown, strict=True))
    cables, lengths = [], np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1)
    for cable, length in zip(robot.cables, lengths, strict=True):
        changes: dict[str, Any] = {} if drive == "forces" else {"winch": None}
        if cable.stiffness is None:
            EA = cable.t_max / STRAIN
            decay = float(np.sqrt(EA / length * robot.platform.mass / robot.m))
            changes |= {"stiffness": EA, "damping": cable.damping or decay}
        cables.append(cable.model_copy(update=changes))
    own = "both" if robot.drive == "variable-length" else robot.drive
    return robot.model_copy(update={"carriers": carriers, "cables": tuple(cables), "drive": own})


def friction_of(robot: Robot) -> float:
    """Return the mean dry friction of the winches of a robot [N]."""
    known = [cable.winch.friction for cable in robot.cables if cable.winch is not None]
    return float(np.mean(known)) if known else 0.0


def changed(robot: Robot, to: Parameters) -> Robot:
    """Return a robot with other parameters; attachments and cables without stiffness or winch stay."""
    more, cables = to.friction - friction_of(robot), []
    moved = np.reshape(to.anchors or 3 * robot.m * (0.0,), (-1, 3))
    for cable, own, by in zip(robot.cables, to.cable_friction or robot.m * (0.0,), moved, strict=True):
        changes: dict[str, Any] = {"stiffness": cable.stiffness and cable.stiffness * to.stiffness}
        changes["anchor"] = tuple(np.add(cable.anchor, by).tolist())
        if cable.winch is not None:
            winch = cable.winch.model_copy(update={"friction": max(cable.winch.friction + more + own, 0.0)})
            changes["winch"] = winch
        cables.append(cable.model_copy(update=changes))
    com = tuple(np.add(robot.platform.com, to.com).tolist())
    inertia = robot.platform.inertia and tuple(to.mass * part for part in robot.platform.inertia)
    heavier = {"mass": robot.platform.mass * to.mass, "inertia": inertia, "com": com}
    platform = robot.platform.model_copy(update=heavier)
    gravity = Rotation.from_rotvec([*to.tilt, 0.0]).apply(robot.gravity) if any(to.tilt) else robot.gravity
    return robot.model_copy(update={"cables": tuple(cables), "platform": platform, "gravity": tuple(gravity)})


def cells_of(to: Parameters, usual: float) -> np.ndarray:
    """Return readings per newton and readings without tension of load cells, (2, m); `usual` is the usual tension."""
    gains, zeros = np.reshape(to.load_cells, (2, -1))
    return np.array([1 + gains, zeros * usual])


def given_by_drives(robot: Robot, commands: np.ndarray, dt: float) -> np.ndarray:
    """Return the tensions that drives give for commands (W, K, m) every `dt` [s], constant before the first [N].

    The response of drives that know their winch is linear, see core/plant/winch_forces.h: with the elongation e,
    J e'' + (P C + D) e' + P K e = P t*, t = K e + C e'. Tensions of cables that do not stretch are given at once.
    """
    from scipy.signal import cont2discrete, lfilter, lfilter_zi

    given, lengths = commands.copy(), np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1)
    for i, cable in enumerate(robot.cables):
        if cable.winch and cable.winch.inertia and cable.stiffness:
            J, K, C = cable.winch.inertia, cable.stiffness / lengths[i], cable.damping or 0.0
            P = max(QUICK**2 * J / K if C == 0 else min(QUICK**2 * J / K, 2 * QUICK * J / C), 1.0)
            D = max(2 * np.sqrt(P * K * J) - P * C, 0.0)
            (b,), a, _ = cont2discrete(([C, K], [J / P, C + D / P, K]), dt, "foh")
            start = lfilter_zi(b, a) * commands[:, :1, i]
            given[..., i] = lfilter(b, a, commands[..., i], axis=1, zi=start)[0]
    return given.clip(0.0)
