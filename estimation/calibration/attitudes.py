"""`misread_attitudes`: orientations without positions, as of an AHRS, in another frame or convention than the file's.

The orientation in which the platform hangs or is held by its cables follows from the lengths, and differs from the
measured one by a rotation of the sensor's world, such as that to magnetic north, or of the sensor on the platform.
Offsets of the readings and a wrong CoM turn a small platform as much, so fits with these unknown decide.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.errors import InputError
from ...base.text import quantity, quantity_row
from ...models import points
from ...models.robot import Robot
from ..logs.encoders import lengths_of
from ..logs.measurements import Measurements, measured_poses
from ..pose.from_lengths import pose_from_lengths
from .attitude_orders import likely_order
from .balance import needs_balance
from .explanations import with_order
from .geometry import length_of
from .hanging import without_slack
from .interpretations import interpretations
from .other_frames import Mistake, corrected_to
from .solving import model_of
from .starts import fit_from

MOST_SAMPLES, MOST_FITTED, MOST_LIKELY, FEWEST = 40, 60, 3, 6
CLEARLY = 3.0  # times smaller differences
EXPLAINED = 0.75  # of the turns from a constant orientation, which differences in another convention must be below
VISIBLE = np.radians(3.0)  # smaller ones are noise, or small offsets of the readings
ASKEW = np.radians(4.0)  # smaller ones of a sensor may be due to displaced anchors, if these explain the log
TILTED = np.radians(20.0)  # of a world whose vertical is another one
MOUNTED = np.radians(7.0)  # from right angles, of a sensor on the platform
LIKELIER = 0.95  # of the sum of squares that a fit with the orientations as they are leaves
SIMPLER = 2.0  # times the least sum of squares, which a simpler error may leave
ENOUGH = 1e-3  # of the sum of squares, of a step that these fits need not take
MOST_WRONG = 9.0  # times the median of the samples' sums of squares, up to which a sample counts


def misread_attitudes(robot: Robot, given: Measurements) -> Mistake | None:
    """Return what is wrong with orientations that were measured without positions, or with the order of cables."""
    position, rotation, known = measured_poses(robot, given)
    rows = np.flatnonzero(known[:, 3:].all(axis=1))
    if given.poses is None or len(rows) < FEWEST or not robot.dof_mask[3:].all():
        return None
    noise = given.sigma.lengths, given.sigma.rotation
    lengths = lengths_of(robot, given.lengths[rows])
    columns, sure, heading, explained = likely_order(robot, lengths, rotation[rows], noise)
    by = Rotation.from_rotvec(-heading * np.array(robot.gravity) / max(np.linalg.norm(robot.gravity), 1e-12))
    turned = by.magnitude() > VISIBLE
    text = with_order("", columns, np.ones(robot.m))
    if not sure:
        return Mistake(f"{text}, by lengths at the measured orientations; another order fits as well", None)
    if not text and not turned:
        return _in_frames(robot, given, rows, rotation, ASKEW if explained else VISIBLE)
    text = " and ".join(filter(None, (text, _said("world", by) if turned else "")))
    placed = position, (by * Rotation.from_matrix(rotation)).as_matrix() if turned else rotation, given.carrier_poses
    corrected = corrected_to(given, placed, columns, 1.0)
    also = None if turned else _in_frames(robot, corrected, rows, rotation)
    text = f"{text}, by lengths at the measured orientations"
    also = also._replace(text=f"{text}, and {also.text}") if also else Mistake(text, corrected)
    return also._replace(columns=columns)


def _in_frames(
    robot: Robot, given: Measurements, rows: np.ndarray, rotation: np.ndarray, visible: float = VISIBLE
) -> Mistake | None:
    """Return the wrong frame or convention of orientations (N, 3, 3), which some samples (rows) have, or None.

    - `visible`: least turn that noise, or displaced anchors, do not explain [rad].
    """
    assert given.poses is not None
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_SAMPLES)).astype(int))]
    carriers = None if given.carrier_poses is None else given.carrier_poses[rows]
    try:
        estimate = pose_from_lengths(robot, lengths_of(robot, given.lengths[rows]), None, carriers)
    except InputError:  # lengths that no cable has
        return None
    good = np.asarray(estimate.converged & np.isfinite(estimate.pose).all(axis=1))
    if good.sum() < FEWEST:
        return None
    rows, expected = rows[good], Rotation.from_matrix(points.rotations(estimate.pose[good, 3:]))
    tried: list[tuple[float, float, str, Rotation, Rotation, int]] = []
    none, up = Rotation.identity(), -np.array(robot.gravity) / max(np.linalg.norm(robot.gravity), 1e-12)
    right_angles, spread = Rotation.create_group("O"), float(np.median((expected * expected.mean().inv()).magnitude()))
    ways = [way for way in interpretations(True) if way.turned is not None or not way.text]
    for k, way in enumerate(ways):
        R = rotation[rows] if way.turned is None else way.turned(rotation[rows], given.poses[rows, 3:])
        seen = Rotation.from_matrix(R)
        outer, inner = (expected * seen.inv()).mean(), (seen.inv() * expected).mean()
        nearest = right_angles[int(np.argmin((right_angles.inv() * inner).magnitude()))]
        # Sensors are mounted at right angles; a wrong CoM tilts the platform, too.
        inner = nearest if (nearest.inv() * inner).magnitude() < MOUNTED else inner
        heading = Rotation.from_rotvec(2 * np.arctan2(up @ outer.as_quat()[:3], outer.as_quat()[3]) * up)
        # An inertial sensor knows the vertical: only its heading is wrong, unless its axes have another order.
        world = heading if (outer * heading.inv()).magnitude() < TILTED else outer
        for left, right, frame in ((none, none, ""), (world, none, "world"), (none, inner, "sensor")):
            size = float(np.median((left * seen * right * expected.inv()).magnitude()))
            corrections = (k > 0) + bool(frame)
            if k > 0 and size > EXPLAINED * spread:  # a constant orientation differs as little
                continue
            tried.append((size * CLEARLY**corrections, size, frame, left, right, k))
    as_they_are, *of_frames = tried[:3]
    if as_they_are[1] < VISIBLE:
        return None
    ranked = sorted(tried, key=lambda one: one[0])
    likely = [one for one in ranked if any(one is other for other in (*ranked[:MOST_LIKELY], *of_frames))]
    try:
        as_given, turns_given = _fitted(robot, given)
    except InputError:  # too few samples for a fit
        as_given, turns_given, likely = np.inf, {}, ranked[:1]
    fitted: list[tuple[float, float, str, Rotation, Rotation, str, dict[str, np.ndarray]]] = []
    for _, size, frame, left, right, k in (one for one in likely if one is not as_they_are):
        turn = ways[k].turned
        every = rotation if turn is None else turn(rotation, np.nan_to_num(given.poses[:, 3:]))
        whole = left * Rotation.from_matrix(every) * right
        cost, turns = _fitted(robot, _turned(given, whole)) if as_given < np.inf else (size, {})
        if as_given < np.inf and frame == "sensor" and k == 0:  # slightly askew: poses without offsets may hide that
            askew = _rest(robot, given, whole * right.inv(), turns_given, frame, up)
            less, others = _fitted(robot, _turned(given, whole * right.inv() * askew))
            if less < cost:
                cost, turns, whole, left, right = less, others, whole * right.inv() * askew, none, askew
                size = float(np.median((whole[rows] * expected.inv()).magnitude()))
        fitted.append((cost, size, frame, left * right, whole, ways[k].text, turns))
    if not fitted:
        return None
    simple = SIMPLER * min(one[0] for one in fitted)
    cost, size, frame, turned, whole, text, turns = next(one for one in fitted if one[0] <= simple)
    rest = 0.0  # median turn that nothing explains [rad]
    if as_given < np.inf and frame:
        more = _rest(robot, given, whole, turns, frame, up)
        turned, whole = ((more * one if frame == "world" else one * more) for one in (turned, whole))
        cost, turns = _fitted(robot, _turned(given, whole))
        rest = float(np.median(np.linalg.norm(turns["world"], axis=1)))
    small = bool(frame) and not text and turned.magnitude() < visible
    if small or cost > LIKELIER * as_given:  # offsets and the CoM may explain the differences as well
        return None
    now, before = (quantity(np.degrees(part), "deg", 2) for part in (size, as_they_are[1]))
    looks = " and ".join(filter(None, (text, _said(frame, turned))))
    text = f"{looks}: they then differ from those computed from the lengths by {now} instead of {before}"
    if rest > VISIBLE:
        return Mistake(f"{text}, and by {quantity(np.degrees(rest), 'deg', 2)} in a fit of the offsets", None)
    return Mistake(text, _turned(given, whole))


def _said(frame: str, turn: Rotation) -> str:
    """Return the sentence that orientations are turned in a frame; empty without one."""
    about = turn.as_rotvec()
    angle = float(np.linalg.norm(about))
    size, axis = quantity(np.degrees(angle), "deg", 3), quantity_row(np.round(about / max(angle, 1e-12), 2), digits=2)
    return frame and f"the {frame} of the orientations looks turned by {size} about ({axis})"


def _turned(given: Measurements, rotation: Rotation) -> Measurements:
    """Return measurements with other orientations where they were measured."""
    assert given.poses is not None
    angles = np.where(np.isfinite(given.poses[:, 3:]), points.angles(rotation.as_matrix()), np.nan)
    return given.changed(poses=np.hstack([given.poses[:, :3], angles]))


def _fitted(robot: Robot, given: Measurements) -> tuple[float, dict[str, np.ndarray]]:
    """Return the sum of squares with offsets and the CoM fitted, and the turns from the measured orientations.

    The turns are of the world and of the sensor, in the axes of each, (n, 3) [rad]. Samples that fit far worse than
    most count only up to a limit, because wrong readings should not decide.
    """
    few = np.unique(np.linspace(0, len(given) - 1, min(len(given), MOST_FITTED)).astype(int))
    groups = ("offsets", "com") if needs_balance(robot, given) and robot.weight else ("offsets",)
    model = model_of(robot, given.only(np.isin(np.arange(len(given)), few)), groups, {})
    found, model = fit_from(model, model.begin(), length_of(robot), enough=ENOUGH)
    model, found = without_slack(model, found, length_of(robot))
    squares = model.residuals(found.state).of_samples
    cost = float(np.minimum(squares, MOST_WRONG * np.median(squares)).sum())
    turns = Rotation.from_matrix(found.state.turn).as_rotvec()
    seen = Rotation.from_matrix(model.poses(found.state)[1])  # a turn is the same in the axes that it leads to
    return cost, {"world": turns, "sensor": seen.inv().apply(turns)}


def _rest(
    robot: Robot, given: Measurements, rotation: Rotation, turns: dict[str, np.ndarray], frame: str, up: np.ndarray
) -> Rotation:
    """Return the turn of the world about the vertical, or of the sensor, after which the mean turn is 0, or none.

    - `turns`: of `_fitted` with the orientations `rotation`.
    """

    def mean(turns: dict[str, np.ndarray]) -> np.ndarray:
        return turns[frame].mean(axis=0) @ (np.outer(up, up) if frame == "world" else np.eye(3))

    first = mean(turns)
    by = Rotation.from_rotvec(first)
    changed = _fitted(robot, _turned(given, by * rotation if frame == "world" else rotation * by))[1]
    again = float(mean(changed) @ first / max(first @ first, 1e-300))  # nearly linear in the turn
    return Rotation.from_rotvec(first / (1 - again) if abs(again) < 1 else np.zeros(3))
