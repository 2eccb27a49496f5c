/* The rows of a batch: in lanes, and those that lanes leave, one after another. */
#include "batch/batch.h"

#include <math.h>

#include "batch/rows.h"

static const double *numbers_of(towline_column column, ptrdiff_t row) {
    return column.of ? column.of + row * column.per : NULL;
}

/* Write `count` numbers, or NAN where there are none. */
static void write(double *to, const double *from, int count, int are_there) {
    for (int i = 0; i < count; i++) { to[i] = are_there ? from[i] : (double)NAN; }
}

/* Solve one row by the solver of one problem. */
static void solve_row(const towline_batch *batch, ptrdiff_t row) {
    const int n = batch->n, m = batch->m, soft = batch->rho > 0;
    const towline_problem problem = {
        n,
        m,
        numbers_of(batch->A, row),
        numbers_of(batch->w, row),
        numbers_of(batch->t_min, row),
        numbers_of(batch->t_max, row),
        numbers_of(batch->t_ref, row),
        numbers_of(batch->weights, row),
        *numbers_of(batch->length, row),
        0,
    };
    towline_answer answer;
    const towline_status status =
        soft ? towline_solve_soft(&problem, batch->rho, &answer) : towline_solve(&problem, &answer);
    const int proven = status == TOWLINE_INFEASIBLE || status == TOWLINE_SINGULAR;
    const int sure = status == TOWLINE_INVALID || (soft ? answer.soft_is_proven : status != TOWLINE_INACCURATE);
    const int missed = soft && status != TOWLINE_INVALID && status != TOWLINE_OPTIMAL;
    const int solved = sure && (status == TOWLINE_OPTIMAL || missed);
    batch->status[row] = !sure ? TOWLINE_UNSURE : missed ? TOWLINE_INACCURATE : status;
    write(batch->tensions + row * m, answer.tensions, m, solved);
    write(batch->residual + row, &answer.residual, 1, solved);
    write(batch->direction + row * n, answer.direction, n, sure && proven);
    write(batch->info + row * 2, &answer.support, 1, sure && proven);
    write(batch->info + row * 2 + 1, &answer.shortfall, 1, sure && proven);
}

/* Solve in lanes all but rows with fewer cables than equations, which only a soft answer meets. */
static void solve_in_lanes(const towline_batch *batch, ptrdiff_t rows) {
#ifdef TOWLINE_NO_LANES
    (void)batch;
    (void)rows;
#else
    if (batch->m >= batch->n || batch->rho > 0) { BEST_FORM(solve_in_lanes, batch, rows); }
#endif
}

ptrdiff_t towline_solve_batch(const towline_batch *batch, ptrdiff_t rows, int lanes) {
    ptrdiff_t optimal = 0;
    if (lanes) { solve_in_lanes(batch, rows); }
    for (ptrdiff_t row = 0; row < rows; row++) {
        if (batch->status[row] == TOWLINE_UNSURE) { solve_row(batch, row); }
        optimal += batch->status[row] == TOWLINE_OPTIMAL;
    }
    return optimal;
}
