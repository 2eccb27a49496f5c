"""`Watch`: compare a robot's motion with its model; `HandOver`: when and why another controller took over.

`lost_carrier` finds a flying carrier without thrust, and `flaw_of_carriers` also those that turn too late. In large
teams a lost thrust hardly moves the platform: with one of six lost, the platform's acceleration shows it after 70 to
140 ms, the carrier's after 10 to 45 ms.
"""

from collections import deque
from math import sqrt
from typing import NamedTuple
from warnings import warn

import numpy as np

from ..models.robot import Robot

LOST = 0.7  # of a carrier's weight: force along gravity that nothing explains; lags, noise and delays made up to 0.66
BOUND = 0.1  # of the usual acceleration: the mean that is not predicted and permitted
UNSTABLE = (
    "small errors at home grow under predictive control, whose model omits that carriers turn before they accelerate"
)
LATE = "carriers turn so late, by lag or delay, that their attitude loop is nearly unstable, as with a lag of"
STEEP = "the platform pitches beyond 1.5 rad, where no linear model of its angles is right"
LOUD = "noise of the measured rates requires more than the tension limits permit: lower bandwidth and observer"
WINDOW, PAUSE = 0.05, 0.21  # [s]: in which a motion is compared, at least, and at most between two steps
BLIND, UNCHECKED = 0.025, 0.5  # [s], at most: without a state, and without a comparison
QUICK, LONG = 0.01, 0.1  # [s]: noise is quicker than what tensions correct, and how long it is heard
OFTEN = 2.0  # standard deviations of noise have room: one command in twenty is cut off
VARIES = 2.0  # times its variance is what known noise, for which bandwidths are chosen, has in some tenth of a second
SMOOTH, MEAN = 0.005, 0.04  # [s], of the difference, against noise, and of the mean of its size
EARLY = 1e-6  # of the window
KNOWN = 0.5  # of an acceleration that sensors find missing in the tensions: observers follow it, predictions do not


class HandOver(NamedTuple):
    """A hand-over to computed torque."""

    time: float  # [s]; minus infinity: from the start
    reason: str
    carrier: int | None = None  # index of the one that has lost its thrust


def lost_carrier(robot: Robot, forces: np.ndarray) -> int | None:
    """Return the index of the carrier that has lost its thrust, None if all have theirs.

    `forces`, (c, 3) [N] in {G}, are those on each carrier that its thrust, its weight and its cables do not explain. A
    carrier without thrust lacks at least its weight, whether or not the tensions of its cables are measured.
    """
    gravity = np.array(robot.gravity)
    masses = [0.0 if carrier.body is None else carrier.body.mass for carrier in robot.carriers]
    excess = forces @ gravity - LOST * np.array(masses) * (gravity @ gravity)
    excess = np.nan_to_num(excess, nan=-np.inf)  # an unknown force must not hide the force of another carrier
    index = int(np.argmax(excess))
    return index if excess[index] > 0 else None


def flaw_of_carriers(
    time: float, robot: Robot, carriers: np.ndarray, turning: np.ndarray, attitude: float
) -> HandOver | None:
    """Return why flying carriers make predictions useless, None if they do not.

    `carriers` and `turning` are the controller's records of one robot (control/records.py), and `attitude` is the
    bandwidth of its attitude loops [rad/s].
    """
    if (lost := lost_carrier(robot, carriers["force"])) is not None:
        return HandOver(time, f"{robot.carriers[lost].name} has lost its thrust", lost)
    lag = float(turning["lag"])
    return HandOver(time, f"{LATE} {1e3 * lag:.0f} ms of {2e3 / attitude:.0f}") if lag else None


