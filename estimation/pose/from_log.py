"""`poses_from_log`: the poses of a platform over a log of readings of its winches."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...base.display import Displayed
from ...base.inputs import check_ending, file_path
from ...base.text import any_of, quantity
from ...base.writing import whole_file
from ...models import points
from ...models.files import AnyRobot, as_robot
from ...models.part import COORDINATES
from ...models.robot import Robot
from ..calibration.geometry import length_of
from ..calibration.plausibility import Mistake, mistake
from ..logs.encoders import lengths_of
from ..logs.measurements import Measurements, carriers_of, check_measurements
from ..logs.recording import COUNTED
from ..logs.smoothing import FEWEST, Polynomials, within
from .estimate import FALSE_ALARM_IN_LOG, PoseEstimate, largest_cost
from .from_lengths import SIGMA, checked_sigma, pose_from_lengths
from .wrong_lengths import TOLD_APART, can_explain, wrong_cables

MOST_TRACKED = 2000  # samples that are followed one by one; all others begin between them
MOST_TOGETHER = 256  # samples that no pose near the last one fits, and that are searched together
BLOCK = 5000  # samples whose poses are fitted together
MOST_NAMED = 12
LOOKS = 100  # samples of those that no pose fits, which are fitted without each cable
CERTAIN = 4.0  # standard deviations by which residuals must exceed the stated ones
VISIBLE = 1e-3  # of the cables' length, of a swing that is named


class Wrong(NamedTuple):
    """Successive samples that no pose fits, from `first` to `last`, and the cables of which one is wrong, from 0.

    Without cables, no single wrong length explains the samples.
    """

    first: int
    last: int
    cables: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class LogPoses(Displayed):
    """The poses of a platform over a log.

    Attributes:
        estimate: The poses with their covariances, of N samples.
        times: Times of the poses on the clock of the lengths [s], (N,), or None.
        squares: Sum of all squared residuals of each sample, in standard deviations, (N,); None if lengths alone were
            measured.
        more: Number of the residuals in a sample besides the residuals of the lengths.
        excess: Factor by which these other residuals exceed their standard deviations.
        misread: Description of an error of the measured orientations, which is corrected; or None.
        mistake: Probable input error of the log, or None.
    """

    estimate: PoseEstimate
    times: np.ndarray | None
    squares: np.ndarray | None = None
    more: int = 0
    excess: float = 1.0
    misread: str | None = None
    mistake: Mistake | None = None

    @property
    def doubt(self) -> str | None:
        """Return the input error of the log that makes the poses doubtful, in one line, or None."""
        return self.mistake.doubt if self.mistake else None

    @cached_property
    def cost(self) -> np.ndarray:
        """Return the sum of squared residuals of each sample, in standard deviations, (N,)."""
        return self.estimate.cost if self.squares is None else self.squares

    @property
    def largest(self) -> float:
        """Return the largest `cost` at which a pose fits a sample; nan without redundant cables.

        In a log without wrong readings, the probability that any sample exceeds it is 0.01 %.
        """
        redundancy = self.estimate.robot.m - int(self.estimate.robot.dof_mask.sum()) + self.more
        return largest_cost(redundancy, FALSE_ALARM_IN_LOG / len(self.estimate.pose)) if redundancy > 0 else np.nan

    @property
    def fits(self) -> np.ndarray:
        """Return which samples are fitted by a pose, (N,) of bool; without redundant readings, all that converged."""
        untested = np.asarray(self.estimate.by_gravity) & (self.squares is None)
        return np.asarray(self.estimate.converged & (~(self.cost > self.largest) | untested))

    @cached_property
    def wrong(self) -> tuple[Wrong, ...]:
        """Return the samples that no pose fits, grouped into runs."""
        rows = np.flatnonzero(~self.fits)
        if not rows.size:
            return ()
        every = np.square(self.estimate.suspects()[rows])  # (k, m)
        wrong: list[Wrong] = []
        for run in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(rows) > 1) + 1):
            together = every[run].sum(axis=0)
            cables = tuple(np.flatnonzero(together >= together.max() - TOLD_APART**2).tolist())
            if len(wrong) < MOST_NAMED and not self.more and can_explain(self.estimate):
                some = np.linspace(0, len(run) - 1, min(LOOKS, len(run))).astype(int)
                cables = wrong_cables(self.estimate, rows[run[some]].tolist())
            wrong.append(Wrong(int(rows[run[0]]), int(rows[run[-1]]), cables))
        return tuple(wrong)

    @cached_property
    def swing(self) -> float:
        """Estimate how far (rms) accelerations move a platform off its poses at rest [m]; 0 without such poses."""
        estimate, rows = self.estimate, np.asarray(self.estimate.by_gravity)
        if self.times is None or len(self.times) <= 2 * FEWEST or not rows.any():
            return 0.0
        bends = Polynomials(self.times, within(self.times)).fitted(estimate.pose[:, :3]).bends
        gravity = max(float(np.linalg.norm(estimate.robot.gravity)), 1e-9)
        return float(np.sqrt((bends[rows] ** 2).sum(axis=1).mean()) / gravity * length_of(estimate.robot))

    def lines(self) -> Iterator[str]:
        """Yield lines about input errors, how far the platform may swing, and each run of wrong samples."""
        if self.mistake:
            yield self.doubt or self.mistake.text
        if self.misread:
            yield f"corrected: {self.misread}"
        if self.excess > 1.0:
            yield f"residuals are {quantity(self.excess, digits=3)} times as large as stated, so sigmas are too"
        if len(self.wrong) == 1 and not self.fits.any():
            if self.doubt:
                return
            yield "no pose fits the lengths of any sample: the robot file is of another robot, or not calibrated"
            return
        if np.any(self.estimate.by_gravity):
            moves = ""
            if self.swing > VISIBLE * length_of(self.estimate.robot):
                moves = (
                    ", but the platform accelerates, so they may be off by "
                    f"{quantity(1e3 * self.swing, 'mm', 2)} (rms), which the covariance does not include"
                )
            yield f"lengths do not determine the pose: poses are those at rest{moves}"
        for one in self.wrong[:MOST_NAMED]:
            which = f"sample {one.first}" if one.first == one.last else f"samples {one.first} to {one.last}"
            at = "" if self.times is None else f" (from {self._time(one.first)})"
            names = any_of(f"cables[{cable}]" for cable in one.cables)
            why = f"most likely the length of {names} is wrong" if names else "no single wrong length explains this"
            yield f"{which}{at}: no pose fits; {why}"
        if len(self.wrong) > MOST_NAMED:
            yield f"and {quantity(len(self.wrong) - MOST_NAMED)} more"

    def _time(self, sample: int) -> str:
        assert self.times is not None
        counted = float(self.times[0]) > COUNTED
        time = quantity(float(self.times[sample] - counted * self.times[0]), "s", 6)
        return f"{time} after the first sample" if counted else time

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save as CSV atomically, and return the path.

        Columns: times, poses, covariances of x, y, z and a small rotation in {G}, residuals, and whether a pose fits.
        Raises `InputError` if the file cannot be written.
        """
        file = check_ending("path", file_path("path", path), ".csv")
        upper = np.triu_indices(6)
        names = ("x", "y", "z", "rx", "ry", "rz")
        units = ("m", "m rad", "rad^2")
        header = [f"{name} [{'m' if i < 3 else 'rad'}]" for i, name in enumerate(COORDINATES)]
        for i, j in zip(*upper, strict=True):
            unit = "m^2" if j < 3 else units[1] if i < 3 else units[2]
            header.append(f"cov_{names[i]}_{names[j]} [{unit}]")
        covariance = self.estimate.covariance[:, upper[0], upper[1]]
        columns = [self.estimate.pose, covariance, self.estimate.residual[:, None], self.fits[:, None]]
        header += ["residual [m]", "fits [1]"]
        if self.times is not None:
            columns, header = [self.times[:, None], *columns], ["t [s]", *header]
        with whole_file(file) as temporary:
            formats = ["%.16g" if name.startswith("t ") else "%.10g" for name in header]  # times may count from 1970
            np.savetxt(temporary, np.hstack(columns), formats, ",", header=",".join(header), comments="")
        return file

    def to_dict(self) -> dict[str, Any]:
        """Return a summary of all samples, ready for JSON."""
        return {
            "samples": len(self.estimate.pose),
            "residual": float(np.sqrt(np.mean(np.square(self.estimate.residuals)))),
            "consistent": float(np.mean(self.fits)),
            "determined": float(np.mean(self.estimate.determined)),
            "swing": self.swing,
            "wrong": [one._asdict() for one in self.wrong],
            "doubt": self.doubt,
        }


