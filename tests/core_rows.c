/* Solve many problems of one shape, for tests/test_core.py. */
#include "towline_core.h"

void solve_rows(int count, int n, int m, const towline_real *A, const towline_real *w, const towline_real *t_min,
                const towline_real *t_max, const towline_real *t_ref, const towline_real *weights,
                const towline_real *length, towline_real rho, int *status, int *steps, int *inner,
                towline_real *tensions, towline_real *direction, towline_real *numbers) {
    for (int row = 0; row < count; row++) {
        const towline_problem problem = {n,
                                         m,
                                         A + row * n * m,
                                         w + row * n,
                                         t_min + row * m,
                                         t_max + row * m,
                                         t_ref + row * m,
                                         weights + row * m,
                                         length[row],
                                         0};
        towline_answer answer;
        status[row] = (int)(rho > 0 ? towline_solve_always(&problem, rho, &answer) : towline_solve(&problem, &answer));
        steps[row] = answer.steps;
        inner[row] = answer.inner;
        for (int c = 0; c < m; c++) {
            tensions[row * m + c] = answer.tensions[c];
        }
        for (int i = 0; i < n; i++) {
            direction[row * n + i] = answer.direction[i];
        }
        numbers[row * 3] = answer.residual;
        numbers[row * 3 + 1] = answer.support;
        numbers[row * 3 + 2] = answer.shortfall;
    }
}
