"""`Windows`: a plant repeats a recording in short windows, each from the recorded state on by recorded commands."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..base.errors import InputError
from ..estimation.logs.encoders import stretched
from ..estimation.logs.pose_track import PoseTrack, track_of
from ..estimation.logs.recorded import TO_COMPARE, Recorded
from ..estimation.logs.recording import GAP
from ..estimation.logs.smoothing import noise_of, smooth, spline_of, widest_parabola
from ..models import points
from ..models.dynamics import dynamics_of
from ..plant import Plant, layout
from ..plant.reading import sensed
from ..plant.steps import Periods, steps_in
from .replayed_robot import Parameters, cells_of, changed, friction_of, given_by_drives, modelled
from .start_tensions import SLOW, StartTensions

STEP = 2e-3  # [s] of the simulation
MARGIN = 0.05  # [s] of a recording before its first window, and longest gap that is none
MOST_WINDOWS, MOST_SAMPLES = 80, 40  # of a recording, evenly spread, and of a window
FEWEST = 5  # samples of a window
NUDGE = 1e-4, 1e-3  # [m, rad] and [m/s, rad/s], by which starts are varied
SLOPE = 8.0  # deviation of a smoothed slope, about twice that of white noise, over noise / (n^1.5 dt)
FLOOR = {"position": 2e-5, "rotation": 2e-5, "tensions": 1e-2, "lengths": 1e-5}  # of noise


class Windows:
    """Windows of a recording.

    - `recorded`: the recording.
    - `drive`: what is commanded: "lengths", "tensions", or "forces" of winches' motors; default: commands where these
      are recorded, otherwise measured lengths of cables with a stiffness, otherwise measured tensions or lengths.
    - `window`: duration of a window [s].
    - `flown`: numbers of the carriers whose recorded thrusts drive them.
    - `starts`: times at which windows start [s], (W,).
    - `rows`, `inside`: samples of each window, (W, S), and which of these belong to it; the last of a shorter window is
      repeated.
    - `start`, `start_sigma`: corrections of the recorded states at the starts, (W, P), and their standard deviations,
      (P,).

    Raises `InputError` if there are no commands, no measurements to compare with, no pose of a moving carrier, or no
    window.
    """

    def __init__(self, recorded: Recorded, drive: str | None, window: float):
        robot, self.recorded, self.window, times = recorded.robot, recorded, window, recorded.times
        self.notes = list(recorded.notes)
        self.flown = np.flatnonzero(np.isfinite(recorded.thrusts).all(axis=0))
        self._choose(drive)
        self.commanded = robot.fixed_lengths is None or len(self.flown) > 0
        self.robot = modelled(robot, self.drive, np.isin(np.arange(len(robot.carriers)), self.flown))
        self.assumed = any(cable.stiffness is None for cable in robot.cables)
        if self.assumed and self.drive != "tensions":
            self.notes.append("cables without a stiffness in the file are assumed to stretch by 0.1 % at t_max")
        if self.drive == "lengths" and recorded.tensions is None and robot.fixed_lengths is None:
            self.notes.append("lengths do not show friction of the winches: record tensions or motor currents for that")
        # whether the recording shows the stiffness: lengths that winches measure, and other commands than tensions
        self.shows_stiffness = self.drive != "tensions" and not self.measured_command
        if recorded.lengths is not None and not recorded.under_tension:
            self.shows_stiffness |= self.drive == "lengths" or not self.assumed
        if not self.shows_stiffness and not self.assumed:
            self.notes.append("tensions and lengths from anchor to attachment do not show the stiffness of the cables")
        none = robot.m * (0.0,)  # parameters of the file
        usual = {"load_cells": 2 * none, "cable_friction": none, "anchors": 3 * none}
        usual["thrusts"] = len(robot.carriers) * (0.0,)
        self.usual = Parameters(friction=friction_of(self.robot), **usual)
        self.usual_tension = self.robot.force_scale
        if recorded.tensions is not None:
            self.usual_tension = float(np.median(np.abs(recorded.tensions)))
        self._known = np.asarray(np.isfinite(recorded.pose).all(axis=1))
        if self._known.sum() < FEWEST:
            raise InputError(f"log must have a pose at {FEWEST} times or more, got {int(self._known.sum())}")
        self._track, neighbours = track_of(times, recorded.pose)
        self._rotation = points.rotations(np.where(self._known[:, None], recorded.pose[:, 3:], 0.0))  # (N, 3, 3)
        self._carriers = self._carrier_tracks()
        apart = float(np.median(np.diff(times)))
        self._place(apart)
        # standard deviation of what is compared, by its sensors: position [m], rotation [rad], tensions [N], lengths
        # [m]
        self.noise = self._noise()
        self._neighbours = widest_parabola(times, self._command) if self.measured_command else 0
        self._sample()
        self._moves = np.flatnonzero(robot.dof_mask)
        slope = SLOPE / (neighbours**1.5 * apart)
        of_pose = [self._of_pose[int(i >= 3)] for i in self._moves]
        of_flown = [self._of_pose[0]] * 3 * len(self.flown)
        sigma = [*of_pose, *(slope * one for one in of_pose), *of_flown, *(slope * one for one in of_flown)]
        self.start_sigma, self.start = np.array(sigma), np.zeros((len(self.starts), len(sigma)))
        pairs = (len(of_pose), len(of_pose), len(of_flown), len(of_flown))
        self._steps_of_start = np.repeat([*NUDGE, *NUDGE], pairs)  # (P,)
        self._parts_of_start = np.cumsum(pairs)[:-1]

    def _choose(self, drive: str | None) -> None:
        """Choose what is commanded, and by which numbers."""
        of, robot = self.recorded, self.recorded.robot
        kinds = {"lengths": of.lengths, "tensions": of.tensions}
        self.measured_command = False
        if robot.fixed_lengths is not None:
            self.drive, self._command = "lengths", np.tile(robot.fixed_lengths, (len(of.times), 1))
        elif of.commands is not None and (drive is None or (drive == "lengths") == (of.commanded == "lengths")):
            self.drive, self._command = drive or of.commanded, of.commands
            if self.drive == "forces" and not all(cable.winch for cable in robot.cables):
                self.drive = "tensions"
        else:
            elastic = all(cable.stiffness for cable in robot.cables)
            wanted = [drive] if drive in kinds else [*(["lengths"] if elastic else []), "tensions", "lengths"]
            found = [(name, values) for name in wanted if (values := kinds[name]) is not None]
            if not found:
                raise InputError(f"log must have {' or '.join(dict.fromkeys(wanted))} of the cables, got none")
            (self.drive, self._command), self.measured_command = found[0], True
        if drive == "forces" and self.drive != drive:
            raise InputError(
                "drive must be forces only if the log has commanded forces and every cable of the robot has a winch"
            )

    def _carrier_tracks(self) -> dict[int, PoseTrack]:
        tracks, of = {}, self.recorded
        for index, carrier in enumerate(of.robot.carriers):
            if carrier.free_coordinates(of.robot.drive):
                known, name = int(np.isfinite(of.carrier_pose[:, index]).all(axis=1).sum()), carrier.name
                if known < FEWEST:
                    raise InputError(f"log must have poses of carrier {name} ({name}_x, ..., {name}_qw), got {known}")
                tracks[index] = track_of(of.times, of.carrier_pose[:, index])[0]
        return tracks

    def _place(self, apart: float) -> None:
        """Choose the windows and their samples."""
        every, times = self.recorded.times, self.recorded.times[self._known]
        starts = np.arange(times[0] + MARGIN, times[-1] - self.window, self.window)
        first, last = np.searchsorted(times, starts - MARGIN), np.searchsorted(times, starts + self.window)
        gaps = np.concatenate([[0], np.cumsum(np.diff(times) > max(GAP * apart, MARGIN))])
        starts = starts[(last - first >= FEWEST) & (gaps[last - 1] == gaps[np.maximum(first - 1, 0)])]
        if not len(starts):
            raise InputError(
                f"log must have poses without a gap over at least one window of {self.window:g} s, got none"
            )
        if len(starts) > MOST_WINDOWS:
            self.notes.append(f"{MOST_WINDOWS} of {len(starts)} windows are used, evenly spread")
            starts = starts[np.linspace(0, len(starts) - 1, MOST_WINDOWS).astype(int)]
        spans = [np.arange(*np.searchsorted(every, [at, at + self.window])) for at in starts]
        spans = [one[np.linspace(0, len(one) - 1, min(len(one), MOST_SAMPLES)).astype(int)] for one in spans]
        most, self.starts = max(map(len, spans)), starts
        self.rows = np.stack([np.pad(one, (0, most - len(one)), mode="edge") for one in spans])  # (W, S)
        self.inside = np.stack([np.arange(most) < len(one) for one in spans])

    def _noise(self) -> dict[str, float]:
        """Return the noise of what is compared, and keep the noise of the pose."""
        of, known, moves = self.recorded, self._known, self.recorded.robot.dof_mask > 0
        turned = Rotation.from_matrix(self._track.at_times(of.times[known]).at(0.0)[1]).inv()
        away = (turned * Rotation.from_matrix(self._rotation[known])).as_rotvec()
        values = {"position": of.pose[known, :3][:, moves[:3]], "rotation": away[:, moves[3:]]}
        values |= {name: each for name in ("tensions", "lengths") if (each := getattr(of, name)) is not None}
        noise = {
            name: max(noise_of(of.times[known] if name in ("position", "rotation") else of.times, each), FLOOR[name])
            for name, each in values.items()
        }
        self._of_pose = noise["position"], noise["rotation"]
        left_out = {self.drive} if self.measured_command else set()
        left_out |= set() if of.measured[:3].any() else {"position"}
        left_out |= set() if of.measured[3:].any() else {"rotation"}
        noise = {name: value for name, value in noise.items() if name not in left_out}
        if not noise:
            raise InputError(f"log must have {TO_COMPARE}, to compare, got none")
        return noise

    def shaken(self) -> Windows:
        """Return windows of the same recording with as much noise again in what drives the plant.

        By how much these differ in simulation is the noise that a simulation has from the recording.
        """
        of, draw = self.recorded, np.random.default_rng(0).standard_normal
        carrier_pose, thrusts = of.carrier_pose.copy(), of.thrusts.copy()

        def add(values: np.ndarray) -> None:
            known = np.asarray(np.isfinite(values).all(axis=1))
            values += noise_of(of.times[known], values[known]) * draw(values.shape)

        for index in self._carriers:
            carrier_pose[:, index, 3:] = np.unwrap(carrier_pose[:, index, 3:], axis=0)
            add(carrier_pose[:, index, :3])
            add(carrier_pose[:, index, 3:])
            add(thrusts[:, [index]])
        named = {"lengths": of.lengths, "tensions": of.tensions}
        noisy: dict[str, Any] = {name: values.copy() for name, values in named.items() if values is not None}
        for values in noisy.values():
            add(values)
        other = copy(self)
        other.recorded = replace(of, carrier_pose=carrier_pose, thrusts=thrusts, **noisy)
        if self.measured_command:
            other._command = noisy[self.drive]
        other._carriers = other._carrier_tracks()
        other._sample()
        other.recorded = replace(of, thrusts=thrusts)  # to compare with
        return other

    def _sample(self) -> None:
        """Evaluate what was recorded along the windows."""
        of, count = self.recorded, max(1, round(self.window / STEP))
        self._dt = self.window / count
        self._substeps = steps_in(self._dt, Plant(self.robot, drive=self.drive))
        self._grid = self.starts[:, None] + self._dt * np.arange(count + 1)  # (W, K + 1)
        carriers = np.tile(of.robot.carrier_home, (*self._grid.shape, 1, 1))
        for index, track in self._carriers.items():
            carriers[:, :, index] = self._along(track)
        self._platform, self._carried = self._motion(self._along(self._track)), self._motion(carriers)
        self._attitudes = {index: self._attitude(carriers[:, :, index, 3:]) for index in self.flown}
        self._signal: Any = lambda at: np.stack([np.interp(at, of.times, one) for one in self._command.T], axis=-1)
        if (self.drive == "lengths" or not self.measured_command) and len(of.times) >= FEWEST:
            # Stiff cables feel where straight lines cut corners, and a platform the impulse that these miss.
            even = smooth(of.times, self._command, self._neighbours) if self.measured_command else self._command
            self._signal = spline_of(of.times, even)
        self._late_by = lru_cache(1)(self._late)  # while other parameters are fitted
        dynamics = dynamics_of(self.robot)
        lengths = np.asarray(dynamics.cable_lengths(self._platform[0], carriers))
        self._cable_speed = np.gradient(lengths, self._dt, axis=1)
        first = [part[:, 0] for part in (*self._platform, *self._carried)]
        balance = dynamics.wrench_matrix(first[0], first[3]), dynamics.required_wrench(*first)
        forces = self._signal if self.drive == "forces" else None
        at_starts = self.robot, of, self.starts, lengths[:, 0], balance, forces, self.usual_tension
        self._tensions = StartTensions(*at_starts)

    def _late(self, delay: float) -> np.ndarray:
        """Return lengths at the ends of all steps (W, K + 1, m) [m], or the drives' tensions or forces in these [N]."""
        if self.drive == "lengths":
            return self._signal(self._grid - delay)
        at = self._grid[:, :-1] + 0.5 * self._dt - delay
        if self.measured_command or self.drive == "forces":
            return self._signal(at)
        before = round(2 * MARGIN / self._dt)
        early = at[:, :1] - self._dt * np.arange(before, 0, -1)
        commands = self._signal(np.concatenate([early, at], axis=1))
        return given_by_drives(self.recorded.robot, commands, self._dt)[:, before:]

    def _along(self, track: PoseTrack) -> np.ndarray:
        """Return the poses of a track on the grid, (W, K + 1, 6), with angles that do not jump."""
        position, rotation = track.at_times(self._grid.ravel()).at(0.0)[:2]
        pose = np.concatenate([position, points.angles(rotation)], axis=1).reshape(*self._grid.shape, 6)
        pose[..., 3:] = np.unwrap(pose[..., 3:], axis=1)
        return pose

    def _motion(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        velocity = np.gradient(pose, self._dt, axis=1)
        return pose, velocity, np.gradient(velocity, self._dt, axis=1)

    def _attitude(self, angles: np.ndarray) -> np.ndarray:
        """Return quaternion (w, x, y, z) and rate in its own axes of a carrier, (W, K + 1, 7), of angles."""
        R = points.rotations(angles)
        turned = (R[:, :-1].swapaxes(-1, -2) @ R[:, 1:]).reshape(-1, 3, 3)
        rate = Rotation.from_matrix(turned).as_rotvec().reshape(len(R), -1, 3) / self._dt
        quaternion = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(scalar_first=True).reshape(*R.shape[:2], 4)
        return np.concatenate([quaternion, np.pad(rate, ((0, 0), (0, 1), (0, 0)), mode="edge")], axis=-1)

    def _states(self, plant: Plant, pulls: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return states (V W, n) and unstrained lengths (V, W, m), for corrections (V, W, P) and tensions (W, m)."""
        m, free = self.robot.m, self.drive != "tensions"
        parts = [
            np.tile(part[:, 0], (len(shift), *[1] * (part.ndim - 1)))
            for of in (self._platform, self._carried)
            for part in of[:2]
        ]
        by = np.split(shift, self._parts_of_start, axis=-1)
        for part, more in zip(parts[:2], by[:2], strict=True):
            part[..., self._moves] += more
        parts[1][..., self.recorded.robot.dof_mask == 0] = 0.0
        for part, more in zip(parts[2:], by[2:], strict=True):
            part[..., self.flown, :3] += more.reshape(*more.shape[:2], -1, 3)
        pose, velocity, carrier_pose, carrier_velocity = parts
        given: dict[str, Any] = {"lengths": np.ones(m)} if free else {"tensions": pulls}
        states = plant.start(pose, velocity, carrier_pose, carrier_velocity, **given).reshape(-1, plant.size)
        lengths = sensed(plant.robot, states)[1]
        stretch = 1 + np.tile(pulls, (len(shift), 1)) / plant.record["cable"]["stiffness"][:m]
        blocks = states[:, -layout.CABLE_BLOCKS * m :].reshape(len(states), -1, m)
        if free:
            blocks[:, layout.LENGTH] = blocks[:, layout.REFERENCE] = lengths[:, 0] / stretch
        if self.drive == "forces":
            stretching = np.tile(self._tensions.stretching, (len(shift), 1))
            blocks[:, layout.LENGTH_RATE] = (lengths[:, 1] - stretching) / stretch
        states[:, -layout.CABLE_BLOCKS * m :] = blocks.reshape(len(states), -1)
        return states, (lengths[:, 0] / stretch).reshape(*shift.shape[:2], m)

    def predict(self, with_: Parameters, nudged: bool = False) -> np.ndarray:
        """Return measured minus simulated over the noise, (V, W, R), 0 where not measured.

        V = 1; with `nudged` 1 + P: then come the derivatives by the corrections of the start.
        """
        m, W, (steps, dt) = self.robot.m, len(self.starts), (self._grid.shape[1] - 1, self._dt)
        plant = Plant(changed(self.robot, with_), drive=self.drive)
        substeps = self._substeps + (with_.stiffness > 1.5)
        by = np.diag(self._steps_of_start) if nudged else np.zeros((0, len(self.start_sigma)))
        shift = self.start + np.concatenate([np.zeros((1, 1, by.shape[1])), by[:, None]])  # (V, W, P)
        count = len(shift)
        states, own = self._states(plant, self._tensions.elastic(with_), shift)
        rows, cables = self._commands(plant, with_, own)
        at = (self.recorded.times[self.rows] - self.starts[:, None]) / dt
        number = np.clip(np.floor(at).astype(int), 0, steps - 1)
        history, tensions = np.zeros((count * W, 2, plant.size)), np.zeros((count * W, 2, m))
        seen = [np.zeros((count, *self.rows.shape, part.shape[-1])) for part in (history, tensions)]
        periods = Periods(plant, dt, substeps)
        # Only periods with samples, and those of carriers that turn, are run alone.
        stops = np.arange(steps + 1) if self._attitudes else np.unique([0, *number.ravel(), *(number.ravel() + 1)])
        with np.errstate(all="ignore"):
            for k, end in pairwise(stops.tolist()):
                # Flown carriers turn as recorded: a thrust is known, the torques behind an attitude rarely are.
                for index, attitude in self._attitudes.items():
                    body = states.reshape(count, W, -1)[..., layout.BODY * (1 + index) : layout.BODY * (2 + index)]
                    body[..., layout.QUATERNION : layout.VELOCITY] = attitude[:, k, :4]
                    body[..., layout.RATE :] = attitude[:, k, 4:]
                commands = rows[None, :, k : end + 1].repeat(count, axis=0)
                commands[:, :, :-1, layout.COMMANDS : layout.COMMANDS + m] = cables[:, :, k:end]
                commands = commands.reshape(count * W, end + 1 - k, -1)
                periods.run(states, commands, history, tensions, count=end - k)
                w, s = np.nonzero(number == k)
                if len(w):
                    share = (at[w, s] - k)[:, None]
                    for part, both in zip(seen, (history, tensions), strict=True):
                        both = both.reshape(count, W, 2, -1)[:, w]
                        part[:, w, s] = (1 - share) * both[:, :, 0] + share * both[:, :, 1]
                states[:] = history[:, 1]
        if self.drive == "tensions":  # each is held for a step, in the middle of which it is right
            before = np.clip(np.floor(at - 0.5).astype(int), 0, steps - 2)[..., None]
            first, second = (np.take_along_axis(cables, (before + i)[None], axis=2) for i in (0, 1))
            seen[1][:] = (first + (at[..., None] - 0.5 - before) * (second - first)).clip(0.0)
        speeds = np.take_along_axis(self._cable_speed, number[..., None], axis=1)  # (W, S, m)
        friction = (with_.friction + np.array(with_.cable_friction)) * np.tanh(speeds / SLOW)
        residuals = self._residuals(seen[0], seen[1], plant, friction, with_)
        residuals[1:] = (residuals[1:] - residuals[0]) / self._steps_of_start[:, None, None] if nudged else 0.0
        return residuals

    def _commands(self, plant: Plant, with_: Parameters, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return commands as rows, (W, K + 1, k), and the numbers of the cables in them, (V, W, K, m)."""
        middle, commanded = self._grid + 0.5 * self._dt - with_.delay, self._late_by(with_.delay)
        if self.drive == "lengths":
            cables = np.maximum(own[:, :, None] + commanded[:, 1:] - commanded[:, :1], layout.SHORTEST)
        else:
            pulls, friction = commanded, with_.friction + np.array(with_.cable_friction)
            if self.measured_command:
                gains, zeros = cells_of(with_, self.usual_tension)
                pulls = (pulls - zeros) / gains
            if self.drive == "tensions":
                pulls = (pulls + friction * np.tanh(self._cable_speed[:, :-1] / SLOW)).clip(0.0)
            cables = np.broadcast_to(pulls, (len(own), *pulls.shape))
        actuators = max(len(carrier.actuators) for carrier in self.robot.carriers)
        actuation = np.zeros((*self._grid.shape, len(self.robot.carriers), actuators))
        for index in self.flown:
            thrust = np.interp(middle, self.recorded.times, self.recorded.thrusts[:, index])
            actuation[:, :, index, 0] = thrust / (1 + np.atleast_1d(with_.thrusts)[index])
        return plant.command(np.ones(self.robot.m), actuation, *self._carried), cables

    def _residuals(
        self, states: np.ndarray, tensions: np.ndarray, plant: Plant, friction: np.ndarray, with_: Parameters
    ) -> np.ndarray:
        """Return measured minus simulated over noise, (V, W, R), of states (V, W, S, n) and tensions (V, W, S, m).

        Winches that follow lengths overcome their friction (W, S, m) [N]: it shows only in tensions that are measured
        behind it, as by motor currents.
        """
        of, rows, inside, parts = self.recorded, self.rows, self.inside[..., None], {}
        motions, lengths = (part[..., 0, :] for part in sensed(plant.robot, states))
        position, q = motions[..., :3], states[..., layout.QUATERNION : layout.VELOCITY]
        quaternion = np.where(np.isfinite(q).all(axis=-1, keepdims=True), q, 1.0)[..., [1, 2, 3, 0]]
        known = inside & self._known[rows][..., None]
        if "position" in self.noise:
            parts["position"] = np.where(known & of.measured[:3], of.pose[rows, :3] - position, 0.0)
        if "rotation" in self.noise:
            recorded = np.broadcast_to(self._rotation[rows], (len(states), *rows.shape, 3, 3)).reshape(-1, 3, 3)
            away = Rotation.from_matrix(recorded) * Rotation.from_quat(quaternion.reshape(-1, 4)).inv()
            moves = known & (of.robot.dof_mask[3:] > 0)
            parts["rotation"] = np.where(moves, away.as_rotvec().reshape(position.shape), 0.0)
        if "tensions" in self.noise and of.tensions is not None:
            behind = (tensions - friction).clip(0.0) if self.drive == "lengths" else tensions
            gains, zeros = cells_of(with_, self.usual_tension)
            parts["tensions"] = np.where(inside, of.tensions[rows] - (gains * behind + zeros), 0.0)
        if "lengths" in self.noise and of.lengths is not None:
            # The file's stiffness made lengths under tension unstrained, and an assumed one is not in the readings.
            of_file = of.under_tension or (self.drive == "tensions" and self.assumed)
            by = of.robot if of_file else plant.robot
            own = lengths / stretched(by, tensions)
            if self.drive == "forces" and not of.under_tension:
                blocks = states[..., -layout.CABLE_BLOCKS * of.robot.m :].reshape(*own.shape[:-1], -1, of.robot.m)
                own = blocks[..., layout.LENGTH, :]  # damping, of which tensions include a part, elongates no cable
            away = np.where(inside, of.lengths[rows] - own, 0.0)
            away -= away.sum(axis=2, keepdims=True) / inside.sum(axis=1, keepdims=True)  # offsets of the encoders
            parts["lengths"] = np.where(inside, away, 0.0)
        self.widths = [part.shape[-1] for part in parts.values()]
        whole = np.concatenate([part / self.noise[name] for name, part in parts.items()], axis=-1)
        return whole.reshape(*whole.shape[:2], -1)
