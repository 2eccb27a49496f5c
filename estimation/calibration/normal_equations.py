"""`NormalEquations`: normal equations of the parameters alone, all poses being eliminated (Schur complement).

With J and G the derivatives of all residuals by parameters and by the pose of each sample, C_k = G_k' G_k of sample k
(6, 6) and E_k = G_k' J_k, the parameters' equations are

    S dp = -b        S = J'J - sum_k E_k' C_k^-1 E_k        b = J'e - sum_k E_k' C_k^-1 G_k'e
    C_k dq_k = -(G_k'e + E_k dp)

with prior standard deviations as residuals of their own. With L_k L_k' = C_k, the sum is one product Y'Y of the matrix
Y of all L_k^-1 E_k on top of each other. Parameters are multiplied by `metric`, so that each is a length [m]. Damping
adds to the diagonals of J'J and of C_k. A reading, and each component of a direction, has derivatives by the parameters
of its own cable and of the robot, so the normal matrix is assembled from blocks. The balance of forces depends on all,
as do readings of cables that weight stretches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.display import Displayed
from ..pose.estimate import unbounded
from .geometry import length_of
from .model import STILL, Derivatives, Model, Residuals, State
from .parameters import COLUMNS, OF_CABLE, OF_ROBOT, Parameters
from .products import inner
from .sightings import SEEN

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
    speed = SLOWEST if model.track is None else max(SLOWEST, model.track.speed)
    strong = measurements.tensions
    force = max(float(np.sqrt((strong**2).mean())) if strong is not None else model.robot.force_scale, 1e-9)
    length = length_of(model.robot)
    table[:, 9], table[:, 10] = spread**2, force * length
    table[:, 11:] = length, length / force, length, length / force
    moved = (1.0, 1.0, 1.0, length, length, length) * 2
    of_robot = (speed, length / model.robot.platform.mass, 1.0, 1.0, 1.0, *moved, force * length)
    return np.concatenate([table.ravel(), of_robot, np.ones(len(parameters.slips))])


class Diagonals(NamedTuple):
    """Diagonals of J'J [1/m^2], (p,), and of each C_k [1/m^2, 1/rad^2], (N, 6)."""

    parameters: np.ndarray
    poses: np.ndarray


@dataclass(frozen=True, eq=False)
class NormalEquations(Displayed):
    """The equations at one state."""

    cost: float  # sum of the squares of all residuals
    # of the parameters that vary, in metres, (p, p) and (p,)
    S: np.ndarray
    b: np.ndarray
    # l_k^-1, (N, 6, 6), and with it Y as (N, 6, p) and the right side; None if no pose varies
    inverse_root: np.ndarray | None
    Y: np.ndarray | None
    y: np.ndarray | None
    diagonals: Diagonals  # without damping; of poses 0 if none varies

    @classmethod
    def at(cls, model: Model, state: State, scale: np.ndarray, damping: Diagonals | None = None) -> NormalEquations:
        """Return the equations, summed over parts of the log, so that few derivatives are in memory at once.

        `scale` is `metric`, and `damping` is added to the diagonals of J'J and C_k.
        """
        S, b, cost = _of_priors(model, state, scale)
        less_S, less_b = np.zeros_like(S), np.zeros_like(b)
        of_poses = np.zeros(model.poses_vary.shape)
        inverse_root, Y, y = None, None, None
        if model.poses_vary.any():
            inverse_root, Y, y = (np.empty((*of_poses.shape, *more)) for more in (of_poses.shape[1:], b.shape, ()))
        for rows, part, own in model.parts(state):
            one = _of_part(part, own, scale, None if damping is None else damping.poses[rows])
            S, b, cost = S + one.S, b + one.b, cost + one.cost
            if one.solved is None or inverse_root is None or Y is None or y is None:
                continue
            inverse_root[rows], Y[rows], y[rows], of_poses[rows] = one.solved
            stacked = Y[rows].reshape(y[rows].size, len(b))
            less_S += inner(stacked, stacked)
            less_b += inner(stacked, y[rows].reshape(-1, 1))[:, 0]
        diagonals = Diagonals(np.diag(S).copy(), of_poses)
        if damping is not None:
            S[np.diag_indices(len(b))] += damping.parameters
        return cls(cost, S - less_S, b - less_b, inverse_root, Y, y, diagonals)

    def poses_after(self, dp: np.ndarray) -> np.ndarray | None:
        """Return the changes of the poses (N, 6) that follow from those of the parameters (p,), None if none varies."""
        if self.inverse_root is None or self.Y is None or self.y is None:
            return None
        return -np.matmul(np.swapaxes(self.inverse_root, 1, 2), (self.y + self.Y @ dp)[..., None])[..., 0]


