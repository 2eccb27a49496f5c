"""`ClockRate`: a log whose poses have a clock of their own, the rate of which is known only roughly.

Clocks of two computers are aligned by cable speeds along the poses, before the anchors are known. Anchors that are
wrong by 20 mm can let a clock seem to drift by 100 ppm within a minute, which is 3 mm at its ends at 1 m/s.
"""

from dataclasses import replace

import numpy as np

from .model import Model

USUAL = 2e-5  # standard deviation of the rate of a computer's clock relative to another's
CLEAR = 3.0  # standard deviations


class ClockRate:
    """Poses as recorded, which can be read at the times of a clock with another rate (`Recorded`).

    The clock is ahead at the end of the log, right in the middle, and late at the beginning.
    """

    names: tuple[str, ...] = ("clock.rate",)
    unit = "1"

    def __init__(self, model: Model):
        times, track = model.measurements.times, model.track
        assert times is not None
        assert track is not None
        self._times, self._track = times, track.at_times(times)
        half = 0.5 * float(times[-1] - times[0])
        self.sigmas, self.per_second = np.array([USUAL * half]), 1 / half

    def model(self, model: Model, ahead: np.ndarray) -> Model:
        """Return a model with the poses by such a clock, (1,) [s]."""
        times = self._times
        early = (times - times[0]) * self.per_second - 1
        return replace(model, track=self._track.at_times(times + ahead[0] * early))
