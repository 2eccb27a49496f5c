"""Kernel: what becomes of the cables without stiffness where contacts change, and their hold between such times."""

from .bodies import normalise
from .constraints import free_stretch_acceleration, gram_matrix, solve_non_negative, solve_pulling, yielding
from .forces import forces, forces_after_hold, geometry
from .layout import (
    BODY,
    CANDIDATE,
    CARRIER_TURN,
    CAUGHT,
    CONDITION,
    CUT,
    E_RATE,
    IMPULSE,
    INVERSE_MASS,
    LENGTH_RATE,
    LENGTH_SCALE,
    MODE,
    MOST_SHIFTS,
    OWNER,
    PARTING,
    PULLS,
    QUATERNION,
    RATE,
    RESTING,
    SLACK,
    STIFFNESS,
    STILL,
    TOUCHING,
    TURN,
    VELOCITY,
    E,
    L,
    T,
    U,
)


def shift(bodies, cables, settings, state, on_bodies, on_cables, places_too):
    """Apply the impulses in `IMPULSE` [N s] to velocities, or with `places_too` displacements [kg m] to places."""
    m, places = cables.shape[0], BODY * bodies.shape[0]
    for i in range(m):
        size = on_cables[i, IMPULSE]
        if size == 0.0:
            continue
        give = size * yielding(cables, settings, state, on_cables, places, i)
        state[places + (0 if places_too else LENGTH_RATE * m) + i] += give
        _shift_body(bodies, state, on_bodies, on_cables, i, 0, TURN, size, places_too)
        _shift_body(bodies, state, on_bodies, on_cables, i, int(cables[i, OWNER]), CARRIER_TURN, -size, places_too)
    if places_too:
        normalise(bodies, state)


def _shift_body(bodies, state, on_bodies, on_cables, i, b, turn, size, places_too):
    at = BODY * b
    first = at if places_too else at + VELOCITY
    for axis in range(3):
        state[first + axis] += size * bodies[b, INVERSE_MASS + axis] * on_cables[i, U + axis]
    x, y, z = size * on_cables[i, turn], size * on_cables[i, turn + 1], size * on_cables[i, turn + 2]
    if places_too:
        q = at + QUATERNION
        a, b_, c, d = state[q], state[q + 1], state[q + 2], state[q + 3]
        state[q] -= 0.5 * (x * b_ + y * c + z * d)
        state[q + 1] += 0.5 * (x * a + y * d - z * c)
        state[q + 2] += 0.5 * (y * a + z * b_ - x * d)
        state[q + 3] += 0.5 * (z * a + x * c - y * b_)
    else:
        for axis in range(3):
            state[at + RATE + axis] += on_bodies[b, axis] * x + on_bodies[b, 3 + axis] * y + on_bodies[b, 6 + axis] * z


def _choose_touching(cables, settings, state, on_cables, picks, places, least_rate):
    """Make candidates of the taut cables without stiffness whose elongation does not fall faster than a rate [m/s].

    One that hardly moves is treated as taut also where rounding, far from the origin, has made it a little short.
    """
    m = cables.shape[0]
    for i in range(m):
        intact = cables[i, STIFFNESS] == 0.0 and state[places + CONDITION * m + i] != CUT
        rests = abs(on_cables[i, E_RATE]) <= PARTING
        taut = on_cables[i, E] >= -(RESTING if rests else TOUCHING) * settings[LENGTH_SCALE]
        taut = taut and on_cables[i, E_RATE] >= least_rate
        picks[CANDIDATE, i] = 1 if intact and taut and on_cables[i, L] > 1e-12 else 0


def _any_too_long(cables, settings, state, on_cables, places):
    for i in range(cables.shape[0]):
        intact = cables[i, STIFFNESS] == 0.0 and state[places + CONDITION * cables.shape[0] + i] != CUT
        if intact and on_cables[i, E] > CAUGHT * settings[LENGTH_SCALE]:
            return True
    return False


def _any_stretches(on_cables, picks):
    fastest = 0.0
    for i in range(on_cables.shape[0]):
        if picks[CANDIDATE, i] == 1:
            fastest = max(fastest, on_cables[i, E_RATE])
    return fastest > STILL


