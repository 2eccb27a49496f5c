"""Recordings in the forms in which users have them, of robots that are simulated here without the models of towline."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import root
from scipy.spatial.transform import Rotation

EPOCH = 1_700_000_000  # [s]
GRAVITY = np.array([0.0, 0.0, 9.81])
CORNERS = np.array([[2.0, 1.5], [-2.0, 1.5], [-2.0, -1.5], [2.0, -1.5]])
FRAME = np.column_stack([CORNERS, np.full(4, 3.0)])
PLATFORM = np.column_stack([0.1 * CORNERS, np.full(4, 0.1)])
COM = np.array([0.01, -0.015, -0.2])
KGF = 9.80665
ROBOT = """name: {name}
source: made up
platform:
  mass: {mass}
  inertia: [0.3, 0.4, 0.5, 0, 0, 0]
  com: {com}
  home: {home}
{extra}carriers:
{carriers}
cables:
{cables}
"""
GROUND = ("{name: frame, kind: ground}",)


def write(path, header, rows, mark=",", form="%.10g"):
    lines = [mark.join(header), *(mark.join(x if isinstance(x, str) else form % x for x in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def robot_file(path, anchors, attachments, home, mass=5.0, com=(0, 0, 0), extra="", carriers=GROUND, cable=""):
    owners = [one.split("name: ")[1].split(",")[0] for one in carriers]
    lines = [
        f"  - {{carrier: {owners[i % len(owners)]}, anchor: {np.round(a, 6).tolist()}, "
        f"attachment: {np.round(b, 6).tolist()}, t_min: 0.01, t_max: 300{cable}}}"
        for i, (a, b) in enumerate(zip(anchors, attachments, strict=True))
    ]
    text = ROBOT.format(
        name=path.stem,
        mass=mass,
        com=[float(part) for part in com],
        home=np.round(home, 9).tolist(),
        extra=extra,
        carriers="\n".join(f"  - {one}" for one in carriers),
        cables="\n".join(lines),
    )
    path.write_text(text)
    return path


def solved(equations, start):
    found = root(equations, start, tol=1e-11)
    assert np.abs(found.fun).max() < 1e-7, found.message
    return found.x


def turned(vector):
    return Rotation.from_rotvec(vector).as_matrix()


def lengths_at(anchors, attachments, position, rotation):
    return np.linalg.norm(position[:, None] + np.einsum("nij,mj->nmi", rotation, attachments) - anchors, axis=-1)


def hanging(places):
    """Rotation vectors (N, 3) of a platform of weight 1 that hangs on four taut cables at places, and tensions (N, 4).

    The balance of forces and moments leaves one number open: both pairs of opposite cables pull alike.
    """
    weight = np.array([0, 0, -1.0])

    def equations(z, place):
        R = turned(z[:3])
        arms = PLATFORM @ R.T
        lines = FRAME - place - arms
        pull = z[3:, None] * lines / np.linalg.norm(lines, axis=1)[:, None]
        moments = np.cross(arms, pull).sum(axis=0) + np.cross(R @ COM, weight)
        return np.concatenate([pull.sum(axis=0) + weight, moments, [z[3] - z[4] + z[5] - z[6]]])

    found = [np.array([0, 0, 0, *[0.3] * 4])]
    for place in places:
        found.append(solved(lambda z, place=place: equations(z, place), found[-1]))
    found = np.array(found[1:])
    assert found[:, 3:].min() > 0
    return found[:, :3], found[:, 3:]


def hanging_robot(folder):
    return robot_file(folder / "hanging.yaml", FRAME, PLATFORM, [0, 0, 1.2, 0, 0, 0], com=COM)


def four_cables(folder, seconds=9):
    """Winches: mm, semicolons, ns since 1970, a line twice. Motion capture: 41 ms ahead, w first, gaps. The truth."""
    draw = np.random.default_rng(0)
    coarse = np.arange(0, seconds + 0.01, 0.1)
    places = np.array([0, 0, 1.2]) + np.array([0.8, 0.6, 0.3]) * np.sin(np.outer(coarse, [1.1, 0.8, 0.6]))
    curve = CubicSpline(coarse, np.hstack([places, hanging(places)[0]]))
    anchors, offsets = FRAME + draw.normal(0, 0.015, FRAME.shape), draw.normal(0, 0.05, 4)
    t, s = np.arange(0, seconds, 0.02), np.arange(0.5, seconds - 0.5, 0.01)
    readings = lengths_at(anchors, PLATFORM, curve(t)[:, :3], turned(curve(t)[:, 3:])) - offsets
    readings += draw.normal(0, 5e-4, readings.shape)
    rows = [[str(round((EPOCH + a) * 1e9)), *(1e3 * row)] for a, row in zip(t, readings, strict=True)]
    rows.insert(200, rows[200])
    write(folder / "winches.csv", ["timestamp", *(f"Winch{i + 1}_Length_mm" for i in range(4))], rows, ";")
    q = Rotation.from_rotvec(curve(s)[:, 3:]).as_quat()[:, [3, 0, 1, 2]]
    table = np.column_stack([EPOCH + s + 0.041, curve(s)[:, :3] + draw.normal(0, 3e-4, (len(s), 3)), q])
    rows = [list(row) for row in table]
    rows[300][1:] = [""] * 7  # hidden from the cameras
    header = ["time_s", "PosX", "PosY", "PosZ", *(f"quat_{axis}" for axis in "wxyz")]
    write(folder / "mocap.csv", header, rows, form="%.16g")
    return anchors, offsets


def locked(folder):
    """Locked winches: the platform swings on cables of constant lengths; motion capture in mm and degrees."""
    draw = np.random.default_rng(0)
    place = np.array([0.2, 0.1, 1.2])
    rest = np.concatenate([place, hanging([place])[0][0]])

    def lengths_of(pose):
        return np.linalg.norm(pose[:3] + PLATFORM @ turned(pose[3:]).T - FRAME, axis=1)

    lengths = lengths_of(rest)
    J = np.array([(lengths_of(rest + 1e-6 * e) - lengths_of(rest - 1e-6 * e)) / 2e-6 for e in np.eye(6)]).T
    free = np.linalg.svd(J)[2][4:]  # (2, 6)
    rows, pose = [], rest
    for t in np.arange(0, 10, 0.05):
        want = 0.25 * np.exp(-0.03 * t) * np.array([np.sin(3 * t), np.sin(3.4 * t + 1)])
        pose = solved(lambda p, want=want: np.concatenate([lengths_of(p) - lengths, free @ (p - rest) - want]), pose)
        euler = Rotation.from_rotvec(pose[3:]).as_euler("xyz", degrees=True)
        rows.append([t, *np.round(lengths, 4), *(1e3 * pose[:3] + draw.normal(0, 0.3, 3)), *euler])
    header = ["Time [s]", *(f"length{i + 1} [m]" for i in range(4))]
    header += ["X [mm]", "Y [mm]", "Z [mm]", "Roll [deg]", "Pitch [deg]", "Yaw [deg]"]
    return write(folder / "locked.csv", header, rows)


def statics(folder, offsets, count=27):
    """Rests of the hanging platform: lengths, angles of an AHRS, load cells in kgf. The positions."""
    draw = np.random.default_rng(0)
    places = draw.uniform([-0.9, -0.6, 0.8], [0.9, 0.6, 1.7], (count, 3))
    rotation, pull = hanging(places)
    lengths = lengths_at(FRAME, PLATFORM, places, turned(rotation)) - offsets + draw.normal(0, 1e-3, (count, 4))
    euler = Rotation.from_rotvec(rotation).as_euler("xyz", degrees=True) + draw.normal(0, 0.5, (count, 3))
    tensions = 5.0 * GRAVITY[2] / KGF * pull * (1 + draw.normal(0, 0.02, pull.shape))
    header = [*(f"l{i + 1}" for i in range(4)), "roll_deg", "pitch_deg", "yaw_deg"]
    header += [f"LoadCell{i + 1} [kgf]" for i in range(4)]
    write(folder / "statics.csv", header, np.hstack([lengths, euler, tensions]))
    return places


def planar(folder, seconds=24):
    """A planar robot at 1 m/s: drums wind 2 % too much, 34 ms between clocks, x and z alone. Robot, anchors."""
    draw = np.random.default_rng(0)
    anchors = np.array([[0, 0, 2.2], [2.9, 0, 2.2], [2.9, 0, 0.0], [0, 0, 0]])
    attachments = np.array([[-0.06, 0, 0.06], [0.06, 0, 0.06], [0.06, 0, -0.06], [-0.06, 0, -0.06]])

    def at(s):
        x, z = 1.45 + 0.9 * np.sin(1.1 * s) + 0.1 * np.sin(2.7 * s), 1.1 + 0.65 * np.sin(1.37 * s + 0.4)
        return np.column_stack([x, 0 * s, z])

    t = np.arange(0, seconds, 0.05)
    true = anchors + draw.normal(0, 0.01, anchors.shape) * [1, 0, 1]
    level = np.tile(np.eye(3), (len(t), 1, 1))
    readings = (lengths_at(true, attachments, at(t), level) - draw.normal(0, 0.02, 4)) / 1.02
    readings += draw.normal(0, 2e-4, readings.shape)
    position = at(t + 0.034)[:, [0, 2]] + draw.normal(0, 1e-4, (len(t), 2))
    header = ["time", *(f"cable_len_{i}" for i in range(4)), "ee_x", "ee_z"]
    write(folder / "planar.csv", header, np.column_stack([t, readings, position]))
    home = [1.45, 0, 1.1, 0, 0, 0]
    return robot_file(folder / "planar.yaml", anchors, attachments, home, extra="  dof: [x, z, pitch]\n"), true


def team(seconds=20, drag=0.0):
    """Two quadrotors with a point mass at 100 Hz: times, position of the load, and of each drone and its cable.

    These are the drone's position, rotation, thrust, and the unit vector from load to drone. `drag` [N s/m] is that of
    the load.
    """
    dt, masses, lengths, load = 1e-3, (0.6, 0.65), (0.82, 0.79), 0.4
    t = np.arange(-0.1, seconds + 0.1, dt)
    kept = slice(100, -100, 10)

    def second(values):
        return np.gradient(np.gradient(values, dt, axis=0), dt, axis=0)

    x = np.column_stack([np.sin(0.9 * t), 0.7 * np.sin(1.2 * t), 1 + 0.3 * np.sin(0.7 * t)])
    apart = np.column_stack([1.2 + 0.2 * np.sin(0.5 * t), 0.3 * np.sin(0.8 * t), 0.1 * np.sin(0.6 * t)])
    drones = []
    for mass, length, sign in zip(masses, lengths, (1, -1), strict=True):
        pull = (load * (second(x) + GRAVITY) + drag * np.gradient(x, dt, axis=0)) / 2 + sign * apart
        q = pull / np.linalg.norm(pull, axis=1, keepdims=True)
        p = x + length * q
        force = mass * (second(p) + GRAVITY) + pull
        thrust = np.linalg.norm(force, axis=1)
        up, yaw = force / thrust[:, None], 0.4 * np.sin(0.3 * t) + (1 - sign) / 2
        side = np.cross(up, np.column_stack([np.cos(yaw), np.sin(yaw), 0 * yaw]))
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        drones.append([part[kept] for part in (p, np.stack([np.cross(side, up), side, up], axis=2), thrust, q)])
    return t[kept], x[kept], drones


def team_robot(folder):
    """Its robot file, with cables of 0.8 m and a load of 0.35 kg."""
    carriers = [
        f"{{name: cf{i + 1}, kind: quadrotor, home: [{0.4 * (1 - 2 * i)}, 0, 1.7, 0, 0, 0], mass: {mass}, "
        "inertia: [0.002, 0.002, 0.003, 0, 0, 0], thrust_max: 20, torque_max: [0.5, 0.5, 0.1], tilt_max: 0.8, "
        "speed_max: 8, acceleration_max: 8}"
        for i, mass in enumerate((0.6, 0.65))
    ]
    ends, more = np.zeros((2, 3)), {"cable": ", length: 0.8", "extra": "  dof: [x, y, z]\n", "carriers": carriers}
    robot = robot_file(folder / "team.yaml", ends, ends, [0, 0, 1, 0, 0, 0], 0.35, **more)
    robot.write_text(robot.read_text() + "drive: fixed-length\n")
    return robot


def directions_of(drones, frame="world", sign=-1, noise=0.01, seed=1):
    """Unit vectors (N, 2, 3) along the cables: -1: from drone to load; seen from the world or the drones."""
    draw = np.random.default_rng(seed)
    found = []
    for _, R, _, q in drones:
        d = sign * q + draw.normal(0, noise, q.shape)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        found.append(np.einsum("nji,nj->ni", R, d) if frame == "carrier" else d)
    return np.stack(found, axis=1)


def flight(path, recorded, directions, names, load=True, throttle=1.0):
    """A table in ms since 1970: drones by their names, thrusts, directions under `names`, the load if wished."""
    t, x, drones = recorded
    draw, header, data = np.random.default_rng(2), ["timestamp"], [np.round(1e3 * (EPOCH + t))]
    for i, (p, R, thrust, _) in enumerate(drones):
        header += [f"cf{i + 1}.{part}" for part in ("x", "y", "z", "qx", "qy", "qz", "qw", "thrust")]
        noisy = thrust * (1 + draw.normal(0, 0.01, len(t))) / throttle
        data += [p + draw.normal(0, 5e-4, p.shape), Rotation.from_matrix(R).as_quat(), noisy]
    header, data = [*header, *names], [*data, directions.reshape(len(t), -1)]
    if load:
        header, data = [*header, *(f"payload_{axis}" for axis in "xyz")], [*data, x + draw.normal(0, 5e-4, x.shape)]
    return write(path, header, np.column_stack(data), form="%.13g")
