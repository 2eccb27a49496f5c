"""Cross-validation: a small residual of the training samples does not prove that more parameters help.

The workspace is cut into regions across the principal direction of the readings, every other region is fitted, and
the lengths of the others are predicted (unknown poses are estimated again). Then the two halves are swapped. So the
outermost samples are extrapolated: blocks in time of a motion that repeats would only be interpolated.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ...base.display import Displayed
from ...base.errors import InputError
from ...models.robot import Robot
from ..logs.measurements import Measurements
from .balance import hangs, needs_balance
from .clock import is_still
from .considered import from_thrusts
from .enough import check_enough, is_enough, usual
from .fit import fit
from .geometry import length_of
from .hanging import carrying
from .model import Model, State
from .parameters import GROUPS, IN_BALANCE, Parameters
from .solving import Solved, cleaned, covariance_of, lengths_of, model_of, solve
from .starts import fit_from
from .turning import turning

REGIONS = 6  # of the workspace
MOST_COMPARED = 1500  # samples
ENOUGH = 1e-6  # of the sum of squares, of a step that a fit need not take
MOST_STEPS = 40  # of a fit with measured poses, which is nearly linear: others do not converge
FEWEST = 40  # samples in all; of fewer, every other sample is left out
CHANCE = 3.0  # times the logarithm of the number of residuals, by which a parameter of forces must reduce their squares
UNEXPLAINED = 1.05  # times the stated standard deviation, of residuals that parameters may explain
CLEARLY, EXPLAINED = 1.15, 0.5  # times smaller errors of validation samples, or share of the variance that repeats
WORSE = 1.02  # of the smallest error left out that a smaller set of parameters may have
CLEANED = {"anchors", "offsets", "clock"}  # found while wrong readings are looked for
FORCES = ("mass", "com", "capstan", "friction", "zeros")  # of which auto selects
ALWAYS = ("clock", "frame", "body", *IN_BALANCE)  # groups that the sets of a comparison share
CERTAIN = 3.0  # standard deviations that a clock offset must differ from 0
NESTED: tuple[tuple[str, ...], ...] = (
    (),
    ("offsets",),
    ("anchors",),
    ("anchors", "offsets"),
    ("anchors", "attachments", "offsets"),
    ("anchors", "offsets", "scales"),
    ("anchors", "offsets", "scales", "build-up"),
    ("anchors", "attachments", "offsets", "scales"),
    ("anchors", "attachments", "offsets", "scales", "build-up"),
    ("anchors", "attachments", "offsets", "radii"),
    ("anchors", "attachments", "offsets", "scales", "radii"),
)


class Compared(NamedTuple):
    """A parameter set, and the root mean square of its training and validation residuals [m].

    With unknown poses both are corrected for the part of the errors that the poses absorb. Inf if half of the samples
    do not determine the parameters, or a fit did not converge. `balance` is the root mean square of the validation
    residuals of forces, in their standard deviations; nan without forces.
    """

    free: tuple[str, ...]
    fitted: float
    left_out: float
    balance: float = np.nan


@dataclass(frozen=True)
class HeldOut(Displayed):
    """Errors of cross-validation.

    Attributes:
        before: Root mean square of the residuals with the file's parameters [m].
        after: Root mean square with the parameters estimated from the other half [m].
        sets: The parameter sets, from the empty set (the file) to the full set.
        best: The smallest set with an error at most 2 % above the smallest error of all.
    """

    before: float
    after: float
    sets: tuple[Compared, ...]
    best: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as plain data."""
        sets = [{**one._asdict(), "free": list(one.free)} for one in self.sets]
        return {"before": self.before, "after": self.after, "sets": sets, "best": list(self.best)}


