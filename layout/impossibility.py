"""Proofs that no layout inside the boxes meets a requirement: `find_impossibility`.

At one pose, each cable gives t (u, r x u) with a tension inside its range, an attachment r in its box and a unit vector
u towards its box of anchors. Along a direction d that is at most t d . (u, r x u) for the best of these: for a given u
it is linear in r, so a corner of the box is the best attachment, and the best u is the projection of d_F + d_M x r on
the cone of all directions from the box of attachments to the box of anchors. The sum over the cables bounds the
wrenches of all layouts; a required wrench beyond the bound is impossible. The direction is found by Gilbert's
algorithm. It is a relaxation: u is chosen without regard to r, so that nothing follows where no such direction exists.
"""

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from ..base.display import Displayed, Fact
from ..base.text import quantity_row
from ..models.points import rotations
from ..solvers import Certificate
from .evaluation import Rows
from .variables import Variables, parts

FARTHEST, STRONGEST = 8, 8  # rows that are tried: those far from the middle, and those with the largest wrenches
_STEPS = 40
_CLEAR = 1e-6  # of the largest wrench: a smaller shortfall is no proof
_SUM = 1e3  # weight of the equation that shares sum to one


@dataclass(frozen=True, repr=False)
class Impossibility(Displayed):
    """A required wrench that no layout inside the boxes can give."""

    pose: np.ndarray  # where it is required, (6,) [m, rad]
    wrench: np.ndarray  # the required wrench about the CoM in {G}, (6,) [N, N m]
    certificate: Certificate  # the direction, what is needed along it, and the most that any layout gives

    def verify(self, variables: Variables) -> bool:
        """Return whether the direction proves it, by the bound for these variables alone."""
        cables = _relaxed(variables, self.pose)
        scale = variables.robot.wrench_scale
        d = self.certificate.direction / scale
        bound, _, _ = _support(cables, d)
        free = variables.robot.dof_mask > 0.0
        demand = float(self.certificate.direction @ self.wrench)
        return bool(not d[~free].any() and demand - bound > _CLEAR * _size(cables))

    def _headline(self) -> str:
        return self.describe()

    def _facts(self) -> list[Fact]:
        return [("pose", quantity_row(self.pose))]

    def describe(self, up: np.ndarray | None = None) -> str:
        """Describe the proof in one line."""
        text = self.certificate.text(up)
        return (
            f"no layout inside the boxes meets the requirements: at pose ({quantity_row(self.pose)}) "
            f"along {text.along}, needed "
            f"{text.needed}, available in the best layout {text.available}"
        )


class _Cables(NamedTuple):
    """Cables with the same boxes and limits."""

    cables: np.ndarray  # their numbers
    arms: np.ndarray  # (k, 3), corners of the attachments' box from the CoM, over the length
    towards: np.ndarray  # (3, j), unit vectors from corners of the attachments' box to those of the anchors' box
    t_min: float
    t_max: float


def find_impossibility(variables: Variables, rows: Rows) -> Impossibility | None:
    """Return a verified proof that the rows, of which some are tried, cannot all be met, or None."""
    robot = variables.robot
    if robot.pulley_radii.any():  # the cable leaves the pulley beside the anchor, outside its box
        return None
    scale, centre = robot.wrench_scale, rows.poses[:, :3].mean(axis=0)
    far = -np.linalg.norm(rows.poses[rows.pose_of, :3] - centre, axis=1).round(9)
    strong = -np.linalg.norm(rows.wrenches * scale, axis=1).round(9)
    tried = np.r_[np.lexsort((strong, far))[:FARTHEST], np.lexsort((far, strong))[:STRONGEST]]
    for row in dict.fromkeys(tried.tolist()):
        pose, wrench = rows.poses[rows.pose_of[row]], rows.wrenches[row]
        cables = _relaxed(variables, pose)
        d = _separating(cables, wrench * scale * robot.dof_mask, robot.dof_mask)
        if d is None:
            continue
        bound, _, at_max = _support(cables, d)
        direction = d * scale
        demand, limits = float(direction @ wrench), np.setdiff1d(np.arange(robot.m), at_max)
        none = np.zeros(robot.m)
        certificate = Certificate(direction, bound, demand, demand - bound, at_max, limits, none, robot.length)
        proof = Impossibility(pose, wrench, certificate)
        if proof.verify(variables):
            return proof
    return None