def _as_before(cables, settings, state, on_cables, places):
    """Return whether cables that pulled are still taut, and all others are not."""
    for i in range(cables.shape[0]):
        if cables[i, STIFFNESS] == 0.0 and state[places + CONDITION * cables.shape[0] + i] != CUT:
            e, rate = on_cables[i, E], on_cables[i, E_RATE]
            if on_cables[i, MODE] == PULLS:
                if abs(e) > TOUCHING * settings[LENGTH_SCALE] or abs(rate) > STILL:
                    return False
            elif e > -RESTING * settings[LENGTH_SCALE]:
                return False
        elif cables[i, STIFFNESS] == 0.0 and on_cables[i, MODE] == PULLS:
            return False
    return True


def _none_pushes(cables, on_cables):
    for i in range(cables.shape[0]):
        if cables[i, STIFFNESS] == 0.0 and on_cables[i, MODE] == PULLS and on_cables[i, T] <= 0.0:
            return False
    return True


def resolve(robot, command, state, change, work, time, parting):
    """Apply the impact of cables that have got taut, and choose those that pull from now on.

    A taut cable gets slack where its tension would be negative, or where the impact shortens it faster than `parting`.
    """
    bodies, cables, settings = robot
    on_bodies, on_cables, square, picks = work
    m, places = cables.shape[0], BODY * bodies.shape[0]
    if parting == PARTING and _as_before(cables, settings, state, on_cables, places):
        forces_after_hold(robot, command, state, change, work, time)
        if _none_pushes(cables, on_cables):
            return
    for i in range(m):
        if cables[i, STIFFNESS] == 0.0:
            on_cables[i, MODE] = SLACK
    for stage in range(MOST_SHIFTS + 1):  # places until they fit, and then velocities
        places_too = stage < MOST_SHIFTS and _any_too_long(cables, settings, state, on_cables, places)
        _choose_touching(cables, settings, state, on_cables, picks, places, -1e300)
        if not places_too and not _any_stretches(on_cables, picks):
            break
        gram_matrix(bodies, cables, settings, state, on_bodies, on_cables, square)
        for i in range(m):
            on_cables[i, IMPULSE] = on_cables[i, E if places_too else E_RATE]
        solve_non_negative(on_cables, square, picks)
        shift(bodies, cables, settings, state, on_bodies, on_cables, places_too)
        geometry(robot, command, state, change, work, time)
        if not places_too:
            break
    forces(robot, command, state, change, work, time)
    _choose_touching(cables, settings, state, on_cables, picks, places, -parting)
    gram_matrix(bodies, cables, settings, state, on_bodies, on_cables, square)
    for i in range(m):
        on_cables[i, IMPULSE] = free_stretch_acceleration(bodies, cables, state, change, on_bodies, on_cables, i)
    solve_non_negative(on_cables, square, picks)
    for i in range(m):
        if on_cables[i, IMPULSE] > 0.0:
            on_cables[i, MODE] = PULLS
    if parting > PARTING:
        hold(robot, command, state, change, work, time)
    forces(robot, command, state, change, work, time)


def hold(robot, command, state, change, work, time):
    """Bring the elongations of the pulling cables without stiffness, and their rates, back to zero."""
    bodies, cables, settings = robot
    on_bodies, on_cables, square, picks = work
    m, any_pulls = cables.shape[0], False
    for i in range(m):
        picks[CANDIDATE, i] = 1 if cables[i, STIFFNESS] == 0.0 and on_cables[i, MODE] == PULLS else 0
        any_pulls = any_pulls or picks[CANDIDATE, i] == 1
    if not any_pulls:
        return
    gram_matrix(bodies, cables, settings, state, on_bodies, on_cables, square)  # the places hardly change it
    for stage in range(2):
        for i in range(m):
            on_cables[i, IMPULSE] = on_cables[i, E if stage == 0 else E_RATE]
        solve_pulling(on_cables, square, picks)
        shift(bodies, cables, settings, state, on_bodies, on_cables, stage == 0)
        geometry(robot, command, state, change, work, time)
