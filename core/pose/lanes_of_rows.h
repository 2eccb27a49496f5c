/* Rows in lanes: where each descent is, how it gets its row and how its result is written. */
#ifndef TOWLINE_LANES_OF_ROWS_H
#define TOWLINE_LANES_OF_ROWS_H

#include "pose/pose.h"
#include "pose/step.h"

enum { MOST_STEPS = 60 }; /* from nearby it takes three */

static const double ROUNDING = 1e-11;  /* times the platform's size: a step that is rounding */
static const double NEGLIGIBLE = 1e-8; /* times the platform's size and the least sigma [m]: nothing beside the noise */

/* What all lanes share. */
typedef struct {
    const towline_robot *robot;
    ptrdiff_t rows;
    towline_lengths measured;
    double size, smallest; /* of the platform, and of a step [m] */
} descent;

typedef struct {
    ptrdiff_t row[LANES];
    ptrdiff_t next; /* the first row that no lane had yet */
    num start[6], carriers[6 * TOWLINE_MOST_CARRIERS], lengths[TOWLINE_MOST_CABLES];
    origins from;
    place at, trial;
    deviations bank[2]; /* bank[now] at `at`, the other at `trial` */
    int now;
    num cost, damping, taken;
    num length, before; /* of the step to `trial`, and of the last one that was taken; 0: there was none [m] */
    num step[6];
    mask going, fresh;  /* has a row; `trial` is where that starts */
    mask sound, curved; /* the matrix was positive definite; it gets second derivatives */
} lanes;

INLINE mask negated(mask chosen) { return chosen == 0; }

/* Set `size` numbers where chosen. */
INLINE void choose(mask chosen, const num *yes, num *result, int size) {
    for (int i = 0; i < size; i++) { result[i] = where(chosen, yes[i], result[i]); }
}

/* Through a pointer: compilers make slow code of `x[lane] = ...` */
INLINE void set_lane(num *to, int lane, const double *from, int size) {
    for (int i = 0; i < size; i++) { ((double *)to)[LANES * i + lane] = from[i]; }
}

INLINE void read_lane(const num *from, int lane, double *to, int size) {
    for (int i = 0; i < size; i++) { to[i] = ((const double *)from)[LANES * i + lane]; }
}

INLINE descent descent_of(const towline_robot *robot, ptrdiff_t rows, towline_lengths measured) {
    double most = 0;
    for (int i = 0; i < robot->cables; i++) { most = measured.weights[i] > most ? measured.weights[i] : most; }
    const double size = size_of_platform(robot), nothing = NEGLIGIBLE / most;
    const descent task = {robot, rows, measured, size, (nothing > ROUNDING ? nothing : ROUNDING) * size};
    return task;
}

/* Give the lanes that have ended the next rows; those for which none is left are no longer going. */
INLINE void next_rows(const descent *task, const double *poses, mask ended, lanes *of) {
    const int m = task->robot->cables;
    const ptrdiff_t per = task->measured.carriers_per;
    const int placed = of->next > 0 && per == 0; /* the cables come from the same points in all rows */
    num left = where(of->going & negated(ended), number(1), number(0));
    for (int lane = 0; lane < LANES; lane++) {
        double busy;
        read_lane(&left, lane, &busy, 1);
        if (busy > 0) { continue; }
        /* Without a next row the lane computes the last one once more, for nobody. */
        const ptrdiff_t row = of->next < task->rows ? of->next : task->rows - 1;
        busy = of->next < task->rows;
        of->row[lane] = row;
        of->next += of->next < task->rows;
        set_lane(&left, lane, &busy, 1);
        set_lane(of->start, lane, poses + 6 * row, 6);
        set_lane(of->lengths, lane, task->measured.lengths + m * row, m);
        if (!placed) { set_lane(of->carriers, lane, task->measured.carriers + per * row, 6 * task->robot->carriers); }
    }
    if (!placed) { place_origins(task->robot, of->carriers, &of->from); }
    const place start = place_of(of->start);
    choose(ended, start.x, of->trial.x, 3);
    choose(ended, start.R, of->trial.R, 9);
    of->going = left > 0;
    of->damping = where(ended, number(task->measured.damping), of->damping);
    of->taken = where(ended, number(0), of->taken);
    of->length = where(ended, number(0), of->length);
    of->before = where(ended, number(0), of->before);
    of->curved = of->curved & negated(ended);
    of->fresh = ended;
}

/* Give each lane its first row. */
INLINE void begin(const descent *task, const double *poses, lanes *of) {
    const mask all = number(0) == 0, none = negated(all);
    of->next = 0;
    of->now = 0;
    of->going = of->sound = of->curved = none;
    of->cost = of->damping = of->taken = of->length = of->before = number(0);
    for (int i = 0; i < 3; i++) { of->trial.x[i] = of->at.x[i] = number(0); }
    for (int i = 0; i < 9; i++) { of->trial.R[i] = of->at.R[i] = number(0); }
    next_rows(task, poses, all, of);
}

/* Set roll, pitch and yaw (3) of a rotation; those that do not move are as at the start. */
INLINE void set_angles(const num *R, const double *free, const num *start, num *angles) {
    if (free[3] > 0 && free[4] > 0 && free[5] > 0) {
        const num upright = square_root(R[7] * R[7] + R[8] * R[8]);
        angles[0] = angle_of(R[7], R[8]);
        angles[1] = angle_of(-R[6], upright);
        /* The yaw that belongs to this roll: at a pitch of 90 degrees both are rounding, and only together an attitude. */
        const mask known = upright > 1e-200;
        const num sine = where(known, R[7], number(0)), cosine = where(known, R[8], number(1));
        angles[2] = angle_of(sine * R[2] - cosine * R[1], cosine * R[4] - sine * R[5]);
        return;
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3; /* a turn about axis i alone */
        angles[i] = free[3 + i] > 0 ? angle_of(R[3 * k + j], R[4 * j]) : start[i];
    }
}

/* Write the results of rows that have ended, with the last step where it is `final`; `well` if at a minimum. */
INLINE void end_rows(const descent *task, mask ended, mask final, mask well, lanes *of, towline_poses results) {
    const int m = task->robot->cables;
    const deviations *here = &of->bank[of->now];
    num pose[6], errors[TOWLINE_MOST_CABLES], taken = where(well, of->taken, number(0));
    num written = where(ended, number(1), number(0));
    choose(final, of->trial.x, of->at.x, 3);
    choose(final, of->trial.R, of->at.R, 9);
    for (int i = 0; i < 3; i++) { pose[i] = of->at.x[i]; }
    set_angles(of->at.R, task->measured.free, of->start + 3, pose + 3);
    for (int i = 0; i < m; i++) {
        num after = here->e[i];
        for (int j = 0; j < 6; j++) { after += here->J[6 * i + j] * of->step[j]; }
        errors[i] = where(final, after, here->e[i]);
    }
    for (int lane = 0; lane < LANES; lane++) {
        const ptrdiff_t row = of->row[lane];
        double wanted;
        read_lane(&written, lane, &wanted, 1);
        if (wanted > 0) {
            read_lane(pose, lane, results.poses + 6 * row, 6);
            read_lane(errors, lane, results.errors + m * row, m);
            read_lane(&taken, lane, results.steps + row, 1);
        }
    }
}

#endif
