"""Recordings of a robot in motion, as MCAP and as bags of ROS 1 and ROS 2, written by the packages of others."""

import json

import numpy as np
from scipy.spatial.transform import Rotation

from towline.models import Dynamics, load

RATES = [2.1, 1.7, 2.7, 1.9, 2.4, 1.3]
TF = "tf2_msgs/msg/TFMessage"


def motion(robot, t, size=(1, 0.8, 0.3, 0.1, 0.1, 0.15)):
    """Poses (N, 6) of a swing through the workspace."""
    return robot.home + np.array(size) * np.sin(np.outer(t, RATES)) * robot.dof_mask


def recorded(name="cogiro", seconds=20, begin=0.0, noise=1e-3, seed=0):
    """Times, readings, times of poses and poses of two sensors that start at different times."""
    robot, draw = load(name), np.random.default_rng(seed)
    times, pose_times = np.arange(0, seconds, 0.01), np.arange(1, seconds - 2, 0.02)
    readings = Dynamics(robot).cable_lengths(motion(robot, times)) + draw.normal(0, noise, (len(times), robot.m))
    return begin + times, readings, begin + pose_times, motion(robot, pose_times)


def quaternions(poses):
    return Rotation.from_euler("xyz", poses[:, 3:]).as_quat()


def stamp(t):
    ns = round(t * 1e9)
    return {"sec": ns // 10**9, "nanosec": ns % 10**9}


def write_ros2_mcap(path, times, readings, pose_times, poses):
    from mcap_ros2.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = ("sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped")
    names = [f"winch_{i + 1}" for i in range(readings.shape[1])]
    with path.open("wb") as file:
        writer = Writer(file)
        joints, pose = (writer.register_msgdef(kind, store.generate_msgdef(kind, ros_version=2)[0]) for kind in kinds)
        for t, row in zip(times, readings, strict=True):
            order = np.random.default_rng(int(t * 100)).permutation(len(row))  # joints are told by their names
            message = {
                "header": {"stamp": stamp(t), "frame_id": ""},
                "name": [names[i] for i in order],
                "position": row[order].tolist(),
                "velocity": [],
                "effort": [],
            }
            writer.write_message("/winches", joints, message, round(t * 1e9), round(t * 1e9))
        for t, p, q in zip(pose_times, poses, quaternions(poses), strict=True):
            message = {
                "header": {"stamp": stamp(t), "frame_id": "map"},
                "pose": {
                    "position": dict(zip("xyz", p[:3], strict=True)),
                    "orientation": dict(zip("xyzw", q, strict=True)),
                },
            }
            # Recorded late: the stamp counts.
            writer.write_message("/mocap/pose", pose, message, round(t * 1e9) + 40_000_000, round(t * 1e9))
        writer.finish()
    return path


def write_json_mcap(path, times, readings, pose_times, poses):
    """Foxglove's schemas, as JSON."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, chunk_size=100_000)
        writer.start()
        channels = []
        for topic, kind in (("/joints", "foxglove.JointStates"), ("/frame", "foxglove.FrameTransform")):
            schema = writer.register_schema(kind, "jsonschema", b'{"type": "object"}')
            channels.append(writer.register_channel(topic, "json", schema))
        for t, row in zip(times, readings, strict=True):
            joints = [{"name": f"cable {i + 1}", "position": value} for i, value in enumerate(row)]
            ns = round(t * 1e9)
            writer.add_message(channels[0], ns, json.dumps({"joints": joints}).encode(), ns)
        for t, p, q in zip(pose_times, poses, quaternions(poses), strict=True):
            ns = round(t * 1e9)
            frame = {
                "parent_frame_id": "map",
                "child_frame_id": "platform",
                "translation": dict(zip("xyz", p[:3], strict=True)),
                "rotation": dict(zip("xyzw", q, strict=True)),
            }
            writer.add_message(channels[1], ns, json.dumps(frame).encode(), ns)
        writer.finish()
    return path


def _bag(writer, store, serialize, times, readings, pose_times, poses):
    """Fill a bag: joint states, and TF with a second frame that does not matter."""
    types = store.types
    seq = [0] if "seq" in types["std_msgs/msg/Header"].__dataclass_fields__ else []

    def head(t):
        return types["std_msgs/msg/Header"](*seq, types["builtin_interfaces/msg/Time"](*stamp(t).values()), "map")

    joints = writer.add_connection("/winches", "sensor_msgs/msg/JointState", typestore=store)
    tf = writer.add_connection("/tf", TF, typestore=store)
    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    transform, stamped = types["geometry_msgs/msg/Transform"], types["geometry_msgs/msg/TransformStamped"]
    names = [f"w{i}" for i in range(readings.shape[1])]
    for t, row in zip(times, readings, strict=True):
        message = types["sensor_msgs/msg/JointState"](head(t), names, row, np.array([]), np.array([]))
        writer.write(joints, round(t * 1e9), serialize(message, "sensor_msgs/msg/JointState"))
    for t, p, q in zip(pose_times, poses, quaternions(poses), strict=True):
        frames = [stamped(head(t), "platform", transform(vector(*p[:3]), quaternion(*q)))]
        writer.write(tf, round(t * 1e9), serialize(types[TF](frames), TF))


def write_ros1_bag(path, *log, compression=None):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
    writer = Writer(path)
    if compression:
        writer.set_compression(getattr(Writer.CompressionFormat, compression))
    with writer:
        _bag(writer, store, store.serialize_ros1, *log)
    return path


def write_ros2_bag(path, *log):
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=9) as writer:
        _bag(writer, store, store.serialize_cdr, *log)
    return path
