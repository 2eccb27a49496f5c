"""Call every public function with wrong arguments, one at a time: it answers in one line, or accepts the value.

The calls are generated from the signatures: a parameter keeps a valid value, kept in a table by its name, or gets each
of the wrong values in turn. A public function that is in neither table fails the test.
"""

from __future__ import annotations

import functools
import inspect
import random
import re
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

import towline
from towline import Dynamics, Planner, TensionProblem, TowlineError, load, plan, solve, solve_batch, time_along, viewer
from towline.base.inputs import printable
from towline.control import ComputedTorque, Predictive, Reference, State
from towline.estimation import PoseFilter
from towline.estimation.calibration import Calibration, Measurements, calibrate
from towline.models import RelativeDynamics
from towline.models.uncertainty import Uncertainty
from towline.plant import Plant
from towline.solvers import Horizon
from towline.statics.robust import Spread
from towline.workspace import Places, Region, StaticEquilibrium, sample

PACKAGES = (
    "towline",
    "towline.models",
    "towline.solvers",
    "towline.workspace",
    "towline.estimation.calibration",
    "towline.ocp",
    "towline.control",
    "towline.simulation",
    "towline.viewer",
    "towline.statics.robust",
    "towline.statics.stiffness",
)
EACH = 6  # wrong values for each parameter
LONGEST = 500  # characters of a message; the lists of robots and of keys are long
ROBOT = "wang-flying"

# Not called by a user: exceptions and status words, what an author of a method or a condition writes or gets, and
# results, which towline makes (their methods are called).
NOT_CALLED = {
    "InputError",
    "SolverError",
    "TowlineError",
    "MotionStatus",
    "Status",
    "Method",
    "Proposal",
    "StandardForm",
    "BatchSolution",
    "Certificate",
    "Multipliers",
    "Residuals",
    "solvers.Margin",
    "Plan",
    "PoseEstimate",
    "RobotShare",
    "Simulation",
    "Replay",
    "Calibration",
    "Compared",
    "Design",
    "HeldOut",
    "Mistake",
    "Outlier",
    "Parameter",
    "Sigma",
    "Slip",
    "StiffestTensions",
    "ANSWERS",
    "METRICS",
    "Command",  # what an author of a controller gets and writes
    "Reference",
    "State",
    "Stop",
    "Sweep",
    "TensionSolution",
    "evaluate",  # of a condition: `holds` checks the arguments and calls it
    "serve",  # a context: the tests of the viewer enter it
}


class Hostile:
    """Its text has escapes and line breaks, and it is an array only elsewhere, as those of a GPU."""

    def __repr__(self) -> str:
        return "a\n\x1b[31mb"

    def __array__(self, *_: Any, **__: Any) -> np.ndarray:
        raise TypeError("not an array")


WRONG: dict[str, Any] = {
    "none": None,
    "empty text": "",
    "text": "nonsense",
    "two lines": "two\nlines",
    "long text": "x" * 5000,
    "nul": "a\0b",
    "bytes": b"bytes",
    "nan": float("nan"),
    "inf": float("inf"),
    "minus one": -1,
    "no float": 10**400,
    "no digits": 10**5000,
    "true": True,
    "complex": 1j,
    "object": object(),
    "list": [],
    "mapping": {},
    "mapping of lists": {"kind": []},
    "unequal rows": [[1, 2], [3]],
    "strings": ["a", "b"],
    "set": {1, 2},
    "function": lambda *_: None,
    "class": Planner,
    "no file": Path("does/not/exist.yaml"),
    "shape": np.zeros((2, 3, 5)),
    "no rows": np.zeros((0, 6)),
    "nan array": np.full(6, np.nan),
    "complex array": np.ones(6, dtype=complex),
    "object array": np.array([None] * 6),
    "text array": np.array(["1"] * 6),
    "dates": np.array(["2020-01-01"] * 6, dtype="datetime64[D]"),
    "huge array": np.full(6, 1e300),
    "masked": np.ma.array(np.ones(6), mask=np.arange(6) == 2),
    "seconds": np.timedelta64(3, "s"),
    "hostile": Hostile(),
    "no text": type("Silent", (), {"__repr__": lambda _: 1 / 0})(),
    "nested": functools.reduce(lambda inner, _: [inner], range(3000), []),
}

