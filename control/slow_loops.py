"""`SlowLoops`: bandwidths for commands that are held for a long time."""

from math import ceil

import numpy as np

from .as_floats import ROUNDING
from .bandwidths import DELAY, LAG, PERIOD, TURNED
from .late_states import OLDEST

GAINS = "kd", "kp", "ki"  # of the settings, in the order of the powers of the bandwidth
LOOPS = "attitude", "place", "carrier_bandwidth", "observer"  # the other bandwidths of the settings
# Longest time between steps, times the bandwidth of the error and of carriers; from 1 on a loop is unstable (Jury).
# The loop of the error also has an observer, tensions that differ from their commands, and a geometry that changes.
HELD_FOR, INNER = 0.6, 0.75


class SlowLoops:
    """Lower the bandwidths of a controller whose steps are far apart, see `HELD_FOR`.

    The observer is lowered with the bandwidth of the error, if that is not given. The attitude loops of flying
    carriers are the fastest, or the loops of other carriers that correct errors. All other loops are closed around
    them, so they are lowered by the same factor.

    - `settings`: settings of the controller, which are changed.
    - `adapts`: whether the bandwidth of the error may be lowered.
    - `usual`: default bandwidth of the error [rad/s].
    - `lag`: time constant that remains of actuators of flying carriers [s].
    """

    def __init__(self, settings: np.ndarray, adapts: bool, usual: float, lag: float):
        self._settings, self._adapts, self._lag = settings, adapts, lag
        corrects = bool(settings["corrects"] and settings["reacts"])
        self._inner = "attitude" if settings["by_wrench"].any() else "carrier_bandwidth" if corrects else None
        self._usual = {name: settings[name].copy() for name in (*GAINS, *LOOPS)}
        self._share = usual / float(settings["attitude"])
        held = (HELD_FOR if adapts else 1.0) / max(self._bandwidth, ROUNDING)
        self.longest = min(held, self.longest_inner)  # time between steps without a change [s]

    def reset(self) -> None:
        """Forget how late states are."""
        self._late, self._for, self._held = 0.0, 0.0, -np.inf

    def late_by(self, age: float, has_time: bool, since: float, dt: float) -> float:
        """Return the time between steps that delays attitude loops as much as lags and late states do [s].

        States are predicted over their `age` [s], which may be wrong unless the state has its time, and while they are
        held, until one is newer by `since` [s]. The mean is over all at first, because a loop may be unstable with the
        first states.
        """
        self._held, self._for = 0.0 if since > 0 else self._held + dt, min(self._for + dt, 1.0)
        late = min(max(self._held, 0.0), OLDEST) if has_time else TURNED * age
        self._late += min(dt / self._for if self._for else 1.0, 1.0) * (late - self._late)
        return LAG * self._lag + ceil(1e3 * self._late - ROUNDING) / 1e3 * PERIOD / DELAY

    @property
    def _bandwidth(self) -> float:
        return float(self._settings["kd"].max()) / 2

    @property
    def longest_inner(self) -> float:
        """Return the longest time between steps for the loops of carriers [s], infinite if there are none."""
        return INNER / max(float(self._settings[self._inner]), ROUNDING) if self._inner else np.inf

    def slow_down(self, period: float) -> tuple[float, float]:
        """Lower bandwidths for steps `period` [s] apart.

        Return the longest time between steps until they should be lowered again [s], and the largest bandwidth
        [rad/s] if a given one is larger, otherwise infinity.
        """
        given, most = self._bandwidth, 1.0 / period
        part = min(HELD_FOR / (period * given) if self._adapts else 1.0, self.longest_inner / period, 1.0)
        for name in LOOPS if self._inner else LOOPS[-1:] if self._adapts else ():  # the last is the observer
            self._settings[name] *= part
        if self._inner:
            most = min(most, self._share * float(self._settings["attitude"]))
        if self._adapts:
            for order, name in enumerate(GAINS, 1):
                self._settings[name] *= part**order
        longest = period * (1 + ROUNDING) if self._adapts or self._inner else np.inf
        return longest, np.inf if self._adapts or given <= most else most

    def speed_up(self) -> None:
        """Use the usual bandwidths."""
        for name, value in self._usual.items():
            self._settings[name] = value
