"""`carriers_at`: poses and thrusts of a robot's carriers over a recording, also in a frame of north, east, down."""

from collections.abc import Sequence

import numpy as np

from ...base.errors import InputError
from ...base.text import quantity
from ...models import points
from ...models.robot import Robot
from .mapping import Fields, LogMap, carrier_fields, command_fields
from .measurements import Measurements
from .recording import Field, Recording, Samples
from .smoothing import FEWEST, Polynomials, continuous, within
from .streams import Reader, at_times
from .thrust_gains import notes as notes_of_gains, thrust_gains

MOST_TILT = 1.1 * np.pi
LEAST_THRUST, MOST_THRUST = 0.6, 3.0  # times the weight, of thrusts in newtons
# Rotations from north, east, down to {G}, by the axis of x of {G}; and from forward, right, down to x, y, z of a body.
FROM_NED = {"east": np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]]), "north": np.diag([1.0, -1, -1])}
FROM_FRD = np.diag([1.0, -1, -1])
HANGS = 0.5  # of the height of carriers above the load at home: less is a load on the ground beside its carriers


def filled(times: np.ndarray | None, samples: Samples, field: Field) -> np.ndarray:
    """Return samples at other times; before, after and inside gaps the nearest ones are held."""
    values = at_times(times, samples, field).values
    good = np.isfinite(values).all(axis=1)
    if not good.any():
        raise InputError(f"{field.full} must have samples at the times of the poses, got none")
    if good.all() or times is None:
        return values
    return np.column_stack([np.interp(times, times[good], column[good]) for column in values.T])


def _plausible(robot: Robot, thrusts: np.ndarray, names: Sequence[str], notes: list[str]) -> np.ndarray:
    """Return thrusts (N, c) [N], nan of carriers that they could not hold up, or that fly without any load.

    `names` are the names of their fields, for a map.
    """
    result, gravity = thrusts.copy(), float(np.linalg.norm(robot.gravity))
    # In hover all thrusts together hold all weights, which gives the unit of thrusts from 0 to 1.
    flying = [i for i, carrier in enumerate(robot.carriers) if carrier.actuators and np.isfinite(thrusts[:, i]).any()]
    driven = [i for i in flying if np.nanmedian(thrusts[:, i]) != 0]
    count = sum(bool(carrier.actuators) for carrier in robot.carriers)
    weights = sum(getattr(robot.carriers[i], "mass", 0.0) * gravity + robot.weight / count for i in driven)
    together = float(np.nanmedian(thrusts[:, driven], axis=0).sum())
    for index in flying:
        carrier = robot.carriers[index]
        usual, own = float(np.nanmedian(thrusts[:, index])), getattr(carrier, "mass", 0.0) * gravity
        if not LEAST_THRUST * own < usual < MOST_THRUST * (own + robot.weight):
            result[:, index] = np.nan
            hint = ""
            if index in driven and together:
                each = ", ".join(f'"{name} [{weights / together:.3g} N]"' for name in names)
                hint = f"; a map may state their unit, as in 'thrusts: [{each}]'"
            notes.append(
                f"thrusts of {carrier.name} are not used: they are {quantity(usual, 'N', 3)} (median) for a weight of "
                f"{quantity(own, 'N', 3)}{hint}"
            )
    return result


def pulls_by_thrust(
    robot: Robot, measured: Measurements, poses: np.ndarray, thrusts: np.ndarray, notes: list[str]
) -> np.ndarray | None:
    """Return the pull of each carrier at its cable in {G}, (N, m, 3) [N], if all have one cable and recorded thrust.

    It is what remains of thrust (corrected by its gain), weight and inertia of the carrier, whose poses are (N, c, 6).
    """
    times, owner = measured.times, robot.carrier_of_cable
    known = np.asarray(np.isfinite(thrusts).all(axis=0))
    if times is None or len(times) <= 2 * FEWEST or len(set(owner)) < len(owner) or not known[owner].all():
        return None
    gains, parabolas = thrust_gains(robot, measured, poses, thrusts), Polynomials(times, within(times))
    notes += notes_of_gains(robot, gains, "so tensions are computed without this error")
    notes.append("tensions are computed from thrusts, weights and accelerations of the carriers")
    thrust_per_newton = {one.index: one.of(times) for one in gains}
    pulls = np.empty((len(times), len(owner), 3))
    for cable, index in enumerate(owner):
        turn = points.rotations(poses[:, index, 3:])
        along = np.einsum("nij,nj->ni", turn, thrust_per_newton.get(int(index), np.eye(3)[[2]]))
        acceleration = parabolas.fitted(poses[:, index, :3]).bends
        mass = robot.carriers[index].mass
        pulls[:, cable] = thrusts[:, index, None] * along + mass * (np.array(robot.gravity) - acceleration)
    return pulls


