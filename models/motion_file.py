"""`save_motion`: a motion as NetCDF, or as MCAP with Foxglove's schemas, which viewers of recordings open."""

import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..base.inputs import InputError, check_ending, file_path
from ..base.netcdf import UNITS, Contents, Variable, save_netcdf
from ..base.writing import whole_file
from . import points
from .part import COORDINATES
from .robot import Robot

ENDINGS = (".nc", ".mcap")
WORLD, PLATFORM = "world", "platform"
SCENE_RATE = 30.0  # [Hz], at most
LINE_LIST = 2  # of Foxglove's LinePrimitive


def dimensions(robot: Robot, times: np.ndarray) -> dict[str, Variable]:
    """Return time (n,) [s], coordinate, carrier with its kind and whether it moves, and cable, from 1."""
    carriers = robot.carriers
    return {
        "time": Variable(("time",), times, {"units": "s"}),
        "coordinate": Variable(("coordinate",), np.array(COORDINATES)),
        "carrier": Variable(("carrier",), np.array([carrier.name for carrier in carriers])),
        "carrier_kind": Variable(("carrier",), np.array([carrier.kind for carrier in carriers])),
        "carrier_moves": Variable(("carrier",), np.array([carrier.moves for carrier in carriers])),
        "cable": Variable(("cable",), np.arange(1, robot.m + 1)),
    }


def over(dims: tuple[str, ...], values: np.ndarray, unit: str, about: str) -> Variable:
    """Return a variable with its unit and what it is."""
    return Variable(dims, values, {"units": unit, "long_name": about})


def motion_variables(platform: Iterable[np.ndarray], carriers: Iterable[np.ndarray]) -> dict[str, Variable]:
    """Return pose, velocity and acceleration over time, of the platform, (n, 6) each, and carriers, (n, c, 6) each."""
    variables = {}
    for name, part, its in zip(("pose", "velocity", "acceleration"), platform, carriers, strict=True):
        variables[name] = over(("time", "coordinate"), part, UNITS[name], f"{name} of the platform frame in G")
        about = f"{name} of each carrier in G"
        variables[f"carrier_{name}"] = over(("time", "carrier", "coordinate"), its, UNITS[name], about)
    return variables


def save_motion(robot: Robot, contents: Contents, file: str | os.PathLike[str]) -> Path:
    """Save the motion of a robot atomically, as the ending of the name says, and return the path.

    MCAP has the topics /tf (platform and carriers), /pose, /cables (lengths [m] as positions, tensions [N] as efforts)
    and /scene (the cables as lines). Raises `InputError` if the file cannot be written.
    """
    path = check_ending("file", file_path("file", file), *ENDINGS)
    if path.suffix.lower() == ".nc":
        return save_netcdf(contents, path)
    try:
        from mcap.writer import Writer
    except ImportError:
        raise InputError("file must end in .nc without the extra logs (pip install 'towline[logs]')") from None
    with whole_file(path) as temporary, temporary.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="towline")
        channels: dict[str, int] = {}
        for time, topic, kind, message in _messages(robot, contents):
            if topic not in channels:
                schema = json.dumps({"title": kind, **_schema(message)}).encode()
                number = writer.register_schema(f"foxglove.{kind}", "jsonschema", schema)
                channels[topic] = writer.register_channel(topic, "json", number)
            writer.add_message(channels[topic], time, json.dumps(message).encode(), time)
        writer.finish()
    return path


def _messages(robot: Robot, contents: Contents) -> Iterator[tuple[int, str, str, dict[str, Any]]]:
    """Yield time [ns], topic, schema and content of each message."""
    from scipy.spatial.transform import Rotation  # loads for longer than most commands take

    values = {name: variable.values for name, variable in {**contents.coordinates, **contents.variables}.items()}
    times, pose, carriers = values["time"], values["pose"], values["carrier_pose"]
    ends = np.stack([points.anchors(robot, carriers), points.attachments(robot, pose)], axis=2)  # (N, m, 2, 3)
    frames = np.concatenate([pose[:, None], carriers], axis=1)  # (N, 1 + c, 6)
    turned = Rotation.from_matrix(points.rotations(frames[..., 3:]).reshape(-1, 3, 3)).as_quat()
    turned = turned.reshape(*frames.shape[:2], 4)
    names = [PLATFORM, *(carrier.name for carrier in robot.carriers)]
    drawn = -np.inf
    for k, time in enumerate(times):
        nanoseconds = max(round(1e9 * float(time)), 0)
        stamp = {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}
        placed = [(_of("xyz", row[:3]), _of("xyzw", q)) for row, q in zip(frames[k], turned[k], strict=True)]
        parent = {"timestamp": stamp, "parent_frame_id": WORLD}
        transforms = [
            {**parent, "child_frame_id": name, "translation": position, "rotation": orientation}
            for name, (position, orientation) in zip(names, placed, strict=True)
        ]
        yield nanoseconds, "/tf", "FrameTransforms", {"transforms": transforms}
        body = {"position": placed[0][0], "orientation": placed[0][1]}
        yield nanoseconds, "/pose", "PoseInFrame", {"timestamp": stamp, "frame_id": WORLD, "pose": body}
        joints = [
            {"name": f"cable {i + 1}", "position": _number(length), "effort": _number(tension)}
            for i, (length, tension) in enumerate(zip(values["cable_lengths"][k], values["tensions"][k], strict=True))
        ]
        yield nanoseconds, "/cables", "JointStates", {"timestamp": stamp, "joints": joints}
        if time >= drawn + 1 / SCENE_RATE - 1e-9:
            drawn = time
            yield nanoseconds, "/scene", "SceneUpdate", {"deletions": [], "entities": [_cables(stamp, ends[k])]}


def _cables(stamp: dict[str, int], ends: np.ndarray) -> dict[str, Any]:
    """Return the cables between their ends (m, 2, 3) as an entity of a scene."""
    identity = {"position": _of("xyz", np.zeros(3)), "orientation": _of("xyzw", np.array([0.0, 0.0, 0.0, 1.0]))}
    points, colour = [_of("xyz", point) for point in ends.reshape(-1, 3)], {"r": 0.2, "g": 0.4, "b": 0.7, "a": 1.0}
    look = {"thickness": 2.0, "scale_invariant": True, "points": points, "color": colour, "colors": [], "indices": []}
    lasting = {"lifetime": {"sec": 0, "nsec": 0}, "frame_locked": True, "metadata": []}
    lines = {"type": LINE_LIST, "pose": identity, **look}
    return {"timestamp": stamp, "frame_id": WORLD, "id": "cables", **lasting, "lines": [lines]}


def _of(names: str, row: np.ndarray) -> dict[str, float | None]:
    return {name: _number(value) for name, value in zip(names, row, strict=True)}


def _number(value: Any) -> float | None:
    return float(value) if np.isfinite(value) else None  # JSON has no nan


def _schema(sample: Any) -> dict[str, Any]:
    """Return the JSON Schema of which a message is an instance."""
    if isinstance(sample, dict):
        return {"type": "object", "properties": {name: _schema(part) for name, part in sample.items()}}
    if isinstance(sample, list):
        return {"type": "array", "items": _schema(sample[0]) if sample else {}}
    kinds = {bool: "boolean", int: "integer", str: "string"}
    return {"type": kinds.get(type(sample), "number")}
