/* B = P^T [L 0] Q by Householder reflections from the right with row pivoting (Golub and Van Loan, 5.4). */
#include "internal.h"

static void swap_rows(form *f, int i, int j) {
    for (int c = 0; c < f->columns; c++) {
        const real x = f->B[i * f->width + c];
        f->B[i * f->width + c] = f->B[j * f->width + c];
        f->B[j * f->width + c] = x;
    }
    for (int c = 0; c < i; c++) {
        const real x = f->L[i * ROWS + c];
        f->L[i * ROWS + c] = f->L[j * ROWS + c];
        f->L[j * ROWS + c] = x;
    }
    const int row = f->order[i];
    f->order[i] = f->order[j];
    f->order[j] = row;
}

/* Apply reflector j to x: subtract tau v v^T x, with v = B[j], which is zero before column j. */
void towline_reflect(const form *f, int j, real *x) {
    const int from = j / 4 * 4, count = f->width - from;
    const real *v = f->B + j * f->width + from;
    add_to(x + from, -f->tau[j] * dot(v, x + from, count), v, count);
}

/*
 * Reduce B to L and reflectors, the largest remaining row first. Return the rank, or -1 if it is in doubt; without
 * `cut` each row counts that is not zero.
 */
int towline_reduce(form *f, int cut) {
    const int n = f->n, steps = n < f->columns ? n : f->columns;
    real squares[ROWS]; /* of what is left of each row */
    for (int i = 0; i < n; i++) {
        const real *row = f->B + i * f->width;
        squares[i] = dot(row, row, f->width);
        f->order[i] = i;
    }
    for (int j = 0; j < steps; j++) {
        real *v = f->B + j * f->width;
        int best = j;
        for (int i = j + 1; i < n; i++) {
            if (squares[i] > squares[best]) {
                best = i;
            }
        }
        /* The squares are kept by subtraction; far below the first one no digits are left, and they are taken anew. */
        if (j > 0 && squares[best] <= RECOUNT * f->L[0] * f->L[0]) {
            best = j;
            for (int i = j; i < n; i++) {
                const real *row = f->B + i * f->width;
                squares[i] = dot(row, row, f->width);
                if (squares[i] > squares[best]) {
                    best = i;
                }
            }
        }
        if (best != j) {
            swap_rows(f, j, best);
            squares[best] = squares[j];
        }
        const real length = root(dot(v, v, f->width)), first = j > 0 ? magnitude(f->L[0]) : length;
        if (length == 0) {
            return j;
        }
        if (cut && length <= SURE_PIVOT * first) {
            return length <= SMALL_PIVOT * first ? j : -1;
        }
        const real head = v[j], pivot = head > 0 ? -length : length;
        f->L[j * ROWS + j] = pivot;
        v[j] = head - pivot;
        f->tau[j] = -1 / (pivot * (head - pivot));
        for (int i = j + 1; i < n; i++) {
            real *row = f->B + i * f->width;
            towline_reflect(f, j, row);
            f->L[i * ROWS + j] = row[j];
            squares[i] -= row[j] * row[j];
            row[j] = 0;
        }
    }
    return steps;
}

/* Make an orthonormal basis of the null space of B: the rows of Q beyond the rank. */
void towline_null_space(form *f) {
    for (int e = 0; e < f->k; e++) {
        real *row = f->basis + e * f->width;
        for (int c = 0; c < f->width; c++) {
            row[c] = 0;
        }
        row[f->rank + e] = 1;
        for (int j = f->rank - 1; j >= 0; j--) {
            towline_reflect(f, j, row);
        }
    }
}
