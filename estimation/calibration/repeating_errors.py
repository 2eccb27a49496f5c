"""`repeating`: errors of lengths that repeat with the pose, as of pulleys or layers on drums that the model lacks.

More samples do not average such errors. Their covariance is taken to be a function of the distance of two poses, or of
two lengths of a cable (Matern, 3/2). Its variance and its reach maximise the restricted likelihood of the residuals,
because parameters absorb a part of the errors: where they may absorb most of them, these may be large.

Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 4.17; Harville, JASA 72 (1977) 320.
"""

from typing import NamedTuple

import numpy as np

from ..logs.measurements import carriers_of
from .autocorrelation import readings_of
from .geometry import runs
from .model import Model, State
from .projection import equations_of, parts

MOST_EQUATIONS = 256  # of all cables in all cells of the workspace
FEWEST = 8  # cells, and samples in each
REACHES = 0.3, 1.0, 3.0  # of the covariance, relative to the spread of poses or lengths
CERTAIN = 6.0  # logarithm of the ratio of likelihoods, below which errors may be noise
RATIOS = np.geomspace(1e-4, 1e6, 61)  # of variances: of errors that repeat, in a mean cell, to noise
VARIED = 10.0  # times the residuals, by which poses or lengths must vary
ROUNDING = 1e-12


class Repeating(NamedTuple):
    """Errors that repeat.

    Attributes:
        sigma: Their standard deviation, over the standard deviation of the residuals of lengths.
        of_lengths: Whether they repeat with the cables' lengths rather than with the pose.
        information: What they add to the covariance of J'e times a root of the parameters' covariance, (r, r), with
            residuals of standard deviation 1.
    """

    sigma: float
    of_lengths: bool
    information: np.ndarray

    def larger(self, M: np.ndarray, white: np.ndarray) -> np.ndarray:
        """Return M (r, r) in directions in which it is larger than with these and `white` errors, else the latter."""
        values, vectors = np.linalg.eigh(M)
        values = np.maximum(values, ROUNDING * max(float(values[-1]), 1e-300))
        root, inverse = ((vectors * values**power) @ vectors.T for power in (0.5, -0.5))
        values, vectors = np.linalg.eigh(inverse @ (white + self.information) @ inverse)
        return root @ (vectors * np.maximum(values, 1.0)) @ vectors.T @ root


def repeating(model: Model, state: State, root: np.ndarray) -> Repeating | None:
    """Return the errors that repeat, or None if noise explains the residuals.

    `root` is a square root of the covariance of the parameters for independent errors with a sigma of 1, (p, r).
    """
    count, m, r = len(model.measurements), model.robot.m, root.shape[1]
    depth = int(np.log2(max(min(MOST_EQUATIONS // m, count // FEWEST), 1)))
    places, lengths = np.empty((count, 3 * m), np.float32), np.empty((count, m), np.float32)
    for rows, part, own in model.parts(state):
        (position, rotation), table = part.poses(own), part.parameters.table(own.x)
        at = carriers_of(part.robot, part.measurements)
        lengths[rows] = runs(part.robot, table, position, rotation, at).lengths.T
        ends = position[:, None] + np.einsum("nij,mj->nmi", rotation, table[:, 3:6])
        places[rows] = ends.reshape(len(ends), -1)
    wound = np.ma.masked_array(lengths, ~model.weights.T)  # with locked winches, only slack cables change much
    spread = np.sqrt([places.var(axis=0).sum() / m, wound.var(axis=0).mean()])
    if 2**depth < FEWEST:
        return None
    cell, squares = _cells(places, depth), 0.0
    # Sums in cells: of residuals, shares of errors that poses do not absorb, roots of these, derivatives, and both.
    sums = np.zeros((2**depth, m, 3 + 2 * r))
    for part in parts(model, state, equations_of(model, state)):
        found, own = readings_of(part, root), cell[part.rows]
        kept = np.einsum("nii->ni", found.P)[..., None]
        squares += float((found.residuals**2).sum())
        np.add.at(sums[..., :3], own, np.dstack([found.residuals, kept**2, kept]))
        np.add.at(sums[..., 3 : 3 + r], own, found.X)
        np.add.at(sums[..., 3 + r :], own, kept * found.X)
    sums = sums.reshape(-1, 3 + 2 * r)
    used = sums[:, 1] > ROUNDING  # roots of matrices leave as much of readings that are left out
    weight = np.sqrt(sums[used, 1:2])  # of a sum of independent errors
    y, size, J, S = np.split(np.delete(sums[used], 1, axis=1), [1, 2, 2 + r], axis=1)
    y, size, J = y / weight, size / weight, J / weight
    left, singular, _ = np.linalg.svd(J)
    Q = left[:, int((singular > 1e-9 * singular.max(initial=0.0)).sum()) :]
    if Q.shape[1] < FEWEST:
        return None
    z = (Q.T @ y)[:, 0]
    centre, mean = (
        np.ma.stack([of[cell == i].mean(axis=0) for i in range(2**depth)]).filled(0.0) for of in (places, wound)
    )
    apart = np.linalg.norm(centre[:, None] - centre, axis=2)[..., None] / np.sqrt(m)
    likely = CERTAIN - len(z) * np.log(max(float((z**2).mean()), 1e-300)) / 2
    best: tuple[float, bool, np.ndarray] | None = None
    noise = model.measurements.sigma.lengths * np.sqrt(squares / max(float(sums[:, 1].sum()), 1e-300))
    for of_lengths, distance in enumerate((apart, np.abs(mean[:, None] - mean))):
        if not spread[of_lengths] > VARIED * noise:  # noise of the poses would repeat with itself
            continue
        for reach in REACHES:
            x = np.sqrt(3) * distance / (reach * spread[of_lengths])
            K = np.swapaxes(((1 + x) * np.exp(-x))[..., None] * np.eye(m), 1, 2)  # (b, m, b, m)
            K = K.reshape(len(used), -1)[np.ix_(used, used)]
            values, vectors = np.linalg.eigh(Q.T @ (size * K * size[:, 0]) @ Q)
            better, variance = _likeliest(values, (vectors.T @ z) ** 2)
            if better > likely:
                likely, best = better, (variance, bool(of_lengths), K)
    if best is None:
        return None
    variance, of_lengths, K = best
    variance *= float(sums[:, 1].sum()) / squares
    return Repeating(float(np.sqrt(variance)), of_lengths, variance * S.T @ K @ S)


def _cells(places: np.ndarray, depth: int) -> np.ndarray:
    """Return the cell of each place (N, k), after halving all `depth` times across their longest coordinate."""
    label = np.zeros(len(places), dtype=int)
    for _ in range(depth):
        halved = 2 * label
        for one in np.unique(label):
            own = np.flatnonzero(label == one)
            rank = np.argsort(places[own, np.argmax(places[own].var(axis=0))], kind="stable")
            halved[own[rank[len(own) // 2 :]]] += 1
        label = halved
    return label


def _likeliest(values: np.ndarray, squares: np.ndarray) -> tuple[float, float]:
    """Return the largest logarithm of the restricted likelihood, and the variance of the errors that repeat."""
    usual = float(values.mean())
    if not usual > ROUNDING:  # parameters absorb all
        return -np.inf, 0.0
    of = 1 + RATIOS[:, None] * np.maximum(values / usual, 0.0)
    noise = (squares / of).mean(axis=1)
    logs = -(np.log(of).sum(axis=1) + squares.size * np.log(np.maximum(noise, 1e-300))) / 2
    k = int(np.argmax(logs))
    return float(logs[k]), float(RATIOS[k] * noise[k] / usual)
