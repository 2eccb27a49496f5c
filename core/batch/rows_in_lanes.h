/* The rows of a batch, some at a time in lanes; included by rows_plain.c and its like. */
#include "batch/newton.h"
#include "batch/rows.h"
#include "batch/slabs.h"

/* Write `size` numbers of a lane to its row, or NAN. */
INLINE void put(double *to, const num *from, ptrdiff_t row, int lane, int size, int are_there) {
    for (int i = 0; i < size; i++) {
        to[row * size + i] = are_there ? ((const double *)from)[LANES * i + lane] : (double)NAN;
    }
}

/* Write what was found of the row of a lane, or nothing: it stays unsure. */
INLINE void put_row(const towline_batch *batch, const demands *p, const mask *met, const num *error, ptrdiff_t row,
                    int lane) {
    const int soft = batch->rho > 0, good = p->good[lane] != 0, optimal = good && (*met)[lane] != 0;
    const int proven = p->proven[lane] != 0 && !optimal, solved = optimal || (soft && good);
    if (!solved && !proven) { return; }
    const num info[2] = {p->support, p->shortfall};
    batch->status[row] = optimal ? TOWLINE_OPTIMAL : soft ? TOWLINE_INACCURATE : TOWLINE_INFEASIBLE;
    put(batch->tensions, p->s, row, lane, batch->m, solved);
    put(batch->residual, error, row, lane, 1, solved);
    put(batch->direction, p->d, row, lane, batch->n, proven);
    put(batch->info, info, row, lane, 2, proven);
}

/* Give lanes the next rows that are unsure; return how many have one of their own. The others repeat the last. */
INLINE int next_rows(const towline_batch *batch, ptrdiff_t rows, ptrdiff_t *next, ptrdiff_t *row) {
    int count = 0;
    for (; *next < rows && count < LANES; ++*next) {
        row[count] = *next;
        count += batch->status[*next] == TOWLINE_UNSURE;
    }
    for (int lane = count; lane < LANES && count > 0; lane++) { row[lane] = row[count - 1]; }
    return count;
}

void FORM(solve_in_lanes)(const towline_batch *batch, ptrdiff_t rows) {
    const int by_slabs = batch->rho == 0 && batch->m - batch->n <= 2;
    const int shared = batch->A.per == 0 && batch->weights.per == 0 && batch->length.per == 0;
    matrices M;
    demands p;
    mask met;
    num error;
    ptrdiff_t row[LANES], next = 0;
    int count, ready = 0;
    while ((count = next_rows(batch, rows, &next, row)) > 0) {
        if (!ready) {
            take_matrices(&M, batch, row);
            if (by_slabs) { reduce(&M); }
            ready = shared;
        }
        take_demands(&p, &M, batch, row);
        if (by_slabs) {
            solve_by_slabs(&p, &M);
        } else {
            solve_by_newton(&p, &M, batch->rho > 0 ? 1 / batch->rho : 0);
        }
        judge(&p, &M, &met, &error);
        for (int lane = 0; lane < count; lane++) { put_row(batch, &p, &met, &error, row[lane], lane); }
    }
}
