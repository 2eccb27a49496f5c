"""`information_of`: what errors that are autocorrelated tell of the parameters, against as many independent ones.

With derivatives J_k of the equations of sample k, minus the part of its pose, the sum of all J_k'e_k has the covariance

    M = sum_k,l r(l) J_k'J_(k+l)

if errors e have the correlation r(l) with errors l samples later. With r of the residuals, averaged over cables, M is
known far better, and in every direction, than from sums J'e of a few blocks of the record. Residuals are P_k e_k less
what parameters absorb, with P_k = 1 - R_k R_k' for unknown poses: the sum of all e_k'e_(k+l) is r(l) times the sum
of all tr(P_k P_(k+l)), less the sum of all tr(J_k C J_(k+l)') with the covariance C of the parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.fft import next_fast_len

from .model import Model, State
from .parameters import OF_CABLE, OF_ROBOT
from .projection import Part, equations_of, parts
from .sightings import SEEN

LONGEST = 4000  # samples that are compared with each other
SHORT = 10  # times the longest lag in a record; of longer ones too few products are known
MOST_ABSORBED = 0.5  # of the spare equations
ROUNDS = 3
FEWEST = 200  # samples, of which sums of products of J'e are known
LEAST = 1e-3  # root of the share of an equation that is left where poses adapt to it
CERTAIN, BY_CHANCE = 3.0, 2.0  # standard deviations of independent errors that neighbours, and others, must exceed


class Equations(NamedTuple):
    """Equations of one kind, with poses eliminated and independent errors: each sample's, multiplied by P^1/2.

    Derivatives times a root of the covariance X (n, k, r), residuals (n, k), and P^1/2 (n, k, k).
    """

    X: np.ndarray
    residuals: np.ndarray
    P: np.ndarray

    @classmethod
    def of(cls, X: np.ndarray, residuals: np.ndarray, weights: np.ndarray, poses: np.ndarray | None) -> Equations:
        """Return the equations from P times these and R, (n, k, 6), or None where poses are exact."""
        P = weights[:, :, None] * np.eye(weights.shape[1])
        if poses is None:
            return cls(X, residuals, P)
        values, vectors = np.linalg.eigh(P - poses @ np.swapaxes(poses, 1, 2))
        roots, back = np.sqrt(np.maximum(values, 0.0))[:, None], np.swapaxes(vectors, 1, 2)
        inverse = (vectors / np.where(roots > LEAST, roots, np.inf)) @ back
        return cls(inverse @ X, (inverse @ residuals[..., None])[..., 0], (vectors * roots) @ back)


def information_of(model: Model, state: State, root: np.ndarray, white: np.ndarray) -> tuple[np.ndarray, float, int]:
    """Return root'M root (r, r), the factor of variances on average, at least 1, and for how many samples errors last.

    - `root`: square root of the covariance of the parameters for independent errors with a sigma of 1, (p, r).
    - `white`: the result for independent errors, (r, r).
    """
    count = len(model.measurements)
    equations = equations_of(model, state)

    def windows() -> Iterator[list[Equations]]:
        held: list[list[Equations]] = []
        for part in parts(model, state, equations):
            held.append(list(_kinds(part, root)))
            if sum(len(kinds[0].X) for kinds in held) >= LONGEST:
                yield _joined(held)
                held = []
        if held:
            yield _joined(held)

    short = list(windows()) if count <= LONGEST else None
    every: Callable[[], Iterator[list[Equations]]] = windows if short is None else lambda: iter(short)
    lags = max(min(count, LONGEST) // SHORT, 1)
    M, found, r = white, list[np.ndarray](), list[np.ndarray]()
    for _ in range(1 if short is None else ROUNDS):  # parameters absorb little of a long log
        values, vectors = np.linalg.eigh(M)
        spread = vectors * np.sqrt(np.maximum(values, 0.0))
        found = [
            np.sum(of, axis=0)
            for of in zip(*([_lagged(k, spread, lags) for k in kinds] for kinds in every()), strict=True)
        ]
        r = [_correlation(*of) for of in found]
        if max(map(len, r)) == 1:
            return white, 1.0, 0
        M = sum((_added(kinds[0], r[0]) for kinds in every()), white)
    # Errors and derivatives may change together, as where a platform rests, and errors of forces differ by direction.
    first = np.concatenate([[1.0], np.full(lags - 1, 2.0)])
    sums = [
        float(first[: len(k)] @ of[3, : len(k)]) * of[1, 0] / max(of[0, 0], 1e-300)
        for of, k in zip(found, r, strict=True)
    ]
    usual, factor = max(float(np.trace(white)), 1e-300), float(np.trace(M)) / max(float(np.trace(white)), 1e-300)
    own = sum(sums) / usual
    if count >= FEWEST and own > factor * (1 + BY_CHANCE * np.sqrt(4 * max(map(len, r)) / (count * usual))):
        M, factor = M * own / factor, own
    if factor <= 1:
        return white, 1.0, 0
    values, vectors = np.linalg.eigh(M)  # a sum of finitely many lags may be negative somewhere
    least = np.einsum("ri,rs,si->i", vectors, white, vectors)
    return (vectors * np.maximum(values, least)) @ vectors.T, factor, max(map(len, r)) - 1


def _joined(held: list[list[Equations]]) -> list[Equations]:
    """Return the equations of successive parts of a log, kind by kind."""
    return [Equations(*map(np.concatenate, zip(*kinds, strict=True))) for kinds in zip(*held, strict=True)]


def _autocovariance(X: np.ndarray, lags: int) -> np.ndarray:
    """Return the sums of products of the rows of X (n, ...) with those l rows later, (lags,)."""
    n, columns = len(X), X.reshape(len(X), -1)
    size = next_fast_len(n + min(lags, n), real=True)
    spectrum = (np.abs(np.fft.rfft(columns, size, axis=0)) ** 2).sum(axis=1)
    return np.pad(np.fft.irfft(spectrum, size)[: min(lags, n)], (0, max(lags - n, 0)))


def _lagged(kind: Equations, spread: np.ndarray, lags: int) -> np.ndarray:
    """Return sums over samples of e_k'e_(k+l), tr(P_k P_(k+l)), what parameters absorb, and g_k'g_(k+l), (4, lags)."""
    g = np.einsum("nkr,nk->nr", kind.X, kind.residuals)
    return np.stack([_autocovariance(of, lags) for of in (kind.residuals, kind.P, kind.X @ spread, g)])


def _correlation(products: np.ndarray, spare: np.ndarray, absorbed: np.ndarray, _: np.ndarray) -> np.ndarray:
    """Return the autocorrelation of errors from lag 0 to the first at which it may be chance."""
    absorbed = absorbed * min(1.0, MOST_ABSORBED * spare[0] / max(absorbed[0], 1e-300))
    noise = products[0] / max(spare[0] - absorbed[0], 1e-9)
    r = (products + noise * absorbed) / np.maximum(spare, 1e-9 * max(spare[0], 1e-9))
    r = r / max(r[0], 1e-300)
    chance = BY_CHANCE * np.sqrt(spare[0]) / np.maximum(spare, 1e-9)
    chance[1:2] *= CERTAIN / BY_CHANCE
    ends = np.flatnonzero(~(r[1:] > chance[1:]))
    return r[: 1 + (int(ends[0]) if ends.size else len(r) - 1)]


def _added(kind: Equations, r: np.ndarray) -> np.ndarray:
    """Return the sum of r(|l|) X_k'X_(k+l) over all samples of a kind and l other than 0, (r, r)."""
    X, n = kind.X, len(kind.X)
    r = r[1:n]
    size = next_fast_len(n + len(r) + 1, real=True)
    around = np.concatenate([[0.0], r, np.zeros(size - 2 * len(r) - 1), r[::-1]])
    X = np.fft.irfft(np.fft.rfft(X, size, axis=0) * np.fft.rfft(around).real[:, None, None], size, axis=0)[:n]
    total = kind.X.reshape(-1, X.shape[2]).T @ X.reshape(-1, X.shape[2])
    return (total + total.T) / 2


