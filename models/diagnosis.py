"""Diagnose a robot at its home pose: the rank of its wrench matrix and the reason, and implausible numbers."""

from dataclasses import dataclass

import numpy as np

from ..base.display import Displayed
from ..base.text import quantity, quantity_row
from ..base.tolerances import INDEPENDENT
from .dynamics import Dynamics
from .files import AnyRobot
from .robot import Robot

RANK_TOLERANCE = 1e-9  # of the largest value, where cables are parallel or meet; that comes out near 1e-16
LEVEL_POSES = 50


@dataclass(frozen=True)
class Diagnosis(Displayed):
    """The diagnosis of a robot at its home pose."""

    rank: int  # rank of the wrench matrix at home
    # largest rank among seeded random poses about home, unrotated and rotated
    rank_level: int
    rank_tilted: int
    # singular values of the balanced rows of the wrench matrix at home, moments divided by `Robot.length`, descending
    singular_values: np.ndarray  # (min(6, m),)
    lengths: np.ndarray  # cable lengths at home, (m,) [m]
    reason: str  # reason for a rank below the platform's degrees of freedom, otherwise empty
    warnings: list[str]  # sentences about numbers that are valid but implausible


def diagnose(robot: AnyRobot) -> Diagnosis:
    """Diagnose `robot` at its home pose, with its carriers at home."""
    dynamics = Dynamics(robot)
    robot = dynamics.robot
    scale = robot.wrench_scale[:, None]
    rows = robot.dof_mask[:, None]
    A = dynamics.wrench_matrix(robot.home) * scale * rows
    lengths = dynamics.cable_lengths(robot.home)
    singular_values = np.linalg.svd(A, compute_uv=False)[: len(robot.platform.dof)]
    rng = np.random.default_rng(0)
    levels = np.tile(robot.home, (LEVEL_POSES, 1))
    levels[:, :3] += robot.dof_mask[:3] * rng.uniform(-0.2, 0.2, size=(LEVEL_POSES, 3)) * lengths.min()
    levels[:, 3:] = 0
    turned = levels.copy()
    turned[:, 3:] = robot.dof_mask[3:] * rng.uniform(-0.3, 0.3, size=(LEVEL_POSES, 3))
    rank, level, tilted = (
        int(np.linalg.matrix_rank(dynamics.wrench_matrix(poses) * scale * rows, rtol=INDEPENDENT).max())
        for poses in (robot.home, levels, turned)
    )
    return Diagnosis(
        rank=rank,
        rank_level=level,
        rank_tilted=tilted,
        singular_values=singular_values,
        lengths=lengths,
        reason=_why(robot, A, rank, lengths) if rank < len(robot.platform.dof) else "",
        warnings=[*too_weak(robot), *_implausible(robot)],
    )


def _why(robot: Robot, A: np.ndarray, rank: int, lengths: np.ndarray) -> str:
    """Return the reason for a rank below the degrees of freedom, from the cable lines at home."""
    directions = A[:3].T  # (m, 3)
    points = robot.home_attachments
    projectors = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    spread = np.linalg.svd(directions, compute_uv=False)
    if spread[1:].max(initial=0.0) < RANK_TOLERANCE * spread[0]:
        return "all cables are parallel"
    meeting = np.linalg.lstsq(projectors.sum(axis=0), (projectors @ points[:, :, None]).sum(axis=0).ravel())[0]
    distance = np.linalg.norm((projectors @ (meeting - points)[:, :, None])[:, :, 0], axis=1)
    if distance.max() < RANK_TOLERANCE * lengths.max():
        return f"all cable lines meet in one point, {_vector(meeting)} m, so no cable has a moment about it"
    if rank == robot.m:
        return f"{robot.m} cables span at most {robot.m} of {len(robot.platform.dof)} directions"
    moving = np.flatnonzero(robot.dof_mask)
    free = np.eye(6)[:, moving] @ np.linalg.svd(A[moving])[0][:, rank:]
    if free.shape[1] == 1:
        return f"no cable resists {_motion(free[:, 0], robot)}"
    return f"no cable resists {free.shape[1]} independent motions"


def _motion(twist: np.ndarray, robot: Robot) -> str:
    """Describe the twist (velocity of the CoM, angular velocity times `Robot.length`) that no cable resists."""
    velocity, omega = twist[:3], twist[3:] / robot.length
    if np.linalg.norm(omega) * robot.length < 1e-6:
        return f"a translation along {_vector(velocity / np.linalg.norm(velocity))}"
    along = omega / np.linalg.norm(omega)
    pitch = velocity @ along / np.linalg.norm(omega)
    kind = "a rotation" if abs(pitch) < 1e-6 * robot.length else f"a screw of {quantity(pitch, 'm/rad', 3)}"
    offset = np.cross(omega, velocity) / (omega @ omega)
    place = "the CoM" if np.linalg.norm(offset) < 1e-6 * robot.length else f"the CoM shifted by {_vector(offset)} m"
    return f"{kind} about {_vector(along)} through {place}"


