"""`read_log`: the measurements of a robot from one log or several, with one clock."""

import os
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.errors import InputError
from ...base.text import quantity
from ...models.files import AnyRobot, as_robot
from ...models.robot import Robot
from .alignment import Clock
from .cable_directions import in_world, vectors
from .carrier_poses import (
    FROM_FRD,
    FROM_NED,
    carriers_at,
    carriers_from_ned,
    ned_frame,
    note_of,
    platform_from_ned,
    pulls_by_thrust,
)
from .clocks import Seen, clock_of_poses, set_clocks_of_carriers
from .encoders import lengths_of, unrolled
from .load_cells import notes as unreadable_notes
from .mapping import Fields, LogMap, carrier_fields, fields_of, free_axes, listed, read_map
from .measurements import Measurements
from .names import LETTERED, corner
from .opening import recordings
from .pose_track import PoseTrack, unit_quaternions
from .recording import COUNTED, Field, Recording, Samples
from .streams import Reader, at_times, complete_samples, interpolated, like_time, seen
from .thrust_gains import notes_of_tilts

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
UNSURE = 0.1  # [s] sigma of clocks of carriers, which a calibration finds more exactly
AHRS = np.radians(0.5)  # sigma of orientations that no motion capture measured


class Log(NamedTuple):
    """Measurements with their origin.

    Attributes:
        measurements: The measurements.
        fields: The fields that they are from.
        notes: Remarks on files and clocks, one line each.
        begin: Reading of the lengths' clock at time 0 of the measurements [s].
        recordings: The files.
        clock: Clock of the poses, if it differs from the lengths' clock.
        ned: Direction of the x axis of {G}, if poses were converted from a frame of north, east, down.
        pulls: Pulls of carriers at their cables by thrusts, in {G}, (N, m, 3) [N], if these give the tensions.
    """

    measurements: Measurements
    fields: Fields
    notes: list[str]
    begin: float = 0.0
    recordings: Sequence[Recording] = ()
    clock: Clock | None = None
    ned: str | None = None
    pulls: np.ndarray | None = None


def read_measurements(
    path: Paths,
    sigma: float | Mapping[str, float] | None = None,
    poses: Paths | None = None,
    robot: AnyRobot | None = None,
    fields: str | os.PathLike[str] | None = None,
) -> Measurements:
    """Read measurements from a log: CSV, NetCDF, MCAP, or a bag of ROS 1 or ROS 2.

    Args:
        path: File, or several. CSV has a header such as `t [s], l0 [m], l1 [m], x [mm], y [mm], z [mm], roll [deg],
            ..., tension0 [N]`; NetCDF is from `Measurements.save` or a simulation, or has variables named like these
            columns. Empty fields or nan mark poses that were not measured. Messages of usual types are recognised.
        sigma: Standard deviations as for `Measurements`; default: as saved if `Measurements.save` wrote the file,
            otherwise the defaults of `Measurements`.
        poses: Log of the poses, if they are in another file; its clock is aligned by cable speeds.
        robot: Robot of the log, to align clocks and to find the poses of its moving carriers by their names.
        fields: YAML file with the names of the fields, such as `lengths: /winches/position[*] [m]`; default: usual
            names.

    Raises:
        InputError: If a file cannot be read, a field has an unknown unit, more than a fifth of the samples lack the
            lengths of some cables (fewer are left out), times do not increase, or clocks cannot be aligned.
    """
    return read_log(path, sigma, poses, robot, fields).measurements