def poses_from_log(
    robot: AnyRobot, measurements: Measurements, sigma: ArrayLike = SIGMA, begin: float = 0.0
) -> LogPoses:
    """Estimate the pose of the platform at each sample of a log; the file's encoders convert readings to lengths.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        measurements: Readings; measured tensions stretch cables with a stiffness, and measured poses of carriers move
            their anchors. Directions of cables and orientations of the platform are used, and tensions with these.
            Positions only serve to detect input errors of the log (`mistake`).
        sigma: Standard deviations of the lengths [m], one number or (m,).
        begin: Time of the clock at time 0 of the measurements [s].

    Raises:
        InputError: If an argument has a wrong value, or a length is not above zero.
    """
    robot = as_robot(robot)
    given, deviations = check_measurements(robot, measurements), checked_sigma(sigma, robot.m)
    few = robot.m < robot.dof_mask.sum()  # more cables need no orientations
    alone = few and given.poses is not None and not np.isfinite(given.poses[:, :3]).any()  # as of an AHRS
    if given.directions is not None or alone:
        return _by_more(robot, given, deviations, begin, alone)
    found_mistake = mistake(robot, given)
    lengths = lengths_of(robot, given.lengths, given.tensions)
    rows = np.unique(np.linspace(0, len(lengths) - 1, min(len(lengths), MOST_TRACKED)).astype(int))
    carriers = np.broadcast_to(carriers_of(robot, given), (len(lengths), *robot.carrier_home.shape))
    known, good = _tracked(robot, lengths[rows], carriers[rows], deviations)
    starts = np.column_stack([np.interp(np.arange(len(lengths)), rows[good], column[good]) for column in known.T])
    estimate = pose_from_lengths(robot, lengths, starts, given.carrier_poses, deviations)
    times = None if given.times is None else given.times + begin
    return LogPoses(estimate, times, mistake=found_mistake)