def readings_of(part: Part, root: np.ndarray) -> Equations:
    """Return the equations of the readings of all cables, with derivatives times a root (p, r)."""
    m = part.model.robot.m
    rows = (part.without_poses(i) for i in range(m))
    X = np.stack([J @ root[columns] for J, columns in rows], axis=1)
    poses = None if part.inverse_root is None else np.stack([part.root(i) for i in range(m)], axis=1)
    return Equations.of(X, part.residuals.T, part.model.weights.T.astype(float), poses)


def _kinds(part: Part, root: np.ndarray) -> Iterator[Equations]:
    """Yield the equations of readings, of the balance of forces, and of the directions of the cables."""
    model, scale, inverse_root, Y = part.model, part.scale, part.inverse_root, part.Y
    varies, forces, seen = model.parameters.varies, part.derivatives.balance, part.derivatives.directions
    yield readings_of(part, root)
    if forces is not None and forces.by_parameters is not None and forces.by_pose is not None:
        H, poses = forces.by_parameters[..., varies] / scale[varies], None
        if inverse_root is not None and Y is not None:
            poses = forces.by_pose * model.poses_vary[:, None] @ np.swapaxes(inverse_root, 1, 2)
            H = H - poses @ Y
        yield Equations.of(H @ root, forces.residuals, np.ones_like(forces.residuals), poses)
    if seen is None or seen.cables is None or seen.robot is None or seen.poses is None:
        return
    found: list[tuple[np.ndarray, np.ndarray]] = []
    for i, e in enumerate(seen.residuals):
        J, R = np.zeros((*e.shape, model.parameters.count)), np.zeros((*e.shape, 6))
        J[..., i * OF_CABLE + np.array(SEEN)] = seen.cables[i]
        J[..., model.parameters.clock : model.parameters.clock + OF_ROBOT] = seen.robot[i]
        J = J[..., varies] / scale[varies]  # (n, 3, p)
        if inverse_root is not None and Y is not None:
            R = (seen.poses[i] * model.poses_vary[:, None, :6]) @ np.swapaxes(inverse_root[:, :, :6], 1, 2)
            J = J - R @ Y
        found.append((J @ root, R))
    X, R = (np.concatenate(of, axis=1) for of in zip(*found, strict=True))
    e = np.concatenate(list(seen.residuals), axis=1)
    yield Equations.of(X, e, np.ones_like(e), R)