def read_log(
    path: Paths,
    sigma: float | Mapping[str, float] | None = None,
    poses: Paths | None = None,
    robot: AnyRobot | None = None,
    fields: str | os.PathLike[str] | None = None,
    carriers: bool = True,
) -> Log:
    """Read measurements as `read_measurements`, with the fields that they are from and notes.

    Without `carriers` the poses of carriers are not read, nor the directions of cables.
    """
    known = None if robot is None else as_robot(robot)
    given = None if fields is None else read_map(fields)
    first = recordings(path)
    try:
        others = [] if poses is None else recordings(poses)
    except InputError as error:
        raise InputError(f"poses: {error}") from None
    where = "; ".join(one.where for one in [*first, *others])
    try:
        found = _fields([*first, *others] if given else first, others, given, known)
        everything = [*first, *others]
        clocks, apart = list[str](), False
        if known is not None and len(everything) > 1 and not found.position:
            clocks, apart = set_clocks_of_carriers(known, [], everything, given, None)
        read = measurements_of(found, everything, sigma, known, given)._replace(recordings=everything)
        moving = [carrier.name for carrier in known.carriers if carrier.moves] if known else []
        of_carriers = [carrier_fields(everything, given, name) for name in moving]
        if not found.position and (unknown := listed(everything, [found, *of_carriers])):
            read.notes.append(f"no positions are read; fields with unknown names are {unknown}")
        if known is not None and len(everything) > 1 and found.position:
            clocks, apart = _clocks(read, known, given)
        read.notes.extend(clocks)
        if apart and not (isinstance(sigma, Mapping) and "clocks" in sigma):
            sigmas = {**read.measurements.sigma._asdict(), "clocks": UNSURE}
            read = read._replace(measurements=read.measurements.changed(sigma=sigmas))
        if not carriers:
            return read
        return _with_directions(read if known is None else _with_carriers(read, known, given), known, given)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _times(read: Log) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return the times of the samples by the clocks of the lengths and of the poses, (N,) [s]."""
    times = None if read.measurements.times is None else read.measurements.times + read.begin
    if times is None or read.clock is None:
        return times, times
    return times, read.clock.offset + read.clock.rate * times


def _clocks(read: Log, robot: Robot, given: LogMap | None) -> tuple[list[str], bool]:
    """Set the clocks of carriers in files of their own by the poses of the platform, as `set_clocks_of_carriers`."""
    measured, seen = read.measurements, _times(read)[1]
    if seen is None or measured.poses is None or measured.m != robot.m:
        return [], False
    of_platform = {id(one.recording): one.recording for one in (*read.fields.position, *read.fields.lengths)}
    along = Seen(seen, measured.poses, lengths_of(robot, measured.lengths))
    return set_clocks_of_carriers(robot, list(of_platform.values()), read.recordings, given, along)


def _with_carriers(read: Log, robot: Robot, given: LogMap | None) -> Log:
    """Return the measurements with the poses of moving carriers, as far as they were recorded."""
    moving = [i for i, carrier in enumerate(robot.carriers) if carrier.moves]
    measured = read.measurements
    if not moving:
        return read
    poses, thrusts = carriers_at(robot, read.recordings, given, _times(read)[1], len(measured), read.notes)
    there = np.asarray(np.isfinite(poses[..., :3]).any(axis=(0, 2)))
    lost = ", ".join(robot.carriers[i].name for i in moving if not there[i])
    if lost:
        read.notes.append(f"the log has no poses of {lost}: assumed to be at home")
    if not there[moving].any():
        return read
    poses[:, ~there], thrusts[:, ~there] = robot.carrier_home[~there], np.nan
    still = np.isnan(poses[..., 3:]).all(axis=(0, 2))
    if still.any():
        names = ", ".join(robot.carriers[i].name for i in np.flatnonzero(still))
        read.notes.append(f"the log has no attitudes of {names}, which are assumed to be as at home")
        poses[:, still, 3:], thrusts[:, still] = robot.carrier_home[still, 3:], np.nan
    kept = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
    if not kept.any():
        raise InputError("lengths and poses of carriers must have samples at the same times, got none")
    if not kept.all():
        read.notes.append(f"samples skipped because carriers have no poses: {quantity(int((~kept).sum()))}")
    axis = ned_frame(robot, measured.poses, poses)
    if axis is not None:
        poses = carriers_from_ned(robot, poses, axis)
        read.notes.append(note_of(axis, measured.poses))
        measured = measured.changed(poses=platform_from_ned(robot, measured.poses, axis))
    measured, pulls = measured.only(kept).changed(carrier_poses=poses[kept]), None
    if measured.tensions is None:
        pulls = pulls_by_thrust(robot, measured, poses[kept], thrusts[kept], read.notes)
        measured = measured if pulls is None else measured.changed(tensions=np.linalg.norm(pulls, axis=2))
    return read._replace(measurements=measured, ned=axis, pulls=pulls)


def _with_directions(read: Log, robot: Robot | None, given: LogMap | None) -> Log:
    """Return the measurements with directions of the cables, if they were recorded, by the `robot` converted to {G}."""
    found, measured = read.fields.directions, read.measurements
    m = measured.m
    if not found or (robot is not None and m != robot.m):
        return read
    reader = Reader(Fields(directions=found, time=read.fields.time))
    times = None if measured.times is None else measured.times + read.begin
    samples = reader.stream(found)
    recorded = vectors(found, samples.values, m)
    for name, part in recorded.items():
        flat = bool(np.isnan(part[..., 2]).all())  # azimuths alone
        part = part[..., :2] if flat else part
        part = at_times(times, Samples(samples.times, part.reshape(len(part), -1)), found[0]).values
        part = part.reshape(len(part), m, -1)
        recorded[name] = np.pad(part, ((0, 0), (0, 0), (0, 1)), constant_values=np.nan) if flat else part
    if read.ned is not None:  # directions in the same frame, or in those of the bodies
        frames = {"in north, east, down": FROM_NED[read.ned], "in forward, right, down": FROM_FRD}
        for (name, part), (frame, turn) in product(list(recorded.items()), frames.items()):
            if np.isfinite(part @ turn.T).any():
                recorded[f"{name} {frame}".strip()] = part @ turn.T
    world, note = next(iter(recorded.values())), None
    if robot is not None:
        world, note = in_world(robot, measured, recorded, None if given is None else given.directions_in)
    seen, notes = measured.changed(directions=world), [*read.notes, *([note] if note else [])]
    if robot is not None and read.pulls is not None and not read.fields.position and seen.directions is not None:
        notes += notes_of_tilts(robot, seen.directions, read.pulls)
    return read._replace(measurements=seen, notes=notes)


def _fields(
    all_: Sequence[Recording], others: Sequence[Recording], given: LogMap | None, robot: Robot | None
) -> Fields:
    m = None if robot is None else robot.m
    moving = () if robot is None else [carrier.name for carrier in robot.carriers if carrier.moves]
    found = fields_of(all_, given, m, moving, free_axes(robot))
    if not found.directions and robot is not None:  # those of the carriers, in the order of their cables
        names = dict.fromkeys(robot.carriers[i].name for i in robot.carrier_of_cable)
        of = [carrier_fields(all_, given, name).directions for name in names]
        found = found._replace(directions=tuple(field for one in of for field in one if all(of)))
    if others and not given:
        of_poses = fields_of(others, None, m, moving, free_axes(robot))
        if not of_poses.position and not of_poses.orientation:
            raise InputError(f"poses must have columns x, y, z or an orientation, got {listed(others)}")
        times = found.time + of_poses.time
        found = found._replace(position=of_poses.position, orientation=of_poses.orientation, time=times)
    seen = found.position or found.directions
    if not found.lengths and not seen and robot is not None and robot.fixed_lengths is not None:
        wanted = "positions of the platform or directions of the cables, whose lengths are fixed"
        raise InputError(f"must have {wanted}, got {listed(all_)}")
    if not found.lengths and (robot is None or robot.fixed_lengths is None):
        raise InputError(f"must have columns l0, l1, ... of lengths, got {listed(all_)}")
    return found


def measurements_of(
    found: Fields,
    from_: Sequence[Recording],
    sigma: float | Mapping[str, float] | None,
    robot: Robot | None,
    given: LogMap | None = None,
) -> Log:
    """Return the measurements of some fields, at the times of whichever of lengths and poses has fewer samples."""
    notes = [note for one in from_ for note in one.notes]
    usual = [one for what in LETTERED if not (given and getattr(given, what)) for one in getattr(found, what)]
    if named := [one.full for one in usual if corner(one.full)]:
        notes.append(f"columns are assumed to be in the order of the cables: {', '.join(named)}; a map may change it")
    main_fields = found.lengths or found.position or found.directions
    main = main_fields[0]
    stated = main.recording.sigma
    sigmas: dict[str, Any] = {"sigma": sigma} if sigma is not None else {"sigma": dict(stated)} if stated else {}
    read = Reader(found)
    position = _whole(robot, read.stream(found.position), 0) if found.position else None
    lengths = read.stream(main_fields)
    values, rolled = unrolled(lengths.values)
    if found.lengths and rolled:
        lengths = Samples(lengths.times, values)
        names = ", ".join(found.lengths[i].full for i in rolled)
        notes.append(f"counters that begin again are continued: {names}")
    if not found.lengths and robot is not None:  # constant ones
        lengths = Samples(lengths.times, np.tile(np.asarray(robot.fixed_lengths), (len(lengths.values), 1)))
    if not len(lengths.values):
        raise InputError(f"{main.full} and fields like it must have samples at the same times, got none")
    tensions = read.stream(found.tensions) if found.tensions else Samples(lengths.times, lengths.values[:, :0])
    if found.tensions and (np.nanmedian(tensions.values, axis=0) < 0).all():
        notes.append("all tensions are negative, so they are read with the other sign")
        tensions = Samples(tensions.times, -tensions.values)
    orientation = _whole(robot, read.stream(found.orientation), 3) if found.orientation else None
    times = lengths.times
    if times is None and (like := like_time(main.topic, {one.name for of in found for one in of})):
        notes.append(
            f"{like} rises as a time does, but is not read as one; if it is, name it in a map: 'time: {like} [s]'"
        )
    begin = float(times[0]) if times is not None and times[0] > COUNTED else 0.0
    together = bool(found.position and found.orientation) and found.position[0].topic is found.orientation[0].topic
    position, orientation, unseen = seen(position, orientation, together)
    notes += unseen
    if position is not None and orientation is not None:
        orientation = at_times(position.times, orientation, found.orientation[0])
    pose = position or orientation
    source = (found.position or found.orientation or (main,))[0]
    together, clock = source.topic is main.topic, None
    is_split = together and pose is not None and found.lengths and of_two_sensors(lengths.values, pose.values)
    if is_split and times is not None:
        complete = np.isfinite(lengths.values).all(axis=1)
        together, lengths = False, Samples(times[complete], lengths.values[complete])
    if pose is not None and not together:
        if times is None or pose.times is None:
            lost = main.full if times is None else source.full
            raise InputError(
                f"lengths and poses of several files or topics must have times, got none for {lost}; a map "
                "(--fields) may name them, as in 'time: clock [ms]'"
            )
        places = np.full((len(pose.values), 3), np.nan) if position is None else position.values
        turns = places[:, :0] if orientation is None else unit_quaternions(orientation.values)
        pose = Samples(pose.times, np.hstack([places, turns]))  # (N, 3) or (N, 7)
        clock = clock_of_poses(lengths, pose, source, main, robot, given, from_)
        lengths, tensions, pose = _merged(lengths, tensions, pose, main, clock, notes)
        position, orientation = (Samples(pose.times, one) for one in (pose.values[:, :3], pose.values[:, 3:]))
    elif found.tensions:
        good = np.isfinite(tensions.values).all(axis=1)
        if tensions.times is not None:
            tensions = Samples(tensions.times[good], tensions.values[good])
        tensions = at_times(lengths.times, tensions, found.tensions[0])
    kept = complete_samples(lengths.values, found.lengths) & complete_samples(tensions.values, found.tensions)
    if not kept.all():
        notes.append(f"samples skipped because lengths or tensions are missing: {quantity(int((~kept).sum()))}")
    rows = slice(None) if kept.all() else kept  # a copy of a long log takes much memory
    arguments: dict[str, Any] = {"times": None if lengths.times is None else (lengths.times - begin)[rows]}
    sensors = {"tensions": (tensions, found.tensions), "poses": (position, found.position)}
    sensors["orientations"] = orientation, found.orientation
    arguments |= {name: one.values[rows] for name, (one, recorded) in sensors.items() if one is not None and recorded}
    if found.orientation and not found.position and "rotation" not in (sigmas.get("sigma") or {}):
        notes.append(
            f"orientations without positions are treated as accurate to {quantity(np.degrees(AHRS), 'deg', 2)}"
        )
        known = sigmas.get("sigma", {})
        sigmas["sigma"] = {"rotation": AHRS, **(known if isinstance(known, Mapping) else {"lengths": known})}
    measured = Measurements(lengths.values[rows], **arguments, **sigmas)
    measured.framed = source.recording.framed
    if measured.tensions is not None:
        notes += unreadable_notes(measured.tensions, measured.lengths)
    return Log(measured, found, [*notes, *read.notes], begin, clock=clock)


def _whole(robot: Robot | None, samples: Samples, first: int) -> Samples:
    """Return positions or orientations of which a planar robot's log has only the coordinates that can move."""
    if robot is None:
        return samples
    free = robot.dof_mask[first : first + 3] > 0
    if samples.values.shape[1] != free.sum() or free.all():
        return samples
    values = np.tile(robot.home[first : first + 3], (len(samples.values), 1))
    values[:, free] = samples.values
    return Samples(samples.times, np.where(np.isfinite(values).all(axis=1, keepdims=True), values, np.nan))


