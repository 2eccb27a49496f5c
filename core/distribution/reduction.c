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

/* Return which of the rows from j on is the largest. */
static int largest(const real *squares, int j, int n) {
    int best = j;
    real most = squares[j];
    for (int i = j + 1; i < n; i++) { /* nothing branches: no processor can predict it */
        best = squares[i] > most ? i : best;
        most = larger(squares[i], most);
    }
    return best;
}

/*
 * Reduce B to L and reflectors, the largest remaining row first. Return the rank, or -1 if it is in doubt; without
 * `cut` each row counts that is not zero.
 */
int towline_reduce(form *f, int cut) {
    const int n = f->n, width = f->width, steps = n < f->columns ? n : f->columns;
    real squares[ROWS]; /* of what is left of each row */
    for (int i = 0; i < n; i++) {
        const real *row = f->B + i * width;
        squares[i] = dot(row, row, width);
        f->order[i] = i;
    }
    for (int j = 0; j < steps; j++) {
        real *v = f->B + j * width;
        int best = largest(squares, j, n);
        /* The squares are kept by subtraction; far below the first one no digits are left, and they are taken anew. */
        if (j > 0 && squares[best] <= RECOUNT * f->L[0] * f->L[0]) {
            for (int i = j; i < n; i++) {
                const real *row = f->B + i * width;
                squares[i] = dot(row, row, width);
            }
            best = largest(squares, j, n);
        }
        swap_rows(f, j, best); /* also a row with itself: no processor can predict that */
        squares[best] = squares[j];
        const real length = root(dot(v, v, width)), first = j > 0 ? magnitude(f->L[0]) : length;
        if (length == 0) { return j; }
        if (cut && length <= SURE_PIVOT * first) { return length <= SMALL_PIVOT * first ? j : -1; }
        const real head = v[j], pivot = (real)(1 - 2 * (head > 0)) * length;
        f->L[j * ROWS + j] = pivot;
        v[j] = head - pivot;
        f->tau[j] = -1 / (pivot * (head - pivot));
        for (int i = j + 1; i < n; i++) {
            real *row = f->B + i * width;
            reflect(f, j, row);
            f->L[i * ROWS + j] = row[j];
            squares[i] -= row[j] * row[j];
            row[j] = 0;
        }
    }
    return steps;
}

/*
 * Make `dimensions` vectors of an orthonormal basis of the null space of B, the rows of Q beyond the rank, and s = Q^T s
 * unless s is 0. Both at once take less time: one does not wait for the other's sums.
 */
void towline_turn_back(form *f, real *s, int dimensions) {
    for (int e = 0; e < dimensions; e++) {
        real *row = f->basis + e * f->width;
        for (int c = 0; c < f->width; c++) { row[c] = 0; }
        row[f->rank + e] = 1;
    }
    for (int j = f->rank - 1; j >= 0; j--) {
        if (s) { reflect(f, j, s); }
        for (int e = 0; e < dimensions; e++) { reflect(f, j, f->basis + e * f->width); }
    }
}
