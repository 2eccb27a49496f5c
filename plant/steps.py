"""Kernel: classical Runge-Kutta steps of fourth order, whose ends are located where a contact changes.

A step is computed with the modes of its beginning. If at its end a cable is in another mode, the time of the earliest
change is found by false position (Illinois) on steps of different length from the same beginning, the step ends there,
the modes are changed, and the rest follows. So no step contains a jump or a kink, and the order is that of smooth
motions. A cable that gets taut and slack again inside of one step is noticed by the cubic through its elongations.
"""

import math

from .bodies import normalise
from .forces import evaluate, forces, forces_after_hold, geometry, set_modes
from .impacts import hold, resolve
from .layout import (
    BODY,
    CAUGHT,
    COMMANDS,
    CONDITION,
    CONSTRAINED,
    CONTACT,
    CUT,
    DRIVE,
    E_RATE,
    ELASTIC,
    FEW_EVENTS,
    FORCE_MAX,
    FORCE_SCALE,
    FORCES,
    FRICTION,
    LENGTH_RATE,
    LENGTH_SCALE,
    LIMP,
    LOCATE,
    MODE,
    MOST_EVENTS,
    PARTING,
    PULLS,
    SLACK,
    SLIP,
    STICKING,
    STIFFNESS,
    TENSIONS,
    WORKS,
    E,
    T,
)
from .lines import pull_of


def begin(robot, command, state, change, work, time, kind):
    """Choose the modes of a state, with the impacts that this needs, and write its derivative and tensions."""
    bodies, cables, _ = robot
    geometry(robot, command, state, change, work, time)
    set_modes(cables, state, work[1], BODY * bodies.shape[0])
    _choose_slips(robot, command, state, change, work, time, kind, True, PARTING)


def advance(robot, command, state, slopes, spare, work, time, step, kind):
    """Move `state` on by a step, through all changes of contact inside of it; `begin` has written `slopes[0]`."""
    bodies, cables, settings = robot
    on_cables, places = work[1], BODY * bodies.shape[0]
    trial = spare[2]
    left, events = step, 0
    while left > 1e-14 * step:
        at_low, located = 0.0, settings[LOCATE] == 1.0 and settings[DRIVE] != TENSIONS
        if located:
            for i in range(cables.shape[0]):
                spare[0, i], spare[1, i] = on_cables[i, E], on_cables[i, E_RATE]
            at_low = min(_largest_violation(cables, settings, command, state, on_cables, places), 0.0)
        high = left
        at_high = _attempt(robot, command, state, slopes, trial, work, time, high, kind)
        if located and at_high <= 0.0:
            high = _graze(on_cables, spare, left)
            if high < left:
                at_high = _attempt(robot, command, state, slopes, trial, work, time, high, kind)
                if at_high <= 0.0:
                    high = left
                    at_high = _attempt(robot, command, state, slopes, trial, work, time, high, kind)
        changes = at_high > 0.0 and located and events < MOST_EVENTS
        if changes:
            high = _locate(robot, command, state, slopes, spare, work, time, high, kind, at_low, at_high)
        for j in range(len(state)):
            state[j] = trial[j]
        if changes:
            events += 1
            parting = PARTING * 16.0 ** max(events - FEW_EVENTS, 0)
            _change_modes(robot, command, state, slopes[0], work, time + high, kind, parting)
        time += high
        left -= high


def _locate(robot, command, state, slopes, spare, work, time, high, kind, at_low, at_high):
    """Return the length of the step [s] that ends just after the earliest change of a mode; `trial` is its end.

    A slack cable is caught where the cubic through its elongations and their rates at both ends of the bracket rises
    above zero; false position finds the other changes. Both aim at half of `CAUGHT`, which ends the search.
    """
    on_cables, trial, close = work[1], spare[2], CAUGHT * robot[2][LENGTH_SCALE]
    at_low, at_high = at_low - 0.5 * close, at_high - 0.5 * close
    low, side, last, width, weighted = 0.0, 0, high, high, at_high
    caught, rate = _caught(on_cables, at_high + 0.5 * close)
    for attempt in range(150):
        if at_high <= 0.5 * close or high - low <= 1e-15 * high:
            break
        step = high - low
        middle = high - weighted * step / (weighted - at_low)
        if caught >= 0:
            below = spare[0, caught] - on_cables[caught, E] + on_cables[caught, CONTACT] - 0.5 * close
            middle = low + step * _rise(below, step * spare[1, caught], at_high, step * rate)
        if attempt % 3 == 2:
            middle = 0.5 * (low + high) if step > 0.25 * width else middle
            width = step
        if not low < middle < high:
            middle = 0.5 * (low + high)
        found, last = _attempt(robot, command, state, slopes, trial, work, time, middle, kind), middle
        if found > 0.0:
            high, at_high = middle, found - 0.5 * close
            weighted, at_low = at_high, at_low * (0.5 if side == 1 else 1.0)
            caught, rate = _caught(on_cables, found)
            side = 1
        else:
            low, at_low = middle, found - 0.5 * close
            weighted, side = weighted * (0.5 if side == -1 else 1.0), -1
            for i in range(on_cables.shape[0]):
                spare[0, i], spare[1, i] = on_cables[i, E], on_cables[i, E_RATE]
    if last != high:
        _attempt(robot, command, state, slopes, trial, work, time, high, kind)
    return high


