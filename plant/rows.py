"""Kernel: many steps of many states, each row on its own."""

import numpy as np

from .carrier_motion import set_motions
from .forces import geometry
from .layout import (
    BODY,
    BODY_WORK,
    CABLE_WORK,
    CARRIER,
    COMMANDS,
    CONDITION,
    CONSTRAINED,
    DRIVE,
    ELASTIC,
    FORCES,
    FRICTION,
    INERTIA_OF_WINCH,
    LAG,
    LENGTH_RATE,
    LENGTHS,
    PICKS,
    POLYNOMIAL,
    RATES,
    REFERENCE,
    REFERENCE_RATE,
    SHORTEST,
    SPEED_MAX,
    STIFFNESS,
    TENSIONS,
    WITH_FRICTION,
    WORKS,
    T,
)
from .steps import advance, begin


def run_rows(start, stop, bodies, cables, settings, states, commands, steps, period, substeps, keep, history, tensions):
    """Run the states of the rows from `start` to `stop`.

    Parameters
    ----------
    bodies, cables, settings
        The robot, see `layout`.
    states
        (N, n), where each row begins.
    commands
        (N, K, k). The first `steps` of them are held for `period` [s] each, in `substeps` steps; carriers move on to
        the reference of one after them.
    history, tensions
        (N, 1 + steps // keep, n) and (.., m): filled with every state of which the number is a multiple of `keep`,
        after the impacts of the command that begins there, and the tensions there [N] under that command; at the end,
        with the state that the last command leaves, and the tensions under it.
    """
    m, places, length = cables.shape[0], BODY * bodies.shape[0], states.shape[1]
    robot = (bodies, cables, settings)
    work = (
        np.zeros((bodies.shape[0], BODY_WORK)),
        np.zeros((m, CABLE_WORK)),
        np.zeros((2 * m + 3, m)),
        np.zeros((PICKS, m), np.int64),
    )
    slopes, spare, state = np.zeros((5, length)), np.zeros((3, length)), np.zeros(length)
    polynomials = COMMANDS + m + CARRIER * (bodies.shape[0] - 1)
    command = np.zeros(polynomials + POLYNOMIAL * (bodies.shape[0] - 1))
    kind = ELASTIC
    if settings[DRIVE] != TENSIONS:
        for i in range(m):
            if cables[i, STIFFNESS] == 0.0:
                kind = CONSTRAINED
            elif kind == ELASTIC and settings[DRIVE] == FORCES and cables[i, FRICTION] > 0.0:
                kind = WITH_FRICTION
    step = period / substeps
    for row in range(start, stop):
        state[:] = states[row]
        slopes[:], work[0][:], work[1][:] = 0.0, 0.0, 0.0  # nothing is left of the row before
        for k in range(steps):
            for j in range(polynomials):
                command[j] = commands[row, k, j]
            is_next = k + 1 < commands.shape[1]
            after = commands[row, k + 1 if is_next else k]
            set_motions(bodies, commands[row, k], after, is_next, command, state, m, period)
            _take_command(cables, settings, command, state, work[1], places, period)
            for s in range(substeps):
                begin(robot, command, state, slopes[0], work, step * s, kind)
                if s == 0 and k % keep == 0:
                    _record_state(state, history[row], k // keep)
                    _record_tensions(work[1], tensions[row], k // keep)
                advance(robot, command, state, slopes, spare, work, step * s, step, kind)
                _limit(cables, settings, state, places)
            for i in range(m):
                state[places + REFERENCE * m + i] = command[COMMANDS + i]
        if steps % keep == 0:
            geometry(robot, command, state, slopes[0], work, period)  # puts imposed carriers where they are
            _record_state(state, history[row], steps // keep)
            begin(robot, command, state, slopes[0], work, period, kind)
            _record_tensions(work[1], tensions[row], steps // keep)


def _take_command(cables, settings, command, state, on_cables, places, period):
    """Set the rates with which cables follow their commands."""
    m, drive = cables.shape[0], settings[DRIVE]
    for i in range(m):
        rate = places + LENGTH_RATE * m + i
        works = state[places + CONDITION * m + i] == WORKS
        if drive == TENSIONS:
            if settings[LAG] == 0.0:
                state[places + i] = max(command[COMMANDS + i], 0.0)
        elif not works:
            state[rate] = 0.0
        elif drive == LENGTHS:
            command[COMMANDS + i] = max(command[COMMANDS + i], SHORTEST)
            on_cables[i, REFERENCE_RATE] = (command[COMMANDS + i] - state[places + REFERENCE * m + i]) / period
            if cables[i, INERTIA_OF_WINCH] == 0.0:
                state[rate] = (command[COMMANDS + i] - state[places + i]) / period
        elif drive == RATES and cables[i, INERTIA_OF_WINCH] == 0.0:
            state[rate] = command[COMMANDS + i]


def _limit(cables, settings, state, places):
    """Keep winches inside their speeds, and cables from being wound in completely."""
    m = cables.shape[0]
    if settings[DRIVE] == TENSIONS:
        return
    for i in range(m):
        rate, fastest = places + LENGTH_RATE * m + i, cables[i, SPEED_MAX]
        if cables[i, INERTIA_OF_WINCH] > 0.0:
            state[rate] = min(max(state[rate], -fastest), fastest)
        if state[places + i] < SHORTEST:
            state[places + i] = SHORTEST
            state[rate] = max(state[rate], 0.0)


def _record_state(state, history, place):
    for j in range(len(state)):
        history[place, j] = state[j]


def _record_tensions(on_cables, tensions, place):
    for i in range(on_cables.shape[0]):
        tensions[place, i] = on_cables[i, T]
