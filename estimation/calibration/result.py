"""`CalibrationData`: the numbers of a calibrated robot, with their covariance."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...base.display import BLUE, GREY, Displayed, picture
from ...base.inputs import InputError, real_array
from ...base.text import counted, quantity
from ...models import points
from ...models.part import LARGEST
from ...models.robot import Robot
from ..logs.measurements import Measurements
from .clock import is_still
from .cross_validation import WORSE, HeldOut, compare, poses_fitted
from .differences import PLAUSIBLE
from .file_errors import ENDS, offsets_are_open
from .geometry import length_of
from .load_changes import load_changes
from .missing_pulleys import MissingPulleys, missing_pulleys
from .outliers import Outlier, Slip, wrong_shares
from .parameters import IN_BALANCE, Parameter, Parameters
from .plausibility import Mistake
from .repeating_errors import Repeating
from .solving import Noise, Solved, covariance_of, lengths_of

EXACT = 1e-3  # times the stated sigma: smaller errors are as good as none
FAR = 5.0  # standard deviations of the prior
FARTHEST = 0.5  # of the cables' length, by which an anchor or an attachment may be displaced
MOST_LOST = 2.0  # times the standard deviation of the file, beyond which a calibrated end is worse than the file's
MOST_WRONG = 1 / 3  # of the readings, beyond which a fit to the others means nothing


def apart(growth: float) -> str:
    """Return how much farther apart anchors are, in per cent."""
    return f"{quantity(100 * abs(growth), digits=2)} % {'farther apart' if growth > 0 else 'closer together'}"


@dataclass(frozen=True, eq=False)
class CalibrationData(Displayed):
    """The result of `calibrate`, without figures, files and reports.

    Attributes:
        free: Groups of estimated parameters.
        prior: Standard deviations about the file's values, if given, or as large as errors of the file turn out to be.
        mistake: A probable input error of the log, such as cables in another order or degrees read as radians, or None.
        samples: Indices (k,) of those samples of a long log that were used, or None if all were.
        unobserved: Names of directions that the log does not determine, where the file's anchors or attachments do.
    """

    _solved: Solved
    free: tuple[str, ...]
    prior: Mapping[str, float]
    mistake: Mistake | None = None
    samples: np.ndarray | None = None
    unobserved: tuple[str, ...] = ()

    def _picture(self) -> str:
        samples = np.arange(len(self.residuals))
        curves = (
            (samples, 1e3 * np.sqrt(np.mean(residuals**2, axis=1)), colour)
            for residuals, colour in ((self.residuals_before, GREY), (self.residuals, BLUE))
        )
        return picture(curves, "sample", "residual before (grey), after [mm]")

    @property
    def converged(self) -> bool:
        """Return whether the fit is a local minimum."""
        return self._solved.fit.converged

    @property
    def doubt(self) -> str | None:
        """Return the input error of the log that makes the result useless, in one line, or None."""
        return self.mistake.text if self.mistake and self.mistake.severe else None

    @cached_property
    def refused(self) -> str | None:
        """Return why `save` and `towline calibrate` do not write the robot, in one line; None if they do.

        The log probably has an input error, the fit did not converge, an end of a cable or the CoM would move by more
        than half of the cables' length (3 % if winches are locked) or be known worse than in the file, the anchors of a
        robot without measured positions would be 3 % farther apart or closer, or its offsets are not shown, residuals
        exceed 3 % of the cables' length, a third of all readings or half of a cable's are outliers (rests count once),
        the mass changes, or the file fits validation samples better.
        """
        if self.doubt is not None:
            return self.doubt
        if not self.converged:
            return f"the fit did not converge in {self._solved.fit.steps} steps"
        if not self.free:
            return "the file predicts validation samples as well as any parameters would: there is nothing to change"
        if self.undetermined is not None:
            return self.undetermined
        if self.residual_after > PLAUSIBLE * length_of(self.file):
            left = quantity(1e3 * self.residual_after, "mm", digits=3)
            return f"no anchors and offsets explain the log: they leave residuals of {left}: check clocks and sensors"
        wrong = wrong_shares(self._solved.outliers, self.measurements)
        whole, of_one = wrong.mean(), wrong.max() if "anchors" in self.free else 0.0
        for share, most, whose in ((whole, MOST_WRONG, ""), (of_one, 0.5, f" of cables[{wrong.argmax()}]")):
            if share > most:
                return f"{100 * share:.0f} % of the readings{whose} do not fit the others: check clocks and sensors"
        if loads := load_changes(self._solved.model, self._solved.fit.state) if "mass" in self.free else []:
            texts = [f"{quantity(mass, 'kg', digits=3)} {self._since(begin)}" for begin, mass in loads]
            return f"the mass changes during the log: {', '.join(texts)}; calibrate each part alone"
        held_out = self.held_out
        # Lengths alone do not judge parameters of forces.
        worse = 1.0 if set(IN_BALANCE).isdisjoint(self.free) else WORSE
        least = max(worse * held_out.before, EXACT * self.stated_sigma)
        if np.isfinite(held_out.after) and held_out.after > least:
            before, after = (quantity(1e3 * error, "mm", digits=3) for error in (held_out.before, held_out.after))
            return (
                f"validation samples fit worse than with the file's robot: {after} instead of {before}; keep the file, "
                "or try --free auto, which estimates only what the log shows"
            )
        return None

    @cached_property
    def undetermined(self) -> str | None:
        """Return which end or CoM would move too far to be real, or be known worse than before, in a line, or None."""
        moved = (one for one in self.parameters if ".a" in one.name or one.name.startswith("com"))
        far, length = max(moved, key=lambda one: abs(one.correction), default=None), length_of(self.file)
        if self.growth is not None and abs(self.growth) > PLAUSIBLE:
            return (
                "lengths without positions do not determine the size of the robot: its anchors would be "
                f"{apart(self.growth)}; give a prior"
            )
        if offsets_are_open(self._solved, self.prior):
            return "orientations do not show how wrong the offsets are in the file: give priors of offsets and anchors"
        still = is_still(self.measurements) and self.measurements.carrier_poses is None
        ends = [(one, end) for one in self.parameters for end in ENDS.values() if f".{end[:-1]}." in one.name]
        sigmas = [(one.sigma / self.prior[end], one, self.prior[end]) for one, end in ends if end in self.prior]
        times, worst, known = max(sigmas, default=(0.0, None, 0.0))
        if worst is not None and times > MOST_LOST:
            after, before = (quantity(1e3 * sigma, "mm", digits=2) for sigma in (worst.sigma, known))
            lacking = "" if self.missing_pulleys is None else "; the file seems to lack pulleys, which the report names"
            return f"{worst.name} would have a standard deviation of {after}, and in the file it has {before}{lacking}"
        if far is None or abs(far.correction) <= (PLAUSIBLE if still else FARTHEST) * length:
            return None
        by, of = (quantity(size, "m", digits=3) for size in (abs(far.correction), length))
        hint = "; the readings hardly change: try --free offsets, or give a prior" if still else ""
        return f"the log does not determine {far.name}: it would move by {by}, and cables are {of} long{hint}"

    @cached_property
    def growth(self) -> float | None:
        """Return the fraction by which the anchors are farther apart than in the file; None if log or prior fix it.

        Without measured positions and without a prior of the anchors, a wrong scale of all readings would have the same
        effect as anchors that are farther apart.
        """
        of, state = self._solved.model, self._solved.fit.state
        named = "anchors" in self.free and "scales" not in self.free and "anchors" not in self.prior
        if not (named and of.size_is_open and of.measurements.carrier_poses is None):
            return None
        turned, placed = of.parameters.carriers
        tables = (of.parameters.table(x) for x in (of.parameters.first, state.x))
        ends = (placed + np.einsum("mij,mj->mi", turned, table[:, :3]) for table in tables)
        before, after = (float(np.linalg.norm(one - one.mean(axis=0))) for one in ends)
        return after / before - 1 if before else None

    @property
    def means_something(self) -> bool:
        """Return whether the parameters can be right: without an input error, determined and converged."""
        return self.doubt is None and self.converged and self.undetermined is None

    @property
    def confirms_file(self) -> bool:
        """Return whether the log shows no reason to change anything: the file predicts it as well as any parameters."""
        return self.doubt is None and self.converged and not self.free

    @property
    def beyond_prior(self) -> tuple[tuple[str, float], ...]:
        """Return parameters moved by more than 5 standard deviations of the prior, largest first, and by how many."""
        of, state = self._solved.model.parameters, self._solved.fit.state
        moved = np.abs(state.x - of.first) / self._solved.model.prior_sigmas
        far = [i for i in np.argsort(-moved) if moved[i] > FAR]
        return tuple((of.names[i], float(moved[i])) for i in far)

    @property
    def file(self) -> Robot:
        """Return the robot before the calibration."""
        return self._solved.model.robot

    @property
    def measurements(self) -> Measurements:
        """Return the measurements that were used (`samples`)."""
        return self._solved.model.measurements

    @cached_property
    def robot(self) -> Robot:
        """Return the robot with the calibrated parameters, its encoders, and its uncertainty."""
        parameters, x = self._solved.model.parameters, self._solved.fit.state.x
        known = np.isfinite(self.noise) and np.abs(self.covariance).max(initial=0.0) <= LARGEST
        return parameters.calibrated(x, self.covariance if known else None)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Return the calibrated parameters, slips included."""
        of, x = self._numbered, self._solved.fit.state.x
        where = np.flatnonzero(of.varies)
        sigmas = np.sqrt(np.diag(self.covariance))
        determined = self._solved.observability.determined
        return tuple(
            Parameter(
                of.names[i], float(x[i]), float(sigma) if known else np.inf, float(x[i] - of.first[i]), of.units[i]
            )
            for i, sigma, known in zip(where, sigmas, determined, strict=True)
        )

    @cached_property
    def covariance(self) -> np.ndarray:
        """Return the covariance of the parameters, (p, p), in their order and units.

        It is zero along unobservable directions. It is scaled up if residuals are larger than stated or autocorrelated
        (`noise`, `autocorrelation`).
        """
        possible = self._possible_pulleys
        return covariance_of(self._solved) + (0.0 if possible is None else possible.covariance)

    @property
    def missing_pulleys(self) -> MissingPulleys | None:
        """Return pulleys that the cables seem to run over, but that the file lacks, or None."""
        return self._possible_pulleys if self._possible_pulleys and self._possible_pulleys.radii else None

    @cached_property
    def _possible_pulleys(self) -> MissingPulleys | None:
        return missing_pulleys(self._solved)

    @cached_property
    def information(self) -> np.ndarray:
        """Return the pseudo-inverse of the covariance, priors included, with parameters as lengths, (p, p) [1/m^2]."""
        return self._possible_pulleys.information if self._possible_pulleys else self._noise.information

    @property
    def _noise(self) -> Noise:
        return self._solved.noise

    @property
    def noise(self) -> float:
        """Return the standard deviation of a length estimated from the residuals [m]; nan without redundancy."""
        return self._noise.excess * self.stated_sigma

    @property
    def stated_sigma(self) -> float:
        """Return the stated standard deviation of a length [m]."""
        return self._solved.model.measurements.sigma.lengths

    @property
    def autocorrelation(self) -> float:
        """Return the factor of the covariance for autocorrelated errors, else 1."""
        return self._noise.autocorrelation

    @property
    def repeating(self) -> Repeating | None:
        """Return errors of the lengths that repeat with the pose or the lengths, which sigmas include, or None."""
        return self._noise.repeating

    @property
    def identifiable(self) -> tuple[str, ...]:
        """Return the names of the observable parameters."""
        return tuple(parameter.name for parameter in self.parameters if np.isfinite(parameter.sigma))

    @property
    def not_identifiable(self) -> tuple[str, ...]:
        """Return the directions of the parameters that are unobservable by the log, one name for each."""
        return tuple(dict.fromkeys((*self.unobserved, *self._solved.observability.open)))

    @cached_property
    def residuals(self) -> np.ndarray:
        """Return the residuals of the lengths of the calibrated robot, (N, m) [m], outliers included."""
        return lengths_of(self._solved.model, self._solved.fit.state)

    @cached_property
    def residuals_before(self) -> np.ndarray:
        """Return the residuals of the lengths with the file's parameters, (N, m) [m], at poses that fit them best."""
        return lengths_of(*poses_fitted(self._solved.model))

    @property
    def residual_before(self) -> float:
        """Return the root mean square of `residuals_before` without outliers [m]."""
        return self._rms(self.residuals_before)

    @property
    def residual_after(self) -> float:
        """Return the root mean square of `residuals` without outliers [m]."""
        return self._rms(self.residuals)

    @property
    def residual(self) -> float:
        """Return `residual_after` [m]."""
        return self.residual_after

    def _rms(self, residuals: np.ndarray) -> float:
        model = self._solved.model
        used = residuals.T[model.weights & model.inside(self._solved.fit.state)]
        return float(np.sqrt((used**2).mean())) if used.size else np.nan

    @cached_property
    def poses(self) -> np.ndarray:
        """Return the poses of the platform at the times of the lengths, (N, 6) [m, rad], measured or estimated.

        Unknown poses are nan where any of the readings may be wrong, so that all are left out.
        """
        model = self._solved.model
        position, rotation = model.poses(self._solved.fit.state)
        poses = np.hstack([position, points.angles(rotation)])
        poses[np.isinf(model.pose_sigmas).any(axis=1) & ~model.weights.any(axis=0)] = np.nan
        return poses

    @property
    def outliers(self) -> tuple[Outlier, ...]:
        """Return the outliers, which the fit excludes, by their samples in the log."""
        return tuple(one._replace(sample=self._in_log(one.sample)) for one in self._solved.outliers)

    @property
    def slips(self) -> tuple[Slip, ...]:
        """Return the slips of winches, by their samples in the log."""
        slips = self._numbered.slips
        own = self.parameters[len(self.parameters) - len(slips) :]
        return tuple(Slip(*place, one.value, one.sigma) for place, one in zip(slips, own, strict=True))

    def _since(self, used: int) -> str:
        """Return since which sample of the log something holds, of which a used one is the first that shows it."""
        skipped = self._in_log(used) - self._in_log(used - 1) - 1 if used else 0
        earlier = f" (or up to {counted(skipped, 'sample')} earlier, which were not used)" if skipped else ""
        return f"from sample {self._in_log(used)} on{earlier}"

    def _in_log(self, sample: int) -> int:
        return sample if self.samples is None else int(self.samples[sample])

    @property
    def _numbered(self) -> Parameters:
        """Return the parameters, with the slips by their samples in the log."""
        of = self._solved.model.parameters
        return replace(of, slips=tuple((cable, self._in_log(sample)) for cable, sample in of.slips))

    @property
    def clock(self) -> float:
        """Return the time by which the poses' clock is ahead of the lengths' clock [s]; 0 if it is fixed."""
        return float(self._solved.fit.state.x[self._solved.model.parameters.clock])

    @property
    def carrier_clocks(self) -> tuple[Parameter, ...]:
        """Return by how much the clock of each carrier is ahead of the poses' clock [s], if that was estimated."""
        return tuple(one for one in self._solved.clock_errors if one.unit == "s")

    @property
    def clock_rate(self) -> Parameter | None:
        """Return how much faster the poses' clock runs than the measurements have it [1], if that was estimated."""
        return next((one for one in self._solved.clock_errors if one.unit == "1"), None)

    @cached_property
    def held_out(self) -> HeldOut:
        """Return the cross-validation of these parameters and of smaller sets."""
        return compare(self._solved, self.free, dict(self.prior))

    def lengths(self, readings: ArrayLike) -> np.ndarray:
        """Convert winch readings (..., m) to unstrained lengths [m], (..., m), with the offsets after the last slip.

        Raises `InputError` if the readings have another number of cables.
        """
        model, x = self._solved.model, self._solved.fit.state.x
        values = np.asarray(real_array("readings", readings), dtype=float)
        table = model.parameters.table(x)
        if values.ndim < 1 or values.shape[-1] != len(table):
            raise InputError(f"readings must have the shape (..., {len(table)}), got {values.shape}")
        return table[:, 6] + model.slips(x)[:, -1] + (table[:, 7] + table[:, 9] * values) * values

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data, the output of `towline calibrate --json`."""
        return {
            "robot": self.file.name,
            "converged": self.converged,
            "refused": self.refused,
            "doubt": self.doubt,
            "hint": None if self.mistake is None or self.mistake.severe else self.mistake.text,
            "beyond_prior": [{"name": name, "sigmas": sigmas} for name, sigmas in self.beyond_prior],
            "free": list(self.free),
            "samples_used": len(self._solved.model.measurements),
            "residual_before": self.residual_before,
            "residual_after": self.residual_after,
            "noise": self.noise,
            "autocorrelation": self.autocorrelation,
            "clock": self.clock if "clock" in self.free else None,
            "clock_rate": self.clock_rate._asdict() if self.clock_rate else None,
            "carrier_clocks": [one._asdict() for one in self.carrier_clocks],
            "parameters": [
                {**parameter._asdict(), "sigma": parameter.sigma if np.isfinite(parameter.sigma) else None}
                for parameter in self.parameters
            ],
            "covariance": self.covariance.tolist(),
            "not_identifiable": list(self.not_identifiable),
            "held_out": None if self.doubt else self.held_out.to_dict(),
            "outliers": [one._asdict() for one in self.outliers],
            "slips": [one._asdict() for one in self.slips],
        }
