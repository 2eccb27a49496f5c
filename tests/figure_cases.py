"""Figures of all kinds by name, drawn from made data that is hard to draw: curves that coincide, limits far away."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from towline import load
from towline.figures import calibration, flight, limits, plan, robot, sweep, workspace
from towline.figures.curves import Panel, curve_in_space, curves
from towline.figures.plan import convergence
from towline.figures.scene import Scene
from towline.figures.views import views
from towline.figures.workspace import metric_map
from towline.statics.scene import scene_at
from towline.studies.flying.pairing import from_above

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TIME = np.linspace(0, 6, 121)
ROUND = 2 * np.pi * TIME / 6


def planned(cables: int = 6, infeasible: bool = False, far: bool = True, phases: bool = False) -> xr.Dataset:
    """Return a plan of a platform on a circle under two carriers; its cables come in pairs of equal tensions."""
    tensions = np.stack([5 + (k // 2) + np.cos(ROUND + k // 2) for k in range(cables)], axis=1)
    missing = (TIME > 2) & (TIME < 3.5) & infeasible
    unlimited = tensions - 8 * missing[:, None]
    pose = np.zeros((len(TIME), 6))
    pose[:, :2] = np.stack([np.cos(ROUND), np.sin(ROUND)], axis=1)
    carriers = np.zeros((len(TIME), 2, 6))
    carriers[:, 0, 2], carriers[:, 1] = 1.5, pose + np.array([0, 0, 2, 0, 0, 0])
    variables = {
        "pose": (("time", "coordinate"), pose),
        "carrier_pose": (("time", "carrier", "coordinate"), carriers),
        "tensions": (("time", "cable"), np.where(missing[:, None], np.nan, tensions)),
        "tensions_unlimited": (("time", "cable"), unlimited),
        "violation": ("time", np.where(missing, 2.1345, 0.0)),
        "t_min": ("cable", np.full(cables, 0.5)),
        "t_max": ("cable", np.full(cables, 60.0 if far else 12.0)),
    }
    coordinates = {
        "time": TIME,
        "cable": np.arange(1, cables + 1),
        "carrier": ["quad", "another"],
        "carrier_moves": ("carrier", [True, True]),
    }
    if phases:
        names = ["slack", "tighten", "lift", "carry", "lower", "release"]
        coordinates["phase"] = names
        variables |= {
            "phase_start": ("phase", np.arange(6.0)),
            "phase_end": ("phase", np.arange(6.0) + 1),
            "ground_reaction": ("time", np.maximum(10 - 5 * TIME, 0)),
        }
    return xr.Dataset(variables, coordinates)


def scene(height: float = 2.0) -> Scene:
    """Return a team of two carriers above a plate, and two cables from the ground."""
    path = np.stack([np.cos(ROUND), np.sin(ROUND), 0.2 * np.sin(ROUND)], axis=1)
    plate = (
        np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]]) * 0.4
    )
    attachments = path[:, None] + plate
    carriers = np.stack([path + np.array([x, 0, height]) for x in (-1.5, 1.5)], axis=1)
    anchors = np.concatenate(
        [np.repeat(carriers, 3, axis=1), np.tile([[3.0, 0, 0], [-3.0, 0, 0]], (len(TIME), 1, 1))], 1
    )
    anchors[:, [0, 3], 1] += 0.3
    anchors[:, [1, 4], 0] += 0.3
    return Scene(
        title="team",
        anchors=anchors,
        attachments=attachments,
        path=path,
        path_times=TIME,
        path_missing=TIME > 2.0,
        carriers=carriers,
        names=["left quadrotor", "right quadrotor"],
        bodies=[np.array([0, 1, 2]), np.array([3, 4, 5])],
        boxes=[(np.array([-2.5, -1, 1]), np.array([0, 1, 3.0]))],
        obstacles=[robot.box_edges(np.array([2, -50, -1.0]), np.array([2.3, 50, 4.0]))],
        tensions=np.full((len(TIME), 8), 5.0),
        t_min=np.full(8, 0.5),
        t_max=np.full(8, 60.0),
    )


def still(name: str) -> Figure:
    """Draw a robot of the library with made tensions."""
    model = load(name)
    at_home = scene_at(model, model.home, np.linspace(1, 40, model.m), f"{name}, at rest")
    return robot.draw(at_home, model.home_com + 0.1 * np.eye(3)[:2])


def flown(cables: int = 6, wind: bool = True) -> xr.Dataset:
    """Return a flight: cable 2 is slack for a while, and cables come in pairs."""
    slack = (TIME >= 2) & (TIME < 3)
    commanded = np.stack([12 + k // 2 + 0.2 * np.sin(ROUND) for k in range(cables)], axis=1)
    real = commanded.copy()
    real[slack, 1] = 0.0
    carrier = np.zeros((len(TIME), 3, 6))
    carrier[:, 1:, 0] = 0.003 * np.sin(ROUND)[:, None] * [1, 1]
    words = ["as_planned", "shifted_plan", "soft_wrench", "hold"]
    variables = {
        "tracking_error": ("time", 0.002 + 0.001 * TIME),
        "tensions": (("time", "cable"), real),
        "tensions_commanded": (("time", "cable"), commanded),
        "t_min": ("cable", np.full(cables, 1.0)),
        "t_max": ("cable", np.full(cables, 500.0)),
        "carrier_pose": (("time", "carrier", "coordinate"), carrier),
        "carrier_reference": (("time", "carrier", "coordinate"), np.zeros_like(carrier)),
        "answered": (
            "time",
            np.where(slack, 2, 0),
            {"flag_values": np.arange(4, dtype=np.int8), "flag_meanings": " ".join(words)},
        ),
        "actuation": (
            ("time", "carrier", "actuator"),
            np.tile([[[np.nan]], [[30.0]], [[30.0]]], (len(TIME), 1, 1, 1))[:, :, 0],
        ),
    }
    if wind:
        variables["wind"] = (("time", "axis"), np.tile([3.0, 2.0, 0.5], (len(TIME), 1)))
    coordinates = {
        "time": TIME,
        "cable": np.arange(1, cables + 1),
        "actuator": ["thrust"],
        "carrier": ["post", "quad1", "quad2"],
        "carrier_moves": ("carrier", [False, True, True]),
    }
    return xr.Dataset(variables, coordinates, {"tolerance_m": 0.05})


def enveloped():
    """Return quantiles of many flights, of which none reached the last second."""
    time, shares = np.linspace(0.05, 4.95, 50), np.array([0.0, 0.05, 0.5, 0.95, 1.0])
    wave = np.where(time < 4, 1 + np.sin(time), np.nan)
    spread = {"error": (0.01, 0.01), "tension_min": (2.0, 1.0), "tension_max": (20.0, 30.0)}
    quantiles = {
        f"{name}_quantiles": (("quantile", "time"), low * wave + width * shares[:, None])
        for name, (low, width) in spread.items()
    }
    return xr.Dataset(quantiles, {"time": time, "quantile": shares}, {"tolerance_m": 0.05, "duration_s": 5.0})


def flights() -> xr.Dataset:
    """Return errors of many flights, some of which failed."""
    errors = np.geomspace(0.004, 0.06, 40)
    return xr.Dataset({"error_max": ("seed", errors), "passed": ("seed", errors < 0.05)}, attrs={"tolerance_m": 0.05})


def sampled(sizes: tuple[int, int, int], every: int = 1) -> xr.Dataset:
    """Return counts of a sampled workspace: a ball in a box, with samples in every n-th cell of an axis."""
    centres = {name: (np.arange(n) + 0.5) / n * 4 - 2 for name, n in zip("xyz", sizes, strict=True)}
    x, y, z = np.meshgrid(*centres.values(), indexing="ij")
    tried = np.where((np.indices(sizes) % every == 0).all(axis=0), 10, 0)
    counts = {"tried": (tuple("xyz"), tried), "reached": (tuple("xyz"), np.where(x**2 + y**2 + z**2 < 3, tried, 0))}
    return xr.Dataset(counts, centres, {"robot": "wang-ctmrts", "accepted": 12345, "samples": 60000})


def mapped(sizes: tuple[int, int, int], scale: Sequence[float] = (2, 2, 2)) -> Figure:
    """Draw two metrics at samples of a ball, some of which have no value."""
    points = np.random.default_rng(0).uniform(-2, 2, (4000, 3)) * (np.array(sizes) > 1)
    points = points[np.linalg.norm(points, axis=1) < 1.7]
    payload = np.where(points[:, 0] < 1.2, 25 - 4 * (points**2).sum(axis=1), np.nan)
    result = sampled(sizes).assign(
        position=(("point", "axis"), points),
        payload=("point", payload, {"units": "kg"}),
        condition_number=("point", np.where(points[:, 0] > -1, 3 + points[:, 1], np.inf), {"units": "1"}),
    )
    return metric_map(result, ["payload", "condition_number"], SQUARE * scale)


def swept(shape: tuple[int, ...]) -> Figure:
    """Draw a sweep over as many fields as `shape` has entries."""
    labels = ("duration [s]", "robot.platform.mass [kg]", "scheme")
    values = [
        np.arange(2.0, 2 + shape[0]).tolist(),
        [0.5 * k for k in range(1, 9)],
        ["linear", "hermite", "other", "last"],
    ]
    axes = [sweep.Axis(label, some[:n]) for label, some, n in zip(labels, values, shape, strict=False)]
    cost = np.arange(float(np.prod(shape))).reshape(shape)
    status = np.where(cost % 5 == 0, "infeasible", np.where(cost % 7 == 0, "not-found", "feasible"))
    good = np.where(status == "feasible", cost, np.nan)
    return sweep.sweep(axes, status, {"cost [-]": good, "least margin of tensions [N]": -good})


def limited() -> list[limits.Limited]:
    """Return quantities with a near limit, a far one, an exact one, and one of many curves."""
    wave = np.stack([np.sin(ROUND), np.sin(ROUND)], axis=1)
    many = np.sin(ROUND[:, None] + np.arange(12))
    return [
        limits.Limited("carrier_acceleration", "m/s^2", ["quad1", "quad2"], wave, -np.inf, 1.2),
        limits.Limited("platform_acceleration", "m/s^2", ["platform"], wave[:, :1], -np.inf, 50.0),
        limits.Limited("cable_speed", "m/s", [f"cable {k}" for k in range(12)], many, -1.5, 1.5),
        limits.Limited("a limit of the user's own with a long name", "-", ["own"], wave[:, :1], 0.0, 0.0),
    ]


def residuals(cables: int, times: np.ndarray | None = None) -> Figure:
    """Draw residuals of a robot whose anchors are 20 mm off, and 1 mm of noise."""
    draws = np.random.default_rng(1).normal(size=(2, 400, cables)) * 1e-3
    return calibration.residuals(0.02 * np.sin(np.arange(cables)) + draws[0], draws[1], times)


def corrected(cables: int) -> Figure:
    """Draw anchors that are some 20 mm off the file's, with ellipsoids of 2 mm."""
    rng = np.random.default_rng(2)
    file, shift, roots = rng.normal(size=(cables, 3)), rng.normal(size=(2, cables, 3)), rng.normal(size=(cables, 3, 3))
    covariances = 4e-6 * roots @ roots.swapaxes(1, 2)
    return calibration.anchors(file, file + 0.02 * shift[0] + 0.002 * shift[1], covariances)


