"""`Reader`: fields of recordings as samples over time, also at other times, and without poses that no camera saw."""

from collections.abc import Sequence

import numpy as np

from ...base.errors import InputError
from ...base.text import quantity
from ...models.part import LARGEST
from .mapping import Fields
from .names import UNITS, dated_unit, time_unit
from .recording import GAP, Field, Samples, Topic, check_rising, plain

MOST_REPEATED = 0.2  # of the samples of a table, that may repeat a time
MOST_LATE, LATEST = 0.2, 5  # share of the lines of a table that may be written late, and by how many lines each
FILLS = 0.6  # of the usual step, by which a late line is apart from its neighbours
FEWEST, STEADY = 20, 5.0  # samples, and how many times the usual step the longest one of a time may be
DAY = 86400.0  # [s]
MOST_PARTIAL = 0.2  # of the samples, of which some but not all cables were measured
MUCH_FASTER = 8  # times the rate, from which lines between samples suffice
AROUND = 3  # rows before and after a spike
UNUSUAL = 20.0  # times the usual distance from the rows around
RETURNS = 0.35  # of the size of a spike, by which the platform moves before, meanwhile and after
SHORT = 0.1  # from 1, of a quaternion's length
LONGEST_HELD = 5  # equal rows in a row that a slower sensor may repeat
JUMP = 5.0  # times the usual step: where the platform is seen again, it is far from where it seemed to stand


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
                rows = in_order(times)
                if rows is not None:
                    late = quantity(int((np.diff(times) < 0).sum()))
                    self.notes.append(f"lines sorted by their times because they were written late: {late}")
                    times, values = times[rows], values[rows]
                    steps = np.diff(times, prepend=np.nan)
                again = steps == 0
                if 0 < again.sum() <= MOST_REPEATED * len(again):
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


def in_order(times: np.ndarray) -> np.ndarray | None:
    """Return the order of lines whose times (N,) rise if a few lines were written late, (N,); else None.

    Each of these fills a gap between its neighbours. A clock that was set back instead leaves two samples where one is
    usual.
    """
    rows = np.argsort(times, kind="stable")
    moved, steps = rows != np.arange(len(rows)), np.diff(times[rows])
    if not 0 < moved.mean() <= MOST_LATE or np.abs(rows - np.arange(len(rows))).max() > LATEST:
        return None
    around, apart = (moved[1:] | moved[:-1]) & (steps != 0), np.median(steps)
    again = (steps == 0).sum() > (np.diff(times) == 0).sum()
    return None if again or (steps[around] < FILLS * apart).any() else rows


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
    smooth = len(own) >= 4 and len(times) > 1 and MUCH_FASTER * apart > float(np.median(np.diff(times)))
    from scipy.interpolate import CubicSpline

    result = np.empty((len(times), values.shape[1]))
    for k, column in enumerate(values.T):  # coefficients of all columns at once would need much memory
        result[:, k] = CubicSpline(own, column)(times) if smooth else np.interp(times, own, column)
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
        most = f", and at most {quantity(100 * MOST_PARTIAL)} % may have only some of their numbers"
        raise InputError(
            f"{fields[column].full} must be a finite number at sample {row}, got {values[row, column]:g}; "
            f"{quantity(int((~kept).sum()))} of {quantity(len(finite))} samples are incomplete{most * bool(kept.any())}"
        )
    return np.asarray(kept)


def seen(
    position: Samples | None, orientation: Samples | None, together: bool
) -> tuple[Samples | None, Samples | None, list[str]]:
    """Return positions and orientations with nan where the platform was not seen, and notes.

    A motion capture then repeats the last pose, or writes zeros or -9999, which are no quaternions of length 1. If most
    are not, they are left as they are. `together` states that both have the same samples, so both are lost.
    """
    notes: list[str] = []
    if orientation is not None and orientation.values.shape[1] == 4:
        lengths = np.linalg.norm(orientation.values, axis=1)
        lost = np.abs(lengths - 1) >= SHORT  # not of nan
        if 0 < 2 * lost.sum() < np.isfinite(lengths).sum():
            notes.append(f"poses skipped because their quaternions are not of length 1: {quantity(int(lost.sum()))}")
            orientation = _without(orientation, lost)
            position = _without(position, lost) if together and position is not None else position
    wrong = {
        "positions skipped because they repeat the previous one until the platform jumps: {}": frozen,
        "positions skipped because they are far from those before and after: {}": spikes,
    }
    for note, found in wrong.items():
        lost = np.zeros(0, dtype=bool) if position is None else found(position.values)
        if position is not None and lost.any():
            notes.append(note.format(quantity(int(lost.sum()))))
            position = _without(position, lost)
            orientation = _without(orientation, lost) if together and orientation is not None else orientation
    return position, orientation, notes


def _without(samples: Samples, lost: np.ndarray) -> Samples:
    return Samples(samples.times, np.where(lost[:, None], np.nan, samples.values))


def frozen(values: np.ndarray) -> np.ndarray:
    """Return which rows of recorded poses (N, k) repeat one before, though the platform moved on, (N,) of bool.

    A platform at rest does not jump at the end.
    """
    result = np.zeros(len(values), dtype=bool)
    steps = np.linalg.norm(np.diff(np.nan_to_num(values, posinf=0.0, neginf=0.0), axis=0), axis=1)
    moves = np.flatnonzero(steps > 0)
    if not moves.size:
        return result
    usual = float(np.median(steps[moves]))
    edges = np.concatenate([[-1], moves, [len(steps)]])  # rows edges[i] + 1 to edges[i + 1] are equal
    for begin, end in zip(edges[:-1] + 1, edges[1:] + 1, strict=True):
        zeros = not values[begin].any()  # which are no pose at all
        if (zeros or end - begin > LONGEST_HELD) and end < len(values) and steps[end - 1] > JUMP * usual:
            result[begin + (not zeros) : end] = True
    return np.asarray(result & np.isfinite(values).all(axis=1))


def spikes(values: np.ndarray) -> np.ndarray:
    """Return which rows of recorded positions (N, k) are far from where the platform is before and after, (N,) of bool.

    Far is what twenty times the usual distance from the median of five rows, and five usual steps, do not explain. Of
    positions measured one by one no distance is unusual.
    """
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    result = np.zeros(len(values), dtype=bool)
    if len(known) < 2 * AROUND:
        return result
    rows = values[known]
    near = np.lib.stride_tricks.sliding_window_view(np.pad(rows, ((2, 2), (0, 0)), "edge"), 5, axis=0)
    apart = np.linalg.norm(rows - np.median(near, axis=2), axis=1)
    usual = UNUSUAL * np.median(apart) + JUMP * np.median(np.linalg.norm(np.diff(rows, axis=0), axis=1))
    for k in AROUND + np.flatnonzero(apart[AROUND:-AROUND] > usual):
        around = rows[k - AROUND : k], rows[k + 1 : k + 1 + AROUND]
        middles = [np.median(part, axis=0) for part in around]
        moved = [np.linalg.norm(middles[-1] - middles[0])]
        moved += [np.median(np.linalg.norm(part - one, axis=1)) for part, one in zip(around, middles, strict=True)]
        result[known[k]] = max(moved) < RETURNS * apart[k]
    return result