# The first asks the network for a host of this name, the second raises what the caller's own function raises.
NOT_TRIED = {("scheduler", "text"), ("progress", "class")}

TASK = {"name": "short", "path": {"kind": "rest", "pose": [0, 0, -1, 0, 0, 0]}, "duration": 0.2, "output_rate": 20}
REQUIREMENTS = {
    "free": [{"part": "t_max", "range": {"min": 50, "max": 60}, "equal": True}],
    "require": [{"poses": [[0, 0, 1, 0, 0, 0]]}],
    "time_limit": 0.05,
}
LINE = {"kind": "line", "start": [0, 0, -1, 0, 0, 0], "end": [0.1, 0, -1, 0, 0, 0]}


@cache
def robot() -> towline.Robot:
    known = {"parameters": ["cables[0].anchor.x"], "covariance": [[1e-4]]}
    return load(ROBOT).model_copy(update={"uncertainty": Uncertainty.model_validate(known)})


@cache
def problem() -> TensionProblem:
    return TensionProblem(np.eye(6, 7), np.ones(6), 0.0, 10.0)


@cache
def infeasible() -> towline.TensionSolution:
    return solve(TensionProblem(np.eye(6, 7), np.full(6, 20.0), 0.0, 10.0))


@cache
def dynamics() -> Dynamics:
    return Dynamics(ROBOT)


@cache
def places() -> Places:
    return Places.at_home(robot(), robot().home)


@cache
def a_run():
    plant = Plant(ROBOT, drive="tensions")
    commands = np.tile(plant.command(np.full(plant.robot.m, 2.0)), (3, 1))
    return plant, plant.run(plant.start(), commands, 1e-3)


@cache
def a_recording() -> Path:
    file = Path(tempfile.mkdtemp()) / "log.csv"
    rows = [
        f"{t},0,0,-1,0,0,0,{','.join(['2'] * 6)},{','.join(['1'] * 6)},0,0,0,0,0,0" for t in np.arange(0, 0.3, 0.02)
    ]
    lengths, pulls = (",".join(f"{name}{i}" for i in range(6)) for name in ("l", "tension"))
    carrier = ",".join(f"quad_{name}" for name in ("x", "y", "z", "roll", "pitch", "yaw"))
    file.write_text("\n".join([f"t,x,y,z,roll,pitch,yaw,{pulls},{lengths},{carrier}", *rows]) + "\n")
    return file


def a_plan() -> towline.Plan:
    return plan(ROBOT, TASK)


def a_planner() -> Planner:
    planner = Planner(ROBOT, TASK)
    planner.plan()
    return planner


def a_state() -> State:
    return State(robot().home, np.zeros(6), np.zeros((1, 6)), np.zeros((1, 6)))


def a_reference() -> Reference:
    return Reference(robot().home, *np.zeros((2, 6)), *np.zeros((3, 1, 6)))


@cache
def a_sweep() -> towline.Sweep:
    return towline.sweep(ROBOT, TASK, {"margin": [0, 1]})


@cache
def time_law() -> towline.Plan:
    return time_along(ROBOT, {"path": LINE}, grid=10)


@cache
def measurements() -> Measurements:
    poses = robot().home + np.random.default_rng(0).uniform(-0.2, 0.2, (9, 6))
    return Measurements(dynamics().cable_lengths(poses) - 0.05, poses, times=np.arange(9.0))  # an offset


@cache
def a_calibration() -> Calibration:
    return calibrate(ROBOT, measurements())