def _merged(
    lengths: Samples, tensions: Samples, pose: Samples, first: Field, clock: Clock | None, notes: list[str]
) -> list[Samples]:
    """Return lengths, tensions and poses at the same times; arguments as in `measurements_of`."""
    times, pose_times, poses = lengths.times, pose.times, pose.values
    assert times is not None
    assert pose_times is not None
    if clock is not None:
        pose_times = (pose_times - clock.offset) / clock.rate
        notes.append(f"{clock} (by cable speeds, whose correlation is {clock.likeness:.2f})")
    nowhere = np.isnan(poses[:, :3]).all()
    known = np.isfinite(poses[:, 3 if nowhere else 0 :]).all(axis=1)
    pose_times, poses = pose_times[known], poses[known]
    if len(pose_times) < 4:
        raise InputError(f"poses must be measured at four times or more, got {len(pose_times)}")
    if np.median(np.diff(pose_times)) >= 0.7 * np.median(np.diff(times)):
        at, inside = pose_times, (pose_times >= times[0]) & (pose_times <= times[-1])
    else:
        at, width = times, poses.shape[1]
        turned = Rotation.from_quat(poses[:, 3:] if width > 3 else np.tile([0, 0, 0, 1], (len(poses), 1))).as_matrix()
        whole = PoseTrack(pose_times, np.nan_to_num(poses[:, :3]), turned, np.ones(len(poses), dtype=bool))
        track = whole.at_times(times)
        inside = track.inside(0.0)
        places, matrices = track.at(0.0)[:2]
        places = np.where(nowhere, np.nan, places)
        poses = np.hstack([places, Rotation.from_matrix(matrices).as_quat()])[:, :width]
    moved = interpolated(at, lengths) if at is not times else lengths.values
    forces = at_times(at, tensions, first).values if tensions.values.size else np.empty((len(at), 0))
    kept = np.isfinite(moved).all(axis=1) & np.isfinite(forces).all(axis=1) & inside
    if not kept.any():
        raise InputError("lengths and poses must have samples at the same times, got none")
    if not kept.all():
        notes.append(f"samples skipped because not all sensors have them: {quantity(int((~kept).sum()))}")
    return [Samples(at[kept], one[kept]) for one in (moved, forces, poses)]


def of_two_sensors(lengths: np.ndarray, poses: np.ndarray) -> bool:
    """Return whether a table has separate lines for lengths (N, m) and for poses (N, k), with nan elsewhere."""
    complete, known = (np.isfinite(values).all(axis=1) for values in (lengths, poses))
    return bool((complete & known).sum() < 0.5 * min(complete.sum(), known.sum()))
