"""`Matching`: a recording compared with its plant, and which of the model's parameters explains the difference."""

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any, NamedTuple

import numpy as np

from ..estimation.calibration.geometry import length_of
from .replayed_robot import Parameters
from .windows import Windows

# For each parameter: its smallest and largest value, and the step of its derivative; for the CoM over the platform's
# length, for anchors over the cables' length.
RANGES = {
    "delay": (-0.2, 0.2, 1e-3),
    "friction": (0.0, 1e5, 0.1),
    "mass": (0.2, 5.0, 0.01),
    "stiffness": (0.1, 10.0, 0.02),
    "tilt": (-0.5, 0.5, 2e-3),
    "com": (-1.0, 1.0, 2e-3),
    "anchors": (-0.3, 0.3, 2e-4),
    "load_cells": (-0.9, 10.0, 0.01),
    "cable_friction": (-1e5, 1e5, 0.1),
    "thrusts": (-0.9, 10.0, 0.01),
}
ALONE = ("delay", "friction", "mass", "stiffness")  # parameters of one number, which a fit may write
STEPS, HALVINGS = 4, 3  # of Gauss and Newton, and of a step that is too long
LEAST = 0.5, 0.1  # share that a parameter of several numbers, or of one by measured poses, must explain to be named
REMOVED = 0.01  # of the sum of squares, from which on a parameter is named
DOUBT = 5e-4  # probability, on each side, that a parameter is named which only the scatter of the windows changes
TIED = 0.1  # of what the best explains: others that explain as much, up to this, are not distinguished from it
SHOWN = 0.1  # of a parameter (of 0.1 s, a third of the length, a tenth of the tensions): its deviation if not shown
LARGE = 0.3  # of the cables' length: displacements of anchors in which a tenth of it is plausible
BLURRED = 0.2  # of the squares of the derivative by the stiffness: what may be noise of lengths
FARTHEST = 5.0  # standard deviations of a start
OUTLYING = 25.0  # times the usual sum of squares of a window
LOST = 1e6  # what a residual is where the simulation diverges


class Explanation(NamedTuple):
    """Share of the residuals that one parameter alone explains."""

    name: str  # a field of `Parameters`
    # its value in the model, the value with the least residual and the standard deviation of that, by the scatter of
    # the windows and the noise: in [s], [N], or as a factor of the file's; several numbers as in `Parameters`
    before: Any
    value: Any
    sigma: Any
    explained: float  # share of the squared residuals beyond the noise that it removes
    shown: bool  # True if the recording shows it well enough to be found
    named: bool  # True if it certainly explains something


class Match(NamedTuple):
    """Residuals with some parameters."""

    parameters: Parameters  # the parameters
    drift: np.ndarray  # measured minus simulated over the noise, from the starts on, (W, R)
    # the same without what other starts would explain, and corrections of starts over their deviations, (W, R + P)
    left: np.ndarray

    @property
    def cost(self) -> np.ndarray:
        """Return the sum of squares of each window, (W,)."""
        return np.sum(self.left**2, axis=1)


