/* Compute and time many control steps, for step.py; compiled with the towline_step.c of a robot. */
#define _POSIX_C_SOURCE 199309L
#include <time.h>

#include "towline_step.h"

enum { PLATFORM = 18, COLUMNS = PLATFORM + 6 * TOWLINE_CARRIERS + 3 * TOWLINE_WIND + 6 };

static const double *copy(towline_real *to, const double *from, int count) {
    for (int i = 0; i < count; i++) {
        to[i] = (towline_real)from[i];
    }
    return from + count;
}

static towline_input input_of(const double *row) {
    towline_input input = {{0}, {0}, {0},
#if TOWLINE_CARRIERS > 0
                           {0},
#endif
#if TOWLINE_WIND
                           {0},
#endif
                           {0}, {0}};
    row = copy(input.pose, row, 6);
    row = copy(input.velocity, row, 6);
    row = copy(input.acceleration, row, 6);
#if TOWLINE_CARRIERS > 0
    row = copy(input.carrier_pose, row, 6 * TOWLINE_CARRIERS);
#endif
#if TOWLINE_WIND
    row = copy(input.wind, row, 3);
#endif
    copy(input.disturbance, row, 6);
    return input;
}

/* Compute steps that do not depend on each other; counts are steps and inner of an answer, numbers residual, support
 * and shortfall. */
void step_rows(int count, const double *rows, int *status, int *counts, double *tensions, double *direction,
               double *numbers) {
    for (int row = 0; row < count; row++) {
        const towline_input input = input_of(rows + (long)row * COLUMNS);
        towline_state state;
        towline_answer answer;
        towline_start(&state);
        status[row] = (int)towline_step(&input, &state, &answer);
        counts[2 * row] = answer.steps;
        counts[2 * row + 1] = answer.inner;
        for (int c = 0; c < TOWLINE_CABLES; c++) {
            tensions[(long)row * TOWLINE_CABLES + c] = (double)answer.tensions[c];
        }
        for (int i = 0; i < 6; i++) {
            direction[(long)row * 6 + i] = (double)answer.direction[i];
        }
        numbers[3 * row] = (double)answer.residual;
        numbers[3 * row + 1] = (double)answer.support;
        numbers[3 * row + 2] = (double)answer.shortfall;
    }
}

/* Measure the time of each step [s], in blocks of `calls` of which the fastest of `repeats` counts. */
void step_times(int count, const double *rows, int calls, int repeats, double *seconds) {
    for (int row = 0; row < count; row++) {
        const towline_input input = input_of(rows + (long)row * COLUMNS);
        seconds[row] = 1e9;
        for (int repeat = 0; repeat < repeats; repeat++) {
            struct timespec start, stop;
            towline_state state;
            towline_answer answer;
            clock_gettime(CLOCK_MONOTONIC, &start);
            for (int call = 0; call < calls; call++) {
                towline_start(&state);
                towline_step(&input, &state, &answer);
            }
            clock_gettime(CLOCK_MONOTONIC, &stop);
            const double spent =
                ((double)(stop.tv_sec - start.tv_sec) + 1e-9 * (double)(stop.tv_nsec - start.tv_nsec)) / calls;
            seconds[row] = spent < seconds[row] ? spent : seconds[row];
        }
    }
}
