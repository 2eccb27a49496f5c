"""Kernel: the time derivative of a state.

    t = max(0, E A e / L0 + C de/dt) while e = l - L0 > 0, else 0         an elastic cable
    t >= 0, d2e/dt2 <= 0, t d2e/dt2 = 0 while e = 0, else t = 0           one without stiffness
    J d2L0/dt2 = t - u - friction sign(dL0/dt)                            a winch whose motor pulls with the force u

Which cables pull, and which winches slip, is fixed while a step is computed: then the derivative is smooth and
Runge-Kutta keeps its order. `steps` finds the times at which that changes.
"""

from .bodies import move_bodies, place_bodies
from .constraints import free_stretch_acceleration, gram_matrix, solve_pulling
from .layout import (
    BODY,
    CANDIDATE,
    COMMANDS,
    CONDITION,
    CUT,
    DRIVE,
    FORCE_MAX,
    FORCES,
    FRICTION,
    HAS_WINCHES,
    IMPULSE,
    INERTIA_OF_WINCH,
    LAG,
    LENGTH_RATE,
    LENGTHS,
    LIMP,
    LOCATE,
    MODE,
    PULLS,
    REFERENCE,
    REFERENCE_RATE,
    SLACK,
    SLIP,
    SPEED_MAX,
    STIFFNESS,
    TENSIONS,
    WINCH_BANDWIDTH,
    WORKS,
    E,
    L,
    T,
)
from .lines import load_bodies, pull_bodies, pull_of, run_cables


def geometry(robot, command, state, change, work, time):
    """Write all that depends on the state alone, `time` [s] after the command began."""
    _geometry(robot, command, state, change, work, time)


def forces(robot, command, state, change, work, time):
    """Write the derivative `change` of a state whose geometry is written, and all tensions."""
    _forces(robot, command, state, change, work, time, True)


def forces_after_hold(robot, command, state, change, work, time):
    """Write them after the end of a step, where `hold` has written G for a state that is hardly another."""
    _forces(robot, command, state, change, work, time, False)


def evaluate(robot, command, state, change, work, time):
    """Write the derivative of a state; elastic cables pull by their elongation unless contacts are located."""
    _geometry(robot, command, state, change, work, time)
    if robot[2][LOCATE] == 0.0:
        set_modes(robot[1], state, work[1], BODY * robot[0].shape[0])
    _forces(robot, command, state, change, work, time, True)


def _geometry(robot, command, state, change, work, time):
    bodies, cables, _ = robot
    on_bodies, on_cables, _, _ = work
    place_bodies(bodies, command, state, change, on_bodies, cables.shape[0], time)
    run_cables(cables, state, on_bodies, on_cables, BODY * bodies.shape[0])


def set_modes(cables, state, on_cables, places):
    """Write which elastic cables pull, by their elongation and its rate."""
    for i in range(cables.shape[0]):
        if cables[i, STIFFNESS] > 0.0:
            if on_cables[i, E] <= 0.0 or state[places + CONDITION * cables.shape[0] + i] == CUT:
                on_cables[i, MODE] = SLACK
            else:
                on_cables[i, MODE] = PULLS if pull_of(cables, state, on_cables, places, i) > 0.0 else LIMP


def commanded_tensions(cables, settings, command, state, change, on_cables, places):
    """Write the tensions of a robot of which they are commanded, and their derivatives."""
    m, lag = cables.shape[0], settings[LAG]
    for i in range(m):
        alive = state[places + CONDITION * m + i] != CUT and on_cables[i, L] > 1e-12
        on_cables[i, T] = max(state[places + i], 0.0) if alive else 0.0
        change[places + i] = (max(command[COMMANDS + i], 0.0) - state[places + i]) / lag if lag > 0.0 else 0.0


