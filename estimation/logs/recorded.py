"""`read_recorded`: the motion and the commands of a robot over a recording, for its replay."""

import os
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.csv_columns import LENGTHS
from ...base.display import Displayed
from ...base.errors import InputError
from ...models.files import AnyRobot, as_robot
from ...models.robot import Robot
from ..calibration.correction import corrected_log
from ..calibration.plausibility import mistake
from ..pose.from_log import poses_from_log
from .carrier_poses import carriers_at, carriers_from_ned, filled, ned_frame, note_of, platform_from_ned
from .encoders import lengths_of
from .load_cells import unreadable
from .mapping import Fields, carrier_fields, command_fields, read_map
from .reading import Log, Paths, read_log
from .recording import Field
from .streams import Reader
from .thrust_gains import notes as notes_of_gains, thrust_gains

TO_COMPARE = "poses, or tensions or lengths that do not drive the plant"


@dataclass(frozen=True, eq=False)
class Recorded(Displayed):
    """N samples of a robot's motion and of its commands, as far as they were recorded, with one clock."""

    robot: Robot  # the robot
    times: np.ndarray  # (N,) [s], increasing
    pose: np.ndarray  # poses of the platform frame in {G}, (N, 6) [m, rad], nan where not measured
    # which coordinates of the pose are measured, (6,) of bool; the others are computed from the lengths
    measured: np.ndarray
    lengths: np.ndarray | None  # unstrained cable lengths by the encoders of the file, (N, m) [m], or None
    tensions: np.ndarray | None  # (N, m) [N], or None
    # commanded unstrained lengths [m], or tensions or forces of the winches' motors [N], (N, m), or None
    commands: np.ndarray | None
    commanded: str  # "lengths", "tensions" or "forces"
    # poses of the carriers in {G}, (N, c, 6) [m, rad]; those that never move are at home. A carrier that moves and was
    # not recorded has nan.
    carrier_pose: np.ndarray
    thrusts: np.ndarray  # thrust of each carrier, (N, c) [N], nan where not recorded
    notes: Sequence[str]  # remarks, one line each
    doubt: str | None = None  # probable input error of the log, in one line, or None
    # True if poses to compare with are computed from lengths and directions of cables, whose errors they include
    computed: bool = False
    # True if `lengths` follow from those under tension, by the tensions and the file's stiffness, which they hide
    under_tension: bool = False


def read_recorded(
    robot: AnyRobot,
    log: Paths,
    poses: Paths | None = None,
    fields: str | os.PathLike[str] | None = None,
    fix: bool = False,
) -> Recorded:
    """Read the motion and the commands of a robot from a log.

    - `robot`: the robot; its moving carriers are found by their names.
    - `log`, `poses`, `fields`: as `path`, `poses` and `fields` of `read_measurements`.
    - `fix`: True to correct probable input errors of the log, also with the encoders of the robot and in its commands.
      Commanded lengths that agree better with the corrected readings without this are used as recorded.

    Raises `InputError` as `read_measurements`, if the log has no times, or with `fix` as `corrected` and if carriers
    move.
    """
    known = as_robot(robot)
    encoded, columns = known, np.arange(known.m)  # of the log, in the order of the cables
    if fix and any(carrier.moves for carrier in known.carriers):
        raise InputError(f"fix must be False for {known.name}, because its carriers move, got True")
    try:
        read = read_log(log, None, poses, known, fields, carriers=False)
        if read.fields.directions and not read.fields.position:  # from which poses follow
            read = read_log(log, None, poses, known, fields)
    except InputError as error:
        raise (InputError(f"log: {error}") if isinstance(log, list | tuple) else error) from None
    given = None if fields is None else read_map(fields)
    where = "; ".join(one.where for one in read.recordings)
    try:
        measured = read.measurements
        if measured.m != known.m:
            raise InputError(f"must have a length for each of the {known.m} cables of {known.name}, got {measured.m}")
        names = [carrier.name for carrier in known.carriers]
        found = command_fields(read.recordings, given, known.m, names)
        placed = [name for name in names if carrier_fields(read.recordings, given, name).position]
        if missing := missing_for_replay(read.fields, found, measured.times is not None, known, placed):
            raise InputError(f"must have {missing} for a replay, got none")
        if fix:
            read, correction = corrected_log(known, read)
            known, measured, columns = correction.robot, read.measurements, correction.columns
        assert measured.times is not None
        times, notes = measured.times + read.begin, list(read.notes)
        reader = Reader(found)

        def at(which: Sequence[Field], size: int) -> np.ndarray | None:
            if not which:
                return None
            if len(which) != size:
                raise InputError(f"{which[0].full} must be one of {size} fields, got {len(which)}")
            return filled(times, reader.stream(which), which[0])[:, columns]

        def apart(commands: np.ndarray) -> float:
            away = commands - lengths_of(known, measured.lengths)
            return float(np.median(np.abs(away - np.median(away, axis=0)), axis=0).sum())

        efforts = at(found.efforts, known.m) if measured.tensions is None else None
        commands, is_length = at(found.commands, known.m), bool(found.commands) and found.commands[0].unit in LENGTHS
        motors = bool(found.commands) and re.search("motor(?!.*tension)", found.commands[0].full.lower()) is not None
        lengths = lengths_of(known, measured.lengths) if read.fields.lengths else None
        under_tension = lengths is not None and efforts is not None
        if lengths is not None and under_tension:
            lengths = lengths / lengths_of(known, np.ones_like(efforts), efforts) * lengths_of(known, np.ones(known.m))
        if commands is not None and is_length:
            # Readings may have errors that the commands do not have.
            as_read = lengths_of(encoded, commands[:, np.argsort(columns)])
            commands = min(lengths_of(known, commands), as_read, key=apart)
        if found.commands and found.commands == read.fields.lengths:  # which are not measured
            lengths = None
        sensed = not found.commands or found.commands != read.fields.tensions
        tensions = efforts if efforts is not None else measured.tensions if sensed else None
        if tensions is not None and lengths is not None and unreadable(tensions, measured.lengths).any():
            tensions = None
            notes.append("tensions are left out of the replay, because some were not measured")
        pose, known_part, computed = _poses(known, read, notes)
        checked = lengths is not None and not any(carrier.moves for carrier in known.carriers)
        wrong = mistake(known, measured) if checked else None
        carrier_pose, thrusts = carriers_at(known, read.recordings, given, times, len(times), notes)
        axis = read.ned or ned_frame(known, pose, carrier_pose)
        if axis is not None:
            notes += [] if read.ned else [note_of(axis, pose)]
            pose = pose if read.ned else np.asarray(platform_from_ned(known, pose, axis))
            carrier_pose = carriers_from_ned(known, carrier_pose, axis)
        else:
            gains = thrust_gains(known, measured, carrier_pose, thrusts)
            notes += notes_of_gains(known, gains, "so the replay flies with other forces")
        doubt, commanded = wrong.doubt if wrong else None, "forces" if motors else "tensions"
        return Recorded(
            robot=known,
            times=times,
            pose=pose,
            measured=known_part,
            lengths=lengths,
            tensions=tensions,
            commands=commands,
            commanded="lengths" if is_length else commanded,
            carrier_pose=carrier_pose,
            thrusts=thrusts,
            notes=notes,
            doubt=doubt,
            computed=computed,
            under_tension=under_tension,
        )
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(where) else f"{where}: {text}") from None