def _caught(on_cables, most):
    """Return which slack cable is beyond its mode by `most`, or -1, and the rate of its elongation."""
    for i in range(on_cables.shape[0]):
        if on_cables[i, MODE] == SLACK and on_cables[i, CONTACT] == most:
            return i, on_cables[i, E_RATE]
    return -1, 0.0


def _rise(e0, d0, e1, d1):
    """Return where in (0, 1) the cubic with these values and slopes at the ends, e0 <= 0 < e1, gets above zero."""
    low, high = 0.0, 1.0
    for _ in range(40):
        s = 0.5 * (low + high)
        if (1.0 - s) * (1.0 - s) * (e0 * (1.0 + 2.0 * s) + s * d0) + s * s * (
            e1 * (3.0 - 2.0 * s) - (1.0 - s) * d1
        ) > 0.0:
            high = s
        else:
            low = s
    return high


def _attempt(robot, command, start, slopes, state, work, time, step, kind):
    """Write into `state` what `start` becomes after a step with its modes; return by how much it is beyond them."""
    bodies, cables, settings = robot
    places = BODY * bodies.shape[0]
    # Slopes of what does not change are 0, and the rest of imposed carriers is written by their reference.
    for stage in range(1, 4):
        share, slope = step if stage == 3 else 0.5 * step, slopes[stage - 1]
        for j in range(len(state)):
            state[j] = start[j] + share * slope[j]
        evaluate(robot, command, state, slopes[stage], work, time + share)
    first, second, third, fourth = slopes[0], slopes[1], slopes[2], slopes[3]
    for j in range(len(state)):
        state[j] = start[j] + step / 6.0 * (first[j] + 2.0 * (second[j] + third[j]) + fourth[j])
    normalise(bodies, state)
    if settings[LOCATE] == 0.0:
        return 0.0
    geometry(robot, command, state, slopes[4], work, time + step)
    if kind == CONSTRAINED:
        hold(robot, command, state, slopes[4], work, time + step)
        forces_after_hold(robot, command, state, slopes[4], work, time + step)
    elif kind != ELASTIC:
        forces(robot, command, state, slopes[4], work, time + step)
    return _largest_violation(cables, settings, command, state, work[1], places)


def _largest_violation(cables, settings, command, state, on_cables, places):
    """Write by how much each cable and winch is beyond its mode, and return the largest; above zero it has changed."""
    m, largest = cables.shape[0], -1.0
    newton = settings[LENGTH_SCALE] / settings[FORCE_SCALE]
    for i in range(m):
        on_cables[i, CONTACT] = on_cables[i, STICKING] = -1.0
        if settings[DRIVE] == TENSIONS or state[places + CONDITION * m + i] == CUT:
            continue
        mode, e = on_cables[i, MODE], on_cables[i, E]
        if cables[i, STIFFNESS] == 0.0:
            on_cables[i, CONTACT] = -on_cables[i, T] * newton if mode == PULLS else e - CAUGHT * settings[LENGTH_SCALE]
        elif mode == SLACK:
            on_cables[i, CONTACT] = e
        else:
            pull = pull_of(cables, state, on_cables, places, i) * state[places + i] / cables[i, STIFFNESS]
            on_cables[i, CONTACT] = -pull if mode == PULLS else max(-e, pull)
        works = state[places + CONDITION * m + i] == WORKS
        if works and settings[DRIVE] == FORCES and cables[i, FRICTION] > 0.0:
            if on_cables[i, SLIP] == 0.0:
                beyond = abs(_drive_of(cables, command, on_cables, i)) - cables[i, FRICTION]
                on_cables[i, STICKING] = beyond * newton
            else:
                on_cables[i, STICKING] = -on_cables[i, SLIP] * state[places + LENGTH_RATE * m + i]
        largest = max(largest, on_cables[i, CONTACT], on_cables[i, STICKING])
    return largest