def elastic_tensions(cables, state, change, on_cables, places):
    """Write the tensions of elastic cables in their modes, and 0 for others; return whether one of these pulls."""
    m, constrained = cables.shape[0], False
    for i in range(m):
        on_cables[i, T] = 0.0
        if on_cables[i, MODE] == PULLS:
            if cables[i, STIFFNESS] > 0.0:
                on_cables[i, T] = pull_of(cables, state, on_cables, places, i)
            else:
                constrained = True
        change[places + i] = state[places + LENGTH_RATE * m + i]
    return constrained


def winch_acceleration(cables, settings, command, state, on_cables, places, time, i, tension):
    """Return the second derivative of the unstrained length that winch `i` gives at a tension [N]."""
    m = cables.shape[0]
    J = cables[i, INERTIA_OF_WINCH]
    if J == 0.0 or state[places + CONDITION * m + i] != WORKS:
        return 0.0
    speed, fastest = state[places + LENGTH_RATE * m + i], cables[i, SPEED_MAX]
    strongest, friction = cables[i, FORCE_MAX], cables[i, FRICTION]
    if settings[DRIVE] == FORCES:
        if on_cables[i, SLIP] == 0.0:
            return 0.0
        force = min(max(command[COMMANDS + i], -strongest), strongest)
        result = (tension - force - on_cables[i, SLIP] * friction) / J
        if (speed >= fastest and result > 0.0) or (speed <= -fastest and result < 0.0):
            return 0.0
        return result
    bandwidth, wanted = settings[WINCH_BANDWIDTH], command[COMMANDS + i]
    if settings[DRIVE] == LENGTHS:
        rate = on_cables[i, REFERENCE_RATE]
        ahead = state[places + REFERENCE * m + i] + rate * time - state[places + i]
        wanted = rate + 0.5 * bandwidth * ahead
    wanted = min(max(wanted, -fastest), fastest)
    rubbing = friction if speed > 0.0 else (-friction if speed < 0.0 else 0.0)
    force = tension - rubbing - J * 2.0 * bandwidth * (wanted - speed)
    return (tension - rubbing - min(max(force, -strongest), strongest)) / J


def move_winches(cables, settings, command, state, change, on_cables, places, time):
    """Write the second derivatives of all unstrained lengths."""
    for i in range(cables.shape[0]):
        change[places + LENGTH_RATE * cables.shape[0] + i] = winch_acceleration(
            cables, settings, command, state, on_cables, places, time, i, on_cables[i, T]
        )


def _forces(robot, command, state, change, work, time, writes_g):
    bodies, cables, settings = robot
    on_bodies, on_cables, square, picks = work
    m, places, constrained = cables.shape[0], BODY * bodies.shape[0], False
    if settings[DRIVE] == TENSIONS:
        commanded_tensions(cables, settings, command, state, change, on_cables, places)
    else:
        constrained = elastic_tensions(cables, state, change, on_cables, places)
    # The second time with the tensions of cables without stiffness, which follow from what bodies do without them.
    for _ in range(2):
        load_bodies(bodies, settings, command, on_bodies, state, m)
        pull_bodies(bodies, cables, on_bodies, on_cables)
        move_bodies(bodies, settings, command, state, change, on_bodies, m)
        if settings[HAS_WINCHES] == 1.0:
            move_winches(cables, settings, command, state, change, on_cables, places, time)
        if not constrained:
            break
        constrained = False
        if writes_g:
            gram_matrix(bodies, cables, settings, state, on_bodies, on_cables, square)
        for i in range(m):
            on_cables[i, IMPULSE] = free_stretch_acceleration(bodies, cables, state, change, on_bodies, on_cables, i)
            picks[CANDIDATE, i] = 1 if cables[i, STIFFNESS] == 0.0 and on_cables[i, MODE] == PULLS else 0
        solve_pulling(on_cables, square, picks)
        for i in range(m):
            if picks[CANDIDATE, i] == 1:
                on_cables[i, T] = on_cables[i, IMPULSE]
