"""Residuals, and their derivatives minus the part that unknown poses absorb, by parts of a log."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .model import Derivatives, Model, State
from .normal_equations import NormalEquations, metric, pose_equations
from .parameters import OF_CABLE, normal_rows


class Projected(NamedTuple):
    """Residuals of the readings and their redundancies, (m, N)."""

    residuals: np.ndarray
    redundancy: np.ndarray


class Part(NamedTuple):
    """Some samples of a log: residuals of their readings, (m, n), and derivatives.

    - `scale`: `metric` of the whole log, (P,).
    - `inverse_root`, `Y`: as in `NormalEquations`, (n, 6, 6) and (n, 6, p), or None if no pose varies.
    """

    rows: slice
    model: Model
    residuals: np.ndarray
    derivatives: Derivatives
    scale: np.ndarray
    inverse_root: np.ndarray | None
    Y: np.ndarray | None

    def root(self, cable: int) -> np.ndarray:
        """Return L^-1 g of each reading of a cable, (n, 6), where poses vary."""
        assert self.inverse_root is not None
        G = self.derivatives.poses[cable] * self.model.poses_vary
        return np.einsum("nab,nb->na", self.inverse_root, G)

    def without_poses(self, cable: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives of one cable's residuals by k parameters, minus the poses' part, (n, k) [1/m].

        The second result has the indices of these among the parameters that vary, (k,). All other derivatives are zero.
        """
        parameters = self.model.parameters
        where, first = np.flatnonzero(parameters.varies), cable * OF_CABLE
        mine, rest = (where >= first) & (where < first + OF_CABLE), where >= parameters.clock
        own = self.derivatives.cables[cable][:, where[mine] - first]
        rows = np.hstack([own, self.derivatives.others[cable]])
        rows, columns = rows / self.scale[where[mine | rest]], np.flatnonzero(mine | rest)
        through = self.derivatives.through
        if self.Y is None and through is None:
            return rows, columns
        whole = np.zeros((len(rows), len(where)))
        if through is not None:
            whole += through[cable][:, where] / self.scale[where]
        if self.Y is not None:
            whole -= np.einsum("na,nap->np", self.root(cable), self.Y)
        whole[:, columns] += rows
        return whole, np.arange(len(where))


def equations_of(model: Model, state: State) -> NormalEquations | None:
    """Return the normal equations at a state if any pose varies, which its `parts` then need."""
    return NormalEquations.at(model, state, metric(model)) if model.poses_vary.any() else None


def parts(model: Model, state: State, equations: NormalEquations | None, backwards: bool = False) -> Iterator[Part]:
    """Yield the parts of a log, the last one first if `backwards`; all derivatives at once would need much memory."""
    scale = metric(model)
    for rows, part, own in model.parts(state, backwards):
        residuals, derivatives = part.linearised(own)
        solved = (None, None) if equations is None else (equations.inverse_root, equations.Y)
        inverse_root, Y = (None if of is None else of[rows] for of in solved)
        yield Part(rows, part, residuals.readings, derivatives, scale, inverse_root, Y)


def project(model: Model, state: State) -> Projected:
    """Return residuals, and the share of each that stays where poses adapt to the readings."""
    used = (model.weights & model.inside(state)).astype(float)
    if not model.poses_vary.any():
        return Projected(model.residuals(state).readings, used)
    residuals = np.empty(model.weights.shape)
    for rows, part, own in model.parts(state):
        found, derivatives = part.linearised(own)
        inverse_root, _, _ = pose_equations(part, found, derivatives)
        residuals[:, rows] = found.readings
        for i, by_pose in enumerate(derivatives.poses):
            root = np.einsum("nab,nb->na", inverse_root, by_pose * part.poses_vary)
            used[i, rows] -= np.einsum("na,na->n", root, root)
    return Projected(residuals, used)


def out_of_plane(model: Model, state: State, root: np.ndarray) -> np.ndarray:
    """Return what ends of cables that may be out of their plane add to the covariance of J'e times a root (p, r).

    At a distance h from the plane, a cable of length l is longer by h^2 / 2l, which derivatives at h = 0 do not show.
    With sigma s of h, 95 % of (h, h^2) are in an ellipse about 0 with variances s^2 and 6.9 s^4, as the 95 % limits of
    one and two degrees of freedom show: 3.84 + 3.84^2 / 6.9 = 5.99. The root is taken of the parameters' covariance.
    """
    rows = normal_rows(model.parameters)
    heights = ((rows[:, model.parameters.varies] @ root) ** 2).sum(axis=1)
    variances = model.parameters.table(heights @ rows**2).sum(axis=1)
    sums = np.zeros((len(variances), root.shape[1]))
    for part in parts(model, state, equations_of(model, state)) if variances.any() else ():
        gains = np.linalg.norm(part.derivatives.poses[..., :3], axis=2) / part.derivatives.lengths
        for i, one in enumerate(gains):
            rows, columns = part.without_poses(i)
            sums[i] += one @ rows @ root[columns]
    return 6.9 / 4 * (sums.T * variances**2) @ sums