class Matching:
    """Compare a recording with its plant for different parameters."""

    def __init__(self, windows: Windows, parameters: Parameters):
        # the windows, their starts corrected within the noise of the recording. Their noise includes
        # the noise of simulations.
        self.windows = windows
        shaken = windows.shaken()
        self._linearise(parameters)
        echo, sensors = self._echo(self.at(parameters), shaken), dict(windows.noise)
        # what residuals are if nothing except noise differs, in windows from the recorded state on, by kind
        self.noise = self._with_echo(sensors, echo)
        windows.noise = self._with_echo(sensors, self._project(echo))
        self._linearise(parameters)
        self.first = self.at(parameters)  # residuals with the first parameters
        self._echoed = self._project(self._echo(self.first, shaken))
        # windows that are no outliers, (W,) of bool
        self.kept = self._good & (self.first.cost <= OUTLYING * np.median(self.first.cost))

    def _linearise(self, parameters: Parameters) -> None:
        """Correct the starts where that reduces residuals, and keep how these depend on them."""
        windows, sigma = self.windows, self.windows.start_sigma
        every = windows.predict(parameters, nudged=True)
        self._good = np.asarray(np.isfinite(every).all(axis=(0, 2)))
        every = np.where(self._good[:, None], every, 0.0)
        known = np.tile(np.diag(1 / sigma), (len(windows.starts), 1, 1))
        Q, R = np.linalg.qr(np.concatenate([np.moveaxis(every[1:], 0, 2), known], axis=1))  # (W, R + P, P)
        self._Q, given = Q, self._with_start(every[0])
        better = windows.start - np.linalg.solve(R, Q.swapaxes(1, 2) @ given[..., None])[..., 0]
        # With a wrong model they would get to where nothing is linear.
        before, windows.start = windows.start, np.clip(better, -FARTHEST * sigma, FARTHEST * sigma)
        improved = np.sum(self._away(parameters) ** 2, axis=1) < np.sum(given**2, axis=1)
        windows.start = np.where(improved[:, None], windows.start, before)

    def _away(self, parameters: Parameters) -> np.ndarray:
        return self._with_start(np.nan_to_num(self.windows.predict(parameters)[0], nan=LOST))

    def _with_start(self, residuals: np.ndarray) -> np.ndarray:
        """Return residuals with the corrections of the starts, over their deviations, (W, R + P)."""
        return np.concatenate([residuals, self.windows.start / self.windows.start_sigma], axis=1)

    def _project(self, vectors: np.ndarray) -> np.ndarray:
        """Return (W, R + P) without what other starts would explain."""
        return vectors - (self._Q @ (self._Q.swapaxes(1, 2) @ vectors[..., None]))[..., 0]

    def _echo(self, first: Match, shaken: Windows) -> np.ndarray:
        """Return what the noise of the recording does to the simulation of a match, over the noise, (W, R + P)."""
        shaken.start, shaken.noise = self.windows.start, self.windows.noise
        away = np.where(first.drift == LOST, 0.0, shaken.predict(first.parameters)[0] - first.drift)
        return np.concatenate([np.nan_to_num(away), np.zeros_like(self.windows.start)], axis=1)

    def _with_echo(self, noise: Mapping[str, float], echo: np.ndarray) -> dict[str, float]:
        """Return the noise of each kind of residual, of sensors and of the simulation."""
        widths, size = self.windows.widths, self.windows.start.shape[1]
        square = np.mean(np.square(echo[:, :-size].reshape(*self.windows.rows.shape, -1)), axis=(0, 1))
        more = [part[part > 0].mean() if part.any() else 0.0 for part in np.split(square, np.cumsum(widths)[:-1])]
        return {name: float(noise[name] * np.sqrt(1 + extra)) for name, extra in zip(noise, more, strict=True)}

    def at(self, parameters: Parameters) -> Match:
        """Return the residuals for other parameters."""
        away = self._away(parameters)
        return Match(parameters, away[:, : -self.windows.start.shape[1]], self._project(away))

    def _range(self, name: str) -> tuple[float, float, float]:
        """Return the smallest and the largest value of a parameter, and the step of its derivative."""
        low, high, step = RANGES[name]
        scale = {"com": self.windows.robot.length, "anchors": length_of(self.windows.robot)}.get(name, 1.0)
        return scale * low, scale * high, scale * step

    def _size(self, name: str) -> float:
        """Return the size of a parameter, of which a standard deviation that shows it is a small share."""
        robot, usual = self.windows.robot, self.windows.usual_tension
        sizes = {"delay": 0.1, "com": robot.length, "anchors": LARGE * length_of(robot), "cable_friction": usual}
        return sizes.get(name, 1.0)

    def slope(self, first: Match, name: str) -> np.ndarray:
        """Return the derivatives of the residuals of a match by a parameter of k numbers, (k, W, R + P)."""
        (_, high, step), value, slopes = self._range(name), np.atleast_1d(getattr(first.parameters, name)), []
        for number in range(len(value)):
            away = (step if value[number] + step <= high else -step) * np.eye(len(value))[number]
            end = self.windows.predict(_with(first.parameters, name, value + away))[0]
            change = np.where(first.drift == LOST, 0.0, np.nan_to_num((end - first.drift) / away[number]))
            slopes.append(self._project(np.concatenate([change, np.zeros_like(self.windows.start)], axis=1)))
        return np.array(slopes)

    def fitted(self, first: Match, name: str, used: np.ndarray) -> tuple[Match, np.ndarray]:
        """Fit one parameter alone to windows `used`, (W,) of bool; return the match, and standard deviations (k,)."""
        (low, high, _), best, size = self._range(name), first, np.size(getattr(first.parameters, name))
        sigma, least = np.full(size, np.inf), 0.0 if size == 1 else 1 / (SHOWN * self._size(name)) ** 2
        for _ in range(STEPS):
            slope, value = self.slope(best, name)[:, used], np.atleast_1d(getattr(best.parameters, name))
            steep = np.einsum("iwr,jwr->wij", slope, slope)
            along = np.einsum("iwr,wr->wi", slope, best.left[used])
            if not np.trace(steep.sum(axis=0)) > 0:
                break
            values, along_of = np.linalg.eigh(steep.sum(axis=0))
            kept = values > least  # not changed along directions that the recording does not show
            inverse = (along_of[:, kept] / values[kept]) @ along_of[:, kept].T
            change = -inverse @ along.sum(axis=0)
            # Change by as much noise again, also on average, because simulated tensions end at zero.
            echo = np.einsum("iwr,wr->i", slope, self._echoed[used])
            scatter = np.vstack([along + steep @ change, echo]) @ inverse
            sigma = np.sqrt(np.sum(scatter**2, axis=0))
            sigma[np.diagonal(inverse) * np.diagonal(steep.sum(axis=0)) < 0.5] = np.inf  # numbers that are kept
            trials = (np.clip(value + change / 2**i, low, high) for i in range(HALVINGS))
            matches = (self.at(_with(best.parameters, name, trial)) for trial in trials)
            better = next((one for one in matches if one.cost[used].sum() < best.cost[used].sum()), None)
            if better is None:
                break
            best = better
            if (np.abs(np.atleast_1d(getattr(best.parameters, name)) - value) < 0.1 * sigma).all():
                break
            if size > 1 and best.cost[used].sum() > (1 - LEAST[0] / 2) * first.cost[used].sum():
                break  # so little explained is not named, and each step takes a simulation for each number
        return best, sigma

    def explanations(self, first: Match, used: np.ndarray) -> list[tuple[Explanation, Match]]:
        """Return what each parameter alone explains, starting at a match, in windows `used`, largest first."""
        from scipy.special import stdtrit

        found, whole, count = [], first.cost[used].sum(), float(np.count_nonzero(first.left[used]))
        certain = float(stdtrit(max(int(used.sum()) - 1, 1), 1 - DOUBT))  # quantile of Student's t
        for name in applicable(self.windows):
            match, sigma = self.fitted(first, name, used)
            before, value = (np.atleast_1d(getattr(one.parameters, name)) for one in (first, match))
            removed = whole - match.cost[used].sum()
            size = self._size(name) / (3 if name == "com" else 1)
            if name == "friction":
                size = max(10 * value[0], 0.1 * self.windows.usual_tension)
            certainly = np.abs(value - before) > certain * sigma
            low, high, _ = self._range(name)
            inside = bool(((low < value + (name == "friction")) & (value < high)).all())
            shown = inside and bool((sigma[certainly] if certainly.any() else sigma).max() < SHOWN * size)
            if name == "stiffness":  # noise of lengths, which it multiplies, would make it too small
                noise = np.sum(self._echoed[used] ** 2)
                shown = shown and noise <= BLURRED * np.sum(self.slope(first, name)[:, used] ** 2)
            explained = float(removed / max(whole - count, removed, 1e-12))
            # Poses that are computed have errors of lengths and directions, of which each parameter explains some, and
            # lengths that do not drive the plant have the errors of its poses, of which stiffness explains some.
            indirect = self.windows.recorded.computed or (name == "stiffness" and self.windows.drive == "tensions")
            least = LEAST[int(name in ALONE and not indirect)]
            enough = explained > least and removed > REMOVED * whole and whole > count  # noise needs no explanation
            named = bool(shown and certainly.any() and enough)
            old, new, sigma = (_plain(one) for one in (before, value, sigma))
            found.append((Explanation(name, old, new, sigma, explained, bool(shown), named), match))
        return sorted(found, key=lambda one: (not one[0].named, not one[0].shown, -weight(one[0])))