def _relaxed(variables: Variables, pose: np.ndarray) -> list[_Cables]:
    """Return what the cables of any layout are among, at a pose."""
    robot, S = variables.robot, variables.S
    low = parts(variables.fixed + np.maximum(S, 0) @ variables.low + np.minimum(S, 0) @ variables.high, robot.m)
    high = parts(variables.fixed + np.maximum(S, 0) @ variables.high + np.minimum(S, 0) @ variables.low, robot.m)
    carriers = robot.carrier_home[robot.carrier_of_cable]
    groups: dict[tuple[float, ...], list[int]] = {}
    for i in range(robot.m):
        key = (*low[0][i], *high[0][i], *low[1][i], *high[1][i], low[2][i], high[3][i], *carriers[i])
        groups.setdefault(tuple(float(x) for x in key), []).append(i)
    R, com = rotations(pose[None, 3:])[0], np.array(robot.platform.com)
    result = []
    for members in groups.values():
        i = members[0]
        turn = rotations(carriers[i][None, 3:])[0]
        anchors = _corners(low[0][i], high[0][i]) @ turn.T + carriers[i, :3]
        attachments = _corners(low[1][i], high[1][i])
        towards = (anchors[:, None] - pose[:3] - (attachments @ R.T)[None]).reshape(-1, 3)
        lengths = np.linalg.norm(towards, axis=1)
        towards = (towards[lengths > 0.0] / lengths[lengths > 0.0, None]).T
        arms = (attachments - com) @ R.T / robot.length
        result.append(_Cables(np.array(members), arms, towards, float(low[2][i]), float(high[3][i])))
    return result


def _corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.array(list(product(*[sorted({a, b}) for a, b in zip(low.tolist(), high.tolist(), strict=True)])))


def _size(cables: list[_Cables]) -> float:
    return sum(len(each.cables) * each.t_max for each in cables)


def _support(cables: list[_Cables], d: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the most that any layout gives along d, with scaled moments, such a wrench, and the cables at t_max."""
    total, wrench, at_max = 0.0, np.zeros(6), []
    for each in cables:
        best, arm, u = -np.inf, each.arms[0], np.zeros(3)
        for r in each.arms:
            g = d[:3] + np.cross(d[3:], r)
            projected = _projected(each.towards, g)
            size = float(np.linalg.norm(projected))
            if size > 1e-9 * max(float(np.linalg.norm(g)), 1e-300):
                value, along = size, projected / size  # g . u = |projection|, and u is in the cone
            else:
                pulls = g @ each.towards
                value, along = float(pulls.max()), each.towards[:, int(pulls.argmax())]
            if value > best:
                best, arm, u = value, r, along
        t = each.t_max if best > 0.0 else each.t_min
        count = len(each.cables)
        total += count * t * best
        wrench += count * t * np.r_[u, np.cross(arm, u)]
        at_max += each.cables.tolist() if best > 0.0 else []
    return total, wrench, np.array(sorted(at_max), dtype=int)


def _separating(cables: list[_Cables], w: np.ndarray, mask: np.ndarray) -> np.ndarray | None:
    """Return a direction along which w is beyond the bound, or None, by Gilbert's algorithm."""
    size, demand = _size(cables), float(np.linalg.norm(w))
    if not demand > 0.0:
        return None
    d, nearest = w / demand, None
    columns: list[np.ndarray] = []
    for _ in range(_STEPS):
        bound, column, _ = _support(cables, d)
        if d @ w > bound + _CLEAR * size:
            return d
        if nearest is not None and bound - d @ nearest < 1e-9 * size:
            return None
        columns.append(column * mask)
        A = np.array(columns).T / size
        try:
            shares = nnls(np.vstack([A, np.full(A.shape[1], _SUM)]), np.r_[w / size, _SUM])[0]
        except RuntimeError:  # too many iterations, of numbers close to dependent
            shares = np.full(A.shape[1], 1.0 / A.shape[1])
        nearest = A @ shares / max(float(shares.sum()), 1e-12) * size
        rest = w - nearest
        distance = float(np.linalg.norm(rest))
        if distance < 1e-7 * size:
            return None
        d = rest / distance
    return None


def _projected(towards: np.ndarray, g: np.ndarray) -> np.ndarray:
    """Return the projection of g on the cone of some vectors, (3, j), or g itself, whose pull is no less."""
    try:
        return towards @ nnls(towards, g)[0]
    except RuntimeError:
        return g