def _vector(vector: np.ndarray) -> str:
    return f"({quantity_row(np.round(vector, 9))})"


def too_weak(robot: Robot) -> list[str]:
    """Return a sentence for each carrier, and for all, that cannot give the force along gravity that rest needs.

    A carrier holds its weight and the pull of its cables at home, with the tensions inside their limits for which that
    is least; all of them hold their weight and the platform's.
    """
    gravity = float(np.linalg.norm(robot.gravity))
    bodies = [carrier.body for carrier in robot.carriers]
    if not gravity or not all(bodies):
        return []
    down = np.array(robot.gravity) / gravity
    pull = -down @ Dynamics(robot).wrench_matrix(robot.home)[:3]  # on the carriers [N per N]
    least = np.bincount(robot.carrier_of_cable, np.minimum(robot.t_min * pull, robot.t_max * pull), len(bodies))
    needs = [gravity * body.mass + extra for body, extra in zip(bodies, least.tolist(), strict=True) if body]
    weak = [
        f"{carrier.name} cannot hover at home: its thrust_max is {quantity(carrier.force_max, 'N')}, and its weight "
        f"and its cables need at least {quantity(need, 'N')}"
        for carrier, need in zip(robot.carriers, needs, strict=True)
        if carrier.force_max < need
    ]
    weight = robot.weight + gravity * sum(body.mass for body in bodies if body)
    if (most := sum(carrier.force_max for carrier in robot.carriers)) < weight:
        weak.append(
            f"the carriers cannot hold the platform: together they give at most {quantity(most, 'N')}, but platform "
            f"and carriers weigh {quantity(weight, 'N')}"
        )
    return weak


def _implausible(robot: Robot) -> list[str]:
    warnings = []
    moments = np.sort(np.linalg.eigvalsh(robot.inertia))
    largest, others = moments[2], moments[0] + moments[1]
    if largest > others * (1 + 1e-9):
        warnings.append(
            f"platform.inertia: the largest principal moment, {quantity(largest, 'kg m^2')}, exceeds the sum of the "
            f"other two, {quantity(others, 'kg m^2')}, which no rigid body has"
        )
    gyration = float(np.sqrt(largest / robot.platform.mass))
    if gyration > 2 * robot.length:
        mass, reach = quantity(robot.platform.mass, "kg"), quantity(robot.length, "m", 2)
        warnings.append(
            f"platform.inertia: {quantity(largest, 'kg m^2', 3)} at {mass} gives a radius of gyration of "
            f"{quantity(gyration, 'm', 2)}, although no attachment is farther than {reach} from the CoM"
        )
    if robot.m >= 3 and not _com_between_attachments(robot):
        warnings.append(
            "platform.com: it lies outside the attachments in the view from above, so suspended cables cannot hold "
            "it level"
        )
    borne = np.array(robot.gravity) * (robot.dof_mask[:3] == 0)  # along coordinates that cannot move
    if np.abs(borne @ Dynamics(robot).wrench_matrix(robot.home)[:3]).max(initial=0.0) > 1e-3 * np.linalg.norm(borne):
        fixed = ", ".join(np.array(["x", "y", "z"])[borne != 0])
        warnings.append(
            f"platform.dof: {fixed} cannot move, so something else is assumed to carry the weight, although the cables "
            f"are inclined; if the platform hangs from them, add {fixed}"
        )
    of_cables: dict[str, list[str]] = {}  # the cables of which a sentence is true
    for index, cable in enumerate(robot.cables):
        most = np.inf if cable.winch is None or robot.fixed_lengths is not None else cable.winch.tension_max
        said = [f"t_min equals t_max, {quantity(cable.t_max, 'N')}"] * (cable.t_min == cable.t_max)
        for name, tension in (("t_min", cable.t_min), ("t_max", cable.t_max)):
            with_less = f"but only with force_max less friction, {quantity(most, 'N')}"
            said += [f"the winch cannot haul in with {name}, {quantity(tension, 'N')}, {with_less}"] * (most < tension)
        for sentence in said:
            of_cables.setdefault(sentence, []).append(f"cables[{index}]")
    warnings.extend(
        f"{'every cable' if len(cables) == robot.m > 1 else ', '.join(cables)}: {sentence}"
        for sentence, cables in of_cables.items()
    )
    return warnings


def _com_between_attachments(robot: Robot) -> bool:
    """Return whether the CoM lies in the convex hull of the attachments along gravity, with the platform at home."""
    down = np.array(robot.gravity)
    if not np.linalg.norm(down) > 0:
        return True
    # The directions from the CoM to the attachments, viewed along gravity, must not fit into a half plane.
    across = np.linalg.svd(down[None])[2][1:]  # (2, 3) basis of the plane
    across_com = (robot.home_attachments - robot.home_com) @ across.T
    if (np.linalg.norm(across_com, axis=1) < 1e-9 * robot.length).any():
        return True
    angles = np.sort(np.arctan2(across_com[:, 1], across_com[:, 0]))
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    return bool(gaps.max() <= np.pi + 1e-9)
