"""`NormalEquations`: those of parameters alone, from which every pose has been eliminated (Schur complement).

With J and G the derivatives of all residuals by parameters and by the pose of each sample, C_k = G_k' G_k of sample k
(6, 6) and E_k = G_k' J_k, the parameters' equations are

    S dp = -b        S = J'J - sum_k E_k' C_k^-1 E_k        b = J'e - sum_k E_k' C_k^-1 G_k'e
    C_k dq_k = -(G_k'e + E_k dp)

with prior standard deviations as residuals of their own. With L_k L_k' = C_k, the sum is one product Y'Y of the matrix
Y of all L_k^-1 E_k on top of each other. Parameters are multiplied by `metric`, so that each is a length [m]. Damping
adds to the diagonals of J'J and of C_k. Rows of the balance of forces and of directions have
derivatives by all parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base.display import Displayed
from .curvature import curvature
from .model import STILL, Derivatives, Model, Residuals, State
from .parameters import OF_CABLE
from .products import inner

NEARLY_SINGULAR = 1e-10  # added to C_k, relative to its mean, where it has no inverse: the lengths leave the pose open
LARGEST_VARIANCE = 1e4  # [m^2, rad^2] of a pose that is determined
FLATTEST = 0.1  # share of C_k that second derivatives leave
SLOWEST = 1e-3  # [m/s]; a platform that moves less makes a clock offset no better known


def metric(model: Model) -> np.ndarray:
    """Return what each parameter is multiplied by to be a length, (P,).

    It is 1 for lengths, a length for scales, a speed for clocks, and a length for errors of forces as large as these.
    """
    parameters, measurements = model.parameters, model.measurements
    scale0 = parameters.table(parameters.first)[:, 7]
    lengths = np.sqrt((measurements.lengths**2).mean(axis=0))
    # Offset and scale act alike where readings hardly differ; a reading near 0 all along has no length of its own.
    spread = np.maximum(lengths, 1e-3 * max(lengths.max(), 1e-6))
    table = np.ones((model.robot.m, OF_CABLE))
    table[:, 7] = spread * np.sign(scale0) * np.where(scale0 < 0, -1.0, 1.0)
    speed = SLOWEST
    if model.track is not None:
        speed = max(SLOWEST, float(np.sqrt((model.track.at(0.0)[2] ** 2).sum(axis=1).mean())))
    strong = measurements.tensions
    force = max(float(np.sqrt((strong**2).mean())) if strong is not None else model.robot.force_scale, 1e-9)
    length = float(np.linalg.norm(model.robot.home_anchors - model.robot.home_attachments, axis=1).mean())
    table[:, 9], table[:, 10], table[:, 11:] = spread**2, force * length, (length, length / force, length)
    of_robot = (speed, length / model.robot.platform.mass, 1.0, 1.0, 1.0)
    return np.concatenate([table.ravel(), of_robot, np.ones(len(parameters.slips))])


class Diagonals(NamedTuple):
    """Of J'J [1/m^2], (p,), and of each C_k [1/m^2, 1/rad^2], (N, 6)."""

    parameters: np.ndarray
    poses: np.ndarray


@dataclass(frozen=True, eq=False)
class NormalEquations(Displayed):
    """The equations at one state."""

    # of the parameters that vary, in metres, (p, p) and (p,)
    S: np.ndarray
    b: np.ndarray
    # l_k^-1, (N, 6, 6), and with it Y as (N, 6, p) and the right side; None if no pose varies
    inverse_root: np.ndarray | None
    Y: np.ndarray | None
    y: np.ndarray | None
    diagonals: Diagonals  # without damping; of poses 0 if none varies

    @classmethod
    def at(
        cls,
        model: Model,
        residuals: Residuals,
        derivatives: Derivatives,
        scale: np.ndarray,
        damping: Diagonals | None = None,
    ) -> NormalEquations:
        """Return the equations; `scale` is `metric`, and `damping` is added to the diagonals of J'J and C_k."""
        varies = model.parameters.varies
        J, others, keep = _columns(model, derivatives, scale)
        m, count, width = J.shape
        e = residuals.readings
        size = m * width + others.shape[2]
        full, right = np.zeros((size, size)), np.zeros(size)
        blocks, cross = inner(J, J), inner(J, others)
        for i in range(m):
            own = slice(i * width, (i + 1) * width)
            full[own, own] = blocks[i]
            full[own, m * width :], full[m * width :, own] = cross[i], cross[i].T
        flat = others.reshape(m * count, -1)
        full[m * width :, m * width :] = inner(flat, flat)
        right[: m * width] = inner(J, e[..., None]).ravel()
        right[m * width :] = inner(flat, e.reshape(-1, 1))[:, 0]
        S, b = full[np.ix_(keep, keep)], right[keep]
        sigma = model.prior_sigmas[varies] * scale[varies]
        blocks = [(e, by_x[..., varies] / scale[varies], by_pose) for e, by_x, by_pose in derivatives.blocks]
        for e, H, _ in blocks:  # (N, k), (N, k, p)
            flat = H.reshape(e.size, -1) if len(b) else np.zeros((e.size, 0))
            S, b = S + inner(flat, flat), b + inner(flat, e.reshape(-1, 1))[:, 0]
        S[np.diag_indices(len(b))] += 1 / sigma**2
        b += residuals.parameters[: len(varies)][varies] / sigma
        kept = model.kept_rows[:, varies] / scale[varies] / STILL
        S, b = S + kept.T @ kept, b + kept.T @ residuals.parameters[len(varies) :]
        own = np.diag(S).copy()
        if damping is not None:
            S[np.diag_indices(len(b))] += damping.parameters
        if not model.poses_vary.any():
            return cls(S, b, None, None, None, Diagonals(own, np.zeros((count, 6))))
        inverse_root, G, g, of_poses = _poses(model, residuals, derivatives, damping)
        E = np.empty((count, G.shape[1], size))
        E[..., : m * width] = (G[..., None] * np.swapaxes(J, 0, 1)[:, None]).reshape(*G.shape[:2], m * width)
        E[..., m * width :] = G @ np.swapaxes(others, 0, 1)
        E = E if keep.all() else E[..., keep]
        for _, H, by_pose in blocks:
            E = E + np.swapaxes(by_pose * model.poses_vary[:, None], 1, 2) @ H
        Y = np.matmul(inverse_root, E)
        y = np.matmul(inverse_root, g[..., None])[..., 0]
        stacked = Y.reshape(y.size, Y.shape[2])
        S, b = S - inner(stacked, stacked), b - inner(stacked, y.reshape(-1, 1))[:, 0]
        return cls(S, b, inverse_root, Y, y, Diagonals(own, of_poses))

    def poses_after(self, dp: np.ndarray) -> np.ndarray | None:
        """Return the changes of the poses (N, 6) that follow from those of the parameters (p,), None if none varies."""
        if self.inverse_root is None or self.Y is None or self.y is None:
            return None
        return -np.matmul(np.swapaxes(self.inverse_root, 1, 2), (self.y + self.Y @ dp)[..., None])[..., 0]