# Valid values by parameter name. Of functions that mean something else by a name: by "function.name".
VALID: dict[str, Callable[[], Any]] = {
    "A": lambda: np.eye(6, 7),
    "w": lambda: np.ones(6),
    "t_min": lambda: 0.0,
    "t_max": lambda: 10.0,
    "t_ref": lambda: 1.0,
    "weights": lambda: 1.0,
    "lengths": lambda: dynamics().cable_lengths(robot().home),
    "sigma": lambda: 1e-3,
    "starts": lambda: 16,
    "length": lambda: 1.0,
    "rho": lambda: 1.0,
    "threads": lambda: 1,
    "backend": lambda: None,
    "m": lambda: 3,
    "n": lambda: 6,
    "problem": problem,
    "solution": lambda: solve(problem()),
    "tensions": lambda: np.full(6, 5.0),
    "TensionProblem.tolerance.tensions": lambda: np.ones(7),
    "previous": lambda: 1.0,
    "rate_max": lambda: 100.0,
    "index": lambda: 0,
    "up": lambda: np.array([0.0, 0.0, 1.0]),
    "robot": robot,
    "dynamics": dynamics,
    "pose": lambda: robot().home,
    "velocity": lambda: np.zeros(6),
    "acceleration": lambda: np.zeros(6),
    "carrier_pose": lambda: np.zeros((1, 6)),
    "carrier_velocity": lambda: np.zeros((1, 6)),
    "carrier_acceleration": lambda: np.zeros((1, 6)),
    "wind": lambda: np.ones(3),
    "thrust": lambda: np.ones(1),
    "torque": lambda: np.zeros((1, 3)),
    "Dynamics.carried_wrench.load": lambda: np.ones(10),
    "elastic": lambda: False,
    "method": lambda: "active-set",
    "sample.method": lambda: "random",
    "name": lambda: "short",
    "load.name": lambda: ROBOT,
    "task": lambda: TASK,
    "time_along.task": lambda: {"path": LINE},
    "plan": a_plan,
    "references.start": lambda: 0.0,
    "start": lambda: None,
    "initial": lambda: None,
    "robust": lambda: None,
    "progress": lambda: None,
    "grid": lambda: 10,
    "times": lambda: np.zeros(2),
    "path": lambda: time_law().law.parametrised.path,
    "file": lambda: "file.nc",
    "export_fmu.file": lambda: "unit.fmu",
    "export_fmu.part": lambda: "plant",
    "export_fmu.reference": lambda: None,
    "Plan.animate.file": lambda: "film.gif",
    "Simulation.animate.file": lambda: "film.gif",
    "folder": lambda: "folder",
    "format": lambda: "png",
    "precision": lambda: "double",
    "uncertainty": lambda: robot().uncertainty,
    "share": lambda: 0.95,
    "changes": lambda: np.ones((3, 6, 2)),
    "wrench": lambda: np.ones((1, 6)),
    **{f"{name}.pose": lambda: robot().home[None] for name in ("spread", "Spread", "share_of_robots")},
    **{f"{name}.carrier_pose": lambda: np.zeros((1, 1, 6)) for name in ("spread", "Spread", "share_of_robots")},
    **{f"{name}.tensions": lambda: np.ones((1, 6)) for name in ("spread", "Spread.changes", "Spread.sigmas")},
    "Spread.rows": lambda: np.arange(6),
    "Spread.only.rows": lambda: np.zeros(1, dtype=int),
    "speed": lambda: 1.0,
    "fps": lambda: 5.0,
    "condition": StaticEquilibrium,
    "condition_from.data": lambda: {"kind": "margin"},
    "region": lambda: None,
    "samples": lambda: 20,
    "seed": lambda: 0,
    "size": lambda: None,
    "workers": lambda: 1,
    "scheduler": lambda: None,
    "checkpoint": lambda: None,
    "resume": lambda: False,
    "keep": lambda: "accepted",
    "points_max": lambda: 10,
    "metric": lambda: "margin",
    "metrics": lambda: ["margin"],
    "low": lambda: np.full(3, -1.0),
    "high": lambda: np.zeros(3),
    "cells": lambda: 2,
    "attitude": lambda: np.zeros(3),
    "count": lambda: 2,
    "places": places,
    "carriers": lambda: np.zeros((1, 1, 6)),
    "rows": lambda: slice(0, 1),
    "simulate.reference": lambda: robot().home,
    "replay.log": a_recording,
    "replay.delay": lambda: 0.0,
    "replay.poses": lambda: None,
    "window": lambda: 0.1,
    "fit": lambda: False,
    "fix": lambda: False,
    "simulation_of.plant": lambda: a_run()[0],
    "history": lambda: a_run()[1],
    "simulation_of.reference": lambda: None,
    "simulate.duration": lambda: 0.01,
    "Conditions.duration": lambda: 0.01,
    "controller": lambda: None,
    "noise": lambda: None,
    "mismatch": lambda: None,
    "events": lambda: ["cut 1 at 0.005"],
    "faults": lambda: None,
    "gusts": lambda: 0.5,
    "disturbance": lambda: np.zeros(6),
    "period": lambda: 1e-3,
    "substeps": lambda: None,
    "tolerance": lambda: 0.1,
    "drive": lambda: None,
    "runs": lambda: None,
    "conditions": lambda: None,
    "execution": lambda: None,
    "simulate.progress": lambda: None,
    "bandwidth": lambda: 5.0,
    "damping": lambda: 1.0,
    "integral": lambda: 0.0,
    "proportional": lambda: 1.0,
    "LengthControl.stiffness": lambda: 1e5,
    "Filtered.controller": lambda: ComputedTorque(ROBOT),
    "Filtered.filter": lambda: PoseFilter(ROBOT),
    "lag": lambda: 0.01,
    "most": lambda: 0.1,
    "observer": lambda: 10.0,
    "tension_loop": lambda: 20.0,
    "tension_lag": lambda: 0.02,
    "rotor_lag": lambda: 0.02,
    "sensors": lambda: {"velocity": 1e-3},
    "rate": lambda: None,
    "reach": lambda: (0.1, 0.1),
    "carrier_bandwidth": lambda: 5.0,
    "ComputedTorque.carrier_acceleration": lambda: 5.0,
    "Predictive.carrier_acceleration": lambda: 5.0,
    "Predictive.attitude": lambda: 40.0,
    "stages": lambda: 3,
    "references": lambda: [a_reference()] * 3,
    "ComputedTorque.follow.start": lambda: 0.0,
    "Predictive.follow.start": lambda: 0.0,
    "stage": lambda: 0.02,
    "Predictive.tube": lambda: 0.02,
    "Predictive.keep_out": lambda: [{"kind": "sphere", "centre": [0, 0, 0], "radius": 0.1}],
    "place": lambda: 5.0,
    "ComputedTorque.attitude": lambda: 40.0,
    "patience": lambda: 0.05,
    "time": lambda: 0.0,
    "settle": lambda: 1.0,
    "state": a_state,
    "reference": a_reference,
    "vary": lambda: {"margin": [0, 1]},
    "sweep.keep": lambda: None,
    "Sweep.plan.index": lambda: 0,
    "N": lambda: 1,
    "Horizon.rows": lambda: 0,
    "Horizon.relative_to.states": lambda: np.zeros((2, 6)),
    "Horizon.relative_to.controls": lambda: np.zeros((1, 2)),
    "shifted": lambda: False,
    "warm": lambda: False,
    "Robot.parameter_values.names": lambda: ["cables[0].anchor.x"],
    "Robot.with_parameters.values": lambda: {"cables[0].anchor.x": 0.5},
    "measurements": measurements,
    "readings": lambda: measurements().lengths,
    "Measurements.lengths": lambda: measurements().lengths,
    "poses": lambda: measurements().poses,
    "orientations": lambda: None,
    "Measurements.tensions": lambda: None,
    "Measurements.times": lambda: np.arange(9.0),
    "carrier_poses": lambda: np.zeros((9, 1, 6)),
    "directions": lambda: None,
    "free": lambda: ("offsets",),
    "prior": lambda: None,
    "outliers": lambda: True,
    "design.robot": lambda: "ipanema-1",
    "design.free": lambda: None,
    "require": lambda: None,
    "maximise": lambda: "margin",
    "requirements": lambda: REQUIREMENTS,
    "candidates": lambda: measurements().poses,
    "measured": lambda: True,
    "read_measurements.path": lambda: measurements().save("log.nc"),
    "read_measurements.poses": lambda: None,
    "fields": lambda: None,
    "Measurements.save.path": lambda: "other.nc",
    "Robot.save.file": lambda: "file.yaml",
    "Calibration.save.path": lambda: "other.yaml",
    "title": lambda: "title",
    **{name: lambda: None for name in ("replay", "cloud", "other", "read.robot")},
    "target": lambda: ROBOT,
    "subject": lambda: viewer.read(ROBOT),
    "save_page.file": lambda: "page.html",
    "result": lambda: sample(robot(), StaticEquilibrium(), samples=20),
}

