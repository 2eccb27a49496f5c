"""A robot as a MuJoCo model (MJCF): platform and carriers as bodies, cables as spatial tendons with a motor each.

    carrier of kind   is in MuJoCo
    ground            a body fixed to the world
    prescribed        a mocap body: set data.mocap_pos and data.mocap_quat
    mobile            a mocap body, set in the same fields
    quadrotor         a free body with a motor an actuator: thrust along its z axis, and three torques

The motor of a cable takes its tension [N] as control, inside its limits; positive pulls. The platform has a free joint,
or, if some of its coordinates cannot move, a joint for each that can. Air, elasticity and reach boxes are left out.
Angles are in radians, frames as in `models.rotation`. Source: MuJoCo's XML reference.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np

from ..base.errors import InputError
from ..models.part import COORDINATES, inertia_matrix
from ..models.robot import Robot

SMALLEST_INERTIA = 1e-14  # [kg m^2], just above what MuJoCo refuses


def to_mjcf(robot: Robot) -> str:
    """Return the MJCF text of `robot`, with bodies, sites, tendons and motors named after its parts.

    Names: body "platform", a body for each moving carrier with its name, sites "anchor1" and "attachment1", tendon
    and motor "cable1", and so on; motors "NAME thrust", "NAME torque x". Raises `InputError` if MuJoCo cannot
    express the robot: it has pulleys, an impossible inertia, a carrier named "platform", or a rotated home of a
    platform with fewer than six coordinates.
    """
    _check(robot)
    root = ET.Element("mujoco", model=robot.name)
    ET.SubElement(root, "compiler", angle="radian", eulerseq="zyx", autolimits="true")
    ET.SubElement(root, "option", gravity=_text(robot.gravity))
    world = ET.SubElement(root, "worldbody")
    tendons, motors = ET.SubElement(root, "tendon"), ET.SubElement(root, "actuator")
    _add_carriers(robot, world, motors)
    _add_platform(robot, world)
    for index, limits in enumerate(zip(robot.t_min, robot.t_max, strict=True), start=1):
        tendon = ET.SubElement(tendons, "spatial", name=f"cable{index}", width="0.003")
        ET.SubElement(tendon, "site", site=f"anchor{index}")
        ET.SubElement(tendon, "site", site=f"attachment{index}")
        # A tendon's positive force lengthens it, a tension shortens it.
        ET.SubElement(motors, "motor", name=f"cable{index}", tendon=f"cable{index}", gear="-1", ctrlrange=_text(limits))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _check(robot: Robot) -> None:
    for index, cable in enumerate(robot.cables):
        if cable.pulley is not None:
            raise InputError(f"cables[{index}].pulley must be null, because MuJoCo's tendons have none, got a pulley")
    for index, carrier in enumerate(robot.carriers):
        if carrier.name == "platform":
            raise InputError(f"carriers[{index}].name must not be 'platform', which is the platform's name in MuJoCo")
    bodies = {"platform": robot.inertia} if robot.platform.inertia else {}
    for index, carrier in enumerate(robot.carriers):
        if carrier.body is not None:
            bodies[f"carriers[{index}]"] = inertia_matrix(carrier.body.inertia)
    for name, inertia in bodies.items():
        moments = np.linalg.eigvalsh(inertia)
        if moments[2] > moments[0] + moments[1] + 1e-12 or moments[0] < SMALLEST_INERTIA:
            raise InputError(
                f"{name}.inertia must have principal moments of at least {SMALLEST_INERTIA:g} kg m^2, none above "
                f"the sum of the others, for MuJoCo, got {moments.round(12).tolist()}"
            )
    if len(robot.platform.dof) < 6 and any(robot.home[3:]):
        raise InputError(f"platform.home must be level unless all six coordinates move, got {robot.home.tolist()}")


def _add_carriers(robot: Robot, world: ET.Element, motors: ET.Element) -> None:
    for index, carrier in enumerate(robot.carriers):
        body = _body(world, carrier.name, carrier.home)
        if carrier.moves and carrier.body is None:
            body.set("mocap", "true")
        elif carrier.body is not None:
            ET.SubElement(body, "freejoint", name=carrier.name)
            _add_inertia(body, (0.0, 0.0, 0.0), *carrier.body)
            site = f"{carrier.name} centre"  # no part of a robot has a blank in its name
            ET.SubElement(body, "site", name=site, size="0.02")
            for actuator in carrier.actuators:
                limits = _text((actuator.low, actuator.high))
                motor = {"site": site, "gear": _text(actuator.wrench), "ctrlrange": limits}
                ET.SubElement(motors, "motor", {"name": f"{carrier.name} {actuator.name}", **motor})
        for cable, owner in enumerate(robot.carrier_of_cable, start=1):
            if owner == index:
                ET.SubElement(body, "site", name=f"anchor{cable}", pos=_text(robot.anchors[cable - 1]), size="0.01")


def _add_platform(robot: Robot, world: ET.Element) -> None:
    body = _body(world, "platform", tuple(robot.home))
    if len(robot.platform.dof) == 6:
        ET.SubElement(body, "freejoint", name="platform")
    else:
        # Slides first, then yaw, pitch, roll: each joint turns with those before it, so R = Rz Ry Rx.
        for name in (*COORDINATES[:3], *reversed(COORDINATES[3:])):
            if name in robot.platform.dof:
                axis = [0.0] * 3
                axis[COORDINATES.index(name) % 3] = 1.0
                kind = "slide" if name in COORDINATES[:3] else "hinge"
                ET.SubElement(body, "joint", name=name, type=kind, axis=_text(axis))
    some = max(1e-6 * robot.platform.mass, SMALLEST_INERTIA)  # MuJoCo wants some
    inertia = robot.platform.inertia or (some,) * 3 + (0.0,) * 3
    _add_inertia(body, robot.platform.com, robot.platform.mass, inertia)
    size = _text((robot.length, robot.length, 0.2 * robot.length))
    ET.SubElement(
        body, "geom", type="ellipsoid", size=size, contype="0", conaffinity="0", mass="0", rgba="0.4 0.6 0.8 0.6"
    )
    for index, attachment in enumerate(robot.attachments, start=1):
        ET.SubElement(body, "site", name=f"attachment{index}", pos=_text(attachment), size="0.01")


def _body(world: ET.Element, name: str, pose: Iterable[float]) -> ET.Element:
    numbers = list(pose)
    euler = _text(numbers[:2:-1])  # in the order in which they turn the body: yaw, pitch, roll
    return ET.SubElement(world, "body", name=name, pos=_text(numbers[:3]), euler=euler)


def _add_inertia(body: ET.Element, com: Iterable[float], mass: float, inertia: Iterable[float]) -> None:
    ET.SubElement(body, "inertial", pos=_text(com), mass=repr(mass), fullinertia=_text(inertia))


def _text(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)
