"""`considered`: what errors of cable ends that a fit takes as exact do to its parameters.

Parameters f are fitted with the ends c of the file. With the normal matrix S of both, an error of the ends moves the
fit by -S_ff^-1 S_fc dc, whose covariance is added to that of the readings' noise (consider covariance, Schmidt 1966).

Without measured positions, or with locked winches, anchors are as wrong as residuals show, if these show more than the
usual errors of files.
For them, with T = S_cc - S_cf S_ff^-1 S_fc = Q diag(t) Q' and the gradient g of half the sum of squares, errors of
variance s^2 give the components of Q'g the variances t + t^2 s^2 for noise as stated; s maximises their likelihood.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...models.robot import Robot
from .clock import is_still
from .geometry import length_of
from .model import Model, State
from .normal_equations import NormalEquations, metric
from .parameters import COLUMNS, GROUPS, IN_BALANCE, OF_CABLE, Parameters

ENDS = ("anchors", "attachments")
OF_THRUSTS = 0.005  # error of thrusts, up to which `thrust_gains` leaves them as they are
SLACK = 1e-6  # of a carrier's weight
ACCURATE, ACCURATELY = 0.005, 0.001  # [m], and share of the cables' length: errors of cable ends in files
LEAST_NOISE = 0.01  # of the stated variance
LARGEST = 0.03  # of the cables' length, of errors that residuals show
SEEN = 1e-9  # of the largest information about the anchors, below which a direction is not seen


class Considered(NamedTuple):
    """The covariance that errors of fixed cable ends add, (p, p), and the standard deviation of the anchors' [m]."""

    covariance: np.ndarray
    error: float


def from_thrusts(robot: Robot) -> bool:
    """Return whether tensions follow from the thrusts of carriers, and so have no load cells with zeros."""
    return any(carrier.actuators for carrier in robot.carriers)


def usual_error(model: Model) -> float:
    """Return the standard deviation of each coordinate of a cable's end in a file without `uncertainty` [m]."""
    return min(ACCURATE, ACCURATELY * length_of(model.robot))


def considered(model: Model, state: State, inverse: np.ndarray, excess: float, redundancy: float) -> Considered:
    """Return the covariance that errors of fixed cable ends add, in the order and units of the parameters.

    These errors are the file's `uncertainty`, the usual errors of ends that it does not contain, and errors of thrusts
    from which tensions were computed. For parameters of the geometry only errors of anchors on carriers at rest count,
    because it is estimated relative to the attachments. Forces are not relative to anything, so neither are anchors by
    poses that they determine, and all errors count.

    - `inverse`: pseudo-inverse of the normal matrix of the free parameters, in metres, (p, p).
    - `excess`, `redundancy`: as in `Noise`, of the fit.
    """
    of, uncertain = model.parameters, model.robot.uncertainty
    varies, in_balance = np.flatnonzero(of.varies), Parameters(model.robot, IN_BALANCE).varies
    of_forces = in_balance[varies[varies < len(in_balance)]]
    of_forces = np.pad(of_forces, (0, len(varies) - len(of_forces)))  # slips are last
    of_forces |= "anchors" in of.groups and model.size_is_open and model.balanced is not None
    thrusts = ("gains",) if from_thrusts(of.robot) and model.measurements.tensions is not None else ()
    groups = tuple(name for name in GROUPS if name in (*of.groups, *ENDS, *thrusts))
    stand = model.measurements.carrier_poses is None  # else measurements tell where anchors are, nearly alone
    if groups == of.groups or not (of_forces.any() or (stand and "anchors" not in of.groups)):
        return Considered(np.zeros((len(varies), len(varies))), usual_error(model))
    whole = replace(model, parameters=replace(of, groups=groups))
    every = np.flatnonzero(whole.parameters.varies)
    free = np.isin(every, varies)
    scale = metric(model)
    equations = NormalEquations.at(whole, state, scale)
    S, across = equations.S, inverse @ equations.S[np.ix_(free, ~free)]
    error, anchors = usual_error(model), Parameters(model.robot, ENDS[:1]).varies[every[~free]]
    shown = model.size_is_open or is_still(model.measurements)
    if shown and uncertain is None and redundancy > 0 and stand and anchors.any():
        T = (S[np.ix_(~free, ~free)] - S[np.ix_(~free, free)] @ across)[np.ix_(anchors, anchors)]
        gradient = (equations.b[~free] - across.T @ equations.b[free])[anchors]
        error = _shown(T, gradient, excess**2 * redundancy, redundancy, error, LARGEST * length_of(model.robot))
    errors = np.diag(np.full(whole.parameters.count, usual_error(model) ** 2))
    errors[np.flatnonzero(Parameters(model.robot, ENDS[:1]).varies)] *= (error / usual_error(model)) ** 2
    if uncertain is not None:
        named = of.places(uncertain.parameters)
        errors[named], errors[:, named] = 0.0, 0.0
        errors[np.ix_(named, named)] = uncertain.matrix
    if thrusts and "gains" not in of.groups:
        tensions = np.nanmean(np.abs(model.measurements.tensions), axis=0)
        masses = np.array([carrier.body.mass if carrier.body else 0.0 for carrier in of.robot.carriers])
        weights = masses[of.robot.carrier_of_cable] * np.linalg.norm(of.robot.gravity)  # which thrusts carry, too
        gains = OF_CABLE * np.arange(of.robot.m) + COLUMNS["gains"][0]
        pulls = tensions > SLACK * weights  # gains of others have no effect
        errors[gains, gains] = (OF_THRUSTS * (1 + np.divide(weights, tensions, out=0 * weights, where=pulls))) ** 2
    errors = errors[np.ix_(every[~free], every[~free])]
    moved = across / scale[varies, None]
    moved[np.ix_(~of_forces, ~(anchors & stand))] = 0.0
    return Considered(moved @ errors @ moved.T, error)


def _shown(T: np.ndarray, gradient: np.ndarray, cost: float, redundancy: float, least: float, most: float) -> float:
    """Return the most likely standard deviation of errors between `least` and `most`, all three in metres.

    The part of the sum of squares `cost` that errors of anchors do not explain shows how large the noise is.
    """
    values, Q = np.linalg.eigh(T)
    seen = values > SEEN * values[-1]
    t, squares = values[seen], (Q.T @ gradient)[seen] ** 2
    spare = redundancy - len(t)
    noise = max(cost - float((squares / t).sum()), 0.0) / spare if spare > len(t) else 1.0
    noise = max(noise, LEAST_NOISE)
    s = np.geomspace(least, max(least, most), 100)
    variances = t * noise + t**2 * s[:, None] ** 2
    return float(s[np.argmin((np.log(variances) + squares / variances).sum(axis=1))])