def fitted_again(windows: Windows, one: Explanation, parameters: Parameters) -> tuple[Explanation, Matching]:
    """Return an explanation fitted from starts that suit it, and the residuals with its value, given as `parameters`.

    Starts that were corrected for a model with a large error explain a part of that.
    """
    for _ in range(2 * STEPS):
        matching = _begun_with(windows, parameters)
        if one.name not in ALONE:
            return one, matching
        match, sigma = matching.fitted(matching.first, one.name, matching.kept)
        change = getattr(match.parameters, one.name) - one.value
        if not abs(change) > one.sigma:
            return one, matching
        parameters = match.parameters
        one = one._replace(value=one.value + change, sigma=_plain(sigma))
    return one, _begun_with(windows, parameters)


def _begun_with(windows: Windows, parameters: Parameters) -> Matching:
    """Return the comparison with starts that are corrected for these parameters alone."""
    anew = copy(windows)
    anew.start, anew.noise = np.zeros_like(windows.start), dict(windows.noise)
    return Matching(anew, parameters)


def applicable(windows: Windows) -> Sequence[str]:
    """Return the parameters on which a simulation with such commands depends."""
    recorded = windows.recorded
    felt = windows.drive != "lengths" or (recorded.tensions is not None and recorded.robot.fixed_lengths is None)
    names = {"delay": windows.commanded, "friction": felt, "mass": True, "stiffness": windows.shows_stiffness}
    names |= {"tilt": True, "com": bool(recorded.robot.dof_mask[3:].any()), "load_cells": recorded.tensions is not None}
    names |= {"cable_friction": felt, "anchors": recorded.robot.fixed_lengths is None}
    names["thrusts"] = len(windows.flown) > 0
    return [name for name, depends in names.items() if depends]


def weight(one: Explanation) -> float:
    """Return the share of an explanation, reduced if it has several numbers, because these explain more anyway.

    Displaced anchors explain nearly as much as whatever else is wrong.
    """
    several = min(np.size(one.value) - 1, 2) / 2 + (one.name == "anchors")
    return one.explained * (1 - TIED * several)


def _with(parameters: Parameters, name: str, value: np.ndarray) -> Parameters:
    return parameters._replace(**{name: _plain(value)})


def _plain(value: np.ndarray) -> Any:
    return float(value[0]) if len(value) == 1 else tuple(value.tolist())


def tied(found: Sequence[Explanation]) -> list[str]:
    """Return the name that explains most, and the names of others that explain as much; none if it explains nothing."""
    least = (1 - TIED) * found[0].explained if found and found[0].named else np.inf
    rivals = [one for one in found if one.named and one.explained >= least]
    return [one.name for one in rivals if one is found[0] or one.name in ALONE]
