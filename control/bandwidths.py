"""`bandwidths_for`: the default bandwidths of controllers, and what delays, lags and noise of sensors permit.

A loop of bandwidth w with an observer of bandwidth K, whose state is T late without being predicted, and whose measured
positions and velocities have the noise s_x and s_v, keeps

    (w + K) T <= 1        w^2 s_x + (2 w + K) s_v <= 0.05 g        L / g (w^4 s_x + 4 w^3 s_v) <= 0.15 g

the last with cables of fixed length L of a team, whose carriers have to move before the load accelerates.
Defaults keep 0.03 g on robots with at least as many cables as degrees of freedom, whose winches follow the noise.
States without a time are predicted over the known delay. It may be wrong by 30 %, and T has 80 % of it. Two standard
deviations of the tensions that noise of velocities requires are inside the limits at home. At about twice these bounds
robots were lost in simulations with an independent plant. Commands to winches that lag amplify the noise, and leave as
much of the lag as T permits where the noise permits no more.

The attitude loops of flying carriers, phi'' = -2 h phi' - h^2 phi, are stable up to h lag = 2 with drives that lag
(Routh), up to h delay = 0.647 with late states (their phase where the gain is 1), and up to h period = 1 with states
that are held for a period (Jury), each alone. States are predicted over their delay: exactly if they have a time.
Without one the delay is that of `sensors`, which may be wrong by 30 %, so that 0.6 of it is taken as not predicted.
Together they keep

    h (lag / 2 + (delay / 0.647 + period) / 1.5) <= 0.5        h >= 6 k

with the bandwidths k of the loops around them, of position and of deviations from the reference. By Routh, those of
position need h > 2 k without any delay. How far apart steps are is known only later: h is then lowered (control/
slow_loops.py) so that lag, delay and steps keep the first bound together. Drives whose commands lead by a known lag
have all of this lag while the commands are at their limits, where a loop with h lag > 2 oscillates for good. So with
all of the lag the bound is 1 in place of 0.5, unless h would be below 15 rad/s, or 18 rad/s if states without a time
are late.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..base.inputs import InputError, number
from ..base.text import quantity
from ..models.parsing import validate
from ..models.robot import Robot
from .controllability import is_underactuated
from .lag import ROTORS_KEEP, WINCHES_KEEP
from .late_states import OLDEST
from .noise import Noise
from .settings import limits_of, positive
from .watch import KNOWN, OFTEN, WINDOW
from .weights import accelerations, ripple

NOISE = 0.05  # of gravity: acceleration by noise of the measured state
SHAKEN = 0.15  # the same of carriers of a team, which accelerate to lean the cables with which a load accelerates
LOST, UNSTABLE = 2.0, 1.5  # times the bounds: robots are lost
DELAY, PERIOD = 0.647, 1.0  # times the inverse of h: where a late or a held state alone makes attitude loops unstable
LAG = UNSTABLE / 2  # as late as a period that leaves attitude loops the same margin
CALM = 0.03  # the same where winches have to follow the noise, as long as it leaves `LEAST` of the usual bandwidths
MISTOLD = 0.8  # of a known delay over which states are predicted: more than twice what may be wrong about it
TURNED = 0.6  # the same for attitude loops
LEAST = 0.1  # of the usual bandwidths: with less a robot does not follow
READINGS = 1e3  # [1/s], without a rate
GRAVITY, TINY = 9.81, 1e-12  # [m/s^2]; what divides
ATTITUDE = 40.0  # [rad/s]
USUALLY, AT_LIMITS = 0.5, 1.0  # bounds of h times lateness; where commands at their limits cannot lead
SLOWEST, WRONG = 15.0, 18.0  # [rad/s], of attitude loops: teams were lost below; with a delay that is wrong by 30 %
SEPARATE = 2.0  # attitude over observers of teams, at least; with 0.9 and late states, teams were handed over
PUSHED = 0.05  # of the weight: a sudden force to which carriers with one cable each lean their cables in time
FREE = 1.5  # times the period of sensors: predictions omit that cables of fixed length tighten
PLACE, CASCADE = 5.0, 6.0  # bandwidth of position [rad/s]; attitude over it and over that of deviations, at least


class Usual(NamedTuple):
    """The defaults for one type of robot: bandwidths [rad/s], and the duration of a stage [s]."""

    bandwidth: float
    observer: float
    carrier_bandwidth: float
    stage: float
    most: float = 1.0  # times bandwidth and observer, if the sensors permit it


# For `ComputedTorque`: with fewer cables than degrees of freedom, whose loads swing, and with others.
SWINGING, HELD = Usual(1.5, 10.0, 6.0, np.inf), Usual(10.0, 10.0, 6.0, np.inf, 2.0)
# For `Predictive`: carriers that correct errors, with cables of fixed length or with winches; carriers that may leave
# their reference, and are slower than tensions; and carriers that stay.
TEAM, TOWING = Usual(8.0, 20.0, 6.0, 0.025), Usual(6.0, 20.0, 6.0, 0.025)
PATIENT, STILL = Usual(40.0, 60.0, 2.0, 0.03), Usual(40.0, 60.0, 2.0, 0.015)


class Bandwidths(NamedTuple):
    """Bandwidths [rad/s]: of the error, (6,), of the observers, and of the attitude loops of flying carriers.

    `lead`: by which factor commands to winches may amplify the noise of the tensions; and `lag`: time constant that may
    remain of winches [s], for which they may amplify it more.
    """

    bandwidth: np.ndarray
    observer: float
    attitude: float
    lead: float = np.inf
    lag: float = np.inf


def correcting(robot: Robot, strongest: float) -> Usual:
    """Return the defaults of `Predictive` for carriers that correct errors, and accelerate by at most `strongest`.

    To balance a force of `PUSHED` of the weight, cables lean by as much. Carriers with one cable each, at a height H
    above the load, then move by PUSHED H in a time of about 1 / w, so w^2 PUSHED H is at most their acceleration
    [m/s^2]. Beyond, loads on long cables swing for seconds after a push. Carriers with several cables of fixed length
    move with the load instead.
    """
    if robot.fixed_lengths is not None and np.bincount(robot.carrier_of_cable).max() > 1:
        return TEAM
    usual = TOWING if robot.fixed_lengths is None else TEAM
    down = np.array(robot.gravity) / max(np.linalg.norm(robot.gravity), TINY)
    height = max(float((robot.home_attachments - robot.home_anchors).mean(axis=0) @ down), TINY)
    limits = [carrier.motion_limits.acceleration or np.inf for carrier in robot.carriers if carrier.moves]
    most = min(strongest or np.inf, *limits) if limits else np.inf
    part = min(float(np.sqrt(most / (PUSHED * height))) / usual.bandwidth, 1.0)
    return usual._replace(bandwidth=part * usual.bandwidth, observer=part * usual.observer)


def bandwidths_for(
    robot: Robot,
    usual: Usual,
    sensors: Noise | Mapping[str, Any] | None,
    rotor_lag: float,
    bandwidth: Any = None,
    observer: float | None = None,
    attitude: float | None = None,
) -> Bandwidths:
    """Return the given bandwidths, and for those that are None the largest ones that the sensors permit.

    Without `sensors` they are the usual ones.

    Raises `InputError` if an argument has a wrong value, or no loop is stable with the given bandwidths, or with a
    tenth of the usual ones.
    """
    w = None if bandwidth is None else positive("bandwidth", bandwidth, 6)
    K = None if observer is None else number("observer", observer, 0.0, 1e3)
    h = None if attitude is None else number("attitude", attitude, 0.1, 1e3)
    errors = None if sensors is None else _errors_of(noise_of(sensors), robot)
    if errors is None:
        h = _attitude_for(robot, None, rotor_lag, h)
        return Bandwidths(np.full(6, usual.bandwidth) if w is None else w, usual.observer if K is None else K, h)
    part, reason = errors.permit(usual.bandwidth, usual.observer)
    if w is None and K is None and part < LEAST:
        raise InputError(
            f"sensors must permit at least {quantity(100 * LEAST, '%')} of the default bandwidths, {usual.bandwidth:g} "
            f"and {usual.observer:g} rad/s, got {reason}, which permits {quantity(100 * part, '%', 2)}"
        )
    by_noise = errors.permit_noise(usual.bandwidth, usual.observer, errors.calm)
    part = min(part, usual.most, max(min(by_noise, errors.permit_leaning(usual.bandwidth)), LEAST))
    most = part * usual.observer
    if K is None and h is None and robot.fixed_lengths is not None:
        most = min(most, _attitude_for(robot, errors, rotor_lag, None) / SEPARATE)
    given = np.full(6, part * usual.bandwidth) if w is None else w, most if K is None else K
    part, reason = errors.permit(float(given[0].max()), given[1])
    if LOST * part < 1.0:
        raise InputError(
            f"bandwidth and observer must be at most {LOST * part * given[0].max():.2g} and "
            f"{LOST * part * given[1]:.2g} rad/s with {reason}, got {given[0].max():g} and {given[1]:g} rad/s"
        )
    lead = max(errors.permit_noise(float(given[0].max()), given[1], errors.calm), 1.0)
    remains = 1.0 / max(float(given[0].max()) + given[1], TINY) - errors.late + WINCHES_KEEP
    return Bandwidths(*given, _attitude_for(robot, errors, rotor_lag, h), lead, remains)


def _attitude_for(robot: Robot, errors: "_Errors | None", lag: float, given: float | None) -> float:
    """Return the bandwidth of attitude loops, `given` or the largest that lags of rotors and sensors permit."""
    delay, period = (0.0, 0.0) if errors is None else (errors.turned, errors.period)
    left, by_sensors = min(lag, ROTORS_KEEP), (delay / DELAY + period / PERIOD) / UNSTABLE
    late, weight = left + delay + period / 2, left / 2 + by_sensors
    if not late or not any(carrier.actuators for carrier in robot.carriers):
        return given or ATTITUDE
    if given is not None and given * weight * UNSTABLE > 1.0:
        raise InputError(
            f"attitude must be at most {1 / UNSTABLE / weight:.3g} rad/s if carriers turn {quantity(late, 's')} late, "
            f"got {given:g} rad/s"
        )
    slowest = WRONG if delay else SLOWEST
    most = min(ATTITUDE, USUALLY / weight, max(AT_LIMITS / (lag / 2 + by_sensors), slowest))
    if given is None and most < slowest:
        room = DELAY * (UNSTABLE * (USUALLY / slowest - left / 2) - period / PERIOD) / TURNED
        hint = f" (a delay of at most {quantity(room, 's')} would permit them)" if delay and room > 0 else ""
        raise InputError(
            f"sensors must permit attitude loops of {slowest:g} rad/s, got carriers that turn {quantity(late, 's')} "
            f"late, which permits {most:.2g} rad/s{hint}"
        )
    return given or most


def place_for(attitude: float, place: float | None) -> float:
    """Return the bandwidth of the position loops of flying carriers with attitude loops of bandwidth `attitude`.

    Raises `InputError` if the given one has a wrong value.
    """
    return min(PLACE, attitude / CASCADE) if place is None else number("place", place, 0.1, 1e3)


def noise_of_change(robot: Robot, sensors: Noise | Mapping[str, Any] | None) -> float:
    """Return the standard deviation of an unexplained change of velocity, of all coordinates together [m/s].

    It includes the noise of two measured velocities, and of measured tensions by which the change is predicted over the
    `WINDOW` of a `Watch`; 0 without `sensors`. Rates of angles are multiplied by the robot's length. Raises
    `InputError` if `sensors` has a wrong value.
    """
    if sensors is None:
        return 0.0
    noise, scale = noise_of(sensors), robot.dof_mask * np.repeat([1.0, robot.length], 3)
    measured = np.sqrt(2) * np.linalg.norm(robot.dof_mask * np.repeat(_errors_of(noise, robot).velocities, 3))
    by_tensions = float(np.linalg.norm(scale[:, None] * accelerations(robot))) * (robot.fixed_lengths is None)
    predicted = KNOWN * by_tensions * noise.of_tensions * np.sqrt(WINDOW / (noise.rate or READINGS))
    return float(np.hypot(measured, predicted))


def noise_of(sensors: Any) -> Noise:
    """Return errors of sensors as `Noise`; raises `InputError` if they have a wrong value."""
    return sensors if isinstance(sensors, Noise) else validate(sensors, Noise, "sensors")


def age_of(noise: Noise) -> float:
    """Return the mean age of states [s]: their delay, and half the time for which a reading is held."""
    return noise.delay + (0.5 / noise.rate if noise.rate else 0.0)


class _Errors(NamedTuple):
    """Errors of sensors: ages [s], and standard deviations of positions [m] and velocities [m/s]."""

    turned: float  # delay that attitude loops have in spite of predictions
    period: float  # for which states are held
    late: float  # what of the age and of lags is not predicted
    position: float
    velocities: np.ndarray  # (2,), of the position and by rates of angles
    calm: float  # largest acceleration by noise of default bandwidths, of gravity
    lean: float  # mean length of the cables of a team, over gravity [s^2]
    ripple: float  # two standard deviations of tensions by velocities, of their distance from limits [s]

    def permit(self, bandwidth: float, observer: float) -> tuple[float, str]:
        """Return by which factor both bandwidths may be multiplied, and what does not permit more."""
        by_age = 1.0 / max((bandwidth + observer) * self.late, TINY)
        by_noise = self.permit_noise(bandwidth, observer, NOISE)
        if by_age < by_noise:
            return by_age, f"a state that is {quantity(self.late, 's')} late"
        velocity = float(self.velocities.max())
        return by_noise, f"noise of {quantity(self.position, 'm')} and {quantity(velocity, 'm/s')}"

    def permit_noise(self, bandwidth: float, observer: float, most: float) -> float:
        """Return by which factor both may be multiplied until noise accelerates by `most`, of gravity."""
        a, b = bandwidth**2 * self.position, (2 * bandwidth + observer) * float(self.velocities.max())
        by_noise = 2 * most * GRAVITY / max(b + np.sqrt(b * b + 4 * a * most * GRAVITY), TINY)
        return min(by_noise, 1.0 / max((2 * bandwidth + observer) * self.ripple, TINY))

    def permit_leaning(self, bandwidth: float) -> float:
        """Return by which factor a bandwidth may be multiplied until noise accelerates carriers of a team by `SHAKEN`.

        A load below cables of length L accelerates by g / L times what its carriers are ahead, so a loop with four
        poles at -w accelerates carriers by L / g (w^4 s_x + 4 w^3 s_v).
        """
        a, b = self.lean * bandwidth**4 * self.position, self.lean * 4 * bandwidth**3 * float(self.velocities.max())
        return float(np.roots([a, b, 0.0, 0.0, -SHAKEN * GRAVITY]).real.max()) if a + b > TINY else np.inf


def _errors_of(noise: Noise, robot: Robot) -> _Errors:
    """Return the errors of sensors; angles count by the robot's length."""
    step, size = 1.0 / (noise.rate or READINGS), np.array([1.0, robot.length])
    age, position = age_of(noise), noise.of_pose
    predicted = (1 - MISTOLD) * noise.delay if age <= OLDEST else 0.0
    held, holds = step if noise.rate else 0.0, not is_underactuated(robot)
    if holds and robot.fixed_lengths is not None:
        late = noise.delay - predicted + FREE * held
    else:
        late = 0.0 if noise.stamped else age - predicted
    velocity = np.array([noise.velocity, noise.attitude_rate])
    if noise.differenced:
        late, velocity = late + step / 2, np.hypot(velocity, np.sqrt(2) * position / step)
    late += WINCHES_KEEP if robot.fixed_lengths is None else 0.0
    strict = robot.fixed_lengths is None and holds
    of_tensions = ripple(robot, limits_of(robot, None), np.repeat(velocity, 3)) if strict and velocity.any() else None
    most = 0.0 if of_tensions is None else OFTEN * float(np.linalg.norm(of_tensions, axis=1).max())
    limit = CALM if strict else NOISE
    turned = 0.0 if noise.stamped else TURNED * noise.delay if age <= OLDEST else noise.delay
    far = float((size * position).max())
    lean = 0.0 if robot.fixed_lengths is None else float(robot.fixed_lengths.mean()) / GRAVITY
    return _Errors(turned, held, late, far, size * velocity, limit, lean, most)
