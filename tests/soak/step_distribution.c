/* Solve many problems by the core inside an exported step, for exactness.py. */
#include "towline_step.c"

void distribute_rows(int count, int n, int m, const towline_real *A, const towline_real *w, const towline_real *t_min,
                     const towline_real *t_max, const towline_real *t_ref, const towline_real *weights,
                     const towline_real *length, int *status, towline_real *tensions, towline_real *direction) {
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
        status[row] = (int)towline_solve_always(&problem, TOWLINE_RHO, &answer);
        for (int c = 0; c < m; c++) {
            tensions[row * m + c] = answer.tensions[c];
        }
        for (int i = 0; i < n; i++) {
            direction[row * n + i] = answer.direction[i];
        }
    }
}