def _tracked(robot: Robot, lengths: np.ndarray, carriers: np.ndarray, sigma: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return the poses of samples (k, 6), each from the one before or by a search, and which of them to start from.

    Samples after one that is lost are searched together: one by one takes 30 times as long.
    """
    poses, good = np.empty((len(lengths), 6)), np.zeros(len(lengths), bool)
    last, block, first, end = None, None, 0, 0  # samples `first` to `end` have been searched
    for k, (row, places) in enumerate(zip(lengths, carriers, strict=True)):
        if last is not None:
            found = pose_from_lengths(robot, row, last, places, sigma)
            poses[k], good[k] = found.pose, found.consistent
        if not good[k]:
            if k >= end:
                count = min(2 * (end - first), MOST_TOGETHER) if k == end else 1
                first, end = k, k + max(count, 1)
                block = pose_from_lengths(robot, lengths[first:end], None, carriers[first:end], sigma)
            assert block is not None
            poses[k], good[k] = block.pose[k - first], block.consistent[k - first]
        last = poses[k] if good[k] else last
    poses[:, 3:] = np.unwrap(poses[:, 3:], axis=0)
    return poses, good | ~good.any()


def _by_more(robot: Robot, given: Measurements, sigma: np.ndarray, begin: float, oriented: bool) -> LogPoses:
    """Return poses by lengths, directions of cables and, if `oriented`, measured orientations; by least squares."""
    from ..calibration.balance import needs_balance
    from ..calibration.sightings import sighted

    measured = given.changed(sigma=given.sigma._asdict() | {"lengths": float(sigma.min())})
    found, misread = mistake(robot, measured), None
    if not oriented:
        measured = measured.changed(poses=None)
    elif found and found.corrected and np.array_equal(found.corrected.lengths, measured.lengths):
        misread, measured = found.text, found.corrected  # of the orientations, not of the lengths
    weights = sigma.min() / sigma
    blocks = [_block(robot, measured.only(slice(k, k + BLOCK)), weights) for k in range(0, len(given), BLOCK)]
    parts = (np.concatenate(part) for part in zip(*blocks, strict=True))
    poses, left, squares, covariances, by_parameters, converged = parts
    balanced = needs_balance(robot, measured)
    freedoms = int(robot.dof_mask.sum())
    of_forces = freedoms if measured.tensions is not None else max(freedoms - robot.m, 0)
    more = int(np.median(sighted(measured))) + 3 * oriented + balanced * of_forces
    redundancy, excess = robot.m - freedoms + more, 1.0
    if redundancy > 0:
        ratio = float(np.sqrt(np.median(squares) / largest_cost(redundancy, 0.5)))
        excess = ratio if ratio > 1 + CERTAIN / np.sqrt(2 * redundancy * len(given)) else 1.0
    estimate = PoseEstimate(
        robot=robot,
        pose=poses,
        residuals=left,
        converged=converged,
        sigma=sigma,
        carrier_pose=given.carrier_poses,
        by_gravity=np.full(len(given), hanging := balanced and robot.m < freedoms),
        known_covariance=excess**2 * covariances,
        by_parameters=by_parameters if hanging and robot.uncertainty else None,
    )
    times = None if given.times is None else given.times + begin
    return LogPoses(estimate, times, squares / excess**2, more, excess, misread, None if misread else found)


def _block(robot: Robot, measured: Measurements, weights: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return poses (k, 6), residuals of lengths (k, m) [m], sums of squares, covariances and success of samples.

    Covariances are those by noise, and by the file's `uncertainty`, (k, 6, 6).
    """
    from ..calibration.hanging import without_slack
    from ..calibration.normal_equations import pose_covariances, pose_covariances_by_file
    from ..calibration.solving import lengths_of as lengths_left, model_of
    from ..calibration.starts import fit_from

    model = model_of(robot, measured, (), {})
    model = replace(model, weights=np.repeat(weights[:, None], len(measured), axis=1))
    length = length_of(robot)
    model, found = without_slack(model, fit_from(model, model.begin(), length)[0], length)
    position, rotation = model.poses(found.state)
    return (
        np.hstack([position, points.angles(rotation)]),
        lengths_left(model, found.state),
        model.residuals(found.state).of_samples,
        pose_covariances(model, found.state),
        pose_covariances_by_file(model, found.state),
        np.full(len(measured), found.converged),
    )