# Other words by which a message may name a parameter: a file also by its path.
ALSO = {
    "data": ("condition",),
    "read.target": ("robot",),
    "read.other": ("robot",),
    "check_share.share": ("robust",),
    "load.name": ("robot",),
    "read_measurements.path": ("log", "a: no such file"),
    "read_measurements.poses": ("log",),
    "fields": ("map",),
    "nonsense": ("options",),
    "Requirements.model_validate.obj": ("requirements",),
}

EVENTS: dict[str, dict[str, Any]] = {
    "Cut": {"at": 0.005, "cable": 1},
    "Stick": {"at": 0.005, "cable": 1},
    "Lose": {"at": 0.005, "carrier": "quad1"},
    "Miss": {"at": 0.005, "duration": 0.01},
    "Carry": {"at": 0.005, "mass": 1.0},
    "Push": {"at": 0.005, "force": [1, 0, 0]},
    "Wall": {"at": 0.005, "point": [0, 0, 0], "normal": [0, 0, 1], "stiffness": 1e3},
    "StopReference": {"at": 0.005},
    "Follow": {"at": 0.005, "plan": "plan.nc"},
}
# Models: their fields are their parameters, and these the valid values.
REST = {"kind": "static-equilibrium"}
MODELS: dict[str, dict[str, Any]] = {
    "Robot": robot().model_dump(mode="json"),
    "Task": TASK,
    "Requirements": REQUIREMENTS,
    "Region": {},
    "Uncertainty": {"parameters": ["cables[0].anchor.x"], "covariance": [[1e-4]]},
    "AllOf": {"conditions": [REST]},
    "AnyOf": {"conditions": [REST]},
    "Dynamic": {"accelerations": [[0, 0, 1, 0, 0, 0]]},
    "EquilibriumPosture": {},
    "ExistsPlacement": {"condition": REST},
    "ForceBalance": {},
    "Interference": {"between_cables": 0.1},
    "Lengths": {"min": 0.1, "max": 10.0},
    "Margin": {},
    "MetricInRange": {"metric": "margin", "min": 0.0},
    "Noise": {},
    "Mismatch": {},
    **EVENTS,
    "StaticEquilibrium": {},
    "WrenchClosure": {},
    "WrenchFeasible": {"box": [[0] * 6, [1] * 6]},
    "WrenchWithTolerance": {"tolerance": 1.0},
}

