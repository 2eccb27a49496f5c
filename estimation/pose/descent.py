"""Kernel: the poses whose cable lengths are nearest to measured ones, by Levenberg and Marquardt's method.

Each problem, in a lane of `simd`, minimises the sum of squared errors e of its lengths, in standard deviations. A step
solves

    (J^T J + lambda diag(J^T J)) (dx, dphi) = -J^T e

and moves the pose by x + dx and Q(dphi) R, with Cayley's rotation Q = (1 - S/2)^-1 (1 + S/2) of the cross product S
with dphi, which agrees with the exponential to second order, needs no trigonometry and never leaves SO(3). A step that
lowers the sum is taken and lambda divided by ten; otherwise lambda grows. Where steps get
shorter slowly, since errors are large for the curvature of the lengths, the matrix gets the second derivatives
(`curvature`) and the steps are Newton's. What a step leaves to do is about its length
times the ratio of its length to that of the step before: where that is rounding the problem ends, with the errors that
are linear in the last step.
"""

from __future__ import annotations

import numpy as np

from ...base.machine_code.simd import (
    TOGETHER,
    WIDTH,
    any_of,
    gather,
    load,
    magnitude,
    maximum,
    minimum,
    places,
    scatter,
    splat,
    sqrt,
    store,
    vectors,
    where,
)
from .curvature import add_curvature
from .lengths import BANK, CABLE, CABLES, POSE, STEP, SYSTEM, TRIAL, bank, lengths_at, rows_of
from .trigonometry import angle, cosine_and_sine

__all__ = ["descend_rows"]

_LEAST, _MOST = 1e-6, 1e8  # of lambda, once a step did not help
_PIVOT = 1e-15  # of the elimination, relative to the diagonal
_NEAR = 0.005  # times the scale: after a step shorter than that the factor serves for the next one too
_SLOW = 0.03  # ratio of a step to the one before: near a minimum large errors make Gauss and Newton's steps converge so
_NEGLIGIBLE = 100.0  # times the smallest step: one that does not help ends a problem whose rounding is coarser


def factor(damping, curved, now, m, radii, weights, free, W):
    """Write the matrix as Cholesky's factor, and return where it is positive definite; `curved` for Newton's method."""
    good = damping >= 0.0
    for j in range(6):
        row = SYSTEM + j * (j + 1) // 2
        for k in range(j + 1):
            total = splat(0.0)
            for i in range(m):
                total = total + load(W, now + BANK * i + j) * load(W, now + BANK * i + k)
            store(W, row + k, total)
        if free[j] == 0.0:  # its row and column are zero
            store(W, row + j, splat(1.0))
    if curved:
        add_curvature(now, m, radii, weights, free, W)
    for j in range(6):
        row = SYSTEM + j * (j + 1) // 2
        for k in range(j):
            column = SYSTEM + k * (k + 1) // 2
            total = load(W, row + k)
            for q in range(k):
                total = total - load(W, row + q) * load(W, column + q)
            store(W, row + k, total * load(W, column + k))
        diagonal = load(W, row + j)
        pivot = diagonal + damping * diagonal
        for q in range(j):
            pivot = pivot - load(W, row + q) * load(W, row + q)
        sound = pivot > _PIVOT * diagonal
        good = good & sound
        store(W, row + j, 1.0 / sqrt(where(sound, pivot, splat(1.0))))  # the inverse is what is needed
    return good


