"""`calibrate`: estimate robot parameters from measurements."""

from collections.abc import Mapping, Sequence

from ...base.inputs import InputError, flag
from ...models.files import AnyRobot, as_robot
from ..logs.measurements import Measurements, check_measurements, tracked
from .calibration import Calibration
from .cross_validation import extended, select
from .enough import check_enough, usual
from .file_errors import errors_of_file, loose, undetermined
from .geometry import length_of
from .parameters import GROUPS, IN_BALANCE, check_free, check_prior
from .plausibility import mistake
from .representative import representative
from .sensor_errors import has_zeros, is_askew, with_mount, with_zeros
from .solving import solve
from .stretch import is_elastic, uses_slack, with_elasticity, with_stretch

ROUNDS_OF_STRETCH = 3  # and of further parameters of the geometry
ROUNDS_OF_SLACK = 3


def calibrate(
    robot: AnyRobot,
    measurements: Measurements,
    free: str | Sequence[str] | None = None,
    prior: Mapping[str, float] | None = None,
    outliers: bool = True,
) -> Calibration:
    """Estimate the robot parameters that best explain measured cable lengths.

    Exactly measured poses are fixed, and poses measured with an error may move within it. Unmeasured poses are
    estimated along with the parameters, from the lengths and, if tensions were measured or the robot has fewer cables
    than coordinates, from the balance of forces on the platform. Carriers are at home unless their poses were measured.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file, with the initial values.
        measurements: `Measurements` of the robot, or from `read_measurements`.
        free: Parameters to estimate (see docs/howto/calibrate.md): any of anchors, attachments, offsets, scales,
            radii, build-up, clock, frame, body, com and elasticity, and with tensions also mass, stiffness, capstan,
            friction, gains and zeros. Default: anchors and offsets, and the clock if times and poses of a motion were
            measured; offsets and com at rest without positions, if gravity tells the CoM. With anchors and offsets,
            towline adds attachments, scales, build-up and radii as far as they explain errors that repeat with the
            pose. Or "auto": the smallest set whose cross-validation error is close to the smallest one; this set may be
            empty.
        prior: Standard deviations of the file's values, in the units of the parameters, by the names of `free`, such as
            {"anchors": 0.02}. Default: no prior; unobservable directions change as little as possible.
        outliers: True to detect outliers, which are left out, and slipped winches, whose cable gets a new offset after
            the slip.

    Raises:
        InputError: If an argument is wrong, the number of cables differs, or there are fewer measurements than
            unknowns.
    """
    chosen = as_robot(robot)
    given = check_measurements(chosen, measurements)
    flag("outliers", outliers)
    samples = representative(chosen, given)
    given = given if samples is None else given.only(samples)
    found = mistake(chosen, given)
    outliers = outliers and not (found and found.severe)  # nearly all readings would be
    if isinstance(free, str) and free == "auto":
        check_prior(prior, GROUPS)
        groups = select(chosen, given, outliers)
        prior = None if prior is None else {name: value for name, value in prior.items() if name in groups}
    else:
        groups = usual(chosen, given) if free is None else check_free(chosen, free)
        groups = tuple(name for name in GROUPS if name in (*groups, *given.framed))
    priors = check_prior(prior, groups)
    if groups:
        check_enough(chosen, given, groups, priors)
    first = loose(length_of(chosen), groups, priors)
    solved = solve(chosen, given, groups, first, outliers)
    if found and found.severe:  # nothing that follows would mean anything
        return Calibration(solved, groups, first, found, samples)
    forces = solved.model.forces
    of_forces = [name for name in groups if name in (*IN_BALANCE, "elasticity")]
    if of_forces and forces is not None and not forces.motion_is_known:
        if given.times is None:
            raise InputError(
                f"measurements.times must be given to estimate {', '.join(of_forces)}, got none, and the poses look "
                "like a motion; if they are at rest, give times more than 0.2 s apart"
            )
        if "elasticity" in groups and given.tensions is None:
            raise InputError(
                "measurements.poses must be known throughout a motion to estimate elasticity without tensions, got "
                f"{int(tracked(chosen, given).sum())} of {len(given)}: longer gaps and open ends hide accelerations"
            )
    unobserved: tuple[str, ...] = ()
    if first == priors and (loosely := undetermined(solved)):
        first, unobserved = priors | loosely, solved.observability.open
        solved = solve(chosen, given, groups, first, outliers)
    if first != priors:
        priors = errors_of_file(solved, priors)
        solved = solve(chosen, given, groups, priors, outliers)
    if is_askew(solved):
        groups, priors = with_mount(groups, priors)
        solved = solve(chosen, given, groups, priors, outliers)
    if has_zeros(solved):
        groups, priors = with_zeros(given, groups, priors)
        solved = solve(chosen, given, groups, priors, outliers)
    for _ in range(ROUNDS_OF_STRETCH):
        better = extended(solved, groups, priors)
        if (better == groups or "elasticity" in better) and (near := with_stretch(solved)) is not None:
            longer, sigmas = with_elasticity(solved)
            elastic = solve(chosen, given, longer, sigmas, outliers, near)
            if is_elastic(elastic):
                groups, priors, solved = longer, sigmas, elastic
                continue
        better = tuple(name for name in better if name in groups or name != "elasticity")  # whose own test is stricter
        if better == groups:
            break
        groups, solved = better, solve(chosen, given, better, priors, outliers)
    for _ in range(ROUNDS_OF_SLACK):
        if not uses_slack(solved):
            break
        solved = solve(chosen, given, groups, priors, outliers, solved)
    return Calibration(solved, groups, priors, found, samples, unobserved)