# Objects whose public methods are called.
OBJECTS: dict[str, Callable[[], Any]] = {
    "Dynamics": dynamics,
    "RelativeDynamics": lambda: RelativeDynamics(robot()),
    "ComputedTorque": lambda: ComputedTorque(ROBOT),
    "Predictive": lambda: Predictive(ROBOT),
    "Simulation": lambda: towline.simulate(ROBOT, robot().home, duration=0.02),
    "Planner": a_planner,
    "Plan": a_plan,
    "Sweep": a_sweep,
    "TensionProblem": problem,
    "TensionSolution": lambda: solve(problem()),
    "Certificate": lambda: infeasible().certificate,
    "Horizon": lambda: Horizon(1, 6, 2),
    "BatchSolution": lambda: solve_batch(np.eye(6, 7)[None], np.ones((2, 6)), 0.0, 10.0),
    "Places": places,
    "Measurements": measurements,
    "Calibration": a_calibration,
    "Robot": robot,
    "Spread": lambda: Spread(robot(), robot().home[None], np.zeros((1, 1, 6))),
    "Task": lambda: towline.read_task(TASK),
    "Requirements": lambda: towline.read_requirements(REQUIREMENTS),
    "Region": Region,
}


class Subject:
    """One public function: how to call it with keywords, the parameters to replace, and their valid values."""

    def __init__(self, label: str, call: Callable[..., Any], valid: dict[str, Any], names: list[str]):
        self.label, self.call, self.valid, self.names = label, call, valid, names