def set_step(now, m, W):
    """Write the step, from the factor and J^T e."""
    for j in range(6):
        row = SYSTEM + j * (j + 1) // 2
        total = splat(0.0)
        for i in range(m):
            total = total - load(W, now + BANK * i + j) * load(W, now + BANK * i + 6)
        for k in range(j):
            total = total - load(W, row + k) * load(W, STEP + k)
        store(W, STEP + j, total * load(W, row + j))
    for back in range(6):
        j = 5 - back
        total = load(W, STEP + j)
        for k in range(j + 1, 6):
            total = total - load(W, SYSTEM + k * (k + 1) // 2 + j) * load(W, STEP + k)
        store(W, STEP + j, total * load(W, SYSTEM + j * (j + 1) // 2 + j))


def move_trial(W):
    """Write the pose that the step leads to."""
    for k in range(3):
        store(W, TRIAL + k, load(W, POSE + k) + load(W, STEP + k))
    a, b, c = 0.5 * load(W, STEP + 3), 0.5 * load(W, STEP + 4), 0.5 * load(W, STEP + 5)
    aa, bb, cc = a * a, b * b, c * c
    inverse = 1.0 / (1.0 + aa + bb + cc)
    double = inverse + inverse
    q0, q4, q8 = (1.0 + aa - bb - cc) * inverse, (1.0 - aa + bb - cc) * inverse, (1.0 - aa - bb + cc) * inverse
    q1, q2, q3 = (a * b - c) * double, (a * c + b) * double, (a * b + c) * double
    q5, q6, q7 = (b * c - a) * double, (a * c - b) * double, (b * c + a) * double
    for k in range(3):
        u, v, w = load(W, POSE + 3 + k), load(W, POSE + 6 + k), load(W, POSE + 9 + k)
        store(W, TRIAL + 3 + k, q0 * u + q1 * v + q2 * w)
        store(W, TRIAL + 6 + k, q3 * u + q4 * v + q5 * w)
        store(W, TRIAL + 9 + k, q6 * u + q7 * v + q8 * w)


def end_with(final, kept, now, m, W):
    """Write the errors of problems that end: those after the last step where `final`, those before where `kept`."""
    ended = bank(2, m)
    for i in range(m):
        row = now + BANK * i
        error = load(W, row + 6)
        after = error
        for j in range(6):
            after = after + load(W, row + j) * load(W, STEP + j)
        store(W, ended + i, where(final, after, where(kept, error, load(W, ended + i))))


def descend(m, radii, weights, free, scale, smallest, first, steps, W):
    """Minimise from the pose in W; return one where it ended at a minimum, and how many steps each problem took."""
    cost = lengths_at(POSE, bank(0, m), m, radii, weights, free, W)
    now, other = bank(0, m), bank(1, m)
    for i in range(m):
        store(W, bank(2, m) + i, splat(0.0))
    zero, one = splat(0.0), splat(1.0)
    damping, before, taken, ended = splat(first), zero, zero, zero
    going = sound = cost >= 0.0
    fresh, curved = True, False
    for _ in range(steps):
        if fresh:
            sound = factor(damping, curved, now, m, radii, weights, free, W)
        set_step(now, m, W)
        good = going & sound
        moved, turned = zero, zero
        for k in range(3):
            moved = moved + load(W, STEP + k) * load(W, STEP + k)
            turned = turned + load(W, STEP + 3 + k) * load(W, STEP + 3 + k)
        size = sqrt(moved + scale * scale * turned)
        ratio = where(before > 0.0, minimum(size / maximum(before, splat(1e-300)), one), one)
        slow = (before > 0.0) & (ratio > _SLOW) & (size <= _NEAR * scale)  # a first step has none before it
        final = good & (size * ratio <= smallest)
        move_trial(W)
        trial = cost
        if any_of(going & ~final):
            trial = lengths_at(TRIAL, other, m, radii, weights, free, W)
        better = good & ~final & (trial < cost)
        kept = good & ~final & ~better & (size <= _NEGLIGIBLE * smallest)
        if any_of(final | kept):
            end_with(final, kept, now, m, W)
        take = final | better
        for k in range(12):
            store(W, POSE + k, where(take, load(W, TRIAL + k), load(W, POSE + k)))
        taken = taken + where(going, one, zero)
        ended = where(final | kept, one, ended)
        rejected = going & ~take & ~kept
        if any_of(rejected):
            for row in range(BANK * m):
                store(W, other + row, where(better, load(W, other + row), load(W, now + row)))
        now, other = other, now
        cost, before = where(better, trial, cost), where(better, size, before)
        lower = where(damping > 1e-8, 0.1 * damping, zero)
        damping = where(rejected, maximum(10.0 * damping, splat(_LEAST)), lower)
        going = (rejected | better) & (damping <= _MOST)
        if not any_of(going):
            break
        slow = slow & going
        fresh = any_of(going & ((damping > 0.0) | (size > _NEAR * scale) | slow))
        curved = any_of(slow) or curved
    end_with(zero > 0.0, ended <= 0.0, now, m, W)
    return ended, taken


def set_pose(of_pose, poses, W):
    """Write poses as x and the rows of R."""
    for k in range(3):
        store(W, POSE + k, gather(poses, of_pose, k))
    cr, sr = cosine_and_sine(gather(poses, of_pose, 3))
    cp, sp = cosine_and_sine(gather(poses, of_pose, 4))
    cy, sy = cosine_and_sine(gather(poses, of_pose, 5))
    store(W, POSE + 3, cy * cp)
    store(W, POSE + 4, cy * sp * sr - sy * cr)
    store(W, POSE + 5, cy * sp * cr + sy * sr)
    store(W, POSE + 6, sy * cp)
    store(W, POSE + 7, sy * sp * sr + cy * cr)
    store(W, POSE + 8, sy * sp * cr - cy * sr)
    store(W, POSE + 9, -sp)
    store(W, POSE + 10, cp * sr)
    store(W, POSE + 11, cp * cr)


def get_pose(of_pose, poses, W):
    """Read the poses again."""
    for k in range(3):
        scatter(poses, of_pose, k, load(W, POSE + k))
    r7, r8 = load(W, POSE + 10), load(W, POSE + 11)
    scatter(poses, of_pose, 3, angle(r7, r8))
    scatter(poses, of_pose, 4, angle(-load(W, POSE + 9), sqrt(r7 * r7 + r8 * r8)))
    # The yaw that belongs to this roll: at a pitch of 90 degrees both are rounding, and only together an attitude.
    known = magnitude(r7) + magnitude(r8) > 1e-200
    sine, cosine = where(known, r7, splat(0.0)), where(known, r8, splat(1.0))
    across = sine * load(W, POSE + 5) - cosine * load(W, POSE + 4)
    scatter(poses, of_pose, 5, angle(across, cosine * load(W, POSE + 7) - sine * load(W, POSE + 8)))


def descend_rows(
    geometry, each, lengths, weights, radii, free, scale, smallest, first, steps, start, stop, poses, errors, info
):
    """Move poses to the nearest minimum of the errors of their lengths, in place.

    Parameters
    ----------
    geometry
        Anchor and swivel axis in {G} and attachment in the platform frame, 9 m numbers for each problem: anchor,
        attachment, axis of one cable after another.
    each
        How many numbers of `geometry` lie between two problems: 9 m, or 0 if one serves all.
    lengths
        Measured, (N m,) [m].
    weights
        Of each cable's error, 1 / sigma times any factor, (m,).
    radii
        Of the pulleys, (m,) [m].
    free
        1 for coordinates that move, else 0, (6,).
    scale
        Length that makes a rotation comparable with a displacement [m].
    smallest
        Step that is rounding [m].
    first
        Lambda of the first step.
    steps
        Most steps.
    start, stop
        Problems to solve.
    poses
        (x, y, z, roll, pitch, yaw), (6 N,) [m, rad]: from where, then where to.
    errors
        Get the errors of the lengths times their weights, (m N,).
    info
        Get 1 for each problem that ended at a minimum, and its steps, (2 N,).
    """
    m = radii.shape[0]
    W = vectors(WIDTH * rows_of(m))
    for begin in range(start, stop, TOGETHER):
        members = np.arange(begin, min(begin + TOGETHER, stop))
        if members.size % WIDTH:  # the last lanes repeat the last problem
            members = np.concatenate((members, np.repeat(members[-1:], WIDTH - members.size % WIDTH)))
        of_geometry = places(members, each)
        for i in range(m):
            for k in range(9):
                at = CABLES + CABLE * i + k
                if each > 0:
                    store(W, at, gather(geometry, of_geometry, 9 * i + k))
                elif begin == start:
                    store(W, at, splat(geometry[9 * i + k]))
        of_pose, of_cable, of_info = places(members, 6), places(members, m), places(members, 2)
        for i in range(m):
            store(W, CABLES + CABLE * i + 9, gather(lengths, of_cable, i))
        set_pose(of_pose, poses, W)
        ended, taken = descend(m, radii, weights, free, scale, smallest, first, steps, W)
        get_pose(of_pose, poses, W)
        for i in range(m):
            scatter(errors, of_cable, i, load(W, bank(2, m) + i))
        scatter(info, of_info, 0, ended)
        scatter(info, of_info, 1, taken)