def _columns(model: Model, derivatives: Derivatives, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives by what may vary, in metres, and which of their columns vary."""
    parameters = model.parameters
    flags, factors = parameters.table(parameters.varies), parameters.table(scale)
    used = np.flatnonzero(flags.any(axis=0))
    J = derivatives.cables[..., used] / factors[:, None, used]
    last = slice(parameters.clock, parameters.count)
    others = derivatives.others / scale[last]
    return J, others, np.concatenate([flags[:, used].ravel(), parameters.varies[last]])


def _poses(
    model: Model, residuals: Residuals, derivatives: Derivatives, damping: Diagonals | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return L_k^-1 (N, 6, 6), G_k' (N, 6, m), G_k'e (N, 6) and C_k's diagonal (N, 6) of the coordinates that vary."""
    vary, sigmas = model.poses_vary, model.pose_sigmas
    G = np.ascontiguousarray(derivatives.poses.transpose(1, 2, 0)) * vary[..., None]
    C = G @ np.swapaxes(G, 1, 2)
    g = (G @ np.ascontiguousarray(residuals.readings.T)[..., None])[..., 0]
    for e, _, by_pose in derivatives.blocks:
        K = np.swapaxes(by_pose * vary[:, None], 1, 2)
        C, g = C + K @ np.swapaxes(K, 1, 2), g + (K @ e[..., None])[..., 0]
    inverse = np.divide(1.0, sigmas, out=np.zeros_like(sigmas), where=vary)
    g += residuals.poses * inverse
    diagonal = np.arange(C.shape[1])
    C[:, diagonal, diagonal] += inverse**2
    own = C[:, diagonal, diagonal]
    if damping is not None:
        C[:, diagonal, diagonal] += damping.poses
    C[:, diagonal, diagonal] += C[:, diagonal, diagonal] == 0
    try:
        root = np.linalg.cholesky(C)
    except np.linalg.LinAlgError:
        C[:, diagonal, diagonal] += NEARLY_SINGULAR * own.mean(axis=1, keepdims=True) + 1e-300
        root = np.linalg.cholesky(C)
    return np.linalg.inv(root), G, g, own


def pose_steps(model: Model, residuals: Residuals, derivatives: Derivatives) -> tuple[np.ndarray, np.ndarray]:
    """Return Newton's steps of poses with parameters as they are, (N, 6), and the decrease to expect of each, (N,)."""
    vary = model.poses_vary
    inverse_root, _, g, _ = _poses(model, residuals, derivatives, None)
    bent = curvature(residuals, derivatives) * (vary[:, :, None] & vary[:, None, :])
    values, vectors = np.linalg.eigh(inverse_root @ bent @ np.swapaxes(inverse_root, 1, 2))
    inverse_root = (
        np.swapaxes(vectors / np.sqrt(np.maximum(np.abs(1 + values), FLATTEST))[:, None], 1, 2) @ inverse_root
    )
    y = np.matmul(inverse_root, g[..., None])
    return -np.matmul(np.swapaxes(inverse_root, 1, 2), y)[..., 0], (y[..., 0] ** 2).sum(axis=1)


def pose_covariances(model: Model, state: State) -> np.ndarray:
    """Return the covariances of the poses with parameters as they are, (N, 6, 6) [m^2, m rad, rad^2].

    They are infinite where nothing determines a coordinate, and zero where it cannot move.
    """
    inverse_root = _poses(model, *model.linearised(state), None)[0]
    varies = model.poses_vary[:, :, None] & model.poses_vary[:, None, :]
    covariance = np.where(varies, np.swapaxes(inverse_root, 1, 2) @ inverse_root, 0.0)[:, :6, :6]
    unknown = np.trace(covariance, axis1=1, axis2=2) > LARGEST_VARIANCE
    covariance[unknown] = np.inf
    return covariance


def state_equations(model: Model, state: State, scale: np.ndarray) -> NormalEquations:
    """Return the equations at a state, without damping."""
    return NormalEquations.at(model, *model.linearised(state), scale)
