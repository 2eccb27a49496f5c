"""`calibrate`: find the parameters of a robot that explain measurements."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

from ...base.inputs import flag
from ...models.files import as_robot
from ...models.robot import Robot
from .calibration import Calibration
from .cross_validation import select
from .measurements import Measurements, check_measurements
from .parameters import GROUPS, check_free, check_prior
from .plausibility import doubt
from .solving import check_enough, solve, usual


def calibrate(
    robot: Robot | str | os.PathLike[str],
    measurements: Measurements,
    free: str | Sequence[str] | None = None,
    prior: Mapping[str, float] | None = None,
    outliers: bool = True,
) -> Calibration:
    """Find the parameters of a robot with which its cables have the measured lengths.

    Poses that were measured exactly are kept, poses measured with an error may move within it, and poses that were not
    measured are found along with the parameters. Carriers are at home.

    Parameters
    ----------
    robot
        A `Robot`, the name of one in the library, or the path of a robot file: the values to begin with.
    measurements
        `Measurements` of the robot, or from `read_measurements`.
    free
        What to find, some of anchors, attachments, offsets (of the lengths), scales (of the lengths), radii (of the
        pulleys) and clock (by how much the clock of the poses is ahead of that of the lengths). Default: anchors and
        offsets, and the clock if times and poses of a motion were measured. Or "auto": the smallest set that predicts
        measurements left out nearly as well as any (`select`), none if that is the file.
    prior
        Standard deviations about the file's values by the names of `free`, [m], of scales [1], of the clock [s], such
        as {"anchors": 0.02}. Default: none; what the measurements do not determine changes as little as possible.
    outliers
        Whether to look for wrong readings, which are left out, and for slipped winches, whose cable gets another offset
        from there on.

    Raises
    ------
    InputError
        If an argument is wrong, the measurements are of another number of cables, or they are fewer than what to find.
    """
    chosen = as_robot(robot)
    given = check_measurements(chosen, measurements)
    flag("outliers", outliers)
    slip = doubt(chosen, given)
    outliers = outliers and slip is None  # nearly all readings would be
    if isinstance(free, str) and free == "auto":
        check_prior(prior, GROUPS)
        groups = select(chosen, given, outliers)
        prior = None if prior is None else {name: value for name, value in prior.items() if name in groups}
    else:
        groups = usual(chosen, given) if free is None else check_free(chosen, free)
    priors = check_prior(prior, groups)
    if groups:
        check_enough(chosen, given, groups, priors)
    solved = solve(chosen, given, groups, priors, outliers)
    return Calibration(solved, groups, priors, slip)