def of_function(label: str, function: Callable[..., Any]) -> Subject:
    """Read a function's parameters from its signature; `**options` stand for a key that is none."""
    valid, names = {}, []
    for name, parameter in inspect.signature(function).parameters.items():
        its = [name]
        if parameter.kind is parameter.VAR_KEYWORD:
            names.append("nonsense")
            keys = re.fullmatch(r"Unpack\[(\w+)\]", str(parameter.annotation))
            its = [*function.__globals__[keys[1]].__annotations__] if keys else []
        names += its
        for each in its:
            make = VALID.get(f"{label}.{each}") or VALID.get(each)
            assert make is not None, f"{label}: no valid value of {each} in the table"
            valid[each] = make()
    return Subject(label, function, valid, names)


def public_methods(value: Any) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield the methods of an object that towline itself defines."""
    for name in dir(type(value)):
        static = inspect.getattr_static(type(value), name)
        function = static.__func__ if isinstance(static, classmethod | staticmethod) else static
        if name[0] == "_" or name in NOT_CALLED or hasattr(BaseModel, name):  # pydantic answers for its own
            continue
        if inspect.isfunction(function) and function.__module__.startswith("towline"):
            yield name, getattr(value, name)


@cache
def subjects() -> dict[str, Subject]:
    """Return the public functions, classes and methods by label."""
    result: dict[str, Subject] = {}
    known: set[int] = set()
    for package in PACKAGES:
        module = import_module(package)
        for name in module.__all__:
            value = getattr(module, name)
            of_package = f"{package.rpartition('.')[2]}.{name}"
            if {name, of_package} & NOT_CALLED or id(value) in known or inspect.isabstract(value):
                continue
            known.add(id(value))
            if name in MODELS:
                names = list(value.model_fields)
                result[name] = Subject(name, value, MODELS[name], names)
                result[f"{name}.model_validate"] = Subject(name, value.model_validate, {"obj": MODELS[name]}, ["obj"])
            else:
                result[name] = of_function(name, value)
    workspace = import_module("towline.workspace")
    objects = {name: make() for name, make in OBJECTS.items()}
    objects |= {
        name: getattr(workspace, name)(**MODELS[name])
        for name in MODELS
        if name not in objects and name not in {"Noise", "Mismatch", "Uncertainty", *EVENTS}
    }
    for name, value in objects.items():
        for method, bound in public_methods(value):
            if method not in {"model_validate", *NOT_CALLED}:
                result[f"{name}.{method}"] = of_function(f"{name}.{method}", bound)
    for name, method in towline.methods().items():
        options = list(method.options or {})
        result[f"solve by {name}"] = Subject(f"solve by {name}", partial(solve, problem(), name), {}, options)
    return result


def calls() -> Iterator[tuple[Subject, str, str]]:
    """Draw the calls: for each parameter of each function some of the wrong values."""
    draw = random.Random(12)
    for subject in subjects().values():
        for name in subject.names:
            for wrong in draw.sample(list(WRONG), EACH):
                if (name, wrong) not in NOT_TRIED:
                    yield subject, name, wrong


def complaint(subject: Subject, name: str, wrong: Any) -> str | None:
    """Return what is wrong about the answer of one call, None if it is one clear line or the value is accepted."""
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            subject.call(**{**subject.valid, name: wrong})
    except TowlineError as error:
        text = str(error)
        if not text.isprintable() or len(text) > LONGEST:
            return f"not one short line: {text[:200]!r}"
        label = re.sub("(?<=[a-z])(?=[A-Z])", "-", subject.label).lower()  # of WrenchFeasible "wrench-feasible"
        named = [name, *ALSO.get(name, ()), *ALSO.get(f"{subject.label}.{name}", ()), label]
        if isinstance(wrong, str | Path):
            named.append(printable(str(wrong)))
        return None if any(word in text for word in named) else f"does not name {name}: {text}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    # Others' modules, when they are imported, warn of what concerns their authors.
    own = [one for one in caught if not issubclass(one.category, DeprecationWarning | SyntaxWarning | ResourceWarning)]
    return f"{own[0].category.__name__}: {own[0].message}" if own else None


def test_wrong_arguments_are_answered_in_one_line(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    count, complaints = 0, []
    for subject, name, wrong in calls():
        count += 1
        text = complaint(subject, name, WRONG[wrong])
        if text is not None:
            complaints.append(f"{subject.label}({name}={wrong}): {text}")
    assert not complaints, f"{len(complaints)} of {count} calls:\n" + "\n".join(complaints)
    assert count >= 1000
    assert capfd.readouterr() == ("", "")