class _Part(NamedTuple):
    """Contribution of n samples to J'J (p, p), J'e (p,) and the sum of squares.

    `solved` are L_k^-1, Y, y and the diagonals of C_k of the samples, or None if no pose varies.
    """

    S: np.ndarray
    b: np.ndarray
    cost: float
    solved: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None = None


def _of_part(model: Model, state: State, scale: np.ndarray, damping: np.ndarray | None) -> _Part:
    residuals, derivatives = model.linearised(state)
    cost = float(residuals.of_samples.sum())
    layers, keep = _layers(model, residuals, derivatives, scale)
    size, varies = len(keep), model.parameters.varies
    full, right = np.zeros((size, size)), np.zeros(size)
    for layer in layers:
        layer.add(full, right)
    S, b = full[np.ix_(keep, keep)], right[keep]
    forces, H = derivatives.balance, np.zeros((0, 6, len(b)))
    if forces is not None and forces.by_parameters is not None:
        H = forces.by_parameters[..., varies] / scale[varies]  # (n, 6, p)
        flat = H.reshape(forces.residuals.size, len(b))
        S, b = S + inner(flat, flat), b + inner(flat, forces.residuals.reshape(-1, 1))[:, 0]
    if not model.poses_vary.any():
        return _Part(S, b, cost)
    inverse_root, g, of_poses = pose_equations(model, residuals, derivatives, damping)
    E = layers[0].cross(model.poses_vary)
    for layer in layers[1:]:
        E[:, :6] += layer.cross(model.poses_vary)
    E = E if keep.all() else E[..., keep]
    if forces is not None and forces.by_pose is not None:
        E = E + np.swapaxes(forces.by_pose * model.poses_vary[:, None], 1, 2) @ H
    y = np.matmul(inverse_root, g[..., None])[..., 0]
    return _Part(S, b, cost, (inverse_root, np.matmul(inverse_root, E), y, of_poses))


