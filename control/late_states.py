"""`LateStates`: current states from older ones and the commands that were sent since."""

from collections import deque
from collections.abc import Sequence
from math import ceil

import numpy as np

from ..core import control_move_on
from .as_floats import ROUNDING

OLDEST, PART = 0.25, 2e-3  # [s]: an older state is none; parts of the time since a state was measured
MANY = 64  # commands in a queue before old ones are looked for


class Pending:
    """Remember commands for `kept` [s]."""

    def __init__(self, kept: float):
        self._kept = kept
        self.reset(0)

    def reset(self, count: int) -> None:
        """Forget all commands, of `count` numbers each; `time` [s] has passed since."""
        self.time, self._count, self._many = 0.0, count, MANY
        self._commands: deque[tuple[float, bytes]] = deque()

    def wait(self, dt: float) -> None:
        """Let `dt` [s] pass."""
        self.time += dt

    def add(self, command: bytes) -> None:
        """Add a command from now on, the bytes of (count,) numbers."""
        self._commands.append((self.time, command))
        if len(self._commands) >= self._many:
            self._forget()

    def _forget(self) -> None:
        """Forget commands that are too old; half of the queue's next length are new."""
        commands = self._commands
        while len(commands) > 1 and commands[1][0] <= self.time - self._kept:
            commands.popleft()
        self._many = max(MANY, 2 * len(commands))

    def means(self, ago: float, parts: int, part: float) -> np.ndarray:
        """Return mean commands, (parts, count), in parts of `part` [s], from `ago` [s] before now on.

        They are zero if nothing has been commanded.
        """
        edges = self.time - ago + part * np.arange(parts + 1)
        first, last = float(edges[0]), float(edges[-1])
        begins: list[float] = []
        values: list[bytes] = []
        for begin, command in reversed(self._commands):
            if begin < last:
                begins.insert(0, begin)
                values.insert(0, command)
            if begin <= first:  # those before are over
                break
        if not begins:
            return np.zeros((parts, self._count))
        starts, commands = np.array(begins), np.frombuffer(b"".join(values)).reshape(len(begins), -1)
        # Integrals at the beginnings are added one after the other, since BLAS rounds those of a robot differently
        # depending on how many there are.
        integrals = np.zeros_like(commands)
        np.cumsum((starts[1:] - starts[:-1])[:, None] * commands[:-1], axis=0, out=integrals[1:])
        at = np.maximum(starts.searchsorted(edges, side="right") - 1, 0)
        reached = integrals[at] + np.maximum(edges - starts[at], 0.0)[:, None] * commands[at]
        return (reached[1:] - reached[:-1]) / part


class LateStates:
    """Predict the current states of N robots from their measured states and the commands that were sent since.

    Observers use the measured states. With predicted ones they would correct their own prediction and be unstable for
    delays beyond the inverse of their bandwidth.

    - `count`: number of tensions of all robots, N m.
    - `actuation`: commands to actuators of all robots, (N, c, a).
    """

    def __init__(self, count: int, actuation: np.ndarray):
        self._commanded, self._begun, self._count = Pending(2 * OLDEST), False, count
        self._commanded.reset(count)
        self._actuated, self._actuation = Pending(2 * OLDEST), actuation
        self._actuated.reset(actuation.size)

    def remember(self, tensions: bytes, dt: float, *before: np.ndarray | None) -> None:
        """Remember the tensions (N, m) of the last step, `dt` [s] ago, and what actuators have given since.

        At the first step nothing is known but `before`, tensions (N, m) or (m,) that are measured or planned [N]. The
        first ones without nan are taken as the tensions of the time before, or as those of the first step.
        """
        known = [np.resize(one, self._count).tobytes() for one in before if one is not None and np.isfinite(one).all()]
        if not self._begun and (dt > 0 or known):
            self._commanded.add(tensions if dt > 0 else known[0])
            self._commanded.wait(OLDEST)
            self._begun = True
        self._commanded.add(tensions)
        self._commanded.wait(dt)
        self._actuated.add(self._actuation.tobytes())
        self._actuated.wait(dt)

    def commanded(self, cables: np.ndarray, age: float, since: float, dt: float, senses: bool) -> None:
        """Write what was commanded when states were measured, `age` [s] ago, to records of cables (N, m).

        `since` [s] is the time between the measurements of this step and of the last one, `dt` [s] that between the
        steps. Sensors report the tensions of one period, while observers need their mean since the last measurement.
        """
        if self._begun:
            window = since if since > 0 else dt or PART
            cables["then"] = self._commanded.means(age + window, 1, window).reshape(cables.shape)
            if window > dt > 0:
                cables["measured"] += cables["then"] - self._commanded.means(age + dt, 1, dt).reshape(cables.shape)
        if not senses:
            cables["measured"] = cables["then"]

    def move_on(
        self,
        age: float,
        models: Sequence[tuple[np.ndarray, float]],
        motions: np.ndarray,
        otherwise: np.ndarray,
        disturbance: np.ndarray,
        accelerations: bytes,
        flies: bool = False,
    ) -> np.ndarray | None:
        """Predict motions, (N, 1 + c, 12), over their `age` [s]; return them as measured if they were predicted.

        - `age`, `motions`: motions that are too old become nan.
        - `models`: records of the robot, and how long each describes it [s], `age` in all.
        - `otherwise`: differences of tensions from their commands, (N, m) [N].
        - `disturbance`: estimated wrench of the disturbance, (N, 6) [N, N m].
        - `accelerations`: commanded accelerations of the carriers, (N, c, 6).
        - `flies`: true: flying carriers move by their thrusts and torques, as far as these are known.
        """
        if age <= ROUNDING or not (self._begun or age > OLDEST):
            return None
        late = motions.copy()
        if age > OLDEST:
            motions[:] = np.nan
            return late
        for robot, lasting in models:
            parts = ceil(lasting / PART)
            tensions = self._commanded.means(age, parts, lasting / parts).reshape(parts, *otherwise.shape) + otherwise
            flown = self._actuated.means(age, parts, lasting / parts) if flies else None
            if flown is not None and age > self._actuated.time:
                flown[: ceil((age - self._actuated.time) * parts / lasting - ROUNDING)] = 0.0
            given = disturbance.copy(), np.maximum(tensions, 0.0), flown, np.frombuffer(accelerations)
            control_move_on(lasting / parts, robot, *given, motions)
            age -= lasting
        return late