class Watch:
    """Compare measured velocities with the model's prediction for the commands that were sent.

    Over the last `WINDOW` the velocity should change by the integral of the model's accelerations, from each measured
    state to the next one, with the tensions sent, half of what sensors report in addition, and the disturbance
    estimated from the earlier state. The mean difference over the window is the unexplained acceleration. States that
    arrive late are compared with the prediction for their time: a disturbance is unexplained until the observer knows
    it, whatever the delay. New plans and jumps of the reference do not contribute, because they act through the
    commands. States that are further apart than `PAUSE` are not compared, nor those before and after more than `blind`
    without a state. If nothing was compared for longer than `UNCHECKED`, a warning is given once.

    - `scale`: factors that make velocities of all coordinates comparable, (6,): 1, and lengths [m] for angles; 0 for
      locked coordinates.
    - `usual`: acceleration of the platform by the robot's force scale [m/s^2]: `BOUND` times this is permitted, and a
      step without a solution is treated as an unexplained acceleration of at least this size.
    - `noise`: standard deviation of what known noise of sensors adds to the difference over the window, of all
      coordinates together [m/s], which is permitted as well.
    - `ripple`: tensions commanded for unit rates of the pose, relative to the distance of tensions from their limits,
      (m, 6) [s/m, s/rad]. The limits clip the effect of rate noise, more on one side than on the other, so `OFTEN`
      standard deviations beyond the limits are a reason to hand over, and `VARIES` times their variance if noise is
      known. Default: noise is ignored.
    - `blind`: largest time without a state that is bridged by predictions [s]; less for cables of fixed length, whose
      tensions change as carriers turn.
    """

    def __init__(
        self,
        scale: np.ndarray,
        usual: float,
        noise: float = 0.0,
        ripple: np.ndarray | None = None,
        blind: float = BLIND,
    ):
        self._scale, self._blind = scale, blind
        self._bound = BOUND * usual + noise / WINDOW
        self._ripple = None if ripple is None else (OFTEN * ripple) ** 2 / (VARIES if noise else 1.0)
        self.reset()

    def reset(self) -> None:
        """Forget all earlier steps."""
        self.unexplained = 0.0  # mean acceleration [m/s^2]
        self._noise = np.zeros(6)  # variance of the rates
        self.solved = np.inf  # when the state of the last solution was measured [s]
        self._checked: float | None = None  # time of the last comparison, or of the first step [s]; inf after a warning
        self._unseen = 0.0  # [s], without a measured state
        self.interrupt()

    def interrupt(self) -> None:
        """Forget all steps except the time without a solution: the robot was not controlled, or not measured."""
        self._left: deque[tuple[float, np.ndarray]] = deque()  # times, and velocities less what explains them
        self._explained, self._off = np.zeros(6), np.zeros(6)
        self._trend: np.ndarray | None = None

    def skip(self, dt: float) -> None:
        """Continue without a measured state, `dt` [s] after the last step."""
        self._unseen += dt
        if self._unseen > self._blind * (1 + EARLY):
            self.interrupt()

    def compare(self, time: float, since: float, rate: np.ndarray, change: np.ndarray) -> HandOver | None:
        """Compare the rate of the pose, (6,), with its prediction; return the reason not to use predictions, or None.

        The rate was measured at `time` [s], `since` [s] after the previous one (infinity if there is none). The model
        predicts that it has changed by `change`, (6,), in between; nan if unknown.
        """
        self._unseen = 0.0
        self.solved = min(self.solved, time)  # at first there is none yet
        if since > WINDOW:
            self.solved = max(self.solved, time)
        if since <= PAUSE and np.isfinite(change).all():
            self._explained += change
        else:
            self.interrupt()
        left, steps = rate - self._explained, self._left
        if self._ripple is not None and self._is_loud(self._ripple, since, left):
            return HandOver(time, LOUD)
        left = self._scale * left
        steps.append((time, left))
        while time - steps[0][0] >= WINDOW * (1 - EARLY) and time - steps[1][0] >= WINDOW * (1 - EARLY):
            steps.popleft()
        window = time - steps[0][0]
        if time - self.solved > WINDOW:
            self._add(since, self._bound / BOUND)
        elif window >= WINDOW * (1 - EARLY):
            self._off += min(since / SMOOTH, 1.0) * (left - steps[0][1] - self._off)
            self._add(since, sqrt(self._off @ self._off) / window)
            self._checked = time
        elif self._checked is None:
            self._checked = time
        elif time - self._checked > UNCHECKED:
            warn(
                f"the motion was not compared with the model of Predictive for {time - self._checked:.2g} s: steps "
                f"must be at most {PAUSE:g} s apart, and states may be missing for at most {self._blind:g} s",
                stacklevel=2,
            )
            self._checked = np.inf
        if self.unexplained <= self._bound:
            return None
        return HandOver(time, f"{self.unexplained:.2g} m/s^2 of its acceleration are not as predicted")

    def _is_loud(self, ripple: np.ndarray, dt: float, left: np.ndarray) -> bool:
        """Update the noise, the deviation from a straight line, and return whether it is too large."""
        if self._trend is None or dt > QUICK:
            self._trend, self._slope = left.copy(), np.zeros(6)
        share = min(dt / QUICK, 0.5)
        self._trend += min(dt, QUICK) * self._slope
        off = left - self._trend
        self._trend += 2 * share * off
        self._slope += share / QUICK * off
        self._noise += min(dt / LONG, 1.0) * (off * off - self._noise)
        return bool((ripple @ self._noise).max() > 1.0)

    def _add(self, dt: float, acceleration: float) -> None:
        self.unexplained += min(dt / MEAN, 1.0) * (acceleration - self.unexplained)
