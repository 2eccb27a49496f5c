"""Paper F's procedure for the driving forces of the cables, over a motion with a small vibration on it.

    T(t) = A^-1 (M ddX + F + D_B - W_e - A dT)       dT = dT_C + dT_K

T is the steady tension that the motors give, dT what the vibration adds at the end of the cable; the platform feels
F = T + dT. The platform's part is in `Dynamics.relative`. The cable's is, with B moved by dB = dx_B + [dTheta]x R b,

    dT_C = C (l(B + dB) - l(B)) / dt      dT_K = E A / e (c . (dB - dx_(n-1)) + de)

where the last of the n elements, of length e = l / n, alone holds the attachment and shares the elongation equally;
`ElementChain` has the matrices of the whole chain.

Source: paper F, section V, steps 1 to 8, where step 7 prints T' for dT; Eqs. 8 to 23 and 38.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...base.display import Displayed
from ...base.inputs import HUGE, TINY, InputError, number, one_of, whole_number
from ..batch import as_array
from ..dynamics import dynamics_of
from ..points import rotations
from ..robot import Robot
from .element_chain import MOST

SINGULAR = 1e-9  # of the largest singular value of A: what is below counts as zero


@dataclass(frozen=True)
class DrivingForce(Displayed):
    """The result of `driving_force`, at N instants for m cables: forces in [N], (N, m).

    - `time`: (N,) [s]. `lengths`: distances from anchor to attachment without vibration [m], (N, m).
    - `T`: steady tension that the motors give. It may be outside the limits or below zero.
    - `dT_C`, `dT_K`: increments by damping and by elasticity.
    - `residual`: norm of A (T + dT) - w, moments over `Robot.length` [N], (N,): above rounding only where the cables
      cannot give the wrench w at all, because A is singular or there are fewer than six.
    - `rank`: of A, (N,).
    """

    time: np.ndarray
    lengths: np.ndarray
    T: np.ndarray
    dT_C: np.ndarray  # noqa: N815
    dT_K: np.ndarray  # noqa: N815
    residual: np.ndarray
    rank: np.ndarray

    @property
    def dT(self) -> np.ndarray:
        """Return the increment by the vibration [N], (N, m)."""
        return self.dT_C + self.dT_K

    @property
    def total(self) -> np.ndarray:
        """Return F = T + dT, which acts on the platform [N], (N, m)."""
        return self.T + self.dT

    @property
    def ratio(self) -> np.ndarray:
        """Return dT / T [-], (N, m), the paper's delta_SV; it is nan or infinite where T is zero."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.dT / self.T