def _graze(on_cables, before, step):
    """Return the time at which a slack cable may get taut and slack again inside of a step, or else its end."""
    for i in range(on_cables.shape[0]):
        e0, d0 = before[0, i], step * before[1, i]
        e1, d1 = on_cables[i, E], step * on_cables[i, E_RATE]
        if on_cables[i, MODE] == SLACK and d0 > 0.0 and d1 < 0.0:
            a, b = 6.0 * (e0 - e1) + 3.0 * (d0 + d1), -6.0 * (e0 - e1) - 4.0 * d0 - 2.0 * d1
            q = -0.5 * (b + math.copysign(math.sqrt(max(b * b - 4.0 * a * d0, 0.0)), b))
            s = d0 / q if q != 0.0 else 0.0
            if not 0.0 < s < 1.0:
                s = q / a if a != 0.0 else 0.0
            if 0.0 < s < 1.0:
                top = e0 + s * s * (3.0 - 2.0 * s) * (e1 - e0) + s * (1.0 - s) * ((1.0 - s) * d0 - s * d1)
                if top > 0.0:
                    return s * step
    return step


def _change_modes(robot, command, state, change, work, time, kind, parting):
    """Bring cables and winches that are beyond their modes into other ones, and write derivative and tensions."""
    bodies, cables, _ = robot
    on_cables, places, m = work[1], BODY * bodies.shape[0], cables.shape[0]
    for i in range(m):
        if on_cables[i, CONTACT] > 0.0 and cables[i, STIFFNESS] > 0.0:
            mode, stretched = on_cables[i, MODE], on_cables[i, E] > 0.0
            if mode == PULLS:
                on_cables[i, MODE] = LIMP if stretched else SLACK
            elif pull_of(cables, state, on_cables, places, i) > 0.0 and (stretched or mode == SLACK):
                on_cables[i, MODE] = PULLS
            else:
                on_cables[i, MODE] = LIMP if mode == SLACK else SLACK
        if on_cables[i, STICKING] > 0.0:
            state[places + LENGTH_RATE * m + i] = 0.0
    geometry(robot, command, state, change, work, time)
    _choose_slips(robot, command, state, change, work, time, kind, False, parting)


def _choose_slips(robot, command, state, change, work, time, kind, all_winches, parting):
    """Choose the modes of winches, and of cables without stiffness, and write derivative and tensions.

    Whether friction holds a winch depends on the tension with the winch at rest, so that is computed first.
    """
    bodies, cables, settings = robot
    on_cables, places, m = work[1], BODY * bodies.shape[0], cables.shape[0]
    if settings[DRIVE] == FORCES:
        for i in range(m):
            if all_winches or on_cables[i, STICKING] > 0.0:
                on_cables[i, SLIP] = _slip_of(cables, command, state, on_cables, places, i)
                if state[places + LENGTH_RATE * m + i] == 0.0 and cables[i, FRICTION] > 0.0:
                    on_cables[i, SLIP] = 0.0
    slipped = True
    while slipped:
        if kind == CONSTRAINED:
            resolve(robot, command, state, change, work, time, parting)
        else:
            forces(robot, command, state, change, work, time)
        slipped = False
        if settings[DRIVE] == FORCES:
            for i in range(m):
                if on_cables[i, SLIP] == 0.0:
                    on_cables[i, SLIP] = _slip_of(cables, command, state, on_cables, places, i)
                    slipped = slipped or on_cables[i, SLIP] != 0.0


def _slip_of(cables, command, state, on_cables, places, i):
    """Return the direction in which a winch slips, or 0 where friction holds it at the tension of its cable."""
    speed, force = state[places + LENGTH_RATE * cables.shape[0] + i], _drive_of(cables, command, on_cables, i)
    if speed != 0.0:
        return math.copysign(1.0, speed)
    if abs(force) > cables[i, FRICTION] or cables[i, FRICTION] == 0.0:
        return math.copysign(1.0, force)
    return 0.0


def _drive_of(cables, command, on_cables, i):
    """Return the force that would pay cable out, beside friction [N]."""
    strongest = cables[i, FORCE_MAX]
    return on_cables[i, T] - min(max(command[COMMANDS + i], -strongest), strongest)
