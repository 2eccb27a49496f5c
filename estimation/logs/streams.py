"""`Reader`: fields of recordings as samples over time, and `at_times`: the same at other times."""

from collections.abc import Sequence

import numpy as np

from ...base.errors import InputError
from ...base.text import quantity
from ...models.part import LARGEST
from .mapping import Fields
from .names import UNITS, dated_unit, time_unit
from .recording import GAP, Field, Samples, Topic, check_rising, plain

MOST_REPEATED = 0.2  # of the samples of a table, that may repeat a time
FEWEST, STEADY = 20, 5.0  # samples, and how many times the usual step the longest one of a time may be
DAY = 86400.0  # [s]
MOST_PARTIAL = 0.2  # of the samples, of which some but not all cables were measured
MUCH_FASTER = 8  # times the rate, from which lines between samples suffice


class Reader:
    """Read each topic once."""

    def __init__(self, found: Fields):
        self._of: dict[int, list[str]] = {}
        self._times: dict[int, Field] = {id(one.topic): one for one in found.time}
        self._done: dict[int, Samples] = {}
        self.notes: list[str] = []
        for one in {one for of in found for one in of}:
            self._of.setdefault(id(one.topic), []).append(one.name)

    def stream(self, fields: Sequence[Field]) -> Samples:
        """Return fields in SI units; fields of other topics are interpolated at the times of the first one.

        Raises `InputError` if a number is so large that only damage explains it.
        """
        parts: list[Samples] = []
        for one in fields:
            whole, names = self._topic(one), self._of[id(one.topic)]
            factor = one.factor * next(units[one.unit] for units in UNITS.values() if one.unit in units)
            column = factor * whole.values[:, names.index(one.name)]
            beyond = np.flatnonzero((np.abs(column) > LARGEST) & np.isfinite(column))
            if beyond.size:
                row = int(beyond[0])
                raise InputError(f"{one.full} must be at most {LARGEST:g}, got {column[row]:.3g} at sample {row}")
            parts.append(Samples(whole.times, column[:, None]))
        if all(one.topic is fields[0].topic for one in fields):
            return Samples(parts[0].times, np.hstack([part.values for part in parts]))
        times = parts[0].times
        whole = np.hstack([at_times(times, *pair).values for pair in zip(parts, fields, strict=True)])
        kept = np.isfinite(whole).all(axis=1)
        return Samples(None if times is None else times[kept], whole[kept])

    def _topic(self, one: Field) -> Samples:
        key = id(one.topic)
        if key not in self._done:
            times, values = one.topic.read(self._of[key])
            clock = self._times.get(key)
            if clock is not None and one.topic.times is None:
                column = values[:, self._of[key].index(clock.name)]
                unit = clock.unit or self._unit_of(clock, column)
                times = clock.factor * UNITS["time"][unit] * column
                steps = np.diff(times, prepend=np.nan)
                if np.nanmax(times, initial=0.0) < DAY:  # times of day, which begin again at midnight
                    times = times + DAY * np.cumsum(steps < -0.5 * DAY)
                again = steps == 0
                if 0 < again.mean() <= MOST_REPEATED:
                    count = quantity(int(again.sum()))
                    self.notes.append(f"samples skipped because they repeat the time of the one before: {count}")
                    times, values = times[~again], values[~again]
            elif times is not None:  # of messages, which may be recorded twice, or late
                times, rows = np.unique(times, return_index=True)
                kept = np.isfinite(values[rows]).any(axis=1)
                times, values = times[kept], values[rows[kept]]
            self._done[key] = Samples(times if times is None else times - one.recording.ahead, values)
        return self._done[key]

    def _unit_of(self, clock: Field, column: np.ndarray) -> str:
        """Return the unit of times without one, and note it where it is no more than likely."""
        unit = time_unit(column)
        if unit != "s" and dated_unit(column) is None:
            step = quantity(UNITS["time"][unit] * float(np.nanmedian(np.diff(column))), "s", 3)
            self.notes.append(
                f"{clock.full} is read in {unit}, so that samples are {step} apart; if that is wrong, write its unit "
                f"in its name, as {clock.full}_s"
            )
        return unit


def like_time(topic: Topic, used: set[str]) -> str | None:
    """Return the name of a column that rises as a time does, but not as a counter of the samples, or None."""
    for name in topic.fields:
        if name in used or topic.count < FEWEST:
            continue
        steps = np.diff(topic.read([name]).values[:, 0])
        rises = (steps >= 0).all() and (steps == 0).mean() <= MOST_REPEATED
        if rises and steps.max() < STEADY * np.median(steps) and (steps != 1).any():
            return plain(name)
    return None


def at_times(times: np.ndarray | None, samples: Samples, one: Field) -> Samples:
    """Return samples at other times, nan inside gaps and beyond the ends."""
    if samples.times is None or times is None:
        if len(samples.values) == (0 if times is None else len(times)) or times is samples.times:
            return samples
        raise InputError(f"{one.full} must have times, since it has more or fewer samples than others, got none")
    if times is samples.times or np.array_equal(times, samples.times):
        return Samples(times, samples.values)
    return Samples(times, interpolated(times, samples))


def interpolated(times: np.ndarray, samples: Samples) -> np.ndarray:
    """Return values (N, k) at other times: by cubic splines, or by lines where samples are much denser."""
    own, values = samples.times, samples.values
    assert own is not None
    good = np.isfinite(values).all(axis=1)
    near = np.searchsorted(own[good], times[[0, -1]]) + np.array([-8, 8]) if len(times) else (0, 0)
    own, values = (one[good][max(near[0], 0) : near[1]] for one in (own, values))
    if len(own) < 2:
        return np.full((len(times), values.shape[1]), np.nan)
    check_rising(own)
    apart = float(np.median(np.diff(own)))
    if len(own) >= 4 and len(times) > 1 and MUCH_FASTER * apart > float(np.median(np.diff(times))):
        from scipy.interpolate import CubicSpline

        result = CubicSpline(own, values)(times)
    else:
        result = np.column_stack([np.interp(times, own, column) for column in values.T])
    after = np.clip(np.searchsorted(own, times), 1, len(own) - 1)
    outside = (own[after] - own[after - 1] > GAP * apart) | (times < own[0]) | (times > own[-1])
    result[outside] = np.nan
    return result


def are_too_partial(finite: np.ndarray) -> bool:
    """Return whether no sample is complete, or too many have only some of their numbers; `finite` is (N, m) of bool."""
    kept = finite.all(axis=1)
    return not kept.any() or bool((finite.any(axis=1) & ~kept).mean() > MOST_PARTIAL)


def complete_samples(values: np.ndarray, fields: Sequence[Field]) -> np.ndarray:
    """Return the samples that are complete, (N,) of bool; raise InputError if too many have gaps."""
    finite = np.isfinite(values)
    kept = finite.all(axis=1)
    if are_too_partial(finite):
        row, column = (int(i) for i in np.argwhere(~finite)[0])
        raise InputError(
            f"{fields[column].full} must be a finite number at sample {row}, got {values[row, column]:g}; "
            f"{quantity(int((~kept).sum()))} of {quantity(len(finite))} samples are incomplete, and at most "
            f"{quantity(100 * MOST_PARTIAL)} % may have only some of their numbers"
        )
    return np.asarray(kept)