def halves(measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    """Return the samples of the two halves: every other region of the workspace, or sample of a short record."""
    count, y = len(measurements), measurements.lengths
    y = np.clip(y, *np.quantile(y, [0.01, 0.99], axis=0))
    y = y - y.mean(axis=0)
    along = y @ np.linalg.eigh(y.T @ y)[1][:, -1]
    rank = np.argsort(np.argsort(along, kind="stable"), kind="stable")
    region = rank * (REGIONS if count >= FEWEST else count) // count
    return np.flatnonzero(region % 2 == 0), np.flatnonzero(region % 2 == 1)


def compare(solved: Solved, free: tuple[str, ...], prior: dict[str, float]) -> HeldOut:
    """Cross-validate the parameter sets within `free`, of a fit that is checked."""
    always = tuple(name for name in free if name in ALWAYS)
    sets = [one for one in NESTED if set(one) < set(free) - set(always)]
    sets = [(*one, *always) if one else one for one in sets]
    return _compare(solved, [*(sets or [()]), free], prior)


def select(robot: Robot, measurements: Measurements, outliers: bool) -> tuple[str, ...]:
    """Return the smallest parameter set whose cross-validation error is close to the best.

    The sets are empty (the file), offsets alone, anchors, both, and these with attachments, scales, build-up,
    pulley radii and, with tensions, stiffness, or elasticity if weight determines the tensions; with a clock offset
    if times and poses of a motion were measured. Attachments are left out if the platform hardly turns. Before,
    mass, CoM and friction are added one by one if they let the balance of forces of the validation samples be
    predicted better. With `outliers`, slips and outliers are removed first. Raises `InputError` if there are too
    few measurements even for the offsets.
    """
    sets = _nested(robot, measurements)
    check_enough(robot, measurements, ("offsets",), {})
    clock, frames = ("clock",) if "clock" in usual(robot, measurements) else (), measurements.framed
    always = (*clock, *frames)
    first = [one for one in sets if one and set(one) <= CLEANED and is_enough(robot, measurements, (*one, *always))][-1]
    solved = solve(robot, measurements, (*first, *always), {}, outliers)
    if clock and not CERTAIN * _clock_sigma(solved) < abs(solved.fit.state.x[solved.model.parameters.clock]):
        # Errors of the poses' velocities let a clock offset seem certain where the lengths hardly change.
        always = frames
    forces = _forces(solved, (*first, *always))
    sets += [(*one, *_of_stretch(solved)) for one in sets if "offsets" in one and _of_stretch(solved)]
    best = _compare(solved, [(*one, *always, *forces) if one else one for one in sets], {}).best
    for word in forces if best else ():
        without = tuple(name for name in best if name != word)
        less, whole = (one.balance for one in _compare(solved, [without, best], {}, True).sets)
        if not _clearly_less(solved, whole, less):  # it had only made up for a wrong geometry
            best = without
    return best


def extended(solved: Solved, free: tuple[str, ...], prior: dict[str, float]) -> tuple[str, ...]:
    """Return `free` with attachments, scales, build-up, radii and elasticity as far as they explain errors that repeat.

    They do if validation samples are predicted clearly better, or by half of the errors that repeat.
    """
    of = solved.model
    known = {"anchors", "offsets"} <= {*free} and not of.size_is_open and of.robot.fixed_lengths is None
    explained = solved.fit.cost < UNEXPLAINED**2 * of.weights.sum()
    if not known or explained or is_still(of.measurements) or (repeats := solved.noise.repeating) is None:
        return free
    sets = [tuple({*free, *one}) for one in _nested(of.robot, of.measurements)]
    if _of_stretch(solved) and not {"elasticity", "stiffness"} & {*free}:
        sets += [(*one, "elasticity") for one in sets]
    held_out = _compare(solved, [*dict.fromkeys(tuple(name for name in GROUPS if name in one) for one in sets)], prior)
    errors = {one.free: one.left_out for one in held_out.sets}
    residuals = lengths_of(of, solved.fit.state).T[of.weights]
    part = EXPLAINED * repeats.sigma**2 * float((residuals**2).mean())
    least = max(errors[free] / CLEARLY, np.sqrt(max(errors[free] ** 2 - part, 0.0)))
    return held_out.best if errors[held_out.best] < least else free


def _nested(robot: Robot, measurements: Measurements) -> list[tuple[str, ...]]:
    """Return the nested sets, without radii if there are no pulleys, or attachments if the platform hardly turns."""
    turns = turning(robot, measurements)
    sets = [one for one in NESTED if "radii" not in one or robot.pulley_radii.any()]
    return [one for one in sets if "attachments" not in one or turns is None or turns.enough]


def _of_stretch(solved: Solved) -> tuple[str, ...]:
    """Return the parameter that stretch of the cables may add, if their tensions are known."""
    of = solved.model
    if of.measurements.tensions is not None:
        return ("stiffness",)
    hung = hangs(of.robot, of.measurements) and of.forces is not None and of.forces.motion_is_known
    return ("elasticity",) if hung else ()


def _clearly_less(solved: Solved, balance: float, other: float) -> bool:
    """Return whether an error of forces is less than another by more than one more parameter does by chance."""
    count = 6 * min(len(solved.model.measurements), MOST_COMPARED)
    return bool(count * (other**2 - balance**2) > CHANCE * np.log(count) * balance**2)


def _forces(solved: Solved, free: tuple[str, ...]) -> tuple[str, ...]:
    """Return which of mass, CoM and friction the balance of forces needs beside `free`, if there are forces."""
    given = solved.model.measurements
    words = ("com",) if given.tensions is None else FORCES
    if from_thrusts(solved.model.robot):
        words = tuple(word for word in words if word != "zeros")
    model = replace(solved.model, weighs=True)
    has_forces = given.tensions is not None or needs_balance(model.robot, given)
    if not (has_forces and model.robot.weight and model.balanced):
        return ()
    chosen: tuple[str, ...] = ()
    best = _compare(solved, [free], {}, True).sets[0].balance
    while left := [word for word in words if word not in chosen]:
        tried = _compare(solved, [(*free, *chosen, word) for word in left], {}, True).sets
        least = min(range(len(left)), key=lambda i: tried[i].balance)
        if not _clearly_less(solved, tried[least].balance, best):
            break
        chosen, best = (*chosen, left[least]), tried[least].balance
    return chosen


def _clock_sigma(solved: Solved) -> float:
    """Return the standard deviation of the clock offset [s]."""
    of = solved.model.parameters
    at = int(np.flatnonzero(np.flatnonzero(of.varies) == of.clock)[0])
    variance = covariance_of(solved)[at, at]
    return float(np.sqrt(variance)) if solved.observability.determined[at] else np.inf


def _compare(solved: Solved, sets: list[tuple[str, ...]], prior: dict[str, float], weighs: bool = False) -> HeldOut:
    """Cross-validate parameter sets; with `weighs` the balance of forces is part of all fits."""
    measurements, weights = cleaned(solved)
    of = solved.model
    wholes = {}
    for clock in {"clock" in one for one in sets} | {False}:
        whole = model_of(of.robot, measurements, ("clock",) if clock else (), {}, of.track, weights)
        of_forces: dict[str, Any] = {name: getattr(of, name) for name in ("noise", "unbalanced", "ahead")}
        # A fit of a hanging platform may begin with tensions of quite another geometry.
        of_forces["felt"] = carrying(of, solved.fit.state, of.felt is not None) or of.felt
        wholes[clock] = replace(whole, weighs=weighs, **of_forces)
    if len(measurements) > MOST_COMPARED:
        rows = np.linspace(0, len(measurements) - 1, MOST_COMPARED).astype(int)
        wholes = {clock: whole.only(rows) for clock, whole in wholes.items()}
    parts = halves(wholes[False].measurements)
    compared = []
    before = float(np.sqrt(_mean_square(*poses_fitted(wholes[False])))) if () in sets else np.nan
    for free in sets:
        if not free:
            compared.append(Compared((), before, before))
            continue
        own = {name: value for name, value in prior.items() if name in free}
        whole = wholes["clock" in free]
        results = [_predict(whole, free, own, solved, parts[i], parts[1 - i]) for i in range(2)]
        known = [result for result in results if result is not None]
        means = np.sqrt(np.mean(known, axis=0)) if len(known) == 2 else np.full(3, np.inf)
        compared.append(Compared(free, *means.tolist()))
    best = min(compared, key=lambda one: one.left_out)
    good = [one for one in compared if one.left_out <= WORSE * best.left_out]
    chosen = min(good, key=lambda one: Parameters(of.robot, one.free).varies.sum(), default=best)
    return HeldOut(before, compared[-1].left_out, tuple(compared), chosen.free)


def _predict(
    whole: Model, free: tuple[str, ...], prior: dict[str, float], solved: Solved, fitted: np.ndarray, left: np.ndarray
) -> tuple[float, float, float] | None:
    """Return the mean squares of training and validation [m^2], and of the balance of forces in the latter.

    None with too few samples, or if no fit converged.
    """
    if not (len(fitted) and len(left)):
        return None
    try:
        check_enough(whole.robot, whole.measurements.only(fitted), free, prior)
    except InputError:
        return None
    parameters = Parameters(whole.robot, free)
    model = replace(whole.only(fitted), parameters=parameters, prior=prior)
    length = length_of(whole.robot)
    begin = model.begin()
    begin.x[parameters.clock] = solved.fit.state.x[parameters.clock] if "clock" in free else 0.0
    if model.has_unknown_poses:
        found = fit_from(model, begin, length, enough=ENOUGH)[0]
    else:
        found = fit(model, begin, length, MOST_STEPS, enough=ENOUGH)
    if not found.converged:
        return None
    # Lengths are predicted at poses as without these parameters: forces would move them.
    nothing = replace(whole.only(left), parameters=Parameters(whole.robot, ()))
    state = nothing.begin()._replace(x=found.state.x)
    state = fit_from(nothing, state, length, enough=ENOUGH)[0].state
    weighed = replace(nothing, weighs=whole.weighs or not set(IN_BALANCE).isdisjoint(free))
    return _mean_square(model, found.state), _mean_square(nothing, state), _unbalanced(weighed, state)


def _unbalanced(model: Model, state: State) -> float:
    """Return the mean square of the residuals of forces, in their standard deviations; nan without forces."""
    used = model.inside(state) if model.unbalanced is None else model.inside(state) & ~model.unbalanced
    if model.balanced is None or not used.any():
        return np.nan
    return float((model.residuals(state).balance ** 2).sum() / max(int(model.balanced.equations[used].sum()), 1))


def _mean_square(model: Model, state: State) -> float:
    """Return the mean square of the lengths' residuals [m^2], corrected for the part that unknown poses absorb."""
    used = model.weights & model.inside(state)
    squares = float((lengths_of(model, state).T[used] ** 2).sum())
    unknown = np.isinf(model.pose_sigmas)
    absorbed = unknown.sum(axis=1)
    if model.balanced or model.measurements.directions is not None:
        # For poses that need forces or directions too, lengths cannot absorb more errors than there are lengths.
        absorbed = np.minimum(absorbed, model.robot.m - 1)
    return squares / max(int(np.maximum(used.sum(axis=0) - absorbed, 0).sum()), 1)


def poses_fitted(model: Model) -> tuple[Model, State]:
    """Return the model without free parameters, and the poses that fit the lengths best with the robot's file."""
    nothing = replace(model, parameters=Parameters(model.robot, ()), prior={}, kept=None)
    return nothing, fit_from(nothing, nothing.begin(), length_of(model.robot))[0].state