def _of_priors(model: Model, state: State, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return J'J (p, p), J'e (p,) and the sum of squares of the residuals of the parameters themselves."""
    varies, residuals = model.parameters.varies, model.of_parameters(state.x)
    sigma = model.prior_sigmas[varies] * scale[varies]
    kept = model.kept_rows[:, varies] / scale[varies] / STILL
    b = residuals[: len(varies)][varies] / sigma + kept.T @ residuals[len(varies) :]
    return np.diag(1 / sigma**2) + kept.T @ kept, b, float(residuals @ residuals)


class _Layer(NamedTuple):
    """Rows of each cable: k components of N samples, with derivatives by the cable's parameters and the robot's."""

    J: np.ndarray  # (m, k N, width)
    others: np.ndarray  # (m, k N, s)
    e: np.ndarray  # (m, k N)
    poses: np.ndarray  # by the poses of the samples, (m, N, k, 6 or more)

    def depending_on_all(self, more: np.ndarray) -> _Layer:
        """Return the same rows with further derivatives (m, k N, P), by which no row is of its own cable alone."""
        m, _, width = self.J.shape
        for i in range(m):
            more[i, :, i * width : (i + 1) * width] += self.J[i]
        more[..., m * width :] += self.others
        return self._replace(J=self.J[..., :0], others=more)

    def add(self, full: np.ndarray, right: np.ndarray) -> None:
        """Add J'J and J'e to the normal matrix and its right side, in place."""
        m, _, width = self.J.shape
        blocks, cross = inner(self.J, self.J), inner(self.J, self.others)
        for i in range(m):
            own = slice(i * width, (i + 1) * width)
            full[own, own] += blocks[i]
            full[own, m * width :] += cross[i]
            full[m * width :, own] += cross[i].T
        flat = self.others.reshape(self.e.size, self.others.shape[2])
        full[m * width :, m * width :] += inner(flat, flat)
        right[: m * width] += inner(self.J, self.e[..., None]).ravel()
        right[m * width :] += inner(flat, self.e.reshape(-1, 1))[:, 0]

    def cross(self, vary: np.ndarray) -> np.ndarray:
        """Return G_k'J_k, (N, 6 or more, P), with rows of zeros for coordinates of poses that do not vary."""
        m, count, k, size = self.poses.shape
        width = self.J.shape[2]
        G = np.ascontiguousarray(self.poses.transpose(1, 3, 0, 2)) * vary[:, :size, None, None]  # (N, 6, m, k)
        J = np.ascontiguousarray(self.J.reshape(m, count, k, width).swapaxes(0, 1))  # (N, m, k, width)
        more = self.others.shape[2]
        others = np.moveaxis(self.others.reshape(m, count, k, more), 0, 1).reshape(count, m * k, more)
        E = np.empty((count, size, m * width + others.shape[2]))
        of_cables = E[..., : m * width].reshape(count, size, m, width)  # a view
        np.multiply(G[..., 0, None], J[:, None, :, 0], out=of_cables)
        for i in range(1, k):
            of_cables += G[..., i, None] * J[:, None, :, i]
        E[..., m * width :] = G.reshape(count, size, m * k) @ others
        return E


def _layers(
    model: Model, residuals: Residuals, derivatives: Derivatives, scale: np.ndarray
) -> tuple[list[_Layer], np.ndarray]:
    """Return readings and directions with derivatives by what may vary, in metres, and which columns vary."""
    parameters = model.parameters
    flags, factors = parameters.table(parameters.varies), parameters.table(scale)
    used = np.flatnonzero(flags.any(axis=0))
    J = derivatives.cables[..., used] / factors[:, None, used]
    last = np.flatnonzero(parameters.varies[parameters.clock :])
    others = derivatives.others / scale[parameters.clock + last]
    keep = np.concatenate([flags[:, used].ravel(), np.ones(len(last), dtype=bool)])
    layers = [_Layer(J, others, residuals.readings, derivatives.poses[:, :, None])]
    if derivatives.through is not None:
        of_cables = derivatives.through[..., : parameters.clock].reshape(*J.shape[:2], *factors.shape)
        of_cables = of_cables[..., used] / factors[:, used]  # (m, N, m, width)
        of_robot = derivatives.through[..., parameters.clock + last] / scale[parameters.clock + last]
        layers = [layers[0].depending_on_all(np.concatenate([of_cables.reshape(*J.shape[:2], -1), of_robot], axis=2))]
    seen = derivatives.directions
    if seen is not None and seen.cables is not None and seen.robot is not None and seen.poses is not None:
        m, count = seen.residuals.shape[:2]
        own, of_robot = np.zeros((m, count, 3, len(used))), last[last < OF_ROBOT]
        for place, column in enumerate(used):
            if column in SEEN:
                own[..., place] = seen.cables[..., SEEN.index(column)] / factors[:, None, None, column]
        more = np.zeros((m, count, 3, len(last)))  # of slips as well
        more[..., : len(of_robot)] = seen.robot[..., of_robot] / scale[parameters.clock + of_robot]
        own, more = (part.reshape(m, 3 * count, part.shape[3]) for part in (own, more))
        layers.append(_Layer(own, more, seen.residuals.reshape(m, -1), seen.poses))
    return layers, keep


def pose_equations(
    model: Model, residuals: Residuals, derivatives: Derivatives, damping: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return L_k^-1 (N, 6, 6), G_k'e (N, 6) and C_k's diagonal (N, 6) of the coordinates that vary."""
    vary, sigmas = model.poses_vary, model.pose_sigmas
    G = np.ascontiguousarray(derivatives.poses.transpose(1, 2, 0)) * vary[..., None]
    C = G @ np.swapaxes(G, 1, 2)
    g = (G @ np.ascontiguousarray(residuals.readings.T)[..., None])[..., 0]
    if derivatives.balance is not None and derivatives.balance.by_pose is not None:
        K = np.swapaxes(derivatives.balance.by_pose * vary[:, None], 1, 2)
        C, g = C + K @ np.swapaxes(K, 1, 2), g + (K @ derivatives.balance.residuals[..., None])[..., 0]
    if derivatives.directions is not None and derivatives.directions.poses is not None:
        for e, by_pose in zip(derivatives.directions.residuals, derivatives.directions.poses, strict=True):
            K = np.swapaxes(by_pose, 1, 2) * vary[:, :6, None]
            C[:, :6, :6] += K @ np.swapaxes(K, 1, 2)
            g[:, :6] += (K @ e[..., None])[..., 0]
    inverse = np.divide(1.0, sigmas, out=np.zeros_like(sigmas), where=vary)
    g += residuals.poses * inverse
    diagonal = np.arange(C.shape[1])
    C[:, diagonal, diagonal] += inverse**2
    own = C[:, diagonal, diagonal]
    if damping is not None:
        C[:, diagonal, diagonal] += damping
    C[:, diagonal, diagonal] += C[:, diagonal, diagonal] == 0
    try:
        root = np.linalg.cholesky(C)
    except np.linalg.LinAlgError:
        C[:, diagonal, diagonal] += NEARLY_SINGULAR * own.mean(axis=1, keepdims=True) + 1e-300
        root = np.linalg.cholesky(C)
    return _inverse(root), g, own


def _inverse(root: np.ndarray) -> np.ndarray:
    """Return the inverses of lower triangular matrices (N, d, d), in a third of the time of LAPACK."""
    result = np.zeros_like(root)
    for i in range(root.shape[1]):
        result[:, i, i] = 1.0 / root[:, i, i]
        result[:, i, :i] = np.matmul(root[:, i, None, :i], result[:, :i, :i])[:, 0] * -result[:, i, i, None]
    return result


def pose_steps(model: Model, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return Newton's steps of poses with parameters as they are, (N, 6).

    For each sample also return the decrease of the sum of squares to expect and the sum itself, (N,).
    """
    parts = [_steps(part, *part.linearised(own)) for _, part, own in model.parts(state)]
    steps, decreases, squares = (np.concatenate(of) for of in zip(*parts, strict=True))
    return steps, decreases, squares


def _steps(model: Model, residuals: Residuals, derivatives: Derivatives) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    vary = model.poses_vary
    inverse_root, g, _ = pose_equations(model, residuals, derivatives)
    bent = curvature(residuals, derivatives) * (vary[:, :, None] & vary[:, None, :])
    values, vectors = np.linalg.eigh(inverse_root @ bent @ np.swapaxes(inverse_root, 1, 2))
    inverse_root = (
        np.swapaxes(vectors / np.sqrt(np.maximum(np.abs(1 + values), FLATTEST))[:, None], 1, 2) @ inverse_root
    )
    y = np.matmul(inverse_root, g[..., None])
    steps = -np.matmul(np.swapaxes(inverse_root, 1, 2), y)[..., 0]
    return steps, (y[..., 0] ** 2).sum(axis=1), residuals.of_samples


def pose_covariances(model: Model, state: State) -> np.ndarray:
    """Return the covariances of the poses with parameters as they are, (N, 6, 6) [m^2, m rad, rad^2].

    They are infinite where nothing determines a coordinate, and zero where it cannot move.
    """
    roots = [pose_equations(part, *part.linearised(own))[0] for _, part, own in model.parts(state)]
    _, values, V = np.linalg.svd((np.concatenate(roots) * model.poses_vary[:, None])[..., :6])
    open_ = values[..., None] ** 2 > LARGEST_VARIANCE
    root = np.where(open_, 0.0, values[..., None] * V)
    return unbounded(np.swapaxes(root, 1, 2) @ root, np.swapaxes(np.where(open_, V, 0.0), 1, 2))


def pose_covariances_by_file(model: Model, state: State) -> np.ndarray:
    """Return the covariances (N, 6, 6) of poses by the `uncertainty` of the robot file, zero without any."""
    uncertain = model.robot.uncertainty
    if uncertain is None or not model.poses_vary.any():
        return np.zeros((len(state.shift), 6, 6))
    whole = replace(model, parameters=Parameters(model.robot, tuple(COLUMNS)[:6]))  # parameters of the geometry
    equations, scale = NormalEquations.at(whole, state, metric(whole)), metric(whole)
    assert equations.inverse_root is not None
    assert equations.Y is not None
    where = whole.parameters.places(uncertain.parameters)
    own = np.searchsorted(np.flatnonzero(whole.parameters.varies), where)
    motions = np.swapaxes(equations.inverse_root, 1, 2)[:, :6] @ equations.Y[..., own] * scale[where]  # (N, 6, p)
    return np.asarray(motions @ uncertain.matrix @ np.swapaxes(motions, 1, 2))


def curvature(residuals: Residuals, derivatives: Derivatives) -> np.ndarray:
    """Return the sum over the cables of residuals times their second derivatives by the pose, (N, 6 + d, 6 + d).

    Usual normal equations neglect them. Where two poses with the same lengths are about to merge, first derivatives say
    little about how far to go, and one such sample would make all steps of a fit short. With u the unit vector along a
    cable of length L and a the arm R b of its attachment, the second-order change of the length by a shift d and a
    rotation w is half of

        v' (I - u u') v / L + (u . w) (a . w) - (u . a) w'w        v = d + w x a

    as for a cable between points; with a pulley it hardly differs.
    """
    arms, along = derivatives.arms, derivatives.poses[..., :3]
    M = np.zeros((*arms.shape, 6))  # v = M (d, w), (m, N, 3, 6)
    M[..., :3] = np.eye(3)
    M[..., 3:] = -np.cross(np.eye(3), arms[..., None, :], axisc=-1)
    gain = np.linalg.norm(along, axis=2)  # of residuals by lengths [1/m], 0 of readings left out
    unit = np.divide(along, gain[..., None], out=np.zeros_like(along), where=gain[..., None] > 0)
    across = M - unit[..., None] * np.matmul(unit[..., None, :], M)
    weight = residuals.readings * gain
    by_length = (weight / derivatives.lengths)[..., None, None]
    rows = [part.swapaxes(0, 1).reshape(arms.shape[1], -1, 6) for part in (by_length * M, across)]  # (N, 3 m, 6)
    result = rows[0].swapaxes(1, 2) @ rows[1]
    both = ((weight / 2)[..., None] * unit).transpose(1, 2, 0) @ arms.swapaxes(0, 1)  # (N, 3, 3)
    both -= np.eye(3) * np.einsum("nii->n", both)[:, None, None]
    result[:, 3:, 3:] += both + np.swapaxes(both, 1, 2)
    more = (0, derivatives.poses.shape[2] - 6)
    return np.pad(result, ((0, 0), more, more))
