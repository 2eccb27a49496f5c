/*
 * Descents to the poses whose cable lengths are nearest to measured ones, one in each lane.
 *
 * A step that lowers the sum of squared errors is taken, and lambda divided by ten; otherwise lambda grows. Where steps get
 * shorter slowly, since errors are large for the curvature of the lengths, the matrix gets the second derivatives and the
 * steps are Newton's. What a step leaves to do is about its length times the ratio of its length to that of the step
 * before: where that is rounding the descent ends, with the errors that are linear in the last step. Its lane then goes to
 * the next row. No result depends on what the other lanes do.
 */
#ifndef TOWLINE_DESCENT_H
#define TOWLINE_DESCENT_H

#include "pose/lanes_of_rows.h"

static const double LEAST_DAMPING = 1e-6, MOST_DAMPING = 1e8; /* once a step did not help */
static const double COARSE =
    100; /* times the smallest step: one that does not help ends a row whose rounding is coarser */
static const double NEAR = 0.005; /* times the platform's size: steps so short are judged by whether they are slow: */
static const double SLOW = 0.01;  /* ratio of a step to the one before; so they converge where errors are large */

/* Judge the trial: take it or not, and return where the row has ended, of these in `well` where at a minimum. */
INLINE mask judge(const descent *task, lanes *of, mask *well) {
    const int m = task->robot->cables;
    deviations *here = &of->bank[of->now], *there = &of->bank[1 - of->now];
    const num cost = deviations_at(task->robot, &of->trial, &of->from, of->lengths, task->measured.weights,
                                   task->measured.free, there);
    const mask better = of->fresh | (of->sound & (cost < of->cost));
    const mask kept = of->going & of->sound & negated(better) & (of->length <= COARSE * task->smallest);
    const mask rejected = of->going & negated(better | kept);
    if (any(of->going & negated(better))) {
        choose(negated(better), here->e, there->e, m);
        choose(negated(better), here->J, there->J, 6 * m);
    }
    of->now = 1 - of->now;
    choose(better, of->trial.x, of->at.x, 3);
    choose(better, of->trial.R, of->at.R, 9);
    of->cost = where(better, cost, of->cost);
    of->before = where(better, of->length, of->before);
    const num lower = where(of->damping > 1e-8, 0.1 * of->damping, number(0));
    const num higher = larger(10 * of->damping, number(LEAST_DAMPING));
    of->damping = where(of->fresh, of->damping, where(rejected, higher, lower));
    *well = kept;
    return kept | (rejected & (of->damping > MOST_DAMPING)) | (of->going & (of->taken >= MOST_STEPS)) |
           (of->going & negated(of->cost >= 0));
}

/* Set the matrix at the place and make it a factor; return where it is positive definite. */
INLINE mask set_factor(const descent *task, lanes *of, num *L) {
    const double *weights = task->measured.weights, *free = task->measured.free;
    const deviations *here = &of->bank[of->now];
    normal_matrix(here->J, task->robot->cables, free, L);
    for (int i = 0; any(of->going & of->curved) && i < task->robot->cables; i++) {
        reach to;
        reach_of(task->robot, i, &of->at, &of->from, &to);
        add_curvature(&to, where(of->curved, here->e[i] * weights[i], number(0)), free, L);
    }
    return factorise(of->damping, L);
}

/* Set the next trial, and return where it is the minimum. */
INLINE mask set_trial(const descent *task, lanes *of) {
    num L[TRIANGLE];
    of->sound = set_factor(task, of, L);
    set_step(&of->bank[of->now], task->robot->cables, L, of->step);
    const num *turn = of->step + 3;
    of->length = square_root(dot(of->step, of->step) + task->size * task->size * dot(turn, turn));
    const mask first = negated(of->before > 0); /* there is no step before it */
    const num ratio = where(first, number(1), smaller(of->length / of->before, number(1)));
    of->curved = of->curved | (negated(first) & (ratio > SLOW) & (of->length <= NEAR * task->size));
    of->fresh = of->fresh & negated(of->fresh);
    of->taken = of->taken + 1;
    move(&of->at, of->step, &of->trial);
    return of->sound & (of->length * ratio <= task->smallest);
}

/* Descend from each of the rows, see `towline_pose_from_lengths`. */
INLINE void descend(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured, towline_poses results) {
    const descent task = descent_of(robot, rows, measured);
    lanes of;
    if (rows < 1) { return; }
    begin(&task, results.poses, &of);
    while (any(of.going)) {
        mask well;
        const mask ended = judge(&task, &of, &well);
        const mask final = set_trial(&task, &of) & of.going & negated(ended);
        if (any(ended | final)) {
            end_rows(&task, ended | final, final, well | final, &of, results);
            next_rows(&task, results.poses, ended | final, &of);
        }
    }
}

#endif