def _poses(robot: Robot, read: Log, notes: list[str]) -> tuple[np.ndarray, np.ndarray, bool]:
    """Return poses (N, 6), which of their coordinates are known, (6,), and whether directions of cables gave some.

    Locked coordinates are at home.
    """
    measured, moves = read.measurements, robot.dof_mask > 0
    poses = np.full((len(measured), 6), np.nan) if measured.poses is None else measured.poses.copy()
    known, seen = np.asarray(np.isfinite(poses).any(axis=0)), False
    if not known[moves].all():
        seen = measured.directions is not None
        if not seen and (any(carrier.moves for carrier in robot.carriers) or not read.fields.lengths):
            raise InputError("must have poses of the platform, position and orientation, got others")
        computed = poses_from_log(robot, measured).estimate.pose
        poses[:, ~known] = computed[:, ~known]
        means = "lengths and directions of the cables" if seen else "lengths"
        notes.append(f"coordinates of the pose that were not measured are computed from the {means}")
        known |= seen
    poses[:, ~moves] = np.where(np.isfinite(poses[:, moves]).all(axis=1, keepdims=True), robot.home[~moves], np.nan)
    return poses, known & moves, seen


def missing_for_replay(
    found: Fields, commands: Fields, timed: bool, robot: Robot | None = None, placed: Collection[str] = ()
) -> str | None:
    """Return what a log lacks for a replay, or None.

    - `found`: fields of the measurements.
    - `commands`: fields of commands and efforts, as of `command_fields`.
    - `timed`: True if the measurements have times.
    - `robot`: the robot, if it is known.
    - `placed`: names of the carriers whose positions were recorded.
    """
    fixed = robot is not None and robot.fixed_lengths is not None
    moving = [] if robot is None else [one.name for one in robot.carriers if one.free_coordinates(robot.drive)]
    turns = robot is None or bool(robot.dof_mask[3:].any())
    if not timed:
        return "times"
    if lost := next((name for name in moving if name not in placed), None):
        return f"poses of carrier {lost} ({lost}_x, ..., {lost}_qw)"
    whole = bool(found.position) and (bool(found.orientation) or not turns)
    if not (whole or found.directions) and (moving or not found.lengths):
        return "poses of the platform, position and orientation,"
    read = bool(found.lengths) and commands.commands != found.lengths
    pulled = bool(commands.efforts if not found.tensions else commands.commands != found.tensions)
    compared = bool(found.position or found.directions) + bool(turns and found.orientation) + read + pulled
    driving = 0 if fixed or commands.commands else 1  # measured lengths or tensions
    return None if compared > driving else TO_COMPARE
