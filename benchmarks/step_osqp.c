/* Time OSQP's generated code on many problems of one shape, for benchmarks/step_peer.py. */
#define _POSIX_C_SOURCE 199309L
#include <time.h>

#include "osqp.h"
#include "qp_workspace.h"

/* Rows of A without zeros, by columns, and limits of its rows; the fastest of `repeats` counts [s]. */
void osqp_rows(int count, int numbers, int limits, int cables, const double *A, const double *low, const double *high,
               int repeats, double *seconds, double *tensions) {
    for (int row = 0; row < count; row++) {
        seconds[row] = 1e9;
    }
    for (int repeat = 0; repeat < repeats; repeat++) {
        for (int row = 0; row < count; row++) {
            struct timespec start, stop;
            clock_gettime(CLOCK_MONOTONIC, &start);
            osqp_update_data_mat(&qp_solver, 0, 0, 0, A + (long)row * numbers, 0, numbers);
            osqp_update_data_vec(&qp_solver, 0, low + (long)row * limits, high + (long)row * limits);
            osqp_solve(&qp_solver);
            clock_gettime(CLOCK_MONOTONIC, &stop);
            const double spent = (double)(stop.tv_sec - start.tv_sec) + 1e-9 * (double)(stop.tv_nsec - start.tv_nsec);
            seconds[row] = spent < seconds[row] ? spent : seconds[row];
            for (int c = 0; c < cables; c++) {
                tensions[(long)row * cables + c] = qp_solver.solution->x[c];
            }
        }
    }
}