def deviations(cables: int, opened: bool) -> Figure:
    """Draw standard deviations of anchors, attachments, offsets and pulleys, of which some may be open."""
    kinds = [f"{place} {axis}" for place in ("anchor", "attachment") for axis in "xyz"] + ["offset", "pulley radius"]
    sigmas = 10 ** np.random.default_rng(3).uniform(-4, -2, (len(kinds), cables))
    sigmas[0, 1:3] = np.inf if opened else 1e-3
    return calibration.observability(dict(zip(kinds, sigmas, strict=True)))


def _curves() -> Figure:
    panels = [
        Panel("tension [N]", {f"cable {k}": 3 + np.sin(ROUND + k // 2) for k in range(8)}, bounds={"t_min": 1.0}),
        Panel("acceleration [m/s^2]", {"x": np.cos(ROUND), "y": np.cos(ROUND)}, dots={"measured": np.cos(ROUND) + 0.1}),
    ]
    return curves(TIME, "time [s]", panels, marks={"natural frequency": 3.0})


def _ball(count: int, radius: float) -> np.ndarray:
    points = np.random.default_rng(0).normal(size=(count, 3))
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True)


RUNS = [(k, 3.0 / (k + 1), 10.0**-k) for _ in range(3) for k in range(6)]
SQUARE = np.array([[1, 1, 1.0], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]])

FIGURES: dict[str, Callable[[], Figure]] = {
    "robot-cogiro": lambda: still("cogiro"),
    "robot-simulator": lambda: still("the-cable-robot-simulator"),
    "robot-ctmrts": lambda: still("wang-ctmrts"),
    "path": lambda: plan.path(planned()),
    "tensions": lambda: plan.tensions(planned()),
    "tensions-16": lambda: plan.tensions(planned(cables=16, far=False)),
    "tensions-infeasible": lambda: plan.tensions(planned(infeasible=True)),
    "tensions-phases": lambda: plan.tensions(planned(phases=True)),
    "tensions-two": lambda: plan.tensions_side_by_side(
        {"quadrotor hovering: infeasible": planned(infeasible=True), "quadrotor free to move: feasible": planned()}
    ),
    "base": lambda: plan.base_offset(planned()),
    "views": lambda: views(scene()),
    "views-high": lambda: views(scene(height=30.0)),
    "limits": lambda: limits.limits(TIME, limited()),
    "convergence": lambda: convergence(RUNS),
    "flight": lambda: flight.flight(flown()),
    "flight-tensions": lambda: flight.tensions(flown()),
    "flight-tensions-8": lambda: flight.tensions(flown(cables=8, wind=False)),
    "errors": lambda: flight.errors(flights()),
    "envelopes": lambda: flight.envelopes(enveloped()),
    "residuals": lambda: residuals(8, np.arange(400) / 100),
    "residuals-3": lambda: residuals(3),
    "anchors-3": lambda: corrected(3),
    "anchors-8": lambda: corrected(8),
    "anchors-12": lambda: corrected(12),
    "observability": lambda: deviations(8, opened=False),
    "observability-open": lambda: deviations(12, opened=True),
    "curves": _curves,
    "curve-in-space": lambda: curve_in_space({"platform": _ball(30, 1.0), "quadrotor": _ball(30, 2.0)}),
    "from-above": lambda: from_above({"as printed": (2 * SQUARE, SQUARE), "as computed": (2 * SQUARE, -SQUARE)}),
    "sweep-1": lambda: swept((6,)),
    "sweep-2": lambda: swept((6, 8)),
    "sweep-3": lambda: swept((6, 8, 4)),
    "projections": lambda: workspace.projections({"W1": _ball(500, 1.0), "W2": _ball(500, 0.5)}, 2 * SQUARE),
    "cross-sections": lambda: workspace.cross_sections(_ball(3000, 1.0), [-0.5, 0.0, 0.5], 0.02),
    "law": lambda: plan.phase_plane(
        np.linspace(0, 1, 21),
        np.sqrt(np.minimum(np.linspace(0, 20, 21), np.linspace(20, 0, 21))),
        [(0.0, 0.4, "t_max of cables 2, 5"), (0.4, 0.6, "speed of platform"), (0.6, 1.0, "t_max of cables 2, 5")],
    ),
    "reached": lambda: workspace.reached(sampled((20, 20, 10))),
    "reached-flat": lambda: workspace.reached(sampled((20, 20, 1))),
    "reached-sparsely": lambda: workspace.reached(sampled((32, 32, 32), 3)),
    "reached-line": lambda: workspace.reached(sampled((20, 1, 1))),
    "metrics": lambda: mapped((20, 20, 10)),
    "metrics-wide": lambda: mapped((20, 20, 10), (9, 2, 2)),
    "metrics-flat": lambda: mapped((20, 20, 1)),
    "metrics-line": lambda: mapped((20, 1, 1)),
}
