/* Facets by the best form for this processor, and the rank of matrices. */
#include "available_wrench/available_wrench.h"

#include <math.h>

#include "available_wrench/facets.h"

enum { ROWS = TOWLINE_ROWS, CABLES = TOWLINE_CABLES };

ptrdiff_t towline_facets_of(int n, int m) {
    ptrdiff_t count = 1;
    for (int i = 1; i < n; i++) { /* each quotient is a whole number, that of subsets of i columns */
        count = count * (m - i + 1) / i;
    }
    return count;
}

void towline_facets(const towline_matrices *matrices, const double *low, const double *high, double *normals,
                    double *least, double *most) {
    BEST_FORM(facets_of_rows, matrices, low, high, normals, least, most);
}

void towline_margins(const towline_matrices *matrices, const double *w, ptrdiff_t w_per, const double *low,
                     const double *high, double *margins, double *reserves) {
    BEST_FORM(margins_of_rows, matrices, w, w_per, low, high, margins, reserves);
}

static double dot(const double *x, const double *y, int n) {
    double total = 0;
    for (int i = 0; i < n; i++) { total += x[i] * y[i]; }
    return total;
}

/* Bring the longest of the columns from j on to position j; return the square of its length. */
static double bring_longest(double column[][ROWS], int j, int m, int n) {
    int longest = j;
    double most = -1;
    for (int c = j; c < m; c++) {
        const double square = dot(column[c], column[c], n);
        if (square > most) {
            longest = c;
            most = square;
        }
    }
    for (int i = 0; i < n; i++) {
        const double x = column[j][i];
        column[j][i] = column[longest][i];
        column[longest][i] = x;
    }
    return most;
}

/* Take one column after another out of those that are left, the longest first. */
static int has_full_rank(const double *A, int n, int m, double tolerance) {
    double column[CABLES][ROWS], longest = 0;
    for (int c = 0; c < m; c++) {
        for (int i = 0; i < n; i++) { column[c][i] = A[i * m + c]; }
    }
    for (int j = 0; j < n && j < m; j++) {
        const double square = bring_longest(column, j, m, n);
        longest = j == 0 ? square : longest;
        if (!(square > tolerance * tolerance * longest && square > 0)) { return 0; }
        for (int c = j + 1; c < m; c++) {
            const double part = dot(column[j], column[c], n) / square;
            for (int i = 0; i < n; i++) { column[c][i] -= part * column[j][i]; }
        }
    }
    return m >= n;
}

void towline_full_rank(const towline_matrices *matrices, double tolerance, double *full) {
    const int n = matrices->n, m = matrices->m;
    for (ptrdiff_t row = 0; row < matrices->count; row++) {
        full[row] = has_full_rank(matrices->A + row * n * m, n, m, tolerance);
    }
}
