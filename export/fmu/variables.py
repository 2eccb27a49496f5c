"""The variables of a unit, where the record of sources/unit.h has them, and the XML files that describe them."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...base.version import __version__
from ...models.part import COORDINATES
from ...models.record import FREE, RESTS, record_of
from ...models.robot import Robot
from ...plant import layout

PARTS = ("plant", "controller", "both")
CABLES = {"tensions": ("tension", "N"), "forces": ("force", "N"), "lengths": ("length", "m"), "rates": ("rate", "m/s")}
Named = Sequence[tuple[str, str]]  # names and units
# Units of translations and rotations.
_MOTION = {"pose": ("m", "rad"), "velocity": ("m/s", "rad/s"), "acceleration": ("m/s2", "rad/s2")}
_JERK = {"jerk": ("m/s3", "rad/s3")}
_SIMULATES, _CONTROLS = ("plant", "both"), ("controller", "both")
# Parts that have a parameter, its name and unit, its place, its least value, and what it is.
_PARAMETERS = (
    (_SIMULATES, "plant.mass", "kg", "mass", 1e-9, "mass of the platform"),
    (_SIMULATES, "plant.longest_step", "s", "longest_step", 1e-9, "longest Runge-Kutta step"),
    (_SIMULATES, "plant.winding_time", "s", "winding_time", 1e-9, "time for which winches keep their rates"),
    (_SIMULATES, "plant.tension_lag", "s", "plant.tension_lag", 0.0, "lag of commanded tensions"),
    (_SIMULATES, "plant.winch_bandwidth", "rad/s", "plant.winch_bandwidth", 1e-3, "bandwidth of winches"),
    (_SIMULATES, "plant.carrier_bandwidth", "rad/s", "plant.carrier_bandwidth", 1e-3, "bandwidth of mobile carriers"),
    (_CONTROLS, "controller.bandwidth", "rad/s", "bandwidth", 0.0, "bandwidth of the error dynamics"),
    (_CONTROLS, "controller.damping", "", "damping", 0.0, "damping ratio of the error dynamics"),
    (_CONTROLS, "controller.integral", "1/s3", "integral", 0.0, "gain of the integral of errors"),
    (_CONTROLS, "controller.observer", "rad/s", "controller.observer", 0.0, "bandwidth of estimated disturbances"),
    (("both",), "controller.period", "s", "period", 1e-6, "period of the controller"),
)
# Exponents of kg, m and s; an angle has none, but rad.
UNITS = {
    "s": {"s": 1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "m/s3": {"m": 1, "s": -3},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "rad/s2": {"rad": 1, "s": -2},
    "rad/s3": {"rad": 1, "s": -3},
    "1/s3": {"s": -3},
    "kg": {"kg": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N.s/m": {"kg": 1, "s": -1},
}


class Variable(NamedTuple):
    """A variable of type Float64.

    Its causality is a term of FMI, its `place` a member of `towline_unit`, and `least` the smallest value that it can
    take; nan: any, also none, as from a sensor.
    """

    name: str
    causality: str
    unit: str
    place: str
    start: float
    about: str
    least: float = -np.inf


def variables_of(robot: Robot, part: str, winches: str | None, data: Mapping[str, Any]) -> list[Variable]:
    """Return the variables of a unit, in the order of their value references.

    - `part`: one of `PARTS`.
    - `winches`: drive of winches that an importer commands, a key of `CABLES`; None if tensions are commanded.
    - `data`: values of the members of `towline_unit` at the start.
    """
    simulates, controls = part != "controller", part != "plant"
    sensor, sensed = ("output", -np.inf) if simulates else ("input", np.nan)
    order, most = "output" if controls else "input", max(len(carrier.actuators) for carrier in robot.carriers)
    bodies = record_of(robot)["body"]["motion"][1 : 1 + len(robot.carriers)]
    moving = [(int(k), f"carrier[{k + 1}]", robot.carriers[k]) for k in np.flatnonzero(bodies != RESTS)]
    rows = [Variable("time", "independent", "s", "time", 0.0, "simulated time")]

    def add(causality: str, named: Named, member: str, about: str, first: int = 0, least: float = -np.inf) -> None:
        for i, (name, unit) in enumerate(named, first):
            place = f"{member}[{i}]"
            rows.append(Variable(name, causality, unit, place, float(data[member][i]), about, least))

    def cables(name: str, unit: str) -> Named:
        return [(name.format(i + 1), unit) for i in range(robot.m)]

    velocity = {name: _MOTION[name] for name in ("pose", "velocity")}
    add(sensor, _motion("platform", velocity), "measured", "motion of the platform", 0, sensed)
    for k, name, carrier in moving:
        about = f"motion of carrier {carrier.name}"
        add(sensor, _motion(name, velocity), "measured", about, 12 * (1 + k), sensed)
    about = "mean tension in the last step, as a sensor reports it"
    add(sensor, cables("cable[{}].mean_tension", "N"), "mean_tension", about, 0, sensed)
    if simulates:
        add("output", cables("cable[{}].tension", "N"), "tension", "tension")
        lengths = [*cables("cable[{}].length", "m"), *cables("cable[{}].rate", "m/s")]
        add("output", lengths, "lengths", "distance between the ends along the cable, or its rate")
        if robot.platform.aero:
            add("input", [(f"wind.{axis}", "m/s") for axis in "xyz"], "wind", "velocity of the air")
        both = (("force", "N"), ("moment", "N.m"))
        wrench = [(f"wrench.{name}.{axis}", unit) for name, unit in both for axis in "xyz"]
        add("input", wrench, "wrench", "force or moment about the CoM on the platform, besides cables and weight")
    if controls:
        add("input", _motion("reference", _MOTION), "reference", "reference of the platform", 0, np.nan)
        add("input", cables("reference.tension[{}]", "N"), "t_ref", "tension to stay near", 0, np.nan)
        for k, name, carrier in moving:
            about = f"reference of carrier {carrier.name}"
            add("input", _motion(f"reference.{name}", _MOTION), "carriers", about, 18 * k, np.nan)
            add("input", _motion(f"reference.{name}", _JERK), "jerks", about, 6 * k)
        rows.append(Variable("answered", "output", "", "answered", 0.0, "0: as planned, 2: soft wrench, 3: hold"))
    what, unit = CABLES[winches or "tensions"]
    member, least = "winches" if winches else "tensions", 1e-3 if winches == "lengths" else -np.inf
    add(order, cables(f"command.{what}[{{}}]", unit), member, f"commanded {what}", 0, least)
    for k, name, carrier in moving:
        about = f"command of carrier {carrier.name}"
        if bodies[k] != FREE:
            add(order, _motion(f"command.{name}", _MOTION), "ordered", about, 18 * k)
            add(order, _motion(f"command.{name}", _JERK), "ordered_jerks", about, 6 * k)
        for a, actuator in enumerate(carrier.actuators):
            named = f"command.{name}.actuation[{a + 1}]", "N" if any(actuator.wrench[:3]) else "N.m"
            add(order, [named], "actuation", f"{about}: {actuator.name}", most * k + a)
    for parts, name, unit, place, least, about in _PARAMETERS:
        if part in parts:
            member, *of_it = place.split(".")
            value = data[member][of_it[0]] if of_it else data[member]
            rows.append(Variable(name, "parameter", unit, place, float(value), about, least))
    cable = data["robot"]["cable"][: robot.m]
    if simulates and data["plant"]["drive"] != layout.TENSIONS and cable["stiffness"].all():
        for i, name in ((i, name) for i in range(robot.m) for name in ("stiffness", "damping")):
            start, unit = float(cable[name][i]), "N" if name == "stiffness" else "N.s/m"
            place = f"robot.cable[{i}].{name}"
            rows.append(Variable(f"plant.cable[{i + 1}].{name}", "parameter", unit, place, start, name, 0.0))
    return rows


def _motion(name: str, orders: Mapping[str, tuple[str, str]]) -> Named:
    """Return names and units of the coordinates of a motion."""
    return [
        (f"{name}.{order}.{coordinate}", units[i // 3])
        for order, units in orders.items()
        for i, coordinate in enumerate(COORDINATES)
    ]


def model_description(
    name: str, identifier: str, token: str, about: str, step: float, variables: Sequence[Variable]
) -> bytes:
    """Return modelDescription.xml, with the variables in the order of their value references, and a step [s]."""
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=name,
        instantiationToken=token,
        description=about,
        generationTool=f"towline {__version__}",
        copyright="Copyright (c) 2026, The towline developers",
        license="BSD-3-Clause",
        variableNamingConvention="structured",
    )
    can = ("canHandleVariableCommunicationStepSize", "canGetAndSetFMUState", "canSerializeFMUState")
    ET.SubElement(root, "CoSimulation", {"modelIdentifier": identifier, **dict.fromkeys(can, "true")})
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(variable.unit for variable in variables if variable.unit):
        exponents = {base: str(power) for base, power in UNITS[unit].items()}
        ET.SubElement(ET.SubElement(units, "Unit", name=unit), "BaseUnit", exponents)
    ET.SubElement(ET.SubElement(root, "LogCategories"), "Category", name="logStatusError", description="refused calls")
    ET.SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(step))
    listed, structure = ET.SubElement(root, "ModelVariables"), ET.SubElement(root, "ModelStructure")
    for reference, variable in enumerate(variables):
        keys = {"name": variable.name, "valueReference": str(reference), "causality": variable.causality}
        keys |= {"description": variable.about} | ({"unit": variable.unit} if variable.unit else {})
        if variable.causality == "output":
            keys["initial"] = "calculated"
        elif variable.causality != "independent":
            keys["start"] = repr(variable.start)
        if variable.causality == "parameter":
            keys |= {"variability": "tunable", "min": repr(variable.least)}
        ET.SubElement(listed, "Float64", keys)
    for element in ("Output", "InitialUnknown"):
        for reference, variable in enumerate(variables):
            if variable.causality == "output":
                ET.SubElement(structure, element, valueReference=str(reference))
    return _text(root)


def build_description(identifier: str, sources: Sequence[str], definitions: dict[str, str]) -> bytes:
    """Return buildDescription.xml, from the C files and preprocessor definitions of a unit."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for source in sources:
        ET.SubElement(files, "SourceFile", name=source)
    for name, value in definitions.items():
        ET.SubElement(files, "PreprocessorDefinition", name=name, value=value)
    ET.SubElement(files, "IncludeDirectory", name=".")
    return _text(root)


def _text(root: ET.Element) -> bytes:
    ET.indent(root)
    return ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