def carriers_at(
    robot: Robot,
    recordings: Sequence[Recording],
    given: LogMap | None,
    times: np.ndarray | None,
    count: int,
    notes: list[str],
) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (N, c, 6) [m, rad] and thrusts (N, c) [N] of the carriers at N = `count` times; nan: not recorded.

    Carriers that cannot move are at home. Without times, there are as many samples as in the recording. Thrusts are
    those that the map names, those with the names of carriers, or those with numbers; what is implausible is noted.
    """
    poses = np.tile(robot.carrier_home, (count, 1, 1))
    thrusts, vectors = np.full(poses.shape[:2], np.nan), []
    names: dict[str, None] = {}
    for index, carrier in enumerate(robot.carriers):
        if not carrier.free_coordinates(robot.drive):
            continue
        found = carrier_fields(recordings, given, carrier.name)
        if not found.position:
            found = carrier_fields(recordings, None, f"carrier {index + 1}")  # as `Measurements.save` names them
        reader = Reader(found)
        poses[:, index, :3] = np.nan
        if found.position:
            poses[:, index, :3] = at_times(times, reader.stream(found.position), found.position[0]).values
        if found.orientation:
            poses[:, index, 3:] = angles_at(times, reader, found, notes)
        elif not carrier.keeps_attitude:
            poses[:, index, 3:] = np.nan
        if found.thrusts:
            values = filled(times, reader.stream(found.thrusts), found.thrusts[0])
            names |= dict.fromkeys(one.full for one in found.thrusts)
            if len(found.thrusts) == 3:
                vectors.append(carrier.name)
            thrusts[:, index] = values[:, 0] if values.shape[1] == 1 else np.linalg.norm(values, axis=1)
    if vectors:
        named = ", ".join(vectors)
        notes.append(f"thrusts of {named} are vectors: their sizes are used, along the z axes of the bodies")
    flying = [i for i, carrier in enumerate(robot.carriers) if carrier.actuators]
    if flying and ((given and given.thrusts) or not np.isfinite(thrusts).any()):
        found = command_fields(recordings, given, robot.m, [carrier.name for carrier in robot.carriers])
        names = dict.fromkeys(one.full for one in found.thrusts)
        if found.thrusts and len(found.thrusts) != len(flying):
            wanted = f"{len(flying)} fields, one for each carrier that flies"
            raise InputError(f"thrusts must be {wanted}, got {len(found.thrusts)}")
        if found.thrusts:
            thrusts[:, flying] = filled(times, Reader(found).stream(found.thrusts), found.thrusts[0])
    return poses, _plausible(robot, thrusts, list(names), notes)


def angles_at(times: np.ndarray | None, reader: Reader, found: Fields, notes: list[str] | None = None) -> np.ndarray:
    """Return the orientation of a carrier at some times as angles, (N, 3) [rad]; nan: not recorded.

    Carriers do not turn over: roll and pitch that go beyond pi are in degrees, which is noted.
    """
    samples = reader.stream(found.orientation)
    if samples.values.shape[1] == 3:
        if np.nanmax(np.abs(samples.values[:, :2]), initial=0.0) > MOST_TILT:
            samples = Samples(samples.times, np.radians(samples.values))
            if notes is not None:
                notes.append(f"angles such as {found.orientation[0].full} are read in degrees, because they exceed pi")
        samples = Samples(samples.times, np.unwrap(samples.values, axis=0))
        return at_times(times, samples, found.orientation[0]).values
    from scipy.spatial.transform import Rotation

    values = at_times(times, Samples(samples.times, continuous(samples.values)), found.orientation[0]).values
    known = np.isfinite(values).all(axis=1) & (np.linalg.norm(values, axis=1) > 0.5)
    angles = np.full((len(values), 3), np.nan)
    angles[known] = points.angles(Rotation.from_quat(values[known]).as_matrix())
    return angles


def ned_frame(robot: Robot, poses: np.ndarray | None, carriers: np.ndarray) -> str | None:
    """Return where x of {G} points if the poses of a team are in a frame of north, east, down; otherwise None.

    Cables cannot push, so a load cannot be above all carriers that move, unless their frames are below it at home too,
    as with vehicles with masts. Without a position of the load, carriers below the origin that are above it at home
    are in such a frame. Which axis it is follows from the home poses.

    - `poses`: of the platform, (N, 6) [m, rad], nan where not measured.
    - `carriers`: of the carriers, (N, c, 6).
    """
    moving = [i for i in sorted(set(robot.carrier_of_cable)) if robot.carriers[i].moves]
    if not moving or len(moving) < len(set(robot.carrier_of_cable)) or np.any(robot.gravity[:2]):
        return None
    loaded = poses is not None and bool(np.isfinite(poses[:, :3]).any())
    at_home = robot.carrier_home[moving, :3] - (robot.home[:3] if loaded else 0.0)
    if not (at_home[:, 2] > 0).all() or not robot.gravity[2] < 0:
        return None
    away = carriers[:, moving, :3] - (poses[:, None, :3] if loaded and poses is not None else 0.0)
    away = away[(np.abs(away[..., 2]) > HANGS * at_home[:, 2]).all(axis=1) & np.isfinite(away).all(axis=(1, 2))]
    if not len(away) or (np.median(away[..., 2], axis=0) >= 0).any():
        return None
    middle = np.median(away, axis=0)
    if not loaded and len(moving) > 1:  # how the carriers lie to each other
        middle, at_home = middle - middle.mean(axis=0), at_home - at_home.mean(axis=0)
    return min(FROM_NED, key=lambda axis: float(np.linalg.norm(middle @ FROM_NED[axis].T - at_home)))


def from_ned(poses: np.ndarray, axis: str) -> np.ndarray:
    """Return poses (..., 6) [m, rad] in {G}, of poses in a frame of north, east, down; nan where not measured."""
    result, turn = poses.copy(), FROM_NED[axis]
    result[..., :3] = poses[..., :3] @ turn.T
    known = np.isfinite(poses[..., 3:]).all(axis=-1)
    result[known, 3:] = points.angles(turn @ points.rotations(poses[known, 3:]) @ FROM_FRD)
    return result


def carriers_from_ned(robot: Robot, poses: np.ndarray, axis: str) -> np.ndarray:
    """Return poses of carriers (N, c, 6) in {G}, as `from_ned`; carriers and attitudes at home are in {G} already."""
    result, home = poses.copy(), robot.carrier_home
    for i, carrier in enumerate(robot.carriers):
        if carrier.moves:
            result[:, i] = from_ned(poses[:, i], axis)
        if (poses[:, i, 3:] == home[i, 3:]).all():
            result[:, i, 3:] = home[i, 3:]
    return result


def platform_from_ned(robot: Robot, poses: np.ndarray | None, axis: str) -> np.ndarray | None:
    """Return poses of the platform (N, 6) in {G}, as `from_ned`; locked coordinates stay at home."""
    if poses is None:
        return None
    return np.where((robot.dof_mask > 0) | ~(poses == robot.home), from_ned(poses, axis), poses)


def note_of(axis: str, poses: np.ndarray | None) -> str:
    """Return the remark on converted poses, where those of the platform were `poses`, (N, 6) or None."""
    loaded = poses is not None and bool(np.isfinite(poses[:, :3]).any())
    why = "the load would be above its carriers" if loaded else "the carriers would be below the origin"
    return (
        f"{why}, so the poses are read as north, east, down, and forward, right, down of the bodies, with x of {{G}} "
        f"to the {axis}"
    )