def driving_force(
    robot: Robot,
    pose: Any,
    velocity: Any,
    acceleration: Any,
    vibration: Any,
    time_step: float,
    elements: int = 8,
    *,
    base: Sequence[Any] | None = None,
    wind: Any = None,
    pretension: Any = 0.0,
    winding: Literal["paid out", "printed"] = "paid out",
) -> DrivingForce:
    """Compute the steady tension and the vibration increments of each cable at each instant.

    With more than six cables T is the least-norm solution. Where A is singular, or the cables are fewer than the
    coordinates, T solves the equations in the least-squares sense (moments over `Robot.length`), least norm again, and
    `residual` is the wrench that is missing; nothing is raised.

    - `robot`: with one carrier, point anchors, and stiffness and damping for every cable.
    - `pose`, `velocity`, `acceleration`: of the platform frame relative to {A}, expressed in {A}, (N, 6).
    - `vibration`: (dx_B, dTheta): small displacement of the platform frame's origin [m] and small turn [rad], in {G},
      (N, 6). Each row is what one time step adds to the steady pose, as the paper has it: dT_C divides it by
      `time_step`.
    - `time_step`: time step dt of the paper [s].
    - `elements`: number of elements of each cable, n of the paper.
    - `base`: pose, velocity and acceleration of {A} in {G}, (N, 6) each; default: at home and at rest.
    - `wind`: velocity of the air in {G} [m/s], (N, 3) or (3,); default: no air.
    - `pretension`: tension of each cable before the vibration [N], broadcast to (N, m): an element is slack if the
      vibration takes more than this. 0 is the paper's rule, by which dT_K is never negative; `inf` keeps every cable
      taut.
    - `winding`: "paid out": the winch pays out cable as the steady motion requires, so winding adds nothing to dT_K.
      "printed": the paper's Eq. 13 to the letter, where each element is lengthened by (l(t + dt) - l(t)) / n in every
      step (the last one repeats); at any usual speed this alone is far more than T.

    Raises `InputError` if an argument has a wrong shape or value, or the robot has several carriers, a pulley, or a
    cable without stiffness or damping.
    """
    stiffness, damping = _cable_constants(robot)
    time_step = number("time_step", time_step, TINY, HUGE)
    elements = whole_number("elements", elements, 1, MOST)
    pose = as_array("pose", pose, (6,))
    if pose.ndim != 2:
        raise InputError(f"pose must have the shape (N, 6), one row per instant, got {pose.shape}")
    instants = len(pose)
    vibration = _series("vibration", vibration, instants)
    given = (robot.carrier_home[0], None, None) if base is None else tuple(base)
    if len(given) != 3:
        raise InputError(f"base must be pose, velocity and acceleration of the carrier, got {len(given)} of them")
    carrier_pose, carrier_velocity, carrier_acceleration = given
    carrier_pose = _series("carrier_pose", carrier_pose, instants)
    one_of("winding", winding, ("paid out", "printed"))
    shape = (instants, robot.m)
    try:
        pretension = np.broadcast_to(np.asarray(pretension, dtype=float), shape)
    except (TypeError, ValueError):
        accepted = f"one number [N] or an array that broadcasts to {shape}"
        raise InputError(f"pretension must be {accepted}, got {pretension!r}") from None
    if not (pretension >= 0).all():
        raise InputError(f"pretension must have numbers >= 0, got {pretension.min():g}")

    dynamics = dynamics_of(robot).relative
    w = dynamics.required_wrench(
        pose, velocity, acceleration, carrier_pose, carrier_velocity, carrier_acceleration, wind
    )
    if w.shape != (instants, 6):
        raise InputError(f"all arguments must have {instants} instants like pose, got {w.shape[:-1]}")
    A = dynamics.wrench_matrix(pose)

    arms = robot.attachments @ rotations(pose[:, 3:]).transpose(0, 2, 1)  # R b, (N, m, 3), in {A}
    vectors = robot.anchors - (pose[:, None, :3] + arms)  # A - B, (N, m, 3), in {A}
    lengths = np.linalg.norm(vectors, axis=-1)
    to_A = rotations(carrier_pose[:, 3:]).transpose(0, 2, 1)
    in_A = np.concatenate([np.einsum("nij,nj->ni", to_A, part) for part in np.split(vibration, 2, axis=1)], axis=1)
    dB = in_A[:, None, :3] + np.cross(in_A[:, None, 3:], arms)
    after = np.linalg.norm(vectors - dB, axis=-1)
    # l(B + dB) - l(B) without the cancellation of two nearly equal lengths
    dT_C = damping * (np.einsum("nmi,nmi->nm", dB - 2 * vectors, dB) / (after + lengths)) / time_step
    end = -np.einsum("nmi,nmi->nm", vectors, dB) / lengths
    before_end = end * ((elements - 1) / elements)
    steps = np.diff(lengths, axis=0)
    unwound = np.concatenate([steps, steps[-1:]]) if len(steps) and winding == "printed" else 0.0
    dT_K = np.maximum(stiffness * elements / lengths * (end - before_end + unwound / elements), -pretension)

    T, residual, rank = _traction(robot, A, w, dT_C + dT_K)
    return DrivingForce(np.arange(instants) * time_step, lengths, T, dT_C, dT_K, residual, rank)


def _cable_constants(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    for index, cable in enumerate(robot.cables):
        if cable.pulley is not None:
            raise InputError(
                f"cables[{index}].pulley must be null, because the procedure has point anchors, got a pulley"
            )
        if cable.stiffness is None:
            raise InputError(f"cables[{index}].stiffness must be E A > 0 [N] for dT_K, got none")
        if cable.damping is None:
            raise InputError(f"cables[{index}].damping must be C >= 0 [N s/m] for dT_C, got none")
    return (np.array([cable.stiffness for cable in robot.cables]), np.array([cable.damping for cable in robot.cables]))


def _series(name: str, value: Any, instants: int) -> np.ndarray:
    array = as_array(name, value, (6,))
    if array.shape not in ((6,), (1, 6), (instants, 6)):
        raise InputError(f"{name} must have the shape ({instants}, 6) like pose, or (6,), got {array.shape}")
    return np.broadcast_to(array, (instants, 6))


def _traction(robot: Robot, A: np.ndarray, w: np.ndarray, dT: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return T, (N, m), |A (T + dT) - w|, (N,), and the rank of A, (N,), on the rows that can move."""
    scale = robot.dof_mask * robot.wrench_scale
    A, w = A * scale[:, None], w * scale
    left = w - np.einsum("nij,nj->ni", A, dT)
    T = np.einsum("nij,nj->ni", np.linalg.pinv(A, rcond=SINGULAR), left)
    residual = np.linalg.norm(np.einsum("nij,nj->ni", A, T) - left, axis=1)
    return T, residual, np.linalg.matrix_rank(A, rtol=SINGULAR)
